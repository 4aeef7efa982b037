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

/// keyed_rows.h: rows of a trace with keys: each is a step of scopes, whose verdicts are written
/// as rows of CSV.
///
/// A row with a key is a message of that instance; one with a value of a shared input, or without
/// any key, is one of all. One with two keys is a message of their pair, and of one of them, with
/// its other pairs, if it has a value of an input that mentions it alone. It gives a row of its
/// key's verdicts and the bundle's. Under FM_TIMED there is a row for each other scope whose
/// verdicts have changed, by kind and slot, the bundle last, and for what is due between the
/// rows. A cell is empty where nothing is known.
///
/// Margins have a label with keys (a head) and n_cells margins for each of these rows, and under
/// FM_TIMED also for each time at which only margins have changed.
///
/// Not thread-safe. The texts and margins are allocated; when memory is short, rows are left out,
/// and `is_short`.

#ifndef KEYED_ROWS_H_
#define KEYED_ROWS_H_

#include "engine.h"

#define FM_NO_VERDICT 2
#define FM_NO_MARGIN 2147483647  // in place of a comparison: the cell is empty

/// A column of values. The caller owns what it points to.
struct fm_keyed_column
{
  const void * values;    // of the type of its input, one for each row
  const bool * is_there;  // a row: whether it has a value; NULL: if it has a key
  uint32_t kind;          // FM_BUNDLE: a shared input
  uint32_t input;         // of that scope
  uint32_t bytes;         // of a value
};

/// The verdicts of a kind, or of the bundle (its `n_slots` is 1).
struct fm_keyed_scope
{
  uint32_t variables[2];    // whose keys it has; of one variable, the first
  bool is_of_pairs;
  uint32_t base;            // the first kind with these instances, which may be this one
  uint32_t n_slots;
  uint32_t n;               // requirements that are shown
  const uint32_t * places;  // of each: its cell in a row
  uint8_t * before;         // a slot: n verdicts that were shown last; at first FM_NO_VERDICT
  double * margins;         // a slot: n margins that were shown last; NULL: none are wanted
};

/// What is written; `text` is freed by fm_keyed_rows_free.
struct fm_keyed_text
{
  char * text;
  uint64_t length;  // in bytes
  uint64_t room;
};

struct fm_keyed_rows
{
  struct fm_scopes * scopes;
  struct fm_keyed_scope * kinds;    // and behind them the bundle, its own base
  uint32_t n_kinds;
  const uint32_t * pairs;           // variables that a row may be of together, two for each pair
  uint32_t n_pairs;
  uint32_t n_variables;
  uint32_t n_cells;
  bool is_timed;                    // labels are times
  struct fm_stepped * events;       // room for as many as the scopes keep
  uint32_t * own;                   // a kind: room for the slot of a row's key
  char * cells;                     // room for n_cells
  struct fm_margin * margins;       // room for n_cells; NULL: none are wanted
  struct fm_key * shown;            // room for n_variables
  const uint32_t * receptions;      // inputs of the bundle that say that a row is for all
  uint32_t n_receptions;
  // Rows.
  uint64_t n;
  uint64_t next;                    // of fm_engine_keyed_rows: the first that is not taken yet
  uint64_t end;                     // the same: the first that is not to be taken
  const int64_t * times;
  int64_t label;                    // of the first row, unless labels are times
  const struct fm_key * keys;       // n of each variable, one variable after the other
  const struct fm_keyed_column * columns;
  uint32_t n_columns;
  // What was found so far.
  uint64_t * violations;            // a cell
  int64_t * first;                  // a cell: the label of its first violation, if there is one
  uint64_t n_rows;                  // that were written
  struct fm_keyed_text text;        // of rows
  struct fm_keyed_text heads;       // of rows of margins
  struct fm_keyed_text found;       // n_cells struct fm_margin for each head
  bool is_short;
};

/// Take the rows, and add to the text. O(operations of all that steps + characters), and O(n log
/// n) for the n scopes that step in a row.
FM_EXPORT void fm_keyed_rows_take(struct fm_keyed_rows * rows);

/// Take what is due by a time, after all rows.
FM_EXPORT void fm_keyed_rows_advance(struct fm_keyed_rows * rows, int64_t until);

/// Take the rows from `next` to `end` with the scopes of an engine, as fm_engine_rows: no verdict
/// is written.
FM_EXPORT bool fm_engine_keyed_rows(
  struct fm_engine * engine, struct fm_keyed_rows * rows, uint32_t most);

/// Say of each row whether it is a message of an instance that has a key of some variables (`own`,
/// of each variable; size 0: none): 0: no, 1: yes, 2: it is one of all instances. Say also in
/// which rows each column has a value for it: `come` has n flags of each column, one column after
/// the other. Of the kinds only the variables and the base are read. O(n x (columns + kinds)).
FM_EXPORT void fm_keyed_rows_of(
  const struct fm_keyed_rows * rows, const struct fm_key * own, uint8_t * are_of, uint8_t * come);

/// Free the texts.
FM_EXPORT void fm_keyed_rows_free(struct fm_keyed_rows * rows);

#endif  // KEYED_ROWS_H_
