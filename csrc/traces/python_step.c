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

/// python_step.c: a function of Python that takes a row and returns a margin. A call through cffi
/// would take many times as long as the step.

#include <stddef.h>
#include <string.h>

#include "fret_monitor.h"

// Of Python's stable C interface, whose headers a robot need not have.
extern void * PyTuple_GetItem(void * tuple, ptrdiff_t place);
extern char * PyByteArray_AsString(void * bytes);
extern void * PyFloat_FromDouble(double value);
extern double PyFloat_AsDouble(void * object);
extern long long PyLong_AsLongLong(void * object);
extern unsigned long long PyLong_AsUnsignedLongLong(void * object);
extern void * PyNumber_Index(void * object);
extern void Py_DecRef(void * object);
extern void * PyErr_Occurred(void);
extern void PyErr_Clear(void);
extern void PyErr_SetString(void * type, const char * text);
extern void * PyExc_TypeError;
extern void * PyExc_ValueError;
extern void * PyExc_OverflowError;
extern void * PyExc_RuntimeError;

/// What a step needs. The tuple keeps alive all that it points to.
struct fm_python_step
{
  const struct fm_group * group;    // of the requirement
  void * state;                     // was reset
  bool * verdicts;
  const struct fm_margin * margin;  // of the requirement, in the state
  void * inputs;                    // of the last step
  void * next;                      // of the step that begins
  void * const * cells;             // a value: where `next` has it
  const uint8_t * types;            // a value: enum fm_type
  uint64_t inputs_bytes;
  uint64_t n_values;
  int64_t start;                    // of ticks: the time of the first row
  int64_t last;                     // of ticks: the last tick; -1: none
  int64_t due;                      // of ticks: what step_at returned
  uint64_t turn;                    // grows where a call begins or ends to store a row
};

FM_EXPORT void * fm_python_step(void * self, void * const * arguments, ptrdiff_t n);

static bool fits(bool is_inside)
{
  if (!is_inside) {
    PyErr_SetString(PyExc_OverflowError, "the value is outside the range of the input's type");
  }
  return is_inside;
}

// Store an integer of Python; returns whether it could.
#define STORE_INTEGER(type, least, most) \
  const long long value = PyLong_AsLongLong(object); \
  if ((value == -1 && PyErr_Occurred() != NULL) || !fits(value >= (least) && value <= (most))) { \
    return false; \
  } \
  *(type *)cell = (type)value; \
  return true;

// Booleans of other packages are no integers, but numbers.
static bool store_truth(uint8_t * cell, void * object)
{
  double value = (double)PyLong_AsLongLong(object);
  if (value == -1.0 && PyErr_Occurred() != NULL) {
    PyErr_Clear();
    value = PyFloat_AsDouble(object);
  }
  if (PyErr_Occurred() != NULL || !fits(value == 0.0 || value == 1.0)) {
    return false;
  }
  *cell = value == 1.0;
  return true;
}

static bool store_uint64(uint64_t * cell, void * object)
{
  void * const whole = PyNumber_Index(object);
  if (whole == NULL) {
    return false;
  }
  *cell = PyLong_AsUnsignedLongLong(whole);
  Py_DecRef(whole);
  return *cell != UINT64_MAX || PyErr_Occurred() == NULL;
}

// Store a value of Python as one of the input's type. Returns false with an error of Python.
static bool store(void * cell, uint8_t type, void * object)
{
  switch ((enum fm_type)type) {
    case FM_BOOL: return store_truth(cell, object);
    case FM_INT8: { STORE_INTEGER(int8_t, INT8_MIN, INT8_MAX) }
    case FM_INT16: { STORE_INTEGER(int16_t, INT16_MIN, INT16_MAX) }
    case FM_INT32: { STORE_INTEGER(int32_t, INT32_MIN, INT32_MAX) }
    case FM_INT64: { STORE_INTEGER(int64_t, INT64_MIN, INT64_MAX) }
    case FM_UINT8: { STORE_INTEGER(uint8_t, 0, UINT8_MAX) }
    case FM_UINT16: { STORE_INTEGER(uint16_t, 0, UINT16_MAX) }
    case FM_UINT32: { STORE_INTEGER(uint32_t, 0, (long long)UINT32_MAX) }
    case FM_UINT64: return store_uint64(cell, object);
    case FM_FLOAT32:
    case FM_FLOAT64:
      break;
  }
  const double value = PyFloat_AsDouble(object);
  if (value == -1.0 && PyErr_Occurred() != NULL) {
    return false;
  }
  if ((enum fm_type)type == FM_FLOAT64) {
    *(double *)cell = value;
  } else {
    *(float *)cell = (float)value;
  }
  return true;
}

// Store the values of a row. A value may be converted by code in Python; meanwhile another call
// may store its row. Returns false with an error of Python.
static bool store_row(struct fm_python_step * s, void * const * values)
{
  const uint64_t turn = ++s->turn;
  bool is_stored = true;
  for (uint64_t i = 0; is_stored && i < s->n_values; ++i) {
    is_stored = store(s->cells[i], s->types[i], values[i]);
  }
  if (is_stored && s->turn != turn) {
    PyErr_SetString(PyExc_RuntimeError, "while a value was converted, another call began: give "
      "numbers, as in float(value)");
    is_stored = false;
  }
  ++s->turn;
  return is_stored;
}

// Take what is due before a tick, then the tick. Returns false with an error of Python.
static bool step_at(struct fm_python_step * s, int64_t now)
{
  s->start = s->last < 0 ? now : s->start;
  const int64_t tick = (int64_t)((uint64_t)now - (uint64_t)s->start);
  if (tick <= s->last || tick > FM_LAST_TICK) {
    PyErr_SetString(PyExc_ValueError, now <= s->start || (tick >= 0 && tick <= s->last) ?
      "the time is not after that of the row before" :
      "the time is more than 146 years after that of the first row");
    return false;
  }
  while (s->due < tick) {
    s->due = s->group->step_at(s->state, s->inputs, s->verdicts, s->due);
  }
  memcpy(s->inputs, s->next, s->inputs_bytes);
  s->due = s->group->step_at(s->state, s->inputs, s->verdicts, tick);
  s->last = tick;
  return true;
}

/// Take a row. self: a tuple whose first item is a bytearray with a struct fm_python_step;
/// arguments: a value of each input, under `timed` after the time. Returns a new float, or NULL
/// with an error of Python, of an argument or of memory; of an argument no row was taken. Holds
/// Python's interpreter lock. O(evaluations x operations).
void * fm_python_step(void * self, void * const * arguments, ptrdiff_t n)
{
  struct fm_python_step * const s =
    (struct fm_python_step *)(void *)PyByteArray_AsString(PyTuple_GetItem(self, 0));
  const bool is_timed = s->group->step == NULL;
  int64_t now = 0;
  if (n < 0 || (uint64_t)n != s->n_values + is_timed) {
    PyErr_SetString(PyExc_TypeError, is_timed ?
      "a step takes the time and a value of each input" : "a step takes a value of each input");
    return NULL;
  }
  if (is_timed && !store(&now, FM_INT64, arguments[0])) {
    return NULL;
  }
  if (!store_row(s, arguments + is_timed)) {
    return NULL;
  }
  if (!is_timed) {
    s->group->step(s->state, s->next, s->verdicts);
  } else if (!step_at(s, now)) {
    return NULL;
  }
  return PyFloat_FromDouble(s->margin->value);
}
