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
#include <inttypes.h>
#include <rcl/arguments.h>
#include <rcl/error_handling.h>
#include <rcl_yaml_param_parser/parser.h>
#include <rcutils/logging.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "mapped_topic.h"

#define OVERRIDES "qos_overrides."
#define CONSTANTS "constants."
#define SUBSCRIPTION ".subscription."

// ---- values ------------------------------------------------------------------------------------

static struct fm_parameter_value copy_value(const struct fm_parameter_value * value)
{
  struct fm_parameter_value copy = *value;
  copy.text = value->text == NULL ? NULL : fm_copy_of(value->text);
  return copy;
}

static struct fm_parameter_value truth(bool is_true)
{
  return (struct fm_parameter_value) {FM_PARAMETER_BOOL, is_true, 0, 0.0, NULL};
}

static struct fm_parameter_value whole(int64_t number)
{
  return (struct fm_parameter_value) {FM_PARAMETER_INTEGER, false, number, 0.0, NULL};
}

// The text is not copied.
static struct fm_parameter_value word(const char * text)
{
  return (struct fm_parameter_value) {FM_PARAMETER_STRING, false, 0, 0.0, (char *)text};
}

static void add_value(struct fm_text * text, const struct fm_parameter_value * value)
{
  switch (value->type) {
    case FM_PARAMETER_UNSET: fm_text_add(text, "not set"); break;
    case FM_PARAMETER_BOOL: fm_text_add(text, "%s", value->is_true ? "true" : "false"); break;
    case FM_PARAMETER_INTEGER: fm_text_add(text, "%" PRId64, value->whole); break;
    case FM_PARAMETER_DOUBLE: fm_text_add_float64(text, value->real); break;
    case FM_PARAMETER_STRING: fm_text_add(text, "'%s'", value->text); break;
    case FM_PARAMETER_LIST: fm_text_add(text, "a list"); break;
  }
}

// The value of a constant as a parameter: a truth value, a whole number, or a number; the text of
// a whole number that does not fit. The text is not copied.
static struct fm_parameter_value value_of_constant(const char * text)
{
  char * end;
  if (strcmp(text, "true") == 0 || strcmp(text, "TRUE") == 0) {
    return truth(true);
  }
  if (strcmp(text, "false") == 0 || strcmp(text, "FALSE") == 0) {
    return truth(false);
  }
  errno = 0;
  const long long number = strtoll(text, &end, 10);
  if (*end == '\0') {
    return errno == ERANGE ? word(text) : whole(number);
  }
  return (struct fm_parameter_value) {FM_PARAMETER_DOUBLE, false, 0, strtod(text, NULL), NULL};
}

// Whether a number is exactly a whole number, which can have more bits than a double.
static bool is_exactly(double real, int64_t whole)
{
  return real >= -0x1p63 && real < 0x1p63 && (int64_t)real == whole && (double)whole == real;
}

static bool are_equal(
  const struct fm_parameter_value * one, const struct fm_parameter_value * other)
{
  if (one->type == FM_PARAMETER_DOUBLE && other->type == FM_PARAMETER_INTEGER) {
    return is_exactly(one->real, other->whole);
  }
  if (one->type == FM_PARAMETER_INTEGER && other->type == FM_PARAMETER_DOUBLE) {
    return is_exactly(other->real, one->whole);
  }
  if (one->type != other->type) {
    return false;
  }
  switch (one->type) {
    case FM_PARAMETER_BOOL: return one->is_true == other->is_true;
    case FM_PARAMETER_INTEGER: return one->whole == other->whole;
    case FM_PARAMETER_DOUBLE: return one->real == other->real;
    case FM_PARAMETER_STRING: return strcmp(one->text, other->text) == 0;
    case FM_PARAMETER_UNSET:
    case FM_PARAMETER_LIST: break;
  }
  return false;
}

// ---- what is given -----------------------------------------------------------------------------

static bool begins_with(const char * text, const char * prefix)
{
  return strncmp(text, prefix, strlen(prefix)) == 0;
}

