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

/// lines.c: see lines.h for the contract.

#include "lines.h"

#include <stdlib.h>

void fm_lines_add(struct fm_lines * lines, enum fm_level level, const char * format, ...)
{
  struct fm_text text = {NULL, 0, 0};
  va_list arguments;
  va_start(arguments, format);
  fm_text_add_arguments(&text, format, arguments);
  va_end(arguments);
  struct fm_line * moved = text.bytes == NULL ? NULL :
    fm_with_room(lines->lines, lines->n, &lines->capacity, sizeof(*lines->lines));
  if (moved == NULL) {
    fm_text_free(&text);
    return;
  }
  lines->lines = moved;
  lines->lines[lines->n++] = (struct fm_line) {(uint32_t)level, text.bytes};
}

bool fm_passes(int64_t * next, int64_t now, int64_t interval)
{
  if (now < *next) {
    return false;
  }
  *next = now + interval;
  return true;
}

bool fm_is_due(int64_t * next, int64_t now, int64_t interval)
{
  if (now < *next) {
    return false;
  }
  *next += ((now - *next) / interval + 1) * interval;
  return true;
}

void fm_lines_clear(struct fm_lines * lines)
{
  for (uint32_t k = 0; k < lines->n; ++k) {
    free(lines->lines[k].text);
  }
  lines->n = 0;
}

void fm_lines_free(struct fm_lines * lines)
{
  fm_lines_clear(lines);
  free(lines->lines);
  *lines = (struct fm_lines) {NULL, 0, 0};
}

// ---- statuses ----------------------------------------------------------------------------------

static void free_status(struct fm_status * status)
{
  for (uint32_t k = 0; k < status->n_values; ++k) {
    free(status->values[k].key);
    free(status->values[k].value);
  }
  free(status->values);
  free(status->name);
  free(status->message);
  free(status->hardware_id);
}

struct fm_status * fm_statuses_add(
  struct fm_statuses * list, enum fm_status_level level, const char * name, const char * message,
  const char * hardware_id)
{
  struct fm_status * moved =
    fm_with_room(list->statuses, list->n, &list->capacity, sizeof(*list->statuses));
  if (moved == NULL) {
    return NULL;
  }
  list->statuses = moved;
  struct fm_status * status = &moved[list->n];
  *status = (struct fm_status) {
    (uint8_t)level, fm_copy_of(name), fm_copy_of(message), fm_copy_of(hardware_id), NULL, 0, 0};
  if (status->name == NULL || status->message == NULL || status->hardware_id == NULL) {
    free_status(status);
    return NULL;
  }
  list->n += 1u;
  return status;
}

void fm_status_value(struct fm_status * status, const char * key, const char * format, ...)
{
  struct fm_text text = {NULL, 0, 0};
  va_list arguments;
  if (status == NULL) {
    return;
  }
  va_start(arguments, format);
  fm_text_add_arguments(&text, format, arguments);
  va_end(arguments);
  struct fm_key_value * moved =
    fm_with_room(status->values, status->n_values, &status->capacity, sizeof(*status->values));
  char * named = moved == NULL ? NULL : fm_copy_of(key);
  char * value = text.bytes != NULL ? text.bytes : fm_copy_of("");
  if (moved != NULL) {
    status->values = moved;
  }
  if (named == NULL || value == NULL) {
    free(named);
    free(value);
    return;
  }
  status->values[status->n_values++] = (struct fm_key_value) {named, value};
}

void fm_status_text(struct fm_status * status, const char * key, struct fm_text * text)
{
  fm_status_value(status, key, "%s", fm_text_get(text));
  fm_text_clear(text);
}

void fm_statuses_clear(struct fm_statuses * list)
{
  for (uint32_t k = 0; k < list->n; ++k) {
    free_status(&list->statuses[k]);
  }
  list->n = 0;
}

void fm_statuses_free(struct fm_statuses * list)
{
  fm_statuses_clear(list);
  free(list->statuses);
  *list = (struct fm_statuses) {NULL, 0, 0};
}
