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

/// evaluator.h: when a step is due, what is ready, what is reported, what is counted.
///
/// No other code decides this; the node and `simulate` only pass values and the time to it.
///
/// Time is an int64_t in nanoseconds, of a clock that the caller chooses; the evaluator reads
/// none. It begins with the first fm_evaluator_advance. A message at a time is given in this
/// order: what is due before it (fm_evaluator_advance with now - 1 until fm_evaluator_wake is not
/// before `now`; not if the evaluator's time is `now` already), its fields (fm_evaluator_store),
/// then fm_evaluator_message. A message at the very instant of a deadline thus comes before what
/// is due at that instant. Under FM_TIMED, `now` is what fm_evaluator_arrival returns.
///
/// The caller owns all memory: it passes a block of fm_evaluator_bytes bytes, aligned to 16.
/// Not thread-safe: callers that share an evaluator hold a mutex around each call.
/// No function allocates, blocks, or fails except by the stated return value. Without a stated
/// complexity a function is O(1).

#ifndef EVALUATOR_H_
#define EVALUATOR_H_

#include "fret_monitor.h"

#ifdef __cplusplus
extern "C" {
#endif

/// When a step happens.
enum fm_policy
{
  FM_EVERY_MESSAGE = 0,     // every message: all ready groups
  FM_RELEVANT_MESSAGE = 1,  // every message: the ready groups that read an input of its topic
  FM_ALL_INPUTS = 2,        // a group once all its inputs were received anew since its last step
  FM_PERIODIC = 3,          // every period: all ready groups
  FM_TIMED = 4              // every nanosecond: see below
};

// FM_TIMED means what FM_PERIODIC with a period of 1 ns would say, without taking these steps. A
// group is evaluated when a message of a topic that it reads comes, and at its deadlines: the
// instants at which one of its values can change although no input does. In between nothing is
// done. Its tick 0 is the message that makes it ready, or the begin of the time if it is ready by
// then. Each evaluation is at its own instant and is stamped with it, however late it is made.
// A message at the instant of a deadline and the deadline are one evaluation.
//
// No two messages take effect at one instant: of two at one time the later takes effect 1 ns
// later. So the evaluator's time may be ahead of the clock, by as many ns as messages came at one
// time. A group that would be evaluated after FM_LAST_TICK starts afresh.

/// Which violations of a requirement are announced.
enum fm_report
{
  FM_EVERY_STEP = 0,  // each violating step; under FM_TIMED each violating evaluation
  FM_ONSET = 1,       // when the verdict turns false
  FM_OCCURRENCE = 2,  // when the verdict that fm_monitor.occurrences names turns false
  FM_UNREPORTED = 3   // never, nor are its violations counted: an operand of an aggregate, whose
                      // verdict is that of its formula even while its group is stale
};

/// What an input is fed by.
enum fm_source
{
  FM_FIELD = 0,      // a field
  FM_RECEPTION = 1,  // a bool: a message came. True at the message alone: until the steps of that
                     // message are taken; under FM_PERIODIC those of a period; under FM_TIMED for
                     // one tick
  FM_AGE = 2,        // a float64: seconds from a stamp in the message to its reception
  FM_AGGREGATE = 3,  // a value over all instances of a kind (scopes.h); several topics may set it
  FM_RATE = 4,       // a float64: messages a second in the last `windows` ns; no value until that
                     // time has passed since the first message
  FM_PERIOD = 5,     // a float64: seconds between the last two messages; none before the second
  FM_TIME = 6        // an int64: when the last message was received, ns
};

/// Periods that are taken after the fact, after the process was stopped or the clock has jumped.
/// Those before them are missed. No more than what the queue of a violation's topic holds.
#define FM_MOST_PERIODS_BEHIND 1000

/// The inputs that the messages of a topic set, as indices. Constant, owned by the caller,
/// outlives the evaluator. A topic may set no input; an input is listed at most once, by one
/// topic.
struct fm_topic
{
  const uint32_t * inputs;
  uint32_t n_inputs;
};

/// How to run a monitor. All that it points to outlives the evaluator and stays the caller's.
struct fm_evaluator_options
{
  const struct fm_monitor * monitor;
  const struct fm_topic * topics;
  uint32_t n_topics;
  uint32_t policy;             // enum fm_policy
  const uint8_t * reports;     // a requirement: enum fm_report
  const int64_t * timeouts;    // an input: ns without a value until it is silent; 0: never
  const bool * violates;       // an input: while it is silent, what reads it is violated
  int64_t period;              // ns, with FM_PERIODIC; 0: steps come from fm_evaluator_step alone
  int64_t patience;            // ns, 0: none; see fm_evaluator_advance
  const uint8_t * sources;     // an input: enum fm_source
  bool reports_recoveries;     // also report when what was announced is over
  const int64_t * startups;    // an input with a timeout: ns without a first value until it is
                               // silent; 0: as its timeout
  const int64_t * windows;     // an input whose source is FM_RATE: the length of its window, ns
  const uint32_t * rooms;      // and how many messages it has room for
  const struct fm_tests * tests;  // of the monitor; NULL: none
  const struct fm_margins * margins;  // of the monitor; NULL: none
};

/// A least margin of a requirement, and the step that had it.
struct fm_closest
{
  struct fm_margin margin;
  int64_t at;     // when the step was
  bool is_known;  // false: no step had one
};

/// Margins over a stretch of time, for drawing: of each requirement and part the least margin of
/// its steps, and the last one. Both are at first margins whose values are NaN.
struct fm_margin_lanes
{
  int64_t begin;             // ns
  int64_t width;             // of a part, ns
  uint64_t n;                // parts
  struct fm_margin * least;  // a requirement: n of them
  struct fm_margin * last;
};

/// One announced violation, or the recovery from one: what its report compares is true again.
struct fm_violation
{
  uint64_t step;         // of its group, from 0 since start or reset; under FM_TIMED the tick
  int64_t stamp;         // the time of the message, row, period, deadline or timeout
  uint32_t requirement;  // index
  bool is_recovery;      // only with fm_evaluator_options.reports_recoveries
  bool is_withheld;      // by a message that a gate withheld
  bool is_end;           // a recovery: the instance ended while it was violated (scopes.h)
};

/// The test of a requirement with a probability, since start or reset.
struct fm_test_counts
{
  const struct fm_test * test;  // NULL: it has no probability, and the rest is 0
  int64_t trials;
  int64_t events;
  int64_t verdict;     // 1: shown, -1: refuted, 0: neither
  int64_t units;       // the likelihood of the outcomes is a power of 2^64
  double likelihood;   // times this
};

/// A trial that was decided at a time.
struct fm_trial_record
{
  int64_t stamp;
  uint32_t requirement;
  bool has_failed;
};

/// Where an evaluator writes the trials that are decided; the caller owns all of it. `missed`
/// counts those for which there was no room.
struct fm_trial_log
{
  struct fm_trial_record * records;
  uint32_t room;
  uint32_t n;
  uint64_t missed;
};

/// Counters of a requirement. They count on through a reset.
struct fm_requirement_counts
{
  uint64_t steps;        // under FM_TIMED evaluations
  uint64_t violations;   // steps whose verdict was false, and timeouts that violated
  uint64_t announced;    // those that were reported (all, onsets, or occurrences)
  bool verdict;          // of the last step or timeout; true before the first
  bool holds;            // what is reported: the verdict, or of H p whose falls are reported, p
  bool is_violated;      // the last violation is not over; of an engine with a gate, also one by a
                         // message that was withheld
  struct fm_test_counts test;
  struct fm_margin margin;  // the present one; a NaN if it is not known
};

/// Counters of an input.
struct fm_input_counts
{
  uint64_t received;     // values stored
  uint64_t unusable;     // counted with fm_evaluator_unusable
  uint64_t overwritten;  // with FM_ALL_INPUTS: values that a group reading it never stepped on
};

/// Counters of a topic.
struct fm_topic_counts
{
  uint64_t messages;     // that were steps or could have been
  uint64_t undecodable;  // counted with fm_evaluator_undecodable
};

/// The silences of an input: times without a usable value, from its timeout on.
struct fm_silence
{
  uint64_t count;        // so far
  int64_t lasted;        // ns from the value before it until now, or the value that ended it
  uint32_t startups;     // of `count`: no value had come at all; may wrap around
  bool is_silent;        // now
};

/// Counters of the time.
struct fm_time_counts
{
  uint64_t periods;      // taken
  uint64_t late;         // taken more than half a period after their instant
  uint64_t missed;       // not taken: more than FM_MOST_PERIODS_BEHIND came in between
  uint64_t restarts;     // how often the time went back
  int64_t restarted_at;  // the time to which it went back last; 0 before
  uint64_t overflows;    // changes more than a `max_rate` allows, since start or reset; and
                         // messages of which a rate had too many
};

struct fm_evaluator;

/// Bytes of memory that an evaluator with these options needs; 0 if the monitor's ABI is not
/// FM_ABI, or the evaluator does not fit in the address space. O(groups).
FM_EXPORT uint64_t fm_evaluator_bytes(const struct fm_evaluator_options * options);

/// Make an evaluator in `memory` (aligned to 16, fm_evaluator_bytes long): no input has a value,
/// and every group is at its start. Returns it, or NULL if an index in the options or the monitor
/// is out of range or out of order, an input has two topics, a requirement is not listed once, by
/// the group it names, a time is negative, a group has no function for the policy, an input's type
/// does not fit its source, or the ABI is not FM_ABI. `reports` NULL: every violation is
/// announced; `timeouts` NULL: none; `violates` NULL: none does; `sources` NULL: all are fields;
/// `startups` NULL: all are as the timeouts; `windows` and `rooms` may be NULL without FM_RATE.
/// O(bytes).
FM_EXPORT struct fm_evaluator * fm_evaluator_init(
  void * memory, const struct fm_evaluator_options * options);

/// When a message that comes `now` takes effect: `now`, or under FM_TIMED, if something was
/// evaluated at that instant already, 1 ns later than the last evaluation. To be used in place of
/// `now` in all calls for this message. Under the other policies `now` is when the message was
/// received, which only matters for measures: FM_RATE, FM_PERIOD, FM_TIME. Then it takes
/// O(rates * log(room)).
FM_EXPORT int64_t fm_evaluator_arrival(struct fm_evaluator * evaluator, int64_t now);

/// Store a value of an input, received at `now`: a silence of the input ends, and its timeout runs
/// from then. No step happens: the call of fm_evaluator_message with the input's
/// topic follows, once all fields of the message are stored. Integers wrap to the input's type,
/// a bool is i != 0. O(1), and O(groups that read it) for the first value, after a silence, and
/// with FM_ALL_INPUTS. An index out of range is ignored. The value of a measure is not looked at:
/// its message was received.
FM_EXPORT void fm_evaluator_store(
  struct fm_evaluator * evaluator, uint32_t input, union fm_value value, int64_t now);

/// As fm_evaluator_store, from an object of the input's type (bool: a byte) at any alignment.
FM_EXPORT void fm_evaluator_store_from(
  struct fm_evaluator * evaluator, uint32_t input, const void * value, int64_t now);

/// Give an input its initial value: as store, but it does not count as received, and neither ends
/// a silence nor begins its timeout anew.
FM_EXPORT void fm_evaluator_initial(
  struct fm_evaluator * evaluator, uint32_t input, union fm_value value);
FM_EXPORT void fm_evaluator_initial_from(
  struct fm_evaluator * evaluator, uint32_t input, const void * value);

/// The two halves of fm_evaluator_store, for a gate; the index is in range. `put` stores a value
/// that was sent and not received: it does not count as received, and ends no silence. `arrive`
/// ends the silence of an input, and begins its timeout anew, when a message of it was withheld.
/// O(groups that read it).
FM_INTERNAL void fm_evaluator_put(
  struct fm_evaluator * evaluator, uint32_t input, union fm_value value, int64_t now);
FM_INTERNAL void fm_evaluator_arrive(
  struct fm_evaluator * evaluator, uint32_t input, int64_t now);

/// Take the value of an aggregate away, if it has one: the groups that read it are not ready until
/// it is stored again. Their state stays; under FM_TIMED the time until then is none of their
/// ticks. The index is in range. O(groups that read it).
FM_INTERNAL void fm_evaluator_withdraw(
  struct fm_evaluator * evaluator, uint32_t input, int64_t now);

/// Count a field that cannot be used. The input keeps its value.
FM_EXPORT void fm_evaluator_unusable(struct fm_evaluator * evaluator, uint32_t input);

/// Count a message that cannot be decoded. No group steps.
FM_EXPORT void fm_evaluator_undecodable(struct fm_evaluator * evaluator, uint32_t topic);

/// A message of a topic has been stored: take the steps that the policy requires.
/// Writes the violations to announce to `out`, by group, then requirement; `out` has room for
/// n_requirements, or is NULL: they are only counted. Returns their number.
/// A group that reads no input steps with every message, except with FM_PERIODIC and FM_TIMED.
/// With FM_ALL_INPUTS a field that cannot be used does not count as received. Under FM_TIMED, a
/// message before the time begins evaluates nothing: its values are those of tick 0.
/// O(operations of the groups that step), and a comparison for each group that might have.
FM_EXPORT uint32_t fm_evaluator_message(
  struct fm_evaluator * evaluator, uint32_t topic, int64_t now, struct fm_violation * out);

/// A row of a trace is stored (any policy): all ready groups take a step, and wait for all their
/// inputs anew with FM_ALL_INPUTS. Under FM_TIMED the first row begins the time. As
/// fm_evaluator_message otherwise.
FM_EXPORT uint32_t fm_evaluator_step(
  struct fm_evaluator * evaluator, int64_t now, struct fm_violation * out);

/// The next instant at which something happens though no message comes: a period, the timeout of
/// an input, or under FM_TIMED the deadline of a group. FM_NEVER if there is none; INT64_MIN
/// before the time has begun. O(1), and O(inputs + groups) when a message has put off what was
/// next.
FM_EXPORT int64_t fm_evaluator_deadline(struct fm_evaluator * evaluator);

/// A time not after the deadline, without looking for it: it may be too early by what values have
/// put off. O(1).
FM_EXPORT int64_t fm_evaluator_wake(const struct fm_evaluator * evaluator);

/// Move the time to `now`, and take the first thing that is due by then, stamped with its own
/// instant, however late this is called. To be called until fm_evaluator_wake is after `now`, or
/// FM_NEVER: nothing is due then. The violations are as those of fm_evaluator_message. Of one
/// instant, the timeouts come first, by input, then the period or the deadlines of groups.
///
/// The first call begins the time: all timeouts run from it, whatever was stored before, and for
/// `startups` where nothing was. The first period ends one period later. Time that goes back is
/// counted: what was to come in a second still comes in a second; values and past are kept. Under
/// FM_TIMED the past is not: all groups start afresh, as with fm_evaluator_reset.
///
/// The deadlines of groups, under FM_TIMED: all groups that are due at that instant are evaluated,
/// in one call.
///
/// A period: all ready groups take a step. Of more than FM_MOST_PERIODS_BEHIND due ones the first
/// are missed, before anything else is taken.
///
/// The timeout of an input: the input is silent until its next store. If it `violates`, it is
/// stale, and so is each group that reads it. A stale group still steps, on the old values, which
/// keeps its temporal state up to date; but all its verdicts are false, whatever its formulas
/// evaluate to. A group that becomes stale violates its requirements once, without a step, ready
/// or not. They are counted and, unless report_onset finds the last verdict false already,
/// announced, with the number of the group's next step. When the last stale input of a group is
/// stored, a group that is not ready counts as satisfied again, and fm_evaluator_message reports
/// the recovery; one that is ready keeps its verdict until its next step.
///
/// With `patience`, a timeout that is found more than that late, by a time that has moved by more
/// than half of it at once, is put off, once a silence: the process did not run, or the clock has
/// jumped, and messages may be waiting to be received. It is looked at again when as long again
/// has passed, at least ten times `patience` and at most its own length (before the first value
/// that is `startups`). That is one call, without
/// a violation. The stamp remains the end of the timeout.
///
/// O(operations) for a period, O(inputs + groups + operations of the groups that are due) for
/// deadlines, O(inputs + groups that read the input, and their requirements) for a timeout, O(1)
/// if nothing is due.
FM_EXPORT uint32_t fm_evaluator_advance(
  struct fm_evaluator * evaluator, int64_t now, struct fm_violation * out);

/// As fm_evaluator_advance, for a clock that stands still at `now`: what is due at `now` itself is
/// not taken, since a message may still come at that time.
FM_INTERNAL uint32_t fm_evaluator_advance_to(
  struct fm_evaluator * evaluator, int64_t now, struct fm_violation * out);

/// The clock was changed: all times are `by` nanoseconds later on the new one. Nothing if the time
/// has not begun. O(inputs + groups + room of rates).
FM_EXPORT void fm_evaluator_shift(struct fm_evaluator * evaluator, int64_t by);

/// Whether the time has begun. O(1).
FM_EXPORT bool fm_evaluator_has_begun(const struct fm_evaluator * evaluator);

/// The time: the largest `now` of the two functions since it began or went back, or under
/// FM_TIMED of a later message; 0 before.
FM_EXPORT int64_t fm_evaluator_now(const struct fm_evaluator * evaluator);

/// Rows of a trace. The caller owns all of it; only `next` is written.
struct fm_rows
{
  const void * const * columns;  // an input: n values of its type (bool: bytes), or NULL: it keeps
                                 // its value; to a measure rows are messages of its topic
  const int64_t * times;         // a row: ns, strictly increasing
  uint64_t n;
  uint64_t next;                 // the row to take next; 0 at first
  const uint8_t * const * come;  // an input: n flags: in which rows it has a value, of a measure
                                 // a message; or NULL, as `come` itself may be: in all
  struct fm_margin * margins;    // room for the margins of n_requirements for each row that is
                                 // written; NULL: none. One that differs makes a row, too
};

/// Take the next row, which there must be, at its time: store its values, then fm_evaluator_step.
/// What is due before it was taken; what is due at its time comes after it. Writes and returns as
/// fm_evaluator_step. O(inputs + operations).
FM_EXPORT uint32_t fm_evaluator_row(
  struct fm_evaluator * evaluator, struct fm_rows * rows, struct fm_violation * out);

/// Take rows, and after the last one what is due by `until`. Before each row, what is due is taken
/// first. Writes a time and n_requirements verdicts for each row, and for each instant between and
/// after the rows at which a verdict differs from those written before. `times` has room for
/// `room` times, `verdicts` for as many rows of flags. Returns how many were written; fewer than
/// `room` once all is taken. Call it again until then. The first row begins the time. Violations
/// are only counted. O(evaluations x operations).
FM_EXPORT uint64_t fm_evaluator_rows(
  struct fm_evaluator * evaluator, struct fm_rows * rows, int64_t until, uint64_t room,
  int64_t * times, bool * verdicts);

/// Put all groups at their start: temporal state, first time point, step numbers, last verdicts
/// (for the reports), and which inputs were received since the last step. The inputs keep their
/// values, and the counters and periods go on. The verdicts are true until the next step; under
/// FM_TIMED that of a ready group is due at once, and is its tick 0. A stale input is stale until
/// its next store, and is due at once: its groups that have not stepped since are violated anew by
/// the next fm_evaluator_advance. O(inputs + state bytes).
FM_EXPORT void fm_evaluator_reset(struct fm_evaluator * evaluator);

/// Copy the instance: the values, state, readiness, verdicts and times, in one block that holds no
/// address. It may be restored, any number of times, to any evaluator of the same monitor and
/// options in this process. The counters, and how long a past silence lasted, are not part of it
/// and go on. `out` and `from`: a block
/// of fm_evaluator_instance_bytes bytes, at any alignment. O(bytes).
FM_EXPORT uint64_t fm_evaluator_instance_bytes(const struct fm_evaluator * evaluator);
FM_EXPORT void fm_evaluator_save(const struct fm_evaluator * evaluator, void * out);
FM_EXPORT void fm_evaluator_restore(struct fm_evaluator * evaluator, const void * from);

/// Whether every input that the group reads has a value.
FM_EXPORT bool fm_evaluator_ready(const struct fm_evaluator * evaluator, uint32_t group);

/// Whether an input is measured: FM_RATE, FM_PERIOD or FM_TIME.
FM_INTERNAL bool fm_evaluator_measures(const struct fm_evaluator * evaluator);

/// Whether the policy is FM_TIMED.
FM_EXPORT bool fm_evaluator_is_timed(const struct fm_evaluator * evaluator);

/// Steps a group has taken since start or reset; under FM_TIMED evaluations.
FM_EXPORT uint64_t fm_evaluator_steps(const struct fm_evaluator * evaluator, uint32_t group);

/// The time of the first of these steps; any number if there was none.
FM_EXPORT int64_t fm_evaluator_start(const struct fm_evaluator * evaluator, uint32_t group);

/// Verdicts of the last steps, n_requirements flags, owned by the evaluator; true where a
/// requirement's group has neither stepped nor been stale yet.
FM_EXPORT const bool * fm_evaluator_verdicts(const struct fm_evaluator * evaluator);

/// The current values, the module's struct of inputs, owned by the evaluator.
FM_EXPORT const void * fm_evaluator_inputs(const struct fm_evaluator * evaluator);

/// Whether an input has a value.
FM_EXPORT bool fm_evaluator_has_value(const struct fm_evaluator * evaluator, uint32_t input);

/// Whether an input is stale.
FM_EXPORT bool fm_evaluator_is_stale(const struct fm_evaluator * evaluator, uint32_t input);

/// Write the trials that are decided from now on to a log, which outlives this use; NULL: to none.
FM_EXPORT void fm_evaluator_log_trials(
  struct fm_evaluator * evaluator, struct fm_trial_log * log);

/// What the words and parts of a test (fret_trials.h) hold. O(1).
FM_EXPORT struct fm_test_counts fm_counts_of_test(
  const struct fm_test * test, const int64_t * words, const double * parts);

/// The margin of a requirement at its group's last step; not known (a NaN) before, without
/// margins, and for an index out of range. O(1).
FM_EXPORT struct fm_margin fm_evaluator_margin(
  const struct fm_evaluator * evaluator, uint32_t requirement);

/// Its least margin since the evaluator was made. Steps while a stale input violates it do not
/// count, as in the functions below. O(1).
FM_EXPORT struct fm_closest fm_evaluator_closest(
  const struct fm_evaluator * evaluator, uint32_t requirement);

/// How far its last violation went beyond: the least margin, while it lasted, of what its report
/// compares. Not known without margins, and before the first one. O(1).
FM_EXPORT struct fm_closest fm_evaluator_beyond(
  const struct fm_evaluator * evaluator, uint32_t requirement);

/// Take its least margin since the last call, the present one included; a NaN if that is not
/// known. O(1).
FM_EXPORT double fm_evaluator_take_margin(struct fm_evaluator * evaluator, uint32_t requirement);

/// Write the margins of all steps from now on to lanes, which outlive this use; NULL: to none.
FM_EXPORT void fm_evaluator_draw_margins(
  struct fm_evaluator * evaluator, const struct fm_margin_lanes * lanes);

/// Forget the least margins. O(requirements).
FM_EXPORT void fm_evaluator_forget_closest(struct fm_evaluator * evaluator);

/// Counters; all 0, and the verdict true, for an index out of range.
FM_EXPORT struct fm_requirement_counts fm_evaluator_requirement_counts(
  const struct fm_evaluator * evaluator, uint32_t requirement);
FM_EXPORT struct fm_input_counts fm_evaluator_input_counts(
  const struct fm_evaluator * evaluator, uint32_t input);
FM_EXPORT struct fm_topic_counts fm_evaluator_topic_counts(
  const struct fm_evaluator * evaluator, uint32_t topic);
FM_EXPORT struct fm_silence fm_evaluator_silence(
  const struct fm_evaluator * evaluator, uint32_t input);
FM_EXPORT struct fm_time_counts fm_evaluator_time_counts(const struct fm_evaluator * evaluator);

#ifdef __cplusplus
}
#endif

#endif  // EVALUATOR_H_
