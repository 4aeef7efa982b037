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

/// keyed_rows.c: see keyed_rows.h for the contract.

#include "keyed_rows.h"

#include <stdlib.h>
#include <string.h>

#include "csv.h"
#include "engine_parts.h"
#include "fret_cdr.h"
#include "pairs.h"
#include "tables.h"

enum {LEAST_ROOM = 1 << 16};

// ---- text --------------------------------------------------------------------------------------

// Room for more bytes; NULL if there is none.
static char * grown(struct fm_keyed_rows * rows, struct fm_keyed_text * text, uint64_t more)
{
  if (text->room - text->length < more) {
    const uint64_t room = 2 * (text->length + more) + LEAST_ROOM;
    char * const bytes = realloc(text->text, (size_t)room);
    if (bytes == NULL) {
      rows->is_short = true;
      return NULL;
    }
    text->text = bytes;
    text->room = room;
  }
  return text->text + text->length;
}

static bool needs_quotes(const struct fm_key * key)
{
  bool needs = false;
  for (uint32_t k = 0; k < key->size; ++k) {
    const uint8_t c = key->bytes[k];
    needs = needs || c == ',' || c == '"' || c == '\n' || c == '\r';
  }
  return needs;
}

static char * write_key(char * at, const struct fm_key * key)
{
  const bool is_quoted = needs_quotes(key);
  *at++ = ',';
  if (is_quoted) {
    *at++ = '"';
  }
  for (uint32_t k = 0; k < key->size; ++k) {
    if (key->bytes[k] == '"') {
      *at++ = '"';
    }
    *at++ = (char)key->bytes[k];
  }
  if (is_quoted) {
    *at++ = '"';
  }
  return at;
}

// Begin a row with a label and the keys of `rows`, with room for more bytes. Returns its end; NULL
// if memory is short.
static char * write_head(
  struct fm_keyed_rows * rows, struct fm_keyed_text * text, int64_t label, uint64_t more)
{
  uint64_t most = FM_CSV_LABEL_BYTES + more;
  for (uint32_t v = 0; v < rows->n_variables; ++v) {
    most += 2 * (uint64_t)rows->shown[v].size + 3;
  }
  char * at = grown(rows, text, most);
  if (at != NULL) {
    at += fm_csv_verdicts(&label, rows->is_timed, NULL, 0, 1, at) - 1;  // without the line feed
    for (uint32_t v = 0; v < rows->n_variables; ++v) {
      at = write_key(at, &rows->shown[v]);
    }
  }
  return at;
}

static void end_line(struct fm_keyed_text * text, char * at)
{
  *at++ = '\n';
  text->length = (uint64_t)(at - text->text);
}

// Write the margins of the cells.
static void write_margins(struct fm_keyed_rows * rows, int64_t label)
{
  const uint64_t bytes = rows->n_cells * sizeof(*rows->margins);
  char * const at = rows->margins == NULL ? NULL : write_head(rows, &rows->heads, label, 1);
  char * const found = at == NULL ? NULL : grown(rows, &rows->found, bytes);
  if (found != NULL) {
    end_line(&rows->heads, at);
    memcpy(found, rows->margins, bytes);
    rows->found.length += bytes;
  }
}

// Write a row with the keys and cells of `rows`.
static void write_row(struct fm_keyed_rows * rows, int64_t label)
{
  char * at = write_head(rows, &rows->text, label, 2 * (uint64_t)rows->n_cells + 1);
  if (at == NULL) {
    return;
  }
  for (uint32_t c = 0; c < rows->n_cells; ++c) {
    *at++ = ',';
    if (rows->cells[c] != FM_NO_VERDICT) {
      *at++ = (char)('0' + rows->cells[c]);
    }
  }
  end_line(&rows->text, at);
  rows->n_rows += 1;
  write_margins(rows, label);
}

// ---- verdicts ----------------------------------------------------------------------------------

static struct fm_keyed_scope * scope_of(const struct fm_keyed_rows * rows, uint32_t kind)
{
  return &rows->kinds[kind == FM_BUNDLE ? rows->n_kinds : kind];
}

static uint8_t * before_of(const struct fm_keyed_rows * rows, const struct fm_stepped * place)
{
  const struct fm_keyed_scope * scope = scope_of(rows, place->kind);
  return scope->before + (uint64_t)place->slot * scope->n;
}

static uint8_t verdict_of(const struct fm_evaluator * evaluator, uint32_t requirement)
{
  const uint32_t group = evaluator->monitor->requirements[requirement].group;
  if (!fm_evaluator_ready(evaluator, group) || fm_evaluator_steps(evaluator, group) == 0) {
    return FM_NO_VERDICT;
  }
  return fm_evaluator_verdicts(evaluator)[requirement] ? 1 : 0;
}

