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

/// parameters.c: see parameters.h for the contract.

#include "parameters.h"

#include <errno.h>
#include <rcl/arguments.h>
#include <rcl/error_handling.h>
#include <rcl_yaml_param_parser/parser.h>
#include <rcutils/logging.h>
#include <stdlib.h>
#include <string.h>

#include "overrides.h"
#include "session.h"
#include "spelling.h"

#define CONSTANTS "constants."

// ---- values ------------------------------------------------------------------------------------

// Values for tables and comparisons; texts are not copied. To be copied, a value needs some text.
#define TEXT(text, n) .string_value = {(char *)(text), (n), (n) + 1u}
#define TRUTH(is_true) {.type = FM_TRUTH, .bool_value = (is_true), TEXT("", 0)}
#define WHOLE(number) {.type = FM_WHOLE, .integer_value = (number), TEXT("", 0)}
#define REAL(number) {.type = FM_REAL, .double_value = (number), TEXT("", 0)}
#define WORD(text) {.type = FM_WORD, TEXT(text, strlen(text))}
#define LIST {.type = FM_LIST, TEXT("", 0)}

// The value as csrc/reporting reads it; it lives as long as the name and the value.
static struct fm_given given_of(const char * name, const fm_parameter_value * value)
{
  return (struct fm_given) {
    name, value->type, value->bool_value, value->integer_value, value->double_value,
    value->string_value.data};
}

// The value of a constant as a parameter: a truth value, a whole number, or a number; the text of
// a whole number that does not fit.
static fm_parameter_value value_of_constant(const char * text)
{
  char * end;
  const bool is_true = strcmp(text, "true") == 0 || strcmp(text, "TRUE") == 0;
  if (is_true || strcmp(text, "false") == 0 || strcmp(text, "FALSE") == 0) {
    return (fm_parameter_value) TRUTH(is_true);
  }
  errno = 0;
  const long long number = strtoll(text, &end, 10);
  if (*end != '\0') {
    return (fm_parameter_value) REAL(strtod(text, NULL));
  }
  return errno == ERANGE ? (fm_parameter_value) WORD(text) : (fm_parameter_value) WHOLE(number);
}

// Whether a number is exactly a whole number, which can have more bits than a double.
static bool is_exactly(double real, int64_t whole)
{
  return real >= -0x1p63 && real < 0x1p63 && (int64_t)real == whole && (double)whole == real;
}

static bool are_equal(const fm_parameter_value * one, const fm_parameter_value * other)
{
  if (one->type == FM_REAL && other->type == FM_WHOLE) {
    return is_exactly(one->double_value, other->integer_value);
  }
  if (one->type == FM_WHOLE && other->type == FM_REAL) {
    return is_exactly(other->double_value, one->integer_value);
  }
  return rcl_interfaces__msg__ParameterValue__are_equal(one, other);
}

// Whether a value that is given is a constant's: also in quotes, and a whole number for a decimal
// one. rcl reads a whole number that does not fit as a double.
static bool is_compiled_value(
  const fm_parameter_value * given, const fm_parameter_value * compiled)
{
  if (given->type == FM_WORD && compiled->type != FM_WORD) {
    char * end = given->string_value.data;
    (void)strtod(given->string_value.data, &end);
    const fm_parameter_value found = value_of_constant(given->string_value.data);
    return (found.type == FM_TRUTH || (*end == '\0' && end > given->string_value.data)) &&
           is_compiled_value(&found, compiled);
  }
  if (given->type == FM_WHOLE && compiled->type == FM_REAL) {
    return (double)given->integer_value == compiled->double_value;
  }
  return given->type == FM_REAL && compiled->type == FM_WORD ?
         given->double_value == strtod(compiled->string_value.data, NULL) :
         are_equal(given, compiled);
}

// ---- what is given -----------------------------------------------------------------------------

static bool begins_with(const char * text, const char * prefix)
{
  return strncmp(text, prefix, strlen(prefix)) == 0;
}

// Whether parameters are for a node, by its full name: their name is its own, with or without the
// first slash, where * is any one part and ** any number of parts. As in rclpy.
static bool is_addressed(const char * pattern, const char * node)
{
  pattern += *pattern == '/';
  node += *node == '/';
  const size_t part = strcspn(pattern, "/");
  const size_t named = strcspn(node, "/");
  if (part == 2u && strncmp(pattern, "**", 2) == 0) {
    return is_addressed(pattern + part, node) ||
           (named > 0u && is_addressed(pattern, node + named));
  }
  const bool is_any = part == 1u && *pattern == '*' && named > 0u;
  const bool is_same = part == named && strncmp(pattern, node, part) == 0;
  return (is_any || is_same) && (part == 0u || is_addressed(pattern + part, node + named));
}

