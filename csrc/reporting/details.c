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
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "figures.h"
#include "instance.h"
#include "pairs.h"

// ---- variables and keys of instances -----------------------------------------------------------

static bool is_of_pairs(const struct fm_report_kind * about)
{
  return about->second[0] != '\0';
}

void fm_add_variables(struct fm_text * text, const struct fm_report_kind * about)
{
  fm_text_add(text, "%s%s%s", about->variable, is_of_pairs(about) ? " and " : "", about->second);
}

void fm_add_key(
  struct fm_text * text, const struct fm_report_kind * about, const uint8_t * key, size_t size,
  bool is_named)
{
  const struct fm_key whole = {key, (uint32_t)size};
  const uint32_t n = size == 0 ? 0 : is_of_pairs(about) ? 2 : 1;
  for (uint32_t k = 0; k < n; ++k) {
    const struct fm_key part = n == 2 ? fm_pair_part(&whole, k) : whole;
    if (is_named) {
      fm_text_add(text, "%s%s=", k == 0 ? "" : ",", k == 0 ? about->variable : about->second);
    } else {
      fm_text_add(text, "%s", k == 0 ? "" : "/");
    }
    fm_text_add_bytes(text, part.bytes, part.size);
  }
}

// ---- details -----------------------------------------------------------------------------------

enum { HAS_VALUE = 1, IS_STALE = 2 };  // flags of an input (outbox.h)

// The keys of all details, in this order; under the policy timed the first one is another.
enum { PLACE, STAMP, SUPPRESSED, SILENT };
static const char * const OF_ALL[FM_OF_ALL_DETAILS] = {"step", "stamp", "suppressed", "silent"};
static const char OF_TIMES[] = "time";
// The last; no input has such a name.
static const char ABOUT_STEP[] = "about step";
static const char ABOUT_TIME[] = "about time";
static const char WITHHELD_BY[] = "withheld by";
static const char INSTANCE[] = "the instance";
static const char ENDED[] = "ended";
// Of the margin: how far the violation went beyond so far.
enum { MARGIN, DISTANCE, COMPARISON, DECIDED_AT, N_OF_MARGIN };
static const char * const OF_MARGIN[N_OF_MARGIN] = {
  "least margin", "deciding distance", "deciding comparison", "decided at"};
// Before the name of an input or a constant that has the name of such a key.
static const char INPUT[] = "input ";
static const char CONSTANT[] = "constant ";

static uint8_t flags_of(
  const struct fm_monitor * monitor, const struct fm_detail * detail, uint32_t input)
{
  return ((const uint8_t *)(detail + 1))[monitor->inputs_bytes + input];
}

// A detail, with whose values it has, and their names.
struct described
{
  const struct fm_reporter * reporter;
  const struct fm_detail * detail;
  const struct fm_report_requirement * requirement;
  const struct fm_report_input * inputs;
  struct fm_detail_scope scope;
};

static struct described describe(
  const struct fm_reporter * reporter, const struct fm_detail * detail)
{
  const struct fm_report_table * table = reporter->table;
  const struct fm_detail_scope scope = fm_engine_detail_scope(reporter->engine, detail);
  return (struct described) {
    reporter, detail, &table->requirements[detail->violation.requirement],
    scope.kind == FM_BUNDLE ? table->inputs : table->kinds[scope.kind].inputs, scope};
}

// Add the name of the requirement: SPEED, or SPEED[robot=alpha].
static void add_name(struct fm_text * text, const struct described * item)
{
  fm_text_add(text, "%s", item->requirement->id);
  if (item->scope.kind != FM_BUNDLE) {
    fm_text_add(text, "[");
    fm_add_key(
      text, &item->reporter->table->kinds[item->scope.kind], item->scope.key,
      item->scope.key_size, true);
    fm_text_add(text, "]");
  }
}

static bool is_float(enum fm_type type)
{
  return type == FM_FLOAT32 || type == FM_FLOAT64;
}

static bool is_unsigned(enum fm_type type)
{
  return type == FM_UINT8 || type == FM_UINT16 || type == FM_UINT32 || type == FM_UINT64;
}

