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

/// details.c: see details.h for the contract.

#include "details.h"

#include <inttypes.h>
#include <string.h>

enum { HAS_VALUE = 1, IS_STALE = 2 };  // flags of an input (outbox.h)

size_t fm_detail_bytes(const struct fm_monitor * monitor)
{
  return sizeof(struct fm_detail) + (size_t)monitor->inputs_bytes + monitor->n_inputs;
}

static const uint8_t * values_of(const struct fm_detail * detail)
{
  return (const uint8_t *)detail + sizeof(*detail);
}

static uint8_t flags_of(
  const struct fm_monitor * monitor, const struct fm_detail * detail, uint32_t input)
{
  return values_of(detail)[monitor->inputs_bytes + input];
}

static bool is_float(enum fm_type type)
{
  return type == FM_FLOAT32 || type == FM_FLOAT64;
}

static bool is_unsigned(enum fm_type type)
{
  return type == FM_UINT8 || type == FM_UINT16 || type == FM_UINT32 || type == FM_UINT64;
}

#define READ(c_type, member) \
  do { \
    c_type found; \
    memcpy(&found, place, sizeof(found)); \
    value.member = found; \
  } while (0)

static union fm_value read_value(const uint8_t * place, enum fm_type type)
{
  union fm_value value = {0};
  switch (type) {
    case FM_BOOL: READ(bool, i); break;
    case FM_INT8: READ(int8_t, i); break;
    case FM_INT16: READ(int16_t, i); break;
    case FM_INT32: READ(int32_t, i); break;
    case FM_INT64: READ(int64_t, i); break;
    case FM_UINT8: READ(uint8_t, u); break;
    case FM_UINT16: READ(uint16_t, u); break;
    case FM_UINT32: READ(uint32_t, u); break;
    case FM_UINT64: READ(uint64_t, u); break;
    case FM_FLOAT32: READ(float, f); break;
    case FM_FLOAT64: READ(double, f); break;
  }
  return value;
}

static bool are_equal(union fm_value one, union fm_value other, enum fm_type type)
{
  return is_float(type) ? one.f == other.f :
         is_unsigned(type) ? one.u == other.u : one.i == other.i;
}

static void add_value(
  struct fm_text * text, const struct fm_report_input * input, union fm_value value,
  enum fm_type type)
{
  for (uint32_t k = 0; k < input->n_values; ++k) {
    if (are_equal(value, input->values[k].value, type)) {
      fm_text_add(text, "%s", input->values[k].name);
      return;
    }
  }
  if (type == FM_BOOL) {
    fm_text_add(text, "%s", value.i != 0 ? "true" : "false");
  } else if (type == FM_FLOAT32) {
    fm_text_add_float32(text, (float)value.f);
  } else if (type == FM_FLOAT64) {
    fm_text_add_float64(text, value.f);
  } else if (is_unsigned(type)) {
    fm_text_add(text, "%" PRIu64, value.u);
  } else {
    fm_text_add(text, "%" PRId64, value.i);
  }
}

void fm_add_input(
  struct fm_text * text, const struct fm_reporter * reporter, const struct fm_detail * detail,
  uint32_t input)
{
  const struct fm_monitor * monitor = reporter->monitor;
  const struct fm_input * stored = &monitor->inputs[input];
  if ((flags_of(monitor, detail, input) & HAS_VALUE) == 0) {
    fm_text_add(text, "(none yet)");
    return;
  }
  add_value(
    text, &reporter->table->inputs[input],
    read_value(values_of(detail) + stored->offset, (enum fm_type)stored->type),
    (enum fm_type)stored->type);
}

void fm_add_silent(
  struct fm_text * text, const struct fm_reporter * reporter, const struct fm_detail * detail)
{
  const struct fm_report_requirement * requirement =
    &reporter->table->requirements[detail->violation.requirement];
  bool is_first = true;
  for (uint32_t k = 0; k < requirement->n_inputs; ++k) {
    const uint32_t input = requirement->inputs[k];
    if ((flags_of(reporter->monitor, detail, input) & IS_STALE) != 0) {
      fm_text_add(text, "%s%s", is_first ? "" : ", ", reporter->table->inputs[input].name);
      is_first = false;
    }
  }
}

static enum fm_status_level level_of(
  const struct fm_report_requirement * requirement, const struct fm_detail * detail)
{
  return detail->violation.is_recovery ? FM_STATUS_OK :
         requirement->is_warning ? FM_STATUS_WARN :
         FM_STATUS_ERROR;
}

void fm_add_detail(
  struct fm_statuses * list, const struct fm_reporter * reporter, const struct fm_detail * detail)
{
  const struct fm_report_requirement * requirement =
    &reporter->table->requirements[detail->violation.requirement];
  struct fm_text text = {NULL, 0, 0};
  struct fm_status * status = fm_statuses_add(
    list, level_of(requirement, detail), requirement->id, requirement->text,
    reporter->table->component);
  if (reporter->table->policy == FM_TIMED) {
    fm_text_add_short_seconds(&text, (int64_t)detail->violation.step);
    fm_status_value(status, "time", "%s", fm_text_get(&text));
  } else {
    fm_status_value(status, "step", "%" PRIu64, detail->violation.step);
  }
  fm_text_clear(&text);
  fm_text_add_seconds(&text, detail->violation.stamp);
  fm_status_value(status, "stamp", "%s", fm_text_get(&text));
  fm_status_value(status, "suppressed", "%" PRIu64, detail->suppressed);
  fm_text_clear(&text);
  fm_add_silent(&text, reporter, detail);
  fm_status_value(status, "silent", "%s", fm_text_get(&text));
  for (uint32_t k = 0; k < requirement->n_inputs; ++k) {
    fm_text_clear(&text);
    fm_add_input(&text, reporter, detail, requirement->inputs[k]);
    fm_status_value(
      status, reporter->table->inputs[requirement->inputs[k]].key, "%s", fm_text_get(&text));
  }
  for (uint32_t k = 0; k < requirement->n_constants; ++k) {
    const struct fm_constant * constant = &reporter->table->constants[requirement->constants[k]];
    fm_status_value(status, constant->key, "%s", constant->value);
  }
  if (detail->violation.is_withheld && reporter->table->gate[0] != '\0') {
    fm_status_value(status, "withheld by", "%s", reporter->table->gate);
  }
  fm_text_free(&text);
}