static void count(
  struct fm_keyed_rows * rows, uint32_t cell, uint8_t verdict, int64_t label)
{
  if (verdict == 0) {
    rows->first[cell] = rows->violations[cell] == 0 ? label : rows->first[cell];
    rows->violations[cell] += 1;
  }
}

// What of a scope is not as it was shown last.
struct changes
{
  bool of_verdicts;
  bool of_margins;
};

// Put a margin into its cell, and that which was shown last. Returns whether it has changed.
static bool show_margin(
  const struct fm_keyed_rows * rows, const struct fm_keyed_scope * scope,
  const struct fm_evaluator * evaluator, uint32_t slot, uint32_t requirement)
{
  if (rows->margins == NULL || verdict_of(evaluator, requirement) == FM_NO_VERDICT) {
    return false;
  }
  const struct fm_margin margin = fm_evaluator_margin(evaluator, requirement);
  double * const before = &scope->margins[(uint64_t)slot * scope->n + requirement];
  const bool has_changed = memcmp(before, &margin.value, sizeof(*before)) != 0;
  *before = margin.value;
  rows->margins[scope->places[requirement]] = margin;
  return has_changed;
}

// Put the verdicts and margins of a scope into the cells, and those that were shown last.
static struct changes show(struct fm_keyed_rows * rows, const struct fm_stepped * place)
{
  const struct fm_keyed_scope * scope = scope_of(rows, place->kind);
  const struct fm_evaluator * evaluator = fm_scopes_look(rows->scopes, place->kind, place->slot);
  uint8_t * const before = before_of(rows, place);
  struct changes changes = {false, false};
  for (uint32_t r = 0; r < scope->n; ++r) {
    const uint8_t verdict = verdict_of(evaluator, r);
    changes.of_verdicts |= verdict != before[r];
    changes.of_margins |= show_margin(rows, scope, evaluator, place->slot, r);
    before[r] = verdict;
    rows->cells[scope->places[r]] = (char)verdict;
  }
  return changes;
}

// As `show`, of all kinds with the instance of a key.
static struct changes show_all(struct fm_keyed_rows * rows, const struct fm_stepped * place)
{
  const uint32_t base = scope_of(rows, place->kind)->base;
  struct changes changes = {false, false};
  for (uint32_t k = 0; place->kind != FM_BUNDLE && k < rows->n_kinds; ++k) {
    if (rows->kinds[k].base == base) {
      struct fm_stepped own = *place;
      own.kind = k;
      const struct changes found = show(rows, &own);
      changes.of_verdicts |= found.of_verdicts;
      changes.of_margins |= found.of_margins;
    }
  }
  return place->kind == FM_BUNDLE ? show(rows, place) : changes;
}

static void clear_cells(struct fm_keyed_rows * rows)
{
  memset(rows->cells, FM_NO_VERDICT, rows->n_cells);
  for (uint32_t c = 0; rows->margins != NULL && c < rows->n_cells; ++c) {
    rows->margins[c].comparison = FM_NO_MARGIN;
  }
}

static void count_all(struct fm_keyed_rows * rows, int64_t label)
{
  for (uint32_t c = 0; c < rows->n_cells; ++c) {
    count(rows, c, (uint8_t)rows->cells[c], label);
  }
}

static void count_cells(
  struct fm_keyed_rows * rows, const struct fm_keyed_scope * scope, int64_t label)
{
  for (uint32_t r = 0; r < scope->n; ++r) {
    count(rows, scope->places[r], (uint8_t)rows->cells[scope->places[r]], label);
  }
}

// ---- what has stepped --------------------------------------------------------------------------

// By the base of the kind, the bundle last, slot, and kind; then as it happened.
static int compare(const void * a, const void * b)
{
  const struct fm_stepped * x = a, * y = b;
  if (x->instant != y->instant) {
    return x->instant < y->instant ? -1 : 1;
  }
  if (x->kind != y->kind) {
    return x->kind < y->kind ? -1 : 1;
  }
  return x->n_violations < y->n_violations ? -1 : x->n_violations > y->n_violations ? 1 : 0;
}

// Leave the last step of each scope, unless its instance has ended since. What was shown of an
// instance before it ended does not matter to the next one: it begins with a row of its own.
static uint32_t thin_out(struct fm_keyed_rows * rows, uint32_t n)
{
  uint32_t kept = 0;
  for (uint32_t k = 0; k < n; ++k) {
    const struct fm_stepped event = rows->events[k];
    const bool is_same = kept > 0 && rows->events[kept - 1].kind == event.kind &&
      rows->events[kept - 1].slot == event.slot;
    kept -= is_same ? 1 : 0;
    if (event.event == FM_SCOPE_STEPPED) {
      rows->events[kept++] = event;
    }
  }
  return kept;
}