static void add_value(
  struct fm_text * text, const struct fm_report_input * input, union fm_value value,
  enum fm_type type)
{
  for (uint32_t k = 0; k < input->n_values; ++k) {
    const union fm_value * named = &input->values[k].value;
    if (is_float(type) ? value.f == named->f : value.u == named->u) {
      fm_text_add(text, "%s", input->values[k].name);
      return;
    }
  }
  if (type == FM_BOOL) {
    fm_text_add(text, "%s", value.i != 0 ? "true" : "false");
  } else if (is_float(type)) {
    fm_text_add_float(text, value.f, type == FM_FLOAT32);
  } else if (is_unsigned(type)) {
    fm_text_add(text, "%" PRIu64, value.u);
  } else {
    fm_text_add(text, "%" PRId64, value.i);
  }
}

static void add_input(struct fm_text * text, const struct described * item, uint32_t input)
{
  const struct fm_input * stored = &item->scope.monitor->inputs[input];
  if ((flags_of(item->scope.monitor, item->detail, input) & HAS_VALUE) == 0) {
    fm_text_add(text, "(none yet)");
    return;
  }
  add_value(
    text, &item->inputs[input],
    fm_instance_value(
      (enum fm_type)stored->type, (const uint8_t *)(item->detail + 1) + stored->offset),
    (enum fm_type)stored->type);
}

// Add the names of the stale inputs that the requirement reads.
static void add_silent(struct fm_text * text, const struct described * item)
{
  for (uint32_t k = 0; k < item->requirement->n_inputs; ++k) {
    const uint32_t input = item->requirement->inputs[k];
    if ((flags_of(item->scope.monitor, item->detail, input) & IS_STALE) != 0) {
      fm_text_join(text, ", ", "%s", item->inputs[input].name);
    }
  }
}

static bool is_of_all(const char * name)
{
  bool is_found = strcmp(name, OF_TIMES) == 0;
  for (uint32_t k = 0; k < FM_OF_ALL_DETAILS; ++k) {
    is_found = is_found || strcmp(name, OF_ALL[k]) == 0;
  }
  return is_found;
}

static void add_named(
  struct fm_status * status, const char * prefix, const char * name, const char * value)
{
  struct fm_text key = {NULL, 0, 0};
  fm_text_add(&key, "%s%s", is_of_all(name) ? prefix : "", name);
  fm_status_value(status, fm_text_get(&key), "%s", value);
  fm_text_free(&key);
}

static const char * without(const char * key, const char * prefix)
{
  return strncmp(key, prefix, strlen(prefix)) == 0 ? key + strlen(prefix) : key;
}

// The name of the input or constant with this key.
static const char * name_of(const char * key)
{
  const char * name = without(without(key, INPUT), CONSTANT);
  return is_of_all(name) ? name : key;
}

static enum fm_status_level level_of(const struct described * item)
{
  return item->detail->violation.is_recovery ? FM_STATUS_OK :
         item->requirement->is_warning ? FM_STATUS_WARN : FM_STATUS_ERROR;
}

// Add a step, or the time of a tick since the start.
static void add_place(struct fm_text * text, const struct fm_reporter * reporter, uint64_t step)
{
  if (reporter->table->policy == FM_TIMED) {
    fm_text_add_short_seconds(text, (int64_t)step);
  } else {
    fm_text_add(text, "%" PRIu64, step);
  }
}

// Add the step that a verdict is about, of a requirement that speaks of the future.
static void add_about(struct fm_status * status, const struct described * item)
{
  const uint64_t horizon = (uint64_t)item->requirement->horizon;
  struct fm_text text = {NULL, 0, 0};
  if (horizon == 0 || item->detail->violation.step < horizon) {
    return;
  }
  add_place(&text, item->reporter, item->detail->violation.step - horizon);
  fm_status_text(
    status, item->reporter->table->policy == FM_TIMED ? ABOUT_TIME : ABOUT_STEP, &text);
  fm_text_free(&text);
}

