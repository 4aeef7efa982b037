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

// @NAME@_app_msgstruct.h: the messages of the application itself.

#ifndef @UPPER@_APP_MSGSTRUCT_H_
#define @UPPER@_APP_MSGSTRUCT_H_

#include "cfe_msg_hdr.h"

#define @UPPER@_APP_N_TOPICS @TOPICS@
#define @UPPER@_APP_N_REQUIREMENTS @REQUIREMENT_COUNT@

// Of all commands, of a request for housekeeping, and of a wakeup.
typedef struct
{
  CFE_MSG_CommandHeader_t CommandHeader;
} @UPPER@_APP_NoArgsCmd_t;

// The counters of a requirement, since the start of the application.
typedef struct
{
  uint32 Steps;       // under the policy timed: evaluations
  uint32 Violations;  // steps whose verdict was false, and timeouts that violated
  uint32 Announced;   // events, also those that were lost
  uint8 IsViolated;   // at the last step
  uint8 Spare[3];
} @UPPER@_APP_Requirement_t;

typedef struct
{
  uint8 CommandCounter;
  uint8 CommandErrorCounter;
  uint16 MessageErrorCounter;  // messages of topics with another length than their struct
  uint32 LostEvents;  // of violations, that the event service did not send
  uint32 Messages[@UPPER@_APP_N_TOPICS];  // by topic, see @NAME@_app_messages.h
  @UPPER@_APP_Requirement_t Requirements[@UPPER@_APP_N_REQUIREMENTS];  // in the bundle's order
} @UPPER@_APP_HkTlm_Payload_t;

typedef struct
{
  CFE_MSG_TelemetryHeader_t TelemetryHeader;
  @UPPER@_APP_HkTlm_Payload_t Payload;
} @UPPER@_APP_HkTlm_t;

#endif  // @UPPER@_APP_MSGSTRUCT_H_
