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

/// csv.h: rows of a trace in CSV, read into columns, and rows of verdicts, written.
///
/// The reader takes plain rows only, and stops at any other: the caller then reads that row by
/// other means, and words the error if there is one. It knows nothing of an engine.

#ifndef CSV_H_
#define CSV_H_

#include "kinds.h"

/// A word that a cell may have in place of a number.
struct fm_csv_name
{
  const char * text;
  uint64_t n;  // bytes
};

/// A column of a trace: what its cells are, and where their values go. The caller owns all of it.
struct fm_csv_column
{
  void * values;      // of the column's type, one for each row; NULL: the cells are not read
  uint8_t type;       // enum fm_type; bool is a byte, 0 or 1
  bool is_time;       // FM_INT64: seconds in decimal, which are stored in nanoseconds
  bool has_numbers;   // if not, only names are values
  uint32_t n_names;
  const struct fm_csv_name * names;
  const void * named;  // the values of these names, of the column's type
  bool * is_there;     // a row: whether its cell is not empty; NULL: an empty one is no value
  bool is_key;         // values are struct fm_key, parts of the text; with names, no others are
  bool needs_key;      // a value is in rows with a key alone, ...
  uint32_t keys[2];    // ... which these columns have, or this one twice
};

/// Complete rows of a trace. The caller owns all of it; only `place` and the values of the columns
/// are written.
struct fm_csv
{
  const struct fm_csv_column * columns;
  uint32_t n_columns;  // 1 or more
  const char * text;
  uint64_t n;          // bytes
  uint64_t place;      // where the next row begins
  int64_t after;       // times are later than this, and increase from row to row, ...
  int64_t latest;      // ... up to this
};

/// Bytes that fm_csv_verdicts writes for the label of a row at most.
#define FM_CSV_LABEL_BYTES 24

/// Read up to `most` rows, and return how many. Stops at a row that does not end with a line feed,
/// has another number of cells or a cell that is no value of its column, or is written in a way
/// that is not read here: an empty row, a carriage return alone, a line break or a quote inside
/// quotes in a cell that is read, white space other than spaces and tabs, a cell of 64 bytes or
/// more. `place` is then where this row begins. Numbers are rounded once, to the nearest, ties to
/// even. Reads no row if the locale of the process has no decimal point. O(bytes + cells that are
/// no numbers x names of their columns). Any thread; not while another one sets the locale.
FM_EXPORT uint64_t fm_csv_rows(struct fm_csv * csv, uint64_t most);

/// Write n rows: a label, then `width` verdicts as 1 or 0. Labels are numbers, or nanoseconds that
/// are written as seconds without trailing zeros. `text` has room for n x (FM_CSV_LABEL_BYTES +
/// 2 x width + 1) bytes. Returns how many are written. O(n x width). Any thread.
FM_EXPORT uint64_t fm_csv_verdicts(
  const int64_t * labels, bool are_times, const bool * verdicts, uint32_t width, uint64_t n,
  char * text);

#endif  // CSV_H_