static fm_parameter_value value_of_variant(const rcl_variant_t * variant)
{
  if (variant->bool_value != NULL) {
    return (fm_parameter_value) TRUTH(*variant->bool_value);
  }
  if (variant->integer_value != NULL) {
    return (fm_parameter_value) WHOLE(*variant->integer_value);
  }
  if (variant->double_value != NULL) {
    return (fm_parameter_value) REAL(*variant->double_value);
  }
  if (variant->string_value != NULL) {
    return (fm_parameter_value) WORD(variant->string_value);
  }
  return (fm_parameter_value) LIST;
}

static struct fm_parameter * find(struct fm_parameter * items, size_t n, const char * name)
{
  for (size_t k = 0; k < n; ++k) {
    if (strcmp(items[k].name, name) == 0) {
      return &items[k];
    }
  }
  return NULL;
}

static void free_parameter(struct fm_parameter * parameter)
{
  free(parameter->name);
  free(parameter->description);
  rcl_interfaces__msg__ParameterValue__fini(&parameter->value);
}

// Add a parameter, or replace its value. If memory is short, `memory` says so.
static void put(
  struct fm_memory * memory, struct fm_parameter ** items, size_t * n, const char * name,
  const char * description, enum fm_settable settable, const fm_parameter_value * value)
{
  struct fm_parameter * item = find(*items, *n, name);
  if (item != NULL) {
    memory->is_short |= !rcl_interfaces__msg__ParameterValue__copy(value, &item->value);
    return;
  }
  struct fm_parameter new_item = {
    .name = fm_copy_of(name), .description = fm_copy_of(description), .settable = settable};
  item = realloc(*items, (*n + 1u) * sizeof(**items));
  *items = item != NULL ? item : *items;
  if (item != NULL && new_item.name != NULL && new_item.description != NULL &&
    rcl_interfaces__msg__ParameterValue__copy(value, &new_item.value))
  {
    item[(*n)++] = new_item;
  } else {
    memory->is_short = true;
    free_parameter(&new_item);
  }
}

static void put_declared(
  struct fm_parameters * parameters, const char * name, const char * description,
  enum fm_settable settable, const fm_parameter_value * value)
{
  parameters->memory.is_short |= name[0] == '\0';
  put(&parameters->memory, &parameters->declared, &parameters->n_declared, name, description,
    settable, value);
}

static void read_given(struct fm_parameters * parameters)
{
  const char * own = rcl_node_get_fully_qualified_name(&parameters->node->node);
  rcl_params_t * found = NULL;
  fm_ignore(rcl_arguments_get_param_overrides(
      &parameters->node->context.global_arguments, &found));
  for (size_t node = 0; found != NULL && node < found->num_nodes; ++node) {
    const rcl_node_params_t * of_node = &found->params[node];
    const size_t n = is_addressed(found->node_names[node], own) ? of_node->num_params : 0u;
    for (size_t k = 0; k < n; ++k) {
      const fm_parameter_value value = value_of_variant(&of_node->parameter_values[k]);
      put(&parameters->memory, &parameters->given, &parameters->n_given,
        of_node->parameter_names[k], "", FM_AT_START, &value);
    }
  }
  if (found != NULL) {
    rcl_yaml_node_struct_fini(found);
  }
}

// ---- checks ------------------------------------------------------------------------------------

// `words` ends with NULL.
static bool is_among(const char * text, const char * const * words)
{
  while (*words != NULL && strcmp(text, *words) != 0) {
    ++words;
  }
  return *words != NULL;
}

struct described
{
  const char * name;
  enum fm_parameter_kind kind;
  enum fm_settable settable;
  fm_parameter_value usual;
  int64_t least;
  int64_t most;
  const char * wanted;
  const char * description;
};