// Whether a node's full name fits a name with wildcards: * is one part, ** any number of parts.
static bool fits(const char * pattern, const char * name)
{
  if (*pattern == '\0' || *name == '\0') {
    return *name == '\0' && (*pattern == '\0' || strcmp(pattern, "/**") == 0);
  }
  const size_t part = 1u + strcspn(pattern + 1, "/");
  const size_t named = 1u + strcspn(name + 1, "/");
  if (part == 3u && strncmp(pattern, "/**", 3) == 0) {
    return fits(pattern + part, name) || fits(pattern, name + named);
  }
  const bool is_same = part == named && strncmp(pattern, name, part) == 0;
  const bool is_any = part == 2u && pattern[1] == '*';
  return (is_same || is_any) && fits(pattern + part, name + named);
}

// Whether parameters are for a node: their name is its own, possibly with wildcards, with or
// without the slash that it begins with.
static bool is_addressed(const char * pattern, const char * node)
{
  struct fm_text full = {NULL, 0, 0};
  fm_text_add(&full, "%s%s", *pattern == '/' ? "" : "/", pattern);
  const bool found = fits(fm_text_get(&full), node);
  fm_text_free(&full);
  return found;
}

static struct fm_parameter_value value_of_variant(const rcl_variant_t * variant)
{
  if (variant->bool_value != NULL) {
    return truth(*variant->bool_value);
  }
  if (variant->integer_value != NULL) {
    return whole(*variant->integer_value);
  }
  if (variant->double_value != NULL) {
    return (struct fm_parameter_value) {
      FM_PARAMETER_DOUBLE, false, 0, *variant->double_value, NULL};
  }
  if (variant->string_value != NULL) {
    return word(variant->string_value);
  }
  return (struct fm_parameter_value) {FM_PARAMETER_LIST, false, 0, 0.0, NULL};
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
  free(parameter->value.text);
}

// Add a parameter, or replace its value. What does not fit in memory is left out.
static void put(
  struct fm_parameter ** items, size_t * n, const char * name, const char * description,
  enum fm_settable settable, const struct fm_parameter_value * value)
{
  struct fm_parameter * item = find(*items, *n, name);
  if (item != NULL) {
    free(item->value.text);
    item->value = copy_value(value);
    return;
  }
  item = realloc(*items, (*n + 1u) * sizeof(**items));
  if (item == NULL) {
    return;
  }
  *items = item;
  const struct fm_parameter new_item = {
    fm_copy_of(name), fm_copy_of(description), settable, copy_value(value)};
  if (new_item.name != NULL && new_item.description != NULL) {
    (*items)[(*n)++] = new_item;
  }
}

static void read_given(struct fm_parameters * parameters)
{
  const char * own = rcl_node_get_fully_qualified_name(&parameters->node->node);
  rcl_params_t * found = NULL;
  if (rcl_arguments_get_param_overrides(
      &parameters->node->context.global_arguments, &found) != RCL_RET_OK)
  {
    rcl_reset_error();
  }
  for (size_t node = 0; found != NULL && node < found->num_nodes; ++node) {
    const rcl_node_params_t * of_node = &found->params[node];
    const size_t n = is_addressed(found->node_names[node], own) ? of_node->num_params : 0u;
    for (size_t k = 0; k < n; ++k) {
      const struct fm_parameter_value value = value_of_variant(&of_node->parameter_values[k]);
      put(&parameters->given, &parameters->n_given, of_node->parameter_names[k], "", FM_AT_START,
        &value);
    }
  }
  if (found != NULL) {
    rcl_yaml_node_struct_fini(found);
  }
}

// ---- checks ------------------------------------------------------------------------------------

static const char * const levels[] = {"debug", "info", "warn", "error", "fatal"};

static bool is_among(const char * text, const char * const * words, size_t n)
{
  for (size_t k = 0; k < n; ++k) {
    if (strcmp(text, words[k]) == 0) {
      return true;
    }
  }
  return false;
}

static void refuse_value(
  const char * name, const struct fm_parameter_value * value, const char * wanted,
  struct fm_text * reason)
{
  fm_text_add(reason, "%sparameter '%s' is ", reason->length > 0 ? "\n" : "", name);
  add_value(reason, value);
  fm_text_add(reason, ", and has to be %s", wanted);
}

static void check_count(
  const char * name, const struct fm_parameter_value * value, struct fm_text * reason)
{
  if (value->type != FM_PARAMETER_INTEGER || value->whole < 1 || value->whole > INT32_MAX) {
    refuse_value(name, value, "a number of messages, at least 1", reason);
  }
}

