// Copyright 2026 The fret_monitor authors
//
// Licensed under the Apache License, Version 2.0 (the "License");
// you may not use this file except in compliance with the License.
// You may obtain a copy of the License at
//
//     http://www.apache.org/licenses/LICENSE-2.0
//
// Unless required by applicable law or agreed to in writing, software
// distributed under the License is distributed on an "AS IS" BASIS,
// WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
// See the License for the specific language governing permissions and
// limitations under the License.

/// gate.h: decides which messages of one topic pass, so that those that pass satisfy the
/// requirements.
///
/// A gate belongs to an evaluator, whose requirements it keeps. Its topic is `from`. It judges a
/// message by a step on it: if every requirement holds afterwards, and the gate is open, the step
/// stays and the message passes. Otherwise the instance is restored: for the requirements, a
/// message that is withheld never happened, values included. Only counters count on, and it ends
/// the silence of the inputs of `from`: a silence is that no message arrives.
///
/// A requirement holds while the verdict is true that fm_monitor.occurrences names: of `H p` that
/// is p, since `H p` would stay false for ever.
///
/// The gate is known when each input of the other topics has a value and each group has stepped,
/// and, unless `passes_silent`, none of these inputs may be silent (fm_may_be_silent) and no
/// thread hangs (fm_gate_note_hang). A gate that is not known is closed.
///
/// A message that is withheld may be replaced: by a substitute, or by the last message that
/// passed. A replacement that is sent is a step that stays, but it was not received: it ends no
/// silence. The gate says when a replacement is due; the caller has its bytes and sends it.
///
/// All times are in nanoseconds. `now` and `stamp` are those of the evaluator; `steady` is the
/// time of a clock that nobody sets and that never stands still, from 0: rate, hold and latch
/// follow it, so that a simulation that is paused is substituted for, too.
///
/// The caller owns all memory: it passes a block of fm_gate_bytes bytes, aligned to 16. Not
/// thread-safe: the mutex that guards the evaluator guards the gate. No function allocates,
/// blocks, or fails except by the stated return value. Without a stated complexity a function is
/// O(1).

#ifndef GATE_H_
#define GATE_H_

#include "evaluator.h"
#include "fret_fields.h"

/// What is sent in place of a message that is withheld.
enum fm_otherwise
{
  FM_DROP = 0,       // nothing
  FM_HOLD = 1,       // the last message that passed, for `hold` after it passed, while it holds
  FM_SUBSTITUTE = 2  // a message, once for each, or with a period from the first one that is
                     // withheld until a message passes
};

/// How to run a gate. All that it points to outlives the gate and stays the caller's.
struct fm_gate_options
{
  struct fm_evaluator * evaluator;
  const struct fm_monitor * monitor;
  const struct fm_topic * topics;  // those of the evaluator
  uint32_t n_topics;
  uint32_t from;          // index of a topic; n_topics: one that feeds no input
  uint32_t otherwise;     // enum fm_otherwise
  int64_t hold;           // with FM_HOLD
  int64_t period;         // with FM_SUBSTITUTE; 0: none
  bool passes_silent;     // the gate stays open while an input of another topic is silent
  bool latches;           // after a violation the gate is closed until fm_gate_reset, or
  int64_t open_after;     // until so long after the last one; 0: only by fm_gate_reset
};

/// The result of judging a message. All but FM_PASSED: it is withheld.
enum fm_judgement
{
  FM_PASSED = 0,
  FM_VIOLATES = 1,   // a requirement would not hold
  FM_CLOSED = 2,     // the gate is not known
  FM_LATCHED = 3,    // a violation before closed the gate
  FM_UNREADABLE = 4, // it cannot be decoded, or a field cannot be used
  FM_DUPLICATE = 5   // it was judged before, from another subscription; only of fm_engine_judge
};

/// The state of a gate, and its counters, which count on through fm_gate_reset.
struct fm_gate_counts
{
  uint64_t passed;
  uint64_t violates;     // withheld, for the reasons of enum fm_judgement
  uint64_t closed;
  uint64_t latched;
  uint64_t unreadable;
  uint64_t replaced;     // substitutes, or held messages, that were sent
  uint64_t violating;    // of these, substitutes after which a requirement did not hold; not while
                         // an input of `from` is stale, since no substitute satisfies that
  bool is_known;         // but for the groups that have not stepped yet
  bool is_latched;
  bool holds;            // all requirements, after the last step
};

