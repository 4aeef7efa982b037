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

// Steps the monitors through a trace, and prints the verdicts as `fret-monitor simulate` does.
//
//   NAME_test < trace.csv                     prints verdicts
//   NAME_test trace.csv verdicts.csv          compares them with a file; 1 at the first difference
//
// A trace has a heading with a column for each input (others are ignored), and a row for each
// step. Under the policy `timed` it also has a column `time`, in seconds. A trace that cannot be
// used ends the program with status 1, and with its line and column on standard error.

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "test_tables.h"

enum
{
  LINE_BYTES = 1 << 16,
  ROW_BYTES = sizeof(test_heading) + 2 * TEST_REQUIREMENTS + 64,
  MOST_COLUMNS = 1 << 12,
  NO_INPUT = -1,
  TIME = -2
};

static const int64_t NS_PER_S = INT64_C(1000000000);
static const int64_t LATEST_S = INT64_C(400000000);
static const char byte_order_mark[] = "\xEF\xBB\xBF";
static const char blanks[] = " \t";
static const char digits[] = "0123456789";

static struct
{
  char line[LINE_BYTES];  // of the trace; its cells end in 0
  char * cells[MOST_COLUMNS];
  int inputs[MOST_COLUMNS];  // of each column: an input, NO_INPUT or TIME
  int n_columns;
  char row[ROW_BYTES];  // of verdicts
  char expected[ROW_BYTES];
  FILE * trace;
  FILE * verdicts;  // to compare with, or NULL
  long n_rows;  // without the heading
  int column;   // that is looked at, from 1; 0: none
} run;

static TEST_INPUTS inputs;
static TEST_STATE state;
static bool verdicts[TEST_VERDICTS];

static void fail(const char * what)
{
  fprintf(stderr, "line %ld", run.n_rows + 1);
  if (run.column != 0) {
    fprintf(stderr, ", column %d", run.column);
  }
  fprintf(stderr, ": %s\n", what);
  exit(1);
}

// -- the trace -----------------------------------------------------------------------------------

// Ends the cell at `from` and takes its quotes away; returns what comes behind it, or NULL.
static char * end_cell(char * from)
{
  char * to = from;
  const bool is_quoted = *from == '"';
  for (from += is_quoted; *from != '\0'; ++from) {
    if (is_quoted && *from == '"') {
      if (from[1] != '"') {
        break;
      }
      ++from;
    } else if (!is_quoted && *from == ',') {
      break;
    }
    *to++ = *from;
  }
  from += is_quoted && *from == '"';
  const bool is_last = *from != ',';
  *to = '\0';
  return is_last ? NULL : from + 1;
}

// Takes the blanks around a cell away.
static char * stripped(char * cell)
{
  cell += strspn(cell, blanks);
  size_t length = strlen(cell);
  while (length > 0u && strchr(blanks, cell[length - 1u]) != NULL) {
    --length;
  }
  cell[length] = '\0';
  return cell;
}

// Reads a line into cells; returns their number, 0 at the end of the trace.
static int read_cells(void)
{
  if (fgets(run.line, LINE_BYTES, run.trace) == NULL) {
    return 0;
  }
  if (strlen(run.line) == LINE_BYTES - 1) {
    fail("a line is too long");
  }
  run.line[strcspn(run.line, "\r\n")] = '\0';
  int n = 0;
  const bool is_marked = run.n_columns == 0 && strncmp(run.line, byte_order_mark, 3u) == 0;
  for (char * cell = run.line + (is_marked ? 3 : 0); cell != NULL; ++n) {
    if (n == MOST_COLUMNS) {
      fail("too many columns");
    }
    char * const next = end_cell(cell);
    run.cells[n] = stripped(cell);
    cell = next;
  }
  return n;
}

static int input_of(const char * heading)
{
  const struct fm_monitor * const monitor = TEST_MONITOR();
  for (uint32_t i = 0u; i < monitor->n_inputs; ++i) {
    if (strcmp(monitor->inputs[i].name, heading) == 0) {
      return (int)i;
    }
  }
  return TEST_IS_TIMED && strcmp(heading, "time") == 0 ? TIME : NO_INPUT;
}

static void need_column(int input, const char * name)
{
  int n = 0;
  for (int column = 0; column < run.n_columns; ++column) {
    n += run.inputs[column] == input;
  }
  if (n != 1) {
    fprintf(stderr, "'%s': ", name);
    fail(n == 0 ? "the heading has no such column" : "the heading has two such columns");
  }
}

