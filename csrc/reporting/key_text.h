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

/// key_text.h: variables and keys of instances, as people read them. Functions as of text.h.

#ifndef KEY_TEXT_H_
#define KEY_TEXT_H_

#include "report_table.h"
#include "text.h"

/// Add the variable of a kind, or both: robot; robot and track.
FM_INTERNAL void fm_add_variables(struct fm_text * text, const struct fm_report_kind * about);

/// Add a key: alpha; of a pair, alpha/3. Nothing if its size is 0.
FM_INTERNAL void fm_add_key(
  struct fm_text * text, const struct fm_report_kind * about, const uint8_t * key, size_t size);

/// Add the variable and the key, or both of each: robot=alpha; robot=alpha,track=3.
FM_INTERNAL void fm_add_named_key(
  struct fm_text * text, const struct fm_report_kind * about, const uint8_t * key, size_t size);

#endif  // KEY_TEXT_H_