struct fm_gate;

/// Bytes of memory that a gate with these options needs; 0 if it does not fit in the address
/// space.
FM_EXPORT uint64_t fm_gate_bytes(const struct fm_gate_options * options);

/// Make a gate in `memory` (aligned to 16, fm_gate_bytes long), with an evaluator on which no
/// message was given yet. Returns NULL if `from` is out of range, a time is negative, `otherwise`
/// is unknown, or the policy is FM_ALL_INPUTS or FM_PERIODIC, under which a message need not be a
/// step. A substitute with a period is due at once, since the gate is closed.
/// O(bytes).
FM_EXPORT struct fm_gate * fm_gate_init(void * memory, const struct fm_gate_options * options);

/// Judge a message of `from`. Call it in place of fm_evaluator_store and fm_evaluator_message:
/// what is due before `now` was taken, and under FM_TIMED `now` is what fm_evaluator_arrival
/// returned. `stamp` is that of its violations; under FM_TIMED it is `now`. `fields` are in the
/// order of the topic's inputs; NULL: the message cannot be decoded. A message of a topic that
/// feeds no input is no step, and is judged by the last ones. Under FM_TIMED it is judged after
/// what is due at `now`, too: if it passes, no other message can take effect at that instant.
///
/// Writes violations to `out`, which has room for n_requirements, and their number to `n_out`. A
/// message that is withheld is a violation of each requirement that it would have violated, as
/// its report says, each time. When the next message passes, that is a recovery of those that
/// were violated so, if the evaluator reports recoveries.
/// Returns enum fm_judgement. Until fm_gate_finish, which must be the next call, the evaluator has
/// the values of the message, for the details of its violations. O(instance bytes + operations of
/// the groups that step).
FM_EXPORT uint32_t fm_gate_judge(
  struct fm_gate * gate, const struct fm_field * fields, int64_t now, int64_t stamp,
  int64_t steady, struct fm_violation * out, uint32_t * n_out);
FM_EXPORT void fm_gate_finish(struct fm_gate * gate);

/// Something else was evaluated: a message of another topic, or what was due. Call it each time;
/// `found` are the `n` violations of that step. Recoveries of what reads `from` are taken out of
/// them while what was sent last is a replacement: they come when a message passes. If some
/// requirement does not hold then, or the gate is not known, a substitute may be due: with a
/// period at once, without one only when that begins.
/// Returns whether fm_gate_due is earlier now. O(inputs + n * inputs of a group + requirements).
FM_EXPORT bool fm_gate_note(
  struct fm_gate * gate, struct fm_violation * found, uint32_t * n, int64_t steady);

/// When a replacement is due, by the steady time; FM_NEVER: none is. INT64_MIN: at once.
FM_EXPORT int64_t fm_gate_due(const struct fm_gate * gate);

/// A replacement is due: take the step of its message. To be called as fm_gate_judge, with the
/// fields of the substitute, or of the last message that passed. Its violations are written to
/// `out`, but its recoveries come when a message passes. Returns whether to send it, which may be
/// false for a held message only: if the gate is not known, or a requirement would not hold after
/// it; then it never happened, and nothing of it is counted. O(instance bytes + operations of the
/// groups that step).
FM_EXPORT bool fm_gate_replace(
  struct fm_gate * gate, const struct fm_field * fields, int64_t now, int64_t stamp,
  int64_t steady, struct fm_violation * out, uint32_t * n_out);

/// Whether a thread hangs that takes the messages of the other topics, or moves the clock: their
/// values are not known then. Call fm_gate_note afterwards.
FM_INTERNAL void fm_gate_note_hang(struct fm_gate * gate, bool hangs);

/// For an evaluator that has started afresh: no violation goes on. A gate that a violation closed
/// stays closed.
FM_INTERNAL void fm_gate_forget_violations(struct fm_gate * gate);

/// The same, and open a gate that a violation closed; the caller also resets the evaluator.
FM_EXPORT void fm_gate_reset(struct fm_gate * gate);

/// The counters, and the state by the steady time. O(inputs + requirements).
FM_EXPORT struct fm_gate_counts fm_gate_counts(const struct fm_gate * gate, int64_t steady);

#endif  // GATE_H_