static void read_heading(void)
{
  run.n_columns = read_cells();
  if (run.n_columns == 0) {
    fail("the trace is empty");
  }
  for (int column = 0; column < run.n_columns; ++column) {
    run.inputs[column] = input_of(run.cells[column]);
  }
  for (uint32_t i = 0u; i < TEST_MONITOR()->n_inputs; ++i) {
    need_column((int)i, TEST_MONITOR()->inputs[i].name);
  }
  if (TEST_IS_TIMED && input_of("time") == TIME) {
    need_column(TIME, "time");
  }
}

// Nanoseconds of a decimal number of seconds.
static int64_t nanoseconds(const char * text)
{
  const bool is_negative = *text == '-';
  text += is_negative || *text == '+';
  const bool has_digits = *text >= '0' && *text <= '9';
  int64_t seconds = 0, part = 0, unit = NS_PER_S;
  for (; *text >= '0' && *text <= '9'; ++text) {
    if (seconds > LATEST_S) {
      fail("a time is too late");
    }
    seconds = seconds * 10 + (*text - '0');
  }
  text += *text == '.';
  for (; *text >= '0' && *text <= '9' && unit > 1; ++text) {
    unit /= 10;
    part += unit * (*text - '0');
  }
  if (*text != '\0' || !has_digits) {
    fail("a time is a number of seconds with at most nine digits behind the point");
  }
  const int64_t sum = seconds * NS_PER_S + part;
  return is_negative ? -sum : sum;
}

// The number that a name of a bundle's `values` stands for, or the cell itself.
static const char * named_value(uint32_t input, const char * cell)
{
  for (size_t i = 0u; i < sizeof(test_values) / sizeof(test_values[0]); ++i) {
    if (test_values[i].input == input && strcmp(test_values[i].name, cell) == 0) {
      return test_values[i].number;
    }
  }
  return cell;
}

// Whether two texts differ in nothing but the case of letters; `small` has small ones.
static bool is_word(const char * text, const char * small)
{
  for (; *small != '\0'; ++text, ++small) {
    if (*text != *small && *text != *small - 'a' + 'A') {
      return false;
    }
  }
  return *text == '\0';
}

// Whether a text is a decimal number: strtod would take others too, such as 0x1p-3.
static bool is_decimal(const char * text, bool is_whole)
{
  text += *text == '+' || *text == '-';
  if (!is_whole && (is_word(text, "nan") || is_word(text, "inf"))) {
    return true;
  }
  size_t n = strspn(text, digits);
  text += n;
  if (is_whole) {
    return n > 0u && *text == '\0';
  }
  if (*text == '.') {
    const size_t behind = strspn(++text, digits);
    n += behind;
    text += behind;
  }
  if (n > 0u && (*text == 'e' || *text == 'E')) {
    ++text;
    text += *text == '+' || *text == '-';
    n = strspn(text, digits);
    text += n;
  }
  return n > 0u && *text == '\0';
}

#define STORE(type, value) \
  do { \
    const type stored = (type)(value); \
    memcpy(to, &stored, sizeof(stored)); \
  } while (false)

#define STORE_INTEGER(type, wide, parse) \
  do { \
    const wide number = parse(text, NULL, 10); \
    if ((wide)(type)number != number || errno == ERANGE || (is_below && number > 0)) { \
      fail("a number does not fit the type of its input"); \
    } \
    STORE(type, number); \
  } while (false)

static bool is_unsigned(uint32_t type)
{
  return type == FM_UINT8 || type == FM_UINT16 || type == FM_UINT32 || type == FM_UINT64;
}

static void store(uint32_t input, const char * cell)
{
  const struct fm_input * const item = &TEST_MONITOR()->inputs[input];
  char * const to = (char *)&inputs + item->offset;
  const char * const text = named_value(input, cell);
  if (item->type == FM_BOOL) {
    const bool is_true = strcmp(text, "1") == 0 || is_word(text, "true");
    if (!is_true && strcmp(text, "0") != 0 && !is_word(text, "false")) {
      fail("a bool is 0, 1, false or true");
    }
    memcpy(to, &is_true, sizeof(is_true));
    return;
  }
  const bool is_real = item->type == FM_FLOAT32 || item->type == FM_FLOAT64;
  if (!is_decimal(text, !is_real)) {
    fail(is_real ? "a cell is no decimal number" : "a cell is no whole decimal number");
  }
  const bool is_below = is_unsigned(item->type) && *text == '-';  // strtoull would wrap around
  errno = 0;
  switch (item->type) {
    case FM_INT8: STORE_INTEGER(int8_t, long long, strtoll); break;
    case FM_INT16: STORE_INTEGER(int16_t, long long, strtoll); break;
    case FM_INT32: STORE_INTEGER(int32_t, long long, strtoll); break;
    case FM_INT64: STORE_INTEGER(int64_t, long long, strtoll); break;
    case FM_UINT8: STORE_INTEGER(uint8_t, unsigned long long, strtoull); break;
    case FM_UINT16: STORE_INTEGER(uint16_t, unsigned long long, strtoull); break;
    case FM_UINT32: STORE_INTEGER(uint32_t, unsigned long long, strtoull); break;
    case FM_UINT64: STORE_INTEGER(uint64_t, unsigned long long, strtoull); break;
    case FM_FLOAT32: STORE(float, strtof(text, NULL)); break;
    default: STORE(double, strtod(text, NULL)); break;
  }
}

