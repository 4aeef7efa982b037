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

/// spelling.h: names that are the same for FRET, and names that are spelled alike.
///
/// Any thread.

#ifndef SPELLING_H_
#define SPELLING_H_

#include "text.h"

/// Add a name as FRET writes it in formulas: `a.b` becomes `a_DOT_b`. As `fret_name` of
/// `model/names.py`. O(characters).
void fm_text_add_spelled(struct fm_text * text, const char * name);

/// Whether FRET takes two names for one. O(characters).
bool fm_is_same_name(const char * one, const char * other);

/// Add "did you mean 'A' or 'B'?" with at most three of `n` names: those that are spelled most
/// like a name, as `did_you_mean` of `model/diagnostics.py` finds them. Returns false, and adds
/// nothing, if none is. O(n * characters^4).
bool fm_text_add_hint(
  struct fm_text * text, const char * name, const char * const * names, uint32_t n);

#endif  // SPELLING_H_
