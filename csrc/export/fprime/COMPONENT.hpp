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

/// @COMPONENT@.hpp: runs the monitors of @BUNDLE_IN_C@. All state is in the component.

#ifndef FRET_@UPPER@_MONITOR_HPP_
#define FRET_@UPPER@_MONITOR_HPP_

#include "@COMPONENT@ComponentAc.hpp"
#include "@NAME@_runner.h"

namespace Fret
{

class @COMPONENT@ : public @COMPONENT@ComponentBase
{
public:
  explicit @COMPONENT@(const char * const compName);
  ~@COMPONENT@() {}

private:
  // Of @COMPONENT@Ports.cpp, which is generated: a message of each topic.
@HANDLERS@

  // Report a violation, or an input that has become silent or has a value again.
  void reportViolation(U32 requirement, U64 stamp);
  void reportSilence(U32 input, bool isSilent);
  void writeCounters();

  // Of @COMPONENT@.cpp.
  void run_handler(FwIndexType portNum, U32 context);
  void RESET_cmdHandler(FwOpcodeType opCode, U32 cmdSeq);

  // Begin a message: what is due before it is taken.
  void arrive();
  I64 startedNow();
  U32 violations(U32 requirement) const;

  static void announce(void * context, const struct fm_violation * found);
  static void changeSilence(void * context, uint32_t input, bool isSilent);

  struct @NAME@_runner m_runner;
  bool m_isStarted;
};

}  // namespace Fret

#endif  // FRET_@UPPER@_MONITOR_HPP_