// A number for the instance of a key, the same in all kinds that have it.
static int64_t place_of(const struct fm_keyed_rows * rows, const struct fm_stepped * event)
{
  return event->kind == FM_BUNDLE ? INT64_MAX :
         (int64_t)scope_of(rows, event->kind)->base * ((int64_t)1 << 32) + (int64_t)event->slot;
}

// Returns how many scopes have stepped since the last call: the first of `events`, with their
// places for `instant`.
static uint32_t take_events(struct fm_keyed_rows * rows)
{
  uint32_t n = 0, taken = 0;
  const struct fm_stepped * events = fm_scopes_stepped(rows->scopes, &n);
  for (uint32_t k = 0; k < n; ++k) {
    if (events[k].event != FM_SCOPE_BEYOND) {
      rows->events[taken] = events[k];
      rows->events[taken].instant = place_of(rows, &events[k]);
      rows->events[taken].n_violations = k;  // the order
      taken += 1;
    }
  }
  fm_scopes_clear(rows->scopes);
  qsort(rows->events, taken, sizeof(*rows->events), compare);
  return thin_out(rows, taken);
}

// ---- rows --------------------------------------------------------------------------------------

// A row of its own for an instance, or the bundle, if its verdicts have changed, or its margins.
static void write_other(
  struct fm_keyed_rows * rows, const struct fm_stepped * place, int64_t time)
{
  uint8_t bytes[FM_MOST_KEY_BYTES];
  const struct fm_keyed_scope * scope = scope_of(rows, place->kind);
  clear_cells(rows);
  const struct changes changes = show_all(rows, place);
  if (!changes.of_verdicts && !changes.of_margins) {
    return;
  }
  memset(rows->shown, 0, rows->n_variables * sizeof(*rows->shown));
  if (place->kind != FM_BUNDLE) {
    const struct fm_key key = {
      bytes, (uint32_t)fm_scopes_key(rows->scopes, place->kind, place->slot, bytes)};
    for (uint32_t part = 0; part < (scope->is_of_pairs ? 2u : 1u); ++part) {
      rows->shown[scope->variables[part]] = scope->is_of_pairs ? fm_pair_part(&key, part) : key;
    }
  }
  if (changes.of_verdicts) {
    count_all(rows, time);
    write_row(rows, time);
  } else {
    write_margins(rows, time);
  }
}

// What has changed at the very instant at which an instance ends is shown while it is there.
static void show_last(
  void * context, const struct fm_stepped * event, const struct fm_violation * found)
{
  struct fm_keyed_rows * rows = context;
  (void)found;
  if (event->event == FM_SCOPE_ENDED && scope_of(rows, event->kind)->base == event->kind) {
    write_other(rows, event, event->instant);
  }
}

// Of the events of an instance, which may have stepped in several kinds.
static bool is_first(const struct fm_keyed_rows * rows, uint32_t k)
{
  return k == 0 || rows->events[k].instant != rows->events[k - 1u].instant;
}

static void write_others(struct fm_keyed_rows * rows, int64_t time)
{
  const uint32_t n = take_events(rows);
  for (uint32_t k = 0; k < n; ++k) {
    if (rows->is_timed && is_first(rows, k)) {
      write_other(rows, &rows->events[k], time);
    }
  }
}

static bool is_own(const struct fm_keyed_rows * rows, const struct fm_stepped * place)
{
  return place->kind == FM_BUNDLE || rows->own[place->kind] == place->slot;
}

static void write_own(struct fm_keyed_rows * rows, uint64_t k, int64_t label, uint32_t n)
{
  clear_cells(rows);
  for (uint32_t e = 0; e < n; ++e) {
    if (is_own(rows, &rows->events[e])) {
      (void)show(rows, &rows->events[e]);
      count_cells(rows, scope_of(rows, rows->events[e].kind), label);
    }
  }
  for (uint32_t v = 0; v < rows->n_variables; ++v) {
    rows->shown[v] = rows->keys[v * rows->n + k];
  }
  write_row(rows, label);
}

