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

/// records.c: see records.h for the contract.

#include "records.h"

#include "engine_parts.h"
#include "instance.h"

static bool is_full(const struct fm_engine * engine, uint32_t most)
{
  return engine->outbox.n_violations >= most;
}

bool fm_engine_take_all_due_locked(
  struct fm_engine * engine, int64_t now, uint32_t most, uint64_t * left)
{
  int64_t deadline = fm_engine_deadline_locked(engine);
  while (deadline != INT64_MIN && deadline < now && *left > 0 && !is_full(engine, most)) {
    fm_engine_take_due_by_locked(engine, deadline);
    deadline = fm_engine_deadline_locked(engine);
    *left -= 1;
  }
  return deadline == INT64_MIN || deadline >= now || *left == 0;
}

bool fm_engine_records(struct fm_engine * engine, struct fm_records * records, uint32_t most)
{
  fm_engine_lock(engine);
  uint64_t left = FM_MOST_BETWEEN_RECORDS;
  while (records->next < records->n && !is_full(engine, most)) {
    const uint64_t k = records->next;
    const int64_t time = records->times[k];
    const uint32_t topic = records->topics[k];
    const uint8_t * message = records->bytes + records->place;
    const size_t size = (size_t)records->sizes[k];
    const uint32_t key_size = records->keys == NULL ? 0 : records->key_sizes[k];
    const uint8_t * key = key_size == 0 ? NULL : records->keys + records->key_place;
    if (topic < engine->options.n_topics) {
      const int64_t until = fm_later(time, -engine->options.reorder);
      if (!fm_engine_take_all_due_locked(engine, until, most, &left)) {
        break;
      }
      const struct fm_origin origin = {time, 0, 0, NULL, false, key, key_size};
      (void)fm_engine_message_locked(engine, topic, message, size, &origin);
      records->counts[topic] += 1u;
    }
    records->next += 1;
    records->place += size;
    records->key_place += key_size;
    left = FM_MOST_BETWEEN_RECORDS;
  }
  const bool are_all = records->next == records->n;
  fm_engine_unlock(engine);
  return are_all;
}

bool fm_engine_rows(struct fm_engine * engine, struct fm_rows * rows, uint32_t most)
{
  fm_engine_lock(engine);
  uint64_t left = UINT64_MAX;
  engine->has_begun = true;
  while (rows->next < rows->n && !is_full(engine, most)) {
    const int64_t time = rows->times[rows->next];
    if (!fm_engine_take_all_due_locked(engine, time, most, &left)) {
      break;
    }
    const uint32_t n = fm_evaluator_row(engine->options.evaluator, rows, engine->found);
    fm_engine_announce_locked(engine, n, 0);
    fm_engine_take_due_by_locked(engine, time);
  }
  const bool are_all = rows->next == rows->n;
  fm_engine_unlock(engine);
  return are_all;
}

bool fm_engine_advance_all(struct fm_engine * engine, int64_t now, uint32_t most)
{
  fm_engine_lock(engine);
  uint64_t left = FM_MOST_BETWEEN_RECORDS;
  engine->has_begun = true;
  const int64_t end = fm_later(now, -engine->options.reorder);
  const bool is_there = fm_engine_take_all_due_locked(engine, end, most, &left);
  if (is_there) {
    fm_engine_take_due_by_locked(engine, end);
  }
  fm_engine_unlock(engine);
  return is_there;
}

int64_t fm_engine_latest_waiting(struct fm_engine * engine)
{
  fm_engine_lock(engine);
  const struct fm_reorder * waiting = &engine->waiting;
  const int64_t latest =
    waiting->n == 0 ? INT64_MIN : waiting->slots[waiting->order[waiting->n - 1]].stamp;
  fm_engine_unlock(engine);
  return latest;
}