static void add_of_all(struct fm_status * status, const struct described * item)
{
  struct fm_text text = {NULL, 0, 0};
  add_place(&text, item->reporter, item->detail->violation.step);
  fm_status_text(
    status, item->reporter->table->policy == FM_TIMED ? OF_TIMES : OF_ALL[PLACE], &text);
  fm_text_add_seconds(&text, item->detail->violation.stamp);
  fm_status_text(status, OF_ALL[STAMP], &text);
  fm_status_value(status, OF_ALL[SUPPRESSED], "%" PRIu64, item->detail->suppressed);
  add_silent(&text, item);
  fm_status_text(status, OF_ALL[SILENT], &text);
  fm_text_free(&text);
}

static void add_values(struct fm_status * status, const struct described * item)
{
  const struct fm_report_requirement * requirement = item->requirement;
  struct fm_text text = {NULL, 0, 0};
  for (uint32_t k = 0; k < requirement->n_inputs; ++k) {
    fm_text_clear(&text);
    add_input(&text, item, requirement->inputs[k]);
    add_named(status, INPUT, item->inputs[requirement->inputs[k]].name, fm_text_get(&text));
  }
  for (uint32_t k = 0; k < requirement->n_constants; ++k) {
    const struct fm_constant * constant =
      &item->reporter->table->constants[requirement->constants[k]];
    add_named(status, CONSTANT, constant->name, constant->value);
  }
  fm_text_free(&text);
}

static void add_margin(struct fm_status * status, const struct described * item)
{
  const struct fm_margin * margin = &item->detail->beyond.margin;
  struct fm_text text = {NULL, 0, 0};
  if (!item->detail->beyond.is_known || !isfinite(margin->value)) {
    return;
  }
  fm_text_add_float(&text, margin->value, false);
  fm_status_text(status, OF_MARGIN[MARGIN], &text);
  fm_text_add_float(&text, margin->distance, false);
  fm_status_text(status, OF_MARGIN[DISTANCE], &text);
  fm_status_value(status, OF_MARGIN[COMPARISON], "%s", fm_comparison_of(
      item->reporter->table, item->scope.kind, margin->comparison));
  fm_text_add_seconds(&text, margin->instant);
  fm_status_text(status, OF_MARGIN[DECIDED_AT], &text);
  fm_text_free(&text);
}

void fm_add_detail(
  struct fm_statuses * list, const struct fm_reporter * reporter, const struct fm_detail * detail)
{
  const struct fm_report_table * table = reporter->table;
  const struct described item = describe(reporter, detail);
  struct fm_text name = {NULL, 0, 0};
  add_name(&name, &item);
  struct fm_status * status = fm_statuses_add(
    list, level_of(&item), fm_text_get(&name), item.requirement->text, table->component);
  add_of_all(status, &item);
  add_values(status, &item);
  add_about(status, &item);
  fm_add_trials(status, &detail->test);
  add_margin(status, &item);
  if (detail->violation.is_withheld && table->gate != NULL) {
    fm_status_value(status, WITHHELD_BY, "%s", table->gate->name);
  }
  if (detail->violation.is_end) {
    fm_status_value(status, INSTANCE, "%s", ENDED);
  }
  fm_text_free(&name);
}

// ---- details that were received ----------------------------------------------------------------

static bool is_of_times(const struct fm_status * detail)
{
  return strcmp(detail->values[PLACE].key, OF_TIMES) == 0;
}

// The end of a number with so many digits; NULL if it has fewer or more.
static const char * past_digits(const char * text, size_t fewest, size_t most)
{
  const size_t n = strspn(text, "0123456789");
  return n >= fewest && n <= most ? text + n : NULL;
}

static bool is_number(const char * text, size_t most, bool may_have_decimals)
{
  const char * end = past_digits(text, 1, most);
  if (may_have_decimals && end != NULL && *end == '.') {
    end = past_digits(end + 1, 1, 9);
  }
  return end != NULL && *end == '\0';
}

static bool read_stamp(const char * text, int64_t * stamp)
{
  const char * whole = *text == '-' ? text + 1 : text;
  const char * point = past_digits(whole, 1, 10);
  const char * end = point != NULL && *point == '.' ? past_digits(point + 1, 9, 9) : NULL;
  const int64_t seconds = end != NULL && *end == '\0' ? strtoll(whole, NULL, 10) : INT64_MAX;
  if (seconds >= INT64_MAX / FM_SECOND) {
    return false;
  }
  *stamp = seconds * FM_SECOND + strtoll(point + 1, NULL, 10);
  *stamp = *text == '-' ? -*stamp : *stamp;
  return true;
}