static void check_level(
  const char * name, const struct fm_parameter_value * value, struct fm_text * reason)
{
  if (value->type != FM_PARAMETER_STRING ||
    (value->text[0] != '\0' &&
    !is_among(value->text, levels, sizeof(levels) / sizeof(levels[0]))))
  {
    refuse_value(name, value, "one of debug, info, warn, error, fatal", reason);
  }
}

static void check_truth(
  const char * name, const struct fm_parameter_value * value, struct fm_text * reason)
{
  if (value->type != FM_PARAMETER_BOOL) {
    refuse_value(name, value, "true or false", reason);
  }
}

static void check(
  const char * name, const struct fm_parameter_value * value, struct fm_text * reason)
{
  if (strcmp(name, "handler_depth") == 0) {
    check_count(name, value, reason);
  } else if (strcmp(name, "log_level") == 0) {
    check_level(name, value, reason);
  } else {
    check_truth(name, value, reason);
  }
}

void fm_parameter_refuse(
  const struct fm_parameters * parameters, const char * name,
  const struct fm_parameter_value * value, struct fm_text * reason)
{
  const struct fm_parameter * found = fm_parameter_find(parameters, name);
  if (found == NULL) {
    fm_text_add(reason, "there is no parameter '%s'", name);
  } else if (begins_with(name, CONSTANTS)) {
    fm_text_add(reason, "%s: compiled into this node", name);
  } else if (found->settable == FM_AT_START) {
    fm_text_add(reason, "%s: read at the start of the process only", name);
  } else if (found->settable == FM_UNCONFIGURED && parameters->is_configured) {
    fm_text_add(reason,
      "%s: read when the node is configured, since a step has to mean the same from the first to "
      "the last; deactivate and clean up first", name);
  } else {
    check(name, value, reason);
  }
}

// ---- quality of service ------------------------------------------------------------------------

static const char * choice_word(
  enum fm_choice choice, const char * follow, const char * weaker, const char * stronger)
{
  return choice == FM_STRONGER ? stronger : choice == FM_WEAKER ? weaker : follow;
}

// Read a word of a policy. Returns false if it is none of these.
static bool read_choice(
  const char * text, const char * weaker, const char * stronger, bool may_follow,
  enum fm_choice * choice)
{
  if (strcasecmp(text, weaker) == 0) {
    *choice = FM_WEAKER;
  } else if (strcasecmp(text, stronger) == 0) {
    *choice = FM_STRONGER;
  } else if (may_follow && strcasecmp(text, "best_available") == 0) {
    *choice = FM_FOLLOW;
  } else {
    return false;
  }
  return true;
}

static void refuse_name(const char * name, const char * why, struct fm_text * problems)
{
  fm_text_add(
    problems, "%sparameter '%s' %s", problems->length > 0 ? "\n" : "", name, why);
}

// Apply an override of a policy.
static void apply(
  const struct fm_parameter * given, const char * policy, struct fm_fixed_qos * fixed,
  struct fm_text * problems)
{
  const struct fm_parameter_value * value = &given->value;
  const char * text = value->type == FM_PARAMETER_STRING ? value->text : "";
  if (strcmp(policy, "depth") == 0) {
    const size_t before = problems->length;
    check_count(given->name, value, problems);
    if (problems->length == before) {
      fixed->depth = (uint32_t)value->whole;
    }
  } else if (strcmp(policy, "reliability") == 0) {
    if (!read_choice(text, "best_effort", "reliable", true, &fixed->reliability)) {
      refuse_value(given->name, value, "one of reliable, best_effort, best_available", problems);
    }
  } else if (strcmp(policy, "durability") == 0) {
    if (!read_choice(text, "volatile", "transient_local", true, &fixed->durability)) {
      refuse_value(
        given->name, value, "one of transient_local, volatile, best_available", problems);
    }
  } else if (strcmp(policy, "history") == 0) {
    if (!read_choice(text, "keep_last", "keep_all", false, &fixed->history)) {
      refuse_value(given->name, value, "one of keep_last, keep_all", problems);
    }
  } else {
    refuse_name(given->name, "is none: there are reliability, durability, history, depth",
      problems);
  }
}

// Whether a part of a name, up to the next dot, is this endpoint, possibly with an id.
static bool is_endpoint(const char * part, const char * endpoint)
{
  const size_t length = strlen(endpoint);
  return begins_with(part, endpoint) && (part[length] == '.' || part[length] == '_');
}

