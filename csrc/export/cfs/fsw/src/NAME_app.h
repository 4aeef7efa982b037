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

// @NAME@_app.h: what the files of the application share.

#ifndef @UPPER@_APP_H_
#define @UPPER@_APP_H_

#include "cfe.h"

#include "@NAME@_app_fcncodes.h"
#include "@NAME@_app_msgids.h"
#include "@NAME@_app_msgstruct.h"
#include "@NAME@_app_platform_cfg.h"
#include "@NAME@_runner.h"

// The event of a requirement's violations.
typedef struct
{
  uint16 EventId;
  CFE_EVS_EventType_Enum_t EventType;
  const char * Id;
} @UPPER@_APP_Violation_t;

// ---- @NAME@_app.c

void @UPPER@_APP_Main(void);

// Write the seconds since a telemetry message was stamped. Returns false if it has no time.
bool @UPPER@_APP_GetAge(const CFE_MSG_Message_t * MsgPtr, double * Age);

// ---- @NAME@_app_map.c, which is generated

extern const @UPPER@_APP_Violation_t @UPPER@_APP_Violations[@UPPER@_APP_N_REQUIREMENTS];
extern const char * const @UPPER@_APP_InputNames[];

// The message identifier of a topic, and the length of its messages in bytes.
CFE_SB_MsgId_Atom_t @UPPER@_APP_GetTopicMsgId(uint32 Topic);
size_t @UPPER@_APP_GetTopicSize(uint32 Topic);

// The topic of a message identifier; @UPPER@_APP_N_TOPICS if it is none of a topic.
uint32 @UPPER@_APP_FindTopic(CFE_SB_MsgId_Atom_t MsgId);

// Store the inputs that a message of a topic has.
void @UPPER@_APP_StoreInputs(
  struct @NAME@_runner * Runner, uint32 Topic, const CFE_SB_Buffer_t * BufPtr);

#endif  // @UPPER@_APP_H_