bool fm_read_detail(const struct fm_status * status, struct fm_received_detail * found)
{
  const struct fm_key_value * values = status->values;
  if (status->n_values < FM_OF_ALL_DETAILS) {
    return false;
  }
  for (uint32_t k = 0; k < FM_OF_ALL_DETAILS; ++k) {
    if (strcmp(values[k].key, OF_ALL[k]) != 0 && (k != PLACE || !is_of_times(status))) {
      return false;
    }
  }
  if (!is_number(values[PLACE].value, is_of_times(status) ? 12 : 20, is_of_times(status)) ||
    !read_stamp(values[STAMP].value, &found->stamp) ||
    !is_number(values[SUPPRESSED].value, 20, false))
  {
    return false;
  }
  found->suppressed = strtoull(values[SUPPRESSED].value, NULL, 10);
  found->is_recovery = status->level == FM_STATUS_OK;
  return true;
}

// The first of `n` values with a key behind those that all details begin with; NULL: none.
static const struct fm_key_value * find(
  const struct fm_status * detail, const char * key, uint32_t n)
{
  for (uint32_t k = FM_OF_ALL_DETAILS; k + n <= detail->n_values; ++k) {
    if (strcmp(detail->values[k].key, key) == 0) {
      return &detail->values[k];
    }
  }
  return NULL;
}

void fm_show_detail(struct fm_text * text, const struct fm_status * detail)
{
  const struct fm_key_value * values = detail->values;
  const struct fm_key_value * gate = find(detail, WITHHELD_BY, 1);
  const struct fm_key_value * step = find(detail, ABOUT_STEP, 1);
  const struct fm_key_value * time = find(detail, ABOUT_TIME, 1);
  const struct fm_key_value * end = find(detail, INSTANCE, 1);
  const struct fm_key_value * trials = find(detail, fm_trials_key, FM_TRIAL_VALUES);
  const struct fm_key_value * margin = find(detail, OF_MARGIN[MARGIN], N_OF_MARGIN);
  uint32_t n = detail->n_values;
  if (n < FM_OF_ALL_DETAILS) {
    return;
  }
  n -= (uint32_t)((gate != NULL) + (step != NULL) + (time != NULL) + (end != NULL));
  n -= trials != NULL ? FM_TRIAL_VALUES : 0u;
  n -= margin != NULL ? (uint32_t)N_OF_MARGIN : 0u;
  fm_text_add(text, " [%s%s%s", is_of_times(detail) ? "" : "step ", values[PLACE].value,
    is_of_times(detail) ? " s after its start" : "");
  if (step != NULL) {
    fm_text_add(text, ", about step %s", step->value);
  } else if (time != NULL) {
    fm_text_add(text, ", about %s s after its start", time->value);
  }
  if (end != NULL) {
    fm_text_add(text, ", %s %s", INSTANCE, end->value);
  }
  if (trials != NULL) {
    fm_text_add(text, ", %s of %s trials failed, probability %s (%s)", trials[1].value,
      trials[0].value, trials[2].value, trials[3].value);
  }
  if (margin != NULL) {
    fm_text_add(text, ", margin %s by %s (%s)", margin[MARGIN].value, margin[COMPARISON].value,
      margin[DISTANCE].value);
  }
  if (values[SILENT].value[0] != '\0') {
    fm_text_add(text, ", no message for %s", values[SILENT].value);
  }
  fm_text_add(text, ": ");
  for (uint32_t k = FM_OF_ALL_DETAILS; k < n; ++k) {
    fm_text_add(
      text, "%s%s = %s", k == FM_OF_ALL_DETAILS ? "" : ", ", name_of(values[k].key),
      values[k].value);
  }
  fm_text_add(text, "]");
  if (gate != NULL) {
    fm_text_add(text, ", withheld by gate '%s'", gate->value);
  }
}