static bool is_of_rcl(const char * topic)
{
  return begins_with(topic, "/clock.") || begins_with(topic, "/parameter_events.") ||
         begins_with(topic, "/rosout.");
}

// Refuse an override that cannot be one, of whatever topic.
static void check_override(const struct fm_parameter * given, struct fm_text * problems)
{
  static const char * const timed[] = {
    "deadline", "lifespan", "liveliness", "liveliness_lease_duration"};
  const char * topic = given->name + strlen(OVERRIDES);
  const char * endpoint = strchr(topic, '.');
  const char * policy = endpoint == NULL ? NULL : strchr(endpoint + 1, '.');
  struct fm_fixed_qos unused;
  if (is_of_rcl(topic)) {
    return;
  }
  if (policy == NULL || strchr(policy + 1, '.') != NULL || *topic != '/' ||
    !(is_endpoint(endpoint + 1, "subscription") || is_endpoint(endpoint + 1, "publisher")))
  {
    refuse_name(given->name, "is none; write '" OVERRIDES "/TOPIC" SUBSCRIPTION "POLICY', with "
      "the topic's full name", problems);
  } else if (begins_with(endpoint, ".subscription_")) {
    refuse_name(given->name, "is none: subscriptions here have no id, write '" SUBSCRIPTION "'",
      problems);
  } else if (begins_with(endpoint, SUBSCRIPTION)) {
    if (is_among(policy + 1, timed, sizeof(timed) / sizeof(timed[0]))) {
      refuse_name(given->name, "cannot be given: it would keep out publishers that do not offer "
        "it; use the `timeout` of the input in the bundle", problems);
    } else {
      apply(given, policy + 1, &unused, problems);
    }
  }
}

// Apply what was given for a topic, and show its policies as parameters.
static void apply_overrides(
  struct fm_parameters * parameters, uint32_t index, const char * topic)
{
  struct fm_fixed_qos * fixed = &parameters->fixed[index];
  struct fm_text prefix = {NULL, 0, 0};
  struct fm_text name = {NULL, 0, 0};
  struct fm_text checked = {NULL, 0, 0};  // what is wrong is known already
  fm_text_add(&prefix, OVERRIDES "%s" SUBSCRIPTION, topic);
  for (size_t k = 0; k < parameters->n_given; ++k) {
    if (begins_with(parameters->given[k].name, fm_text_get(&prefix))) {
      apply(
        &parameters->given[k], parameters->given[k].name + prefix.length, fixed, &checked);
    }
  }
  const struct {const char * policy; struct fm_parameter_value value;} shown[] = {
    {"reliability",
      word(choice_word(fixed->reliability, "best_available", "best_effort", "reliable"))},
    {"durability",
      word(choice_word(fixed->durability, "best_available", "volatile", "transient_local"))},
    {"history", word(choice_word(fixed->history, "keep_last", "keep_last", "keep_all"))},
    {"depth", whole(fixed->depth == 0 ? FM_USUAL_DEPTH : fixed->depth)}};
  for (size_t k = 0; k < sizeof(shown) / sizeof(shown[0]); ++k) {
    fm_text_clear(&name);
    fm_text_add(&name, "%s%s", fm_text_get(&prefix), shown[k].policy);
    put(&parameters->declared, &parameters->n_declared, fm_text_get(&name),
      "a policy of the subscription to the topic; read at the start of the process", FM_AT_START,
      &shown[k].value);
  }
  fm_text_free(&prefix);
  fm_text_free(&name);
  fm_text_free(&checked);
}

static void refuse_publishers(
  const struct fm_parameters * parameters, const char * topic, struct fm_text * problems)
{
  struct fm_text prefix = {NULL, 0, 0};
  char * resolved = fm_resolved_name(parameters->node, topic);
  fm_text_add(&prefix, OVERRIDES "%s.publisher", resolved == NULL ? "" : resolved);
  for (size_t k = 0; resolved != NULL && k < parameters->n_given; ++k) {
    if (begins_with(parameters->given[k].name, fm_text_get(&prefix))) {
      fm_text_add(problems,
        "%sparameter '%s' cannot be given: violations are announced reliable and volatile; their "
        "depth is -p handler_depth:=NUMBER", problems->length > 0 ? "\n" : "",
        parameters->given[k].name);
    }
  }
  free(resolved);
  fm_text_free(&prefix);
}