// What a row has made of all scopes: those that it is not of have no row without times.
static void write_stepped(struct fm_keyed_rows * rows, uint64_t k)
{
  const int64_t label = rows->is_timed ? rows->times[k] : rows->label + (int64_t)k;
  const uint32_t n = take_events(rows);
  for (uint32_t e = 0; e < n && !rows->is_timed; ++e) {
    if (!is_own(rows, &rows->events[e])) {
      (void)show(rows, &rows->events[e]);
      count_cells(rows, scope_of(rows, rows->events[e].kind), label);
    }
  }
  write_own(rows, k, label, n);
  for (uint32_t e = 0; e < n && rows->is_timed; ++e) {
    if (!is_own(rows, &rows->events[e]) && is_first(rows, e)) {
      write_other(rows, &rows->events[e], label);
    }
  }
}

// ---- steps -------------------------------------------------------------------------------------

static const void * value_at(const struct fm_keyed_column * column, uint64_t k)
{
  const bool is_there = column->is_there == NULL || column->is_there[k];
  return is_there ? (const char *)column->values + k * column->bytes : NULL;
}

static bool is_for_all(const struct fm_keyed_rows * rows, uint64_t k)
{
  bool has_key = false, has_shared = false;
  for (uint32_t v = 0; v < rows->n_variables; ++v) {
    has_key = has_key || rows->keys[v * rows->n + k].size > 0;
  }
  for (uint32_t c = 0; c < rows->n_columns; ++c) {
    const struct fm_keyed_column * column = &rows->columns[c];
    has_shared = has_shared || (column->kind == FM_BUNDLE && value_at(column, k) != NULL);
  }
  return has_shared || !has_key;
}

static void store_shared(struct fm_keyed_rows * rows, uint64_t k, bool is_of_all)
{
  const bool yes = true;
  for (uint32_t c = 0; c < rows->n_columns; ++c) {
    const struct fm_keyed_column * column = &rows->columns[c];
    const void * value = value_at(column, k);
    if (column->kind == FM_BUNDLE && value != NULL) {
      fm_scopes_store_from(rows->scopes, column->input, value);
    }
  }
  for (uint32_t r = 0; r < rows->n_receptions && is_of_all; ++r) {
    fm_scopes_store_from(rows->scopes, rows->receptions[r], &yes);
  }
}

// The key of a row for a kind; of pairs, it is written to `pair`. Its size is 0 if there is none.
static struct fm_key key_of(
  const struct fm_keyed_rows * rows, uint64_t k, uint32_t kind, uint8_t * pair)
{
  const struct fm_keyed_scope * scope = &rows->kinds[kind];
  const struct fm_key * first = &rows->keys[scope->variables[0] * rows->n + k];
  const struct fm_key * second = &rows->keys[scope->variables[1] * rows->n + k];
  return !scope->is_of_pairs ? *first : (struct fm_key) {pair, (uint32_t)fm_pair_key(
      pair, first->bytes, first->size, second->bytes, second->size)};
}

// Whether a row has a value of a kind in a column of its own.
static bool has_value(const struct fm_keyed_rows * rows, uint64_t k, uint32_t kind)
{
  bool has = false;
  for (uint32_t c = 0; c < rows->n_columns; ++c) {
    const struct fm_keyed_column * column = &rows->columns[c];
    has = has || (column->kind == kind && column->is_there != NULL && column->is_there[k]);
  }
  return has;
}

// Whether a row is of a pair that has the variable of a kind.
static bool is_of_pair_with(const struct fm_keyed_rows * rows, uint64_t k, uint32_t kind)
{
  const uint32_t variable = rows->kinds[kind].variables[0];
  bool is_of_one = false;
  for (uint32_t p = 0; p < rows->n_pairs; ++p) {
    const uint32_t * pair = &rows->pairs[2 * p];
    is_of_one = is_of_one || ((pair[0] == variable || pair[1] == variable) &&
      rows->keys[pair[0] * rows->n + k].size > 0 && rows->keys[pair[1] * rows->n + k].size > 0);
  }
  return is_of_one;
}

// Whether a row is one of the instance of its key: a row of a pair is one of each of both only
// with a value of an input of its own.
static bool is_of_kind(const struct fm_keyed_rows * rows, uint64_t k, uint32_t kind)
{
  return rows->kinds[kind].is_of_pairs || has_value(rows, k, kind) ||
         !is_of_pair_with(rows, k, kind);
}

static void store_keyed(struct fm_keyed_rows * rows, uint64_t k, uint32_t kind)
{
  if (rows->kinds[kind].base != kind) {
    rows->own[kind] = rows->own[rows->kinds[kind].base];
    return;
  }
  uint8_t pair[FM_PAIR_ROOM];
  const struct fm_key key = key_of(rows, k, kind, pair);
  rows->own[kind] = key.size == 0 || !is_of_kind(rows, k, kind) ? FM_NO_SLOT :
    fm_scopes_enter(rows->scopes, kind, key.bytes, key.size);
  for (uint32_t c = 0; c < rows->n_columns && rows->own[kind] != FM_NO_SLOT; ++c) {
    const struct fm_keyed_column * column = &rows->columns[c];
    const void * value = value_at(column, k);
    if (column->kind == kind && value != NULL) {
      fm_scopes_store_keyed_from(rows->scopes, column->input, value);
    }
  }
}

