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

// Stub: what an application uses of cFE 7 (tag equuleus, 2025). Signatures are those of cfe_es.h,
// cfe_evs.h, cfe_msg.h, cfe_sb.h and cfe_time.h; cfs_main.c defines the functions.

#ifndef CFE_H
#define CFE_H

#include "cfe_msg_hdr.h"

typedef int32 CFE_Status_t;
#define CFE_SUCCESS ((CFE_Status_t)0)
#define CFE_EVS_APP_SQUELCHED ((CFE_Status_t)0xc2000009)
#define CFE_MSG_WRONG_MSG_TYPE ((CFE_Status_t)0xca000014)
#define CFE_SB_TIME_OUT ((CFE_Status_t)0xca000001)
#define CFE_SB_NO_MESSAGE ((CFE_Status_t)0xca000002)

enum {CFE_ES_RunStatus_APP_RUN = 1, CFE_ES_RunStatus_APP_ERROR = 3};
bool CFE_ES_RunLoop(uint32 * RunStatus);
void CFE_ES_ExitApp(uint32 ExitStatus);
CFE_Status_t CFE_ES_WriteToSysLog(const char * SpecStringPtr, ...)
__attribute__((format(printf, 1, 2)));
void CFE_ES_PerfLogAdd(uint32 Marker, uint32 EntryExit);
#define CFE_ES_PerfLogEntry(id) (CFE_ES_PerfLogAdd(id, 0))
#define CFE_ES_PerfLogExit(id) (CFE_ES_PerfLogAdd(id, 1))

enum {
  CFE_EVS_EventType_DEBUG = 1, CFE_EVS_EventType_INFORMATION = 2, CFE_EVS_EventType_ERROR = 3
};
typedef uint16 CFE_EVS_EventType_Enum_t;
enum {CFE_EVS_EventFilter_BINARY = 0};
CFE_Status_t CFE_EVS_Register(const void * Filters, uint16 NumEventFilters, uint16 FilterScheme);
CFE_Status_t CFE_EVS_SendEvent(
  uint16 EventID, CFE_EVS_EventType_Enum_t EventType, const char * Spec, ...)
__attribute__((format(printf, 3, 4)));

typedef struct CFE_TIME_SysTime
{
  uint32 Seconds;
  uint32 Subseconds;
} CFE_TIME_SysTime_t;
CFE_TIME_SysTime_t CFE_TIME_GetTime(void);
CFE_TIME_SysTime_t CFE_TIME_GetMET(void);

typedef struct
{
  int64 ticks;  // of 100 ns
} OS_time_t;
void CFE_PSP_GetTime(OS_time_t * LocalTime);

static inline int64 OS_TimeGetTotalNanoseconds(OS_time_t tm)
{
  return tm.ticks * 100;
}

typedef uint32 CFE_SB_MsgId_Atom_t;
typedef struct
{
  CFE_SB_MsgId_Atom_t Value;
} CFE_SB_MsgId_t;
#define CFE_SB_INVALID_MSG_ID ((CFE_SB_MsgId_t){0})
typedef size_t CFE_MSG_Size_t;
typedef uint16 CFE_MSG_FcnCode_t;
CFE_Status_t CFE_MSG_Init(CFE_MSG_Message_t * MsgPtr, CFE_SB_MsgId_t MsgId, CFE_MSG_Size_t Size);
CFE_Status_t CFE_MSG_GetSize(const CFE_MSG_Message_t * MsgPtr, CFE_MSG_Size_t * Size);
CFE_Status_t CFE_MSG_GetFcnCode(const CFE_MSG_Message_t * MsgPtr, CFE_MSG_FcnCode_t * FcnCode);
CFE_Status_t CFE_MSG_GetMsgTime(const CFE_MSG_Message_t * MsgPtr, CFE_TIME_SysTime_t * Time);
CFE_Status_t CFE_MSG_GetMsgId(const CFE_MSG_Message_t * MsgPtr, CFE_SB_MsgId_t * MsgId);

typedef union CFE_SB_Msg
{
  CFE_MSG_Message_t Msg;
  long long int LongInt;
  long double LongDouble;
} CFE_SB_Buffer_t;
typedef uint32 CFE_SB_PipeId_t;
typedef struct
{
  uint8 Priority;
  uint8 Reliability;
} CFE_SB_Qos_t;
#define CFE_SB_DEFAULT_QOS ((CFE_SB_Qos_t){0})
#define CFE_SB_PEND_FOREVER -1
#define CFE_SB_POLL 0
CFE_Status_t CFE_SB_CreatePipe(CFE_SB_PipeId_t * PipeIdPtr, uint16 Depth, const char * PipeName);
CFE_Status_t CFE_SB_SubscribeEx(
  CFE_SB_MsgId_t MsgId, CFE_SB_PipeId_t PipeId, CFE_SB_Qos_t Quality, uint16 MsgLim);
CFE_Status_t CFE_SB_ReceiveBuffer(
  CFE_SB_Buffer_t ** BufPtr, CFE_SB_PipeId_t PipeId, int32 TimeOut);
CFE_Status_t CFE_SB_TransmitMsg(const CFE_MSG_Message_t * MsgPtr, bool IsOrigination);
void CFE_SB_TimeStampMsg(CFE_MSG_Message_t * MsgPtr);

static inline CFE_SB_MsgId_Atom_t CFE_SB_MsgIdToValue(CFE_SB_MsgId_t MsgId)
{
  return MsgId.Value;
}

static inline CFE_SB_MsgId_t CFE_SB_ValueToMsgId(CFE_SB_MsgId_Atom_t MsgIdValue)
{
  return (CFE_SB_MsgId_t){MsgIdValue};
}

#endif  // CFE_H