static void read_overrides(struct fm_parameters * parameters, struct fm_text * problems)
{
  const struct fm_node_table * table = parameters->table;
  const uint32_t n = table->monitor()->n_requirements;
  parameters->fixed = calloc(table->report.n_topics + 1u, sizeof(*parameters->fixed));
  for (size_t k = 0; k < parameters->n_given; ++k) {
    if (begins_with(parameters->given[k].name, OVERRIDES)) {
      check_override(&parameters->given[k], problems);
    }
  }
  for (uint32_t k = 0; parameters->fixed != NULL && k < table->report.n_topics; ++k) {
    char * topic = fm_resolved_name(parameters->node, table->topics[k].name);
    parameters->fixed[k] = table->topics[k].qos;
    if (topic != NULL) {
      apply_overrides(parameters, k, topic);
    } else {
      rcl_reset_error();  // refused when the node is configured
    }
    free(topic);
  }
  refuse_publishers(parameters, FM_DETAILS_TOPIC, problems);
  for (uint32_t k = 0; k < n; ++k) {
    refuse_publishers(parameters, table->handlers[k], problems);
  }
}

// ---- declarations ------------------------------------------------------------------------------

struct described
{
  const char * name;
  const char * description;
  enum fm_settable settable;
  struct fm_parameter_value usual;
};

static void declare(
  struct fm_parameters * parameters, const struct described * item, struct fm_text * problems)
{
  const struct fm_parameter * given =
    find(parameters->given, parameters->n_given, item->name);
  const struct fm_parameter_value * value = &item->usual;
  if (given != NULL) {
    const size_t before = problems->length;
    check(item->name, &given->value, problems);
    value = problems->length == before ? &given->value : value;
  }
  put(&parameters->declared, &parameters->n_declared, item->name, item->description,
    item->settable, value);
}

static void declare_constant(
  struct fm_parameters * parameters, const struct fm_constant * constant,
  struct fm_text * problems)
{
  const struct fm_parameter_value value = value_of_constant(constant->value);
  struct fm_text name = {NULL, 0, 0};
  fm_text_add(&name, CONSTANTS "%s", constant->name);
  const struct fm_parameter * given =
    find(parameters->given, parameters->n_given, fm_text_get(&name));
  if (given != NULL && !are_equal(&given->value, &value)) {
    fm_text_add(problems,
      "%sparameter '%s': the constant is compiled into this node, as %s: export the bundle with "
      "another value", problems->length > 0 ? "\n" : "", fm_text_get(&name), constant->value);
  }
  put(&parameters->declared, &parameters->n_declared, fm_text_get(&name),
    "a constant of the bundle; compiled into this node", FM_AT_START, &value);
  fm_text_free(&name);
}

static void refuse_unknown_constants(
  const struct fm_parameters * parameters, struct fm_text * problems)
{
  struct fm_text names = {NULL, 0, 0};
  for (uint32_t k = 0; k < parameters->table->report.n_constants; ++k) {
    fm_text_list(&names, ", ", parameters->table->report.constants[k].name);
  }
  for (size_t k = 0; k < parameters->n_given; ++k) {
    const char * name = parameters->given[k].name;
    if (begins_with(name, CONSTANTS) && fm_parameter_find(parameters, name) == NULL) {
      fm_text_add(problems, "%sparameter '%s': the bundle has no such constant%s%s",
        problems->length > 0 ? "\n" : "", name, names.length > 0 ? "; its constants are " : "",
        fm_text_get(&names));
    }
  }
  fm_text_free(&names);
}

static void set_level(const struct fm_parameters * parameters)
{
  const char * text = fm_parameter_find(parameters, "log_level")->value.text;
  int level = RCUTILS_LOG_SEVERITY_UNSET;
  for (int k = 0; k < (int)(sizeof(levels) / sizeof(levels[0])); ++k) {
    level = strcmp(text, levels[k]) == 0 ? RCUTILS_LOG_SEVERITY_DEBUG * (k + 1) : level;
  }
  fm_log_set_level(parameters->node, level);
}

