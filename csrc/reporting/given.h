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

/// given.h: the values of parameters, as they were given, and those that cannot be used, in words.
///
/// Any thread.

#ifndef GIVEN_H_
#define GIVEN_H_

#include "text.h"

/// Types as those of rcl_interfaces/msg/ParameterType; all lists are one.
enum fm_parameter_type
{
  FM_UNSET = 0,
  FM_TRUTH = 1,
  FM_WHOLE = 2,
  FM_REAL = 3,
  FM_WORD = 4,
  FM_LIST = 5
};

/// A parameter and its value: the member of its type.
struct fm_given
{
  const char * name;
  uint32_t type;  // enum fm_parameter_type
  bool is_true;
  int64_t whole;
  double real;
  const char * word;
};

/// Add the line "parameter 'NAME' is VALUE, and has to be WANTED" to a text that may have others,
/// with the value as YAML writes it.
void fm_text_refuse(
  struct fm_text * text, const struct fm_given * given, const char * wanted);

#endif  // GIVEN_H_