#define USUAL_FLAG(is_true) TRUTH(is_true)
#define USUAL_COUNT(number) WHOLE(number)
#define USUAL_SECONDS(number) REAL(number)
#define USUAL_TEXT(text) {.type = FM_WORD, TEXT(text, sizeof(text) - 1u)}
#define USUAL_NUMBERS(text) USUAL_TEXT(text)
#define USUAL_CHOICE(text) USUAL_TEXT(text)
#define USUAL_SWITCH(text) USUAL_TEXT(text)
#define FM_PARAMETER(name, kind, settable, usual, least, most, wanted, description) \
  {name, FM_KIND_##kind, FM_##settable, USUAL_##kind(usual), least, most, wanted, description},

static const struct described described[] = {
  FM_PARAMETERS
  FM_PARAMETER("use_sim_time", FLAG, ALWAYS, false, 0, 0, "true or false", "")  // as rclpy's
  FM_PARAMETER("start_type_description_service", FLAG, AT_START, true, 0, 0, "true or false",
    "If enabled, start the ~/get_type_description service.")};
enum { N_DESCRIBED = sizeof(described) / sizeof(described[0]), N_OF_RCL = 2 };  // the last ones

static const struct described * description_of(const char * name)
{
  for (size_t k = 0; k < N_DESCRIBED; ++k) {
    if (strcmp(described[k].name, name) == 0) {
      return &described[k];
    }
  }
  return NULL;
}

// Whether a text is empty, or a word of "one of A, B".
static bool is_choice(const char * text, const char * wanted)
{
  const size_t length = strlen(text);
  for (const char * word = wanted + strlen(FM_ONE_OF); *word != '\0'; word += strspn(word, ", ")) {
    const size_t n = strcspn(word, ",");
    if (n == length && strncmp(word, text, n) == 0) {
      return true;
    }
    word += n;
  }
  return length == 0;
}

static bool is_good(const struct described * item, const fm_parameter_value * value)
{
  const bool is_word = value->type == FM_WORD;
  const double real =
    value->type == FM_WHOLE ? (double)value->integer_value : value->double_value;
  switch (item->kind) {
    case FM_KIND_FLAG:
      return value->type == FM_TRUTH;
    case FM_KIND_COUNT:
      return value->type == FM_WHOLE && value->integer_value >= item->least &&
             value->integer_value <= item->most;
    case FM_KIND_SECONDS:
      return (value->type == FM_WHOLE || value->type == FM_REAL) &&
             real > (double)item->least && real <= (double)item->most;
    case FM_KIND_CHOICE:
    case FM_KIND_SWITCH:
      return is_word ? is_choice(value->string_value.data, item->wanted) :
             item->kind == FM_KIND_SWITCH && value->type == FM_TRUTH;
    case FM_KIND_TEXT:
      return is_word;
    case FM_KIND_NUMBERS:
      return is_word || value->type == FM_WHOLE;
  }
  return false;
}

// Whether a value is one of a parameter, possibly under another name; adds a line if not.
static bool check(
  const struct described * item, const char * name, const fm_parameter_value * value,
  struct fm_text * reason)
{
  const bool found = is_good(item, value);
  if (!found) {
    const struct fm_given given = given_of(name, value);
    fm_text_refuse(reason, &given, item->wanted);
  }
  return found;
}

bool fm_parameter_refuse(
  const struct fm_parameters * parameters, const char * name,
  const fm_parameter_value * value, struct fm_text * reason)
{
  const struct fm_parameter * found = fm_parameter_find(parameters, name);
  if (found == NULL) {
    fm_text_add(reason, FM_WORDS_NO_PARAMETER, name);
  } else if (begins_with(name, CONSTANTS)) {
    fm_text_add(reason, "%s: compiled into this node", name);
  } else if (found->settable == FM_AT_START) {
    fm_text_add(reason, FM_WORDS_READ_AT_START, name);
  } else if (found->settable == FM_UNCONFIGURED && parameters->is_configured) {
    fm_text_add(reason, FM_WORDS_READ_ONCE, name);
  } else {
    return !check(description_of(name), name, value, reason);
  }
  return true;
}

// ---- quality of service ------------------------------------------------------------------------

// The name, as written, of a bundle's `k`-th topic; after those of the table comes that of a gate
// which no input reads. NULL: the node does not subscribe to it, or it is many topics.
static const char * subscribed_topic(const struct fm_node_table * table, uint32_t k)
{
  const struct fm_report_table * report = &table->report;
  if (k < report->n_topics) {
    return report->topics[k].kind == FM_TOPIC && report->topics[k].variable[0] == '\0' ?
           report->topics[k].name : NULL;
  }
  return table->gate != NULL && !report->gate->is_service && report->gate->topic == k ?
         table->gate->name : NULL;
}

static void show_policies(
  struct fm_parameters * parameters, const struct fm_fixed_qos * fixed, const char * topic)
{
  struct fm_text name = {NULL, 0, 0};
  struct fm_text description = {NULL, 0, 0};
  for (uint32_t k = 0; k < FM_POLICIES; ++k) {
    const struct fm_shown_policy shown = fm_show_policy(fixed, k);
    const fm_parameter_value depth = WHOLE(shown.depth);
    const fm_parameter_value word = WORD(shown.word);
    fm_text_clear(&name);
    fm_text_clear(&description);
    fm_text_add(&name, FM_WORDS_OVERRIDES FM_WORDS_OVERRIDE, topic, shown.name);
    fm_text_add(&description, FM_WORDS_POLICY, shown.name, topic, shown.note);
    put_declared(parameters, fm_text_get(&name), fm_text_get(&description), FM_AT_START,
      shown.word[0] == '\0' ? &depth : &word);
  }
  fm_text_free(&name);
  fm_text_free(&description);
}

// Add a full name to a list. Returns NULL if there is none: refused when the node is configured.
static const char * add_resolved(
  struct fm_parameters * parameters, const char * name, const char ** names, uint32_t * n)
{
  const char * full = name == NULL ? NULL :
    fm_resolve(parameters->node, &parameters->memory, name, false);
  if (full != NULL) {
    names[(*n)++] = full;
  } else {
    rcl_reset_error();
  }
  return full;
}

// Returns the policies of each topic of a bundle; NULL if memory is short.
static struct fm_fixed_qos * apply_overrides(
  struct fm_parameters * parameters, const struct fm_node_table * table)
{
  const uint32_t n = table->report.n_topics;
  struct fm_fixed_qos * fixed = fm_reserve(&parameters->memory, n + 1u, sizeof(*fixed));
  for (uint32_t k = 0; fixed != NULL && k <= n; ++k) {
    const char * topic = add_resolved(parameters, subscribed_topic(table, k),
      parameters->subscribed, &parameters->n_subscribed);
    if (k < n) {
      fixed[k] = table->topics[k].qos;
    }
    if (topic != NULL) {
      fm_apply_overrides(&fixed[k], parameters->facts, (uint32_t)parameters->n_given, topic);
      show_policies(parameters, &fixed[k], topic);
    }
  }
  return fixed;
}

// Add what is wrong with overrides. Returns whether nothing is. `names`: room for all topics that
// are announced.
static bool check_overrides(
  struct fm_parameters * parameters, const char ** names, struct fm_text * problems)
{
  struct fm_lines lines = {NULL, 0, 0};
  uint32_t n = 0;
  for (uint32_t t = 0; t < parameters->tables->n; ++t) {
    const struct fm_report_table * table = &parameters->tables->tables[t]->report;
    for (uint32_t k = 0; k < table->n_used; ++k) {
      (void)add_resolved(parameters,
        table->topics[k].kind == FM_ANNOUNCED ? table->topics[k].name : NULL, names, &n);
    }
  }
  const bool is_good = fm_check_overrides(
    &lines, parameters->facts, (uint32_t)parameters->n_given, names, n);
  for (uint32_t k = 0; k < lines.n; ++k) {
    fm_text_join(problems, "\n", "%s", lines.lines[k].text);
  }
  fm_lines_free(&lines);
  return is_good;
}

static bool read_overrides(struct fm_parameters * parameters, struct fm_text * problems)
{
  const struct fm_node_tables * all = parameters->tables;
  struct fm_memory * memory = &parameters->memory;
  size_t most = 0;
  for (uint32_t t = 0; t < all->n; ++t) {
    most += all->tables[t]->report.n_used + 1u;
  }
  struct fm_given * facts = fm_reserve(memory, parameters->n_given, sizeof(*facts));
  const char ** names = fm_reserve(memory, most, sizeof(*names));
  parameters->subscribed = fm_reserve(memory, most, sizeof(*names));
  parameters->fixed = fm_reserve(memory, all->n, sizeof(*parameters->fixed));
  if (memory->is_short) {
    return false;
  }
  for (size_t k = 0; k < parameters->n_given; ++k) {
    facts[k] = given_of(parameters->given[k].name, &parameters->given[k].value);
  }
  parameters->facts = facts;
  for (uint32_t t = 0; t < all->n; ++t) {
    parameters->fixed[t] = apply_overrides(parameters, all->tables[t]);
  }
  return check_overrides(parameters, names, problems);
}

// ---- declarations ------------------------------------------------------------------------------

// Returns whether what is given can be used, as all that follow; adds a line if not.
static bool declare(
  struct fm_parameters * parameters, const struct described * item, struct fm_text * problems)
{
  const struct fm_parameter * given =
    find(parameters->given, parameters->n_given, item->name);
  const bool is_good =
    given == NULL || check(item, item->name, &given->value, problems);
  put_declared(parameters, item->name, item->description, item->settable,
    given != NULL && is_good ? &given->value : &item->usual);
  return is_good;
}

// The `k`-th constant of all bundles; NULL: there are fewer.
static const struct fm_constant * constant_at(const struct fm_parameters * parameters, uint32_t k)
{
  for (uint32_t t = 0; t < parameters->tables->n; ++t) {
    const struct fm_report_table * table = &parameters->tables->tables[t]->report;
    if (k < table->n_constants) {
      return &table->constants[k];
    }
    k -= table->n_constants;
  }
  return NULL;
}

// Whether another bundle has another value of the constant.
static bool has_other_value(
  const struct fm_parameters * parameters, const struct fm_constant * constant)
{
  const fm_parameter_value value = value_of_constant(constant->value);
  const struct fm_constant * other;
  bool is_other = false;
  for (uint32_t k = 0; (other = constant_at(parameters, k)) != NULL; ++k) {
    const fm_parameter_value its = value_of_constant(other->value);
    is_other = is_other ||
      (strcmp(other->name, constant->name) == 0 && !are_equal(&its, &value));
  }
  return is_other;
}

// What is given for a constant, whose name may be as FRET writes it; NULL if nothing is.
static const struct fm_parameter * given_constant(
  const struct fm_parameters * parameters, const struct fm_constant * constant)
{
  for (size_t k = 0; k < parameters->n_given; ++k) {
    const char * name = parameters->given[k].name;
    if (begins_with(name, CONSTANTS) &&
      fm_is_same_name(name + strlen(CONSTANTS), constant->name))
    {
      return &parameters->given[k];
    }
  }
  return NULL;
}

static bool declare_constant(
  struct fm_parameters * parameters, const struct fm_constant * constant,
  struct fm_text * problems)
{
  const fm_parameter_value value = value_of_constant(constant->value);
  struct fm_text name = {NULL, 0, 0};
  fm_text_add(&name, CONSTANTS "%s", constant->name);
  const struct fm_parameter * given = given_constant(parameters, constant);
  const bool is_good = given == NULL || is_compiled_value(&given->value, &value);
  if (!is_good) {
    fm_text_join(
      problems, "\n", "parameter '%s': the constant is compiled into this node, as %s: export the "
      "bundle with another value", fm_text_get(&name), constant->value);
  }
  if (!has_other_value(parameters, constant)) {  // a parameter shows one value
    put_declared(parameters, fm_text_get(&name),
      "a constant of the bundle; compiled into this node", FM_AT_START,
      given != NULL && is_good && value.type != FM_WORD ? &given->value : &value);
  }
  fm_text_free(&name);
  return is_good;
}

static bool is_constant(const struct fm_parameters * parameters, const char * name)
{
  const struct fm_constant * constant;
  bool is_one = false;
  for (uint32_t k = 0; (constant = constant_at(parameters, k)) != NULL; ++k) {
    is_one = is_one || fm_is_same_name(constant->name, name);
  }
  return is_one;
}

static void refuse_constant(
  const char * parameter, const char * const * names, uint32_t n, struct fm_text * problems)
{
  struct fm_text hint = {NULL, 0, 0};
  struct fm_text all = {NULL, 0, 0};
  for (uint32_t k = 0; k < n; ++k) {
    fm_text_join(&all, ", ", "%s", names[k]);
  }
  if (n == 0) {
    fm_text_add(&hint, FM_WORDS_NO_CONSTANTS);
  } else if (!fm_text_add_hint(&hint, parameter + strlen(CONSTANTS), names, n)) {
    fm_text_add(&hint, FM_WORDS_ALL_CONSTANTS, fm_text_get(&all));
  }
  fm_text_join(problems, "\n", FM_WORDS_NO_CONSTANT, parameter, fm_text_get(&hint));
  fm_text_free(&hint);
  fm_text_free(&all);
}

static bool refuse_unknown_constants(struct fm_parameters * parameters, struct fm_text * problems)
{
  const struct fm_constant * constant;
  bool is_good = true;
  uint32_t n = 0;
  while (constant_at(parameters, n) != NULL) {
    ++n;
  }
  const char ** names = fm_reserve(&parameters->memory, n + 1u, sizeof(*names));
  n = 0;
  for (uint32_t k = 0; names != NULL && (constant = constant_at(parameters, k)) != NULL; ++k) {
    if (!is_among(constant->name, names)) {
      names[n++] = constant->name;
    }
  }
  for (size_t k = 0; names != NULL && k < parameters->n_given; ++k) {
    const char * name = parameters->given[k].name;
    if (begins_with(name, CONSTANTS) && !is_constant(parameters, name + strlen(CONSTANTS))) {
      refuse_constant(name, names, n, problems);
      is_good = false;
    }
  }
  return is_good;
}

static void set_level(const struct fm_parameters * parameters)
{
  const char * text = fm_parameter_find(parameters, "log_level")->value.string_value.data;
  int level = RCUTILS_LOG_SEVERITY_UNSET;
  if (text[0] != '\0') {
    fm_ignore(rcutils_logging_severity_level_from_string(
        text, rcutils_get_default_allocator(), &level));
  }
  fm_log_set_level(parameters->node, level);
}

static bool refuse_metrics(const struct fm_parameters * parameters, struct fm_text * problems)
{
  const struct fm_parameter * given = find(parameters->given, parameters->n_given, "metrics");
  const bool is_good = given == NULL ||
    (given->value.type == FM_WORD && given->value.string_value.size == 0);
  if (!is_good) {
    fm_text_join(
      problems, "\n", "parameter 'metrics': this node is in C, and serves no figures for "
      "Prometheus; they are on /diagnostics, and `monitor` without native serves them");
  }
  return is_good;
}

bool fm_parameters_begin(
  struct fm_parameters * parameters, struct fm_node * node, const struct fm_node_tables * tables,
  struct fm_text * problems)
{
  parameters->node = node;
  parameters->tables = tables;
  read_given(parameters);
  bool is_good = true;
  for (size_t k = 0; k < N_DESCRIBED; ++k) {
    is_good &= declare(parameters, &described[k], problems);
  }
  const struct fm_constant * constant;
  for (uint32_t k = 0; (constant = constant_at(parameters, k)) != NULL; ++k) {
    is_good &= declare_constant(parameters, constant, problems);
  }
  is_good &= refuse_unknown_constants(parameters, problems);
  is_good &= refuse_metrics(parameters, problems);
  is_good &= read_overrides(parameters, problems);
  if (!parameters->memory.is_short) {
    set_level(parameters);
  }
  return is_good && !parameters->memory.is_short;
}

// The parameters of `monitor` and `gate` that decide which node in C it becomes.
static const char * const compiled[] = {
  "gates", "spec", "library", "policy", "period", "rate", "metrics", "native", NULL};
enum { N_COMPILED = sizeof(compiled) / sizeof(compiled[0]) - 1 };

// Whether this node stands for `monitor` or `gate`.
static bool is_stand_in(const struct fm_parameters * parameters)
{
  return parameters->tables->tables[0]->origin[0] != '\0';
}

// The names that are offered, in the order of the node in Python; returns how many.
static uint32_t list_names(const struct fm_parameters * parameters, const char ** names)
{
  static const char * const of_gates[] = {"gates", NULL};
  static const char * const of_monitors[] = {"period", "rate", NULL};
  const bool is_gate = parameters->tables->tables[0]->gate != NULL;
  uint32_t n = 0;
  for (uint32_t k = 0; is_stand_in(parameters) && k < N_COMPILED; ++k) {
    if (!is_among(compiled[k], is_gate ? of_monitors : of_gates)) {
      names[n++] = compiled[k];
    }
  }
  for (uint32_t k = 0; k < N_DESCRIBED - N_OF_RCL; ++k) {
    names[n++] = described[k].name;
  }
  return n;
}

static void warn_of_unknown(const struct fm_parameters * parameters, const char * name)
{
  const char * names[N_COMPILED + N_DESCRIBED];
  const uint32_t n = list_names(parameters, names);
  struct fm_text all = {NULL, 0, 0};
  struct fm_text hint = {NULL, 0, 0};
  for (uint32_t k = 0; k < n; ++k) {
    fm_text_join(&all, ", ", "%s", names[k]);
  }
  if (!fm_text_add_hint(&hint, name, names, n)) {
    fm_text_add(&hint, FM_WORDS_ALL_PARAMETERS, fm_text_get(&all));
  }
  fm_log(parameters->node, FM_WARN, FM_WORDS_IGNORED, name, fm_text_get(&hint));
  fm_text_free(&all);
  fm_text_free(&hint);
}

void fm_parameters_warn(const struct fm_parameters * parameters)
{
  for (size_t k = 0; k < parameters->n_given; ++k) {
    const char * name = parameters->given[k].name;
    const char * dot = strrchr(name, '.');
    const char * last = dot == NULL ? name : dot + 1;
    if (fm_parameter_find(parameters, name) != NULL || begins_with(name, CONSTANTS) ||
      begins_with(name, FM_WORDS_OVERRIDES))
    {
      continue;
    }
    if (is_among(name, compiled)) {
      // Those of a node that stands for `monitor` have chosen this program; `metrics` is refused.
      if (!is_stand_in(parameters) && strcmp(name, "metrics") != 0) {
        fm_log(parameters->node, FM_WARN, FM_WORDS_IGNORED, name,
          "the bundle is compiled into this node");
      }
    } else if (is_constant(parameters, last)) {
      struct fm_text hint = {NULL, 0, 0};
      fm_text_add(&hint, "did you mean '" CONSTANTS "%s'?", last);
      fm_log(parameters->node, FM_WARN, FM_WORDS_IGNORED, name, fm_text_get(&hint));
      fm_text_free(&hint);
    } else {
      warn_of_unknown(parameters, name);
    }
  }
}

void fm_parameters_warn_of_overrides(const struct fm_parameters * parameters)
{
  struct fm_lines lines = {NULL, 0, 0};
  fm_add_unused_overrides(&lines, parameters->facts, (uint32_t)parameters->n_given,
    parameters->subscribed, parameters->n_subscribed);
  fm_log_lines(parameters->node, &lines);
}

void fm_parameters_end(struct fm_parameters * parameters)
{
  for (size_t k = 0; k < parameters->n_declared; ++k) {
    free_parameter(&parameters->declared[k]);
  }
  for (size_t k = 0; k < parameters->n_given; ++k) {
    free_parameter(&parameters->given[k]);
  }
  free(parameters->declared);
  free(parameters->given);
  fm_memory_free(&parameters->memory);
  memset(parameters, 0, sizeof(*parameters));
}

// ---- use ---------------------------------------------------------------------------------------

struct fm_parameter * fm_parameter_find(const struct fm_parameters * parameters, const char * name)
{
  return find(parameters->declared, parameters->n_declared, name);
}

bool fm_parameter_is_of_rcl(const struct fm_parameter * parameter)
{
  const struct described * item = description_of(parameter->name);
  return item != NULL && item >= described + N_DESCRIBED - N_OF_RCL;
}

bool fm_parameter_is_true(const struct fm_parameters * parameters, const char * name)
{
  return fm_parameter_find(parameters, name)->value.bool_value;
}

int64_t fm_parameter_whole(const struct fm_parameters * parameters, const char * name)
{
  return fm_parameter_find(parameters, name)->value.integer_value;
}

double fm_parameter_real(const struct fm_parameters * parameters, const char * name)
{
  const fm_parameter_value * value = &fm_parameter_find(parameters, name)->value;
  return value->type == FM_WHOLE ? (double)value->integer_value : value->double_value;
}

const char * fm_parameter_hot_path(const struct fm_parameters * parameters)
{
  const fm_parameter_value * value = &fm_parameter_find(parameters, "hot_path")->value;
  return value->type != FM_TRUTH ? value->string_value.data : value->bool_value ? "on" : "off";
}

void fm_parameter_set(
  struct fm_parameters * parameters, const char * name, fm_parameter_value * value)
{
  struct fm_parameter * parameter = fm_parameter_find(parameters, name);
  const fm_parameter_value before = parameter->value;
  parameter->value = *value;
  *value = before;
  if (strcmp(name, "log_level") == 0) {
    set_level(parameters);
  }
}