static void step(struct fm_keyed_rows * rows, uint64_t k)
{
  const bool is_of_all = is_for_all(rows, k);
  fm_scopes_begin_row(rows->scopes, is_of_all, rows->times[k]);
  store_shared(rows, k, is_of_all);
  for (uint32_t kind = 0; kind < rows->n_kinds; ++kind) {
    store_keyed(rows, k, kind);
  }
  (void)fm_scopes_end(rows->scopes);
}

void fm_keyed_rows_advance(struct fm_keyed_rows * rows, int64_t until)
{
  int64_t instant;
  fm_scopes_listen(rows->scopes, rows->is_timed ? show_last : NULL, rows);
  while ((instant = fm_scopes_advance(rows->scopes, until)) != FM_NEVER) {
    write_others(rows, instant);
  }
}

void fm_keyed_rows_take(struct fm_keyed_rows * rows)
{
  fm_scopes_listen(rows->scopes, rows->is_timed ? show_last : NULL, rows);
  for (uint64_t k = 0; k < rows->n; ++k) {
    int64_t instant;
    while ((instant = fm_scopes_advance_to(rows->scopes, rows->times[k])) != FM_NEVER) {
      write_others(rows, instant);
    }
    step(rows, k);
    write_stepped(rows, k);
    fm_keyed_rows_advance(rows, rows->times[k]);
  }
}

bool fm_engine_keyed_rows(
  struct fm_engine * engine, struct fm_keyed_rows * rows, uint32_t most)
{
  fm_engine_lock(engine);
  uint64_t left = UINT64_MAX;
  engine->has_begun = true;
  while (rows->next < rows->end && engine->outbox.n_violations < most) {
    const int64_t time = rows->times[rows->next];
    if (!fm_engine_take_all_due_locked(engine, time, most, &left)) {
      break;
    }
    fm_engine_advance_scopes_locked(engine, time, true);
    step(rows, rows->next);
    fm_engine_take_due_by_locked(engine, time);
    rows->next += 1;
  }
  const bool are_all = rows->next == rows->end;
  fm_engine_unlock(engine);
  return are_all;
}

// Whether a row has the keys that an instance has of the variables of a kind.
static bool is_of_keys(
  const struct fm_keyed_rows * rows, uint64_t k, uint32_t kind, const struct fm_key * own)
{
  bool is = true;
  for (uint32_t v = 0; v < 2; ++v) {
    const struct fm_key * key = &rows->keys[rows->kinds[kind].variables[v] * rows->n + k];
    const struct fm_key * wanted = &own[rows->kinds[kind].variables[v]];
    is = is && wanted->size > 0 && key->size == wanted->size &&
      memcmp(key->bytes, wanted->bytes, key->size) == 0;
  }
  return is;
}

static bool is_message_of(
  const struct fm_keyed_rows * rows, uint64_t k, const struct fm_key * own)
{
  bool is = false;
  for (uint32_t kind = 0; kind < rows->n_kinds; ++kind) {
    is = is || (rows->kinds[kind].base == kind && is_of_keys(rows, k, kind, own) &&
      is_of_kind(rows, k, kind));
  }
  return is;
}

void fm_keyed_rows_of(
  const struct fm_keyed_rows * rows, const struct fm_key * own, uint8_t * are_of, uint8_t * come)
{
  for (uint64_t k = 0; k < rows->n; ++k) {
    are_of[k] = is_for_all(rows, k) ? 2 : is_message_of(rows, k, own) ? 1 : 0;
    for (uint32_t c = 0; c < rows->n_columns; ++c) {
      const struct fm_keyed_column * column = &rows->columns[c];
      come[c * rows->n + k] = value_at(column, k) != NULL &&
        (column->kind == FM_BUNDLE || is_of_keys(rows, k, column->kind, own)) ? 1 : 0;
    }
  }
}

static void free_text(struct fm_keyed_text * text)
{
  free(text->text);
  *text = (struct fm_keyed_text) {NULL, 0, 0};
}

void fm_keyed_rows_free(struct fm_keyed_rows * rows)
{
  free_text(&rows->text);
  free_text(&rows->heads);
  free_text(&rows->found);
}