// Reads the next row to the inputs; returns false at the end.
static bool read_row(int64_t * time)
{
  const int n = read_cells();
  if (n == 0) {
    return false;
  }
  ++run.n_rows;
  run.column = 0;
  if (n != run.n_columns) {
    fail("another number of cells than in the heading");
  }
  for (int column = 0; column < n; ++column) {
    run.column = column + 1;
    if (run.inputs[column] == TIME) {
      const int64_t before = *time;
      *time = nanoseconds(run.cells[column]);
      if (run.n_rows > 1 && *time <= before) {
        fail("a time is not after that of the row before");
      }
    } else if (run.inputs[column] != NO_INPUT) {
      store((uint32_t)run.inputs[column], run.cells[column]);
    }
  }
  return true;
}

// -- the verdicts --------------------------------------------------------------------------------

// Prints the line in run.row, or compares it.
static void give_line(void)
{
  if (run.verdicts == NULL) {
    puts(run.row);
    return;
  }
  if (fgets(run.expected, ROW_BYTES, run.verdicts) == NULL) {
    fail("more verdicts than expected");
  }
  run.expected[strcspn(run.expected, "\r\n")] = '\0';
  if (strcmp(run.row, run.expected) != 0) {
    printf("expected %s\n     got %s\n", run.expected, run.row);
    fail("verdicts differ");
  }
}

static void give_verdicts(const char * first)
{
  size_t length = strlen(first);
  memcpy(run.row, first, length);
  for (uint32_t i = 0u; i < TEST_REQUIREMENTS; ++i) {
    run.row[length++] = ',';
    run.row[length++] = verdicts[i] ? '1' : '0';
  }
  run.row[length] = '\0';
  give_line();
}

#if TEST_IS_TIMED

static bool before[TEST_VERDICTS];

static void give_seconds(int64_t time)
{
  static char text[40];
  const uint64_t size = time < 0 ? 0u - (uint64_t)time : (uint64_t)time;
  int length = sprintf(
    text, "%s%llu.%09llu", time < 0 ? "-" : "",
    (unsigned long long)(size / (uint64_t)NS_PER_S),
    (unsigned long long)(size % (uint64_t)NS_PER_S));
  while (text[length - 1] == '0') {
    --length;
  }
  length -= text[length - 1] == '.';
  text[length] = '\0';
  give_verdicts(text);
}

static int64_t evaluate(int64_t start, int64_t time, bool is_row)
{
  memcpy(before, verdicts, sizeof(before));
  const int64_t next = TEST_STEP(&state, &inputs, verdicts, time - start);
  if (is_row || memcmp(before, verdicts, TEST_REQUIREMENTS * sizeof(bool)) != 0) {
    give_seconds(time);
  }
  return next == FM_NEVER ? FM_NEVER : start + next;
}

static void run_all(void)
{
  static TEST_INPUTS held;
  int64_t start = 0, due = FM_NEVER, time = 0;
  for (bool is_first = true; read_row(&time); is_first = false) {
    const TEST_INPUTS read = inputs;
    if (is_first) {
      start = time;
    }
    inputs = held;
    while (due < time) {
      due = evaluate(start, due, false);
    }
    held = inputs = read;
    due = evaluate(start, time, true);
  }
}

#else

static void run_all(void)
{
  static char text[24];
  int64_t time = 0;
  for (long step = 0; read_row(&time); ++step) {
    TEST_STEP(&state, &inputs, verdicts);
    sprintf(text, "%ld", step);
    give_verdicts(text);
  }
}

#endif

static FILE * opened(const char * path)
{
  FILE * const file = fopen(path, "r");
  if (file == NULL) {
    perror(path);
    exit(2);
  }
  return file;
}

int main(int n_arguments, char ** arguments)
{
  run.trace = n_arguments > 1 ? opened(arguments[1]) : stdin;
  run.verdicts = n_arguments > 2 ? opened(arguments[2]) : NULL;
  TEST_RESET(&state);
  read_heading();
  strcpy(run.row, test_heading);
  give_line();
  run_all();
  if (run.verdicts != NULL && fgets(run.expected, ROW_BYTES, run.verdicts) != NULL) {
    fail("fewer verdicts than expected");
  }
  return 0;
}
