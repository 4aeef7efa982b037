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

// @COMPONENT@.cpp: the time, resets, and what the runner calls back.

#include "@COMPONENT@.hpp"

namespace Fret
{

namespace
{

const I64 NS_PER_S = 1000000000;
const I64 NS_PER_US = 1000;

// The policy periodic: each call of `run` is the end of a period.
const bool HAS_PERIODS = @HAS_PERIODS@ != 0;

}  // namespace

@COMPONENT@::@COMPONENT@(const char * const compName)
: @COMPONENT@ComponentBase(compName), m_runner(), m_isStarted(false)
{
}

// The time begins with the first call of a port.
I64 @COMPONENT@::startedNow()
{
  const Fw::Time time = this->getTime();
  const I64 now = static_cast<I64>(time.getSeconds()) * NS_PER_S +
    static_cast<I64>(time.getUSeconds()) * NS_PER_US;
  if (!m_isStarted) {
    m_isStarted = @NAME@_runner_start(
      &m_runner, now, &@COMPONENT@::announce, &@COMPONENT@::changeSilence, this);
    FW_ASSERT(m_isStarted);  // the files of the export match
  }
  return now;
}

void @COMPONENT@::arrive()
{
  @NAME@_runner_arrive(&m_runner, this->startedNow());
}

void @COMPONENT@::run_handler(FwIndexType portNum, U32 context)
{
  (void)portNum;
  (void)context;
  const I64 now = this->startedNow();
  if (HAS_PERIODS) {
    @NAME@_runner_period(&m_runner, now);
  } else {
    @NAME@_runner_advance(&m_runner, now);
  }
  this->writeCounters();
}

void @COMPONENT@::RESET_cmdHandler(FwOpcodeType opCode, U32 cmdSeq)
{
  @NAME@_runner_reset(&m_runner, this->startedNow());
  this->cmdResponse_out(opCode, cmdSeq, Fw::CmdResponse::OK);
}

U32 @COMPONENT@::violations(U32 requirement) const
{
  return static_cast<U32>(@NAME@_runner_requirement(&m_runner, requirement).violations);
}

void @COMPONENT@::announce(void * context, const struct fm_violation * found)
{
  static_cast<@COMPONENT@ *>(context)->reportViolation(
    found->requirement, static_cast<U64>(found->stamp));
}

void @COMPONENT@::changeSilence(void * context, uint32_t input, bool isSilent)
{
  static_cast<@COMPONENT@ *>(context)->reportSilence(input, isSilent);
}

}  // namespace Fret