void fm_parameters_begin(
  struct fm_parameters * parameters, struct fm_node * node, const struct fm_node_table * table,
  struct fm_text * problems)
{
  const struct described described[] = {
    {"use_sim_time", "whether the time is that of /clock", FM_ALWAYS, truth(false)},
    {"log_level", "the least severity that this node logs: debug, info, warn, error or fatal; "
      "empty for the process's", FM_ALWAYS, word("")},
    {"handler_depth", "violations that a slow listener of one handler may be behind before it "
      "loses some; read by `configure`", FM_UNCONFIGURED, whole(1000)},
    {"log_violations", "whether the node logs violations and their ends; false if the logger "
      "does; read by `configure`", FM_UNCONFIGURED, truth(true)},
    {"autostart", "whether the node configures and activates itself at its start", FM_AT_START,
      truth(true)}};
  parameters->node = node;
  parameters->table = table;
  read_given(parameters);
  for (size_t k = 0; k < sizeof(described) / sizeof(described[0]); ++k) {
    declare(parameters, &described[k], problems);
  }
  for (uint32_t k = 0; k < table->report.n_constants; ++k) {
    declare_constant(parameters, &table->report.constants[k], problems);
  }
  refuse_unknown_constants(parameters, problems);
  read_overrides(parameters, problems);
  set_level(parameters);
}

static bool is_constant(const struct fm_parameters * parameters, const char * name)
{
  for (uint32_t k = 0; k < parameters->table->report.n_constants; ++k) {
    if (strcmp(parameters->table->report.constants[k].name, name) == 0) {
      return true;
    }
  }
  return false;
}

static void warn_of_override(const struct fm_parameters * parameters, const char * name)
{
  const char * topic = name + strlen(OVERRIDES);
  const char * endpoint = strchr(topic, '.');
  if (endpoint != NULL && begins_with(endpoint, SUBSCRIPTION)) {
    fm_log(parameters->node, FM_WARN, "ignored parameter '%s': the topic %.*s is not subscribed to",
      name, (int)(endpoint - topic), topic);
  } else {
    fm_log(parameters->node, FM_WARN,
      "ignored parameter '%s': only subscriptions can be changed", name);
  }
}

void fm_parameters_warn(const struct fm_parameters * parameters)
{
  static const char * const compiled[] = {
    "spec", "library", "policy", "period", "rate", "hot_path"};
  for (size_t k = 0; k < parameters->n_given; ++k) {
    const char * name = parameters->given[k].name;
    const char * dot = strrchr(name, '.');
    const char * last = dot == NULL ? name : dot + 1;
    if (fm_parameter_find(parameters, name) != NULL ||
      (begins_with(name, OVERRIDES) && is_of_rcl(name + strlen(OVERRIDES))) ||
      strcmp(name, "start_type_description_service") == 0)
    {
      continue;
    }
    if (is_among(name, compiled, sizeof(compiled) / sizeof(compiled[0]))) {
      fm_log(parameters->node, FM_WARN,
        "ignored parameter '%s': the bundle is compiled into this node", name);
    } else if (begins_with(name, OVERRIDES)) {
      warn_of_override(parameters, name);
    } else if (is_constant(parameters, last)) {
      fm_log(parameters->node, FM_WARN,
        "ignored parameter '%s': did you mean '" CONSTANTS "%s'?", name, last);
    } else {
      fm_log(parameters->node, FM_WARN,
        "ignored parameter '%s': this node has use_sim_time, log_level, handler_depth, "
        "log_violations, autostart, " CONSTANTS "NAME", name);
    }
  }
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
  free(parameters->fixed);
  memset(parameters, 0, sizeof(*parameters));
}

// ---- use ---------------------------------------------------------------------------------------

struct fm_parameter * fm_parameter_find(const struct fm_parameters * parameters, const char * name)
{
  return find(parameters->declared, parameters->n_declared, name);
}

bool fm_parameter_is_true(const struct fm_parameters * parameters, const char * name)
{
  return fm_parameter_find(parameters, name)->value.is_true;
}

int64_t fm_parameter_whole(const struct fm_parameters * parameters, const char * name)
{
  return fm_parameter_find(parameters, name)->value.whole;
}

void fm_parameter_set(
  struct fm_parameters * parameters, const char * name, const struct fm_parameter_value * value)
{
  struct fm_parameter * parameter = fm_parameter_find(parameters, name);
  free(parameter->value.text);
  parameter->value = copy_value(value);
  if (strcmp(name, "log_level") == 0) {
    set_level(parameters);
  }
}
