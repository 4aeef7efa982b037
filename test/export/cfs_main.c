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

// A software bus for the applications of target `cfs`, on one clock that only messages move.
//
//   program NUMBER [EVENTS] < script
//
// runs an application, of which at most EVENTS are sent in a second. A line of the script is the
// time in nanoseconds, a message identifier in hexadecimal, a function code, the time since the
// message was stamped (ns), and the bytes behind the first header in hexadecimal, or -. An
// identifier of 0 ends it. Events and telemetry are printed, each with the time.

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cfe.h"

#include "apps.inc"

enum { MOST_BYTES = 4096, MOST_IDS = 64, SIZE_OF_HEADER = 6, TICK = 100 };

static int64_t now;
static unsigned most_in_second = 1000000;  // events that are not dropped
static bool is_over;
static unsigned n_reads;  // of the pipe
static uint32 subscribed[MOST_IDS];
static uint32 n_subscribed;

// The message to receive.
static struct
{
  union {CFE_SB_Buffer_t align; unsigned char bytes[MOST_BYTES];} buffer;
  size_t size;
  uint32 id;
  uint16 code;
  int64_t time;
  int64_t stamp;
  bool is_read;
} next;

static CFE_TIME_SysTime_t system_time(int64_t ns)
{
  const uint64_t part = (uint64_t)(ns % 1000000000) << 32;
  return (CFE_TIME_SysTime_t){
    (uint32)(ns / 1000000000), (uint32)((part + 999999999u) / 1000000000u)};
}

static void check(bool condition, const char * what)
{
  if (!condition) {
    fprintf(stderr, "%s\n", what);
    exit(1);
  }
}

static void read_next(void)
{
  static char text[2 * MOST_BYTES];
  unsigned id, code;
  long long time, age;
  if (next.is_read) {
    return;
  }
  check(scanf("%lld %x %u %lld %8000s", &time, &id, &code, &age, text) == 5, "script");
  next.id = id;
  next.code = (uint16)code;
  next.time = time;
  next.stamp = time - age;
  next.is_read = true;
  next.size = SIZE_OF_HEADER;
  for (const char * at = text; *at != '-' && *at != '\0'; at += 2) {
    unsigned byte;
    sscanf(at, "%2x", &byte);
    next.buffer.bytes[next.size++] = (unsigned char)byte;
  }
}

bool CFE_ES_RunLoop(uint32 * RunStatus)
{
  return !is_over && *RunStatus == CFE_ES_RunStatus_APP_RUN;
}

void CFE_ES_ExitApp(uint32 ExitStatus)
{
  printf("reads %u\n", n_reads);
  printf("exit %u\n", (unsigned)ExitStatus);
}

CFE_Status_t CFE_ES_WriteToSysLog(const char * SpecStringPtr, ...)
{
  (void)SpecStringPtr;
  return CFE_SUCCESS;
}

void CFE_ES_PerfLogAdd(uint32 Marker, uint32 EntryExit)
{
  (void)Marker;
  (void)EntryExit;
}

CFE_Status_t CFE_EVS_Register(const void * Filters, uint16 NumEventFilters, uint16 FilterScheme)
{
  (void)Filters;
  (void)NumEventFilters;
  (void)FilterScheme;
  return CFE_SUCCESS;
}

CFE_Status_t CFE_EVS_SendEvent(
  uint16 EventID, CFE_EVS_EventType_Enum_t EventType, const char * Spec, ...)
{
  static int64_t second;
  static unsigned in_second;
  va_list arguments;
  in_second = second == now / 1000000000 ? in_second + 1 : 1;
  second = now / 1000000000;
  if (in_second > most_in_second) {
    return CFE_EVS_APP_SQUELCHED;
  }
  va_start(arguments, Spec);
  printf("%lld event %u %u ", (long long)now, (unsigned)EventID, (unsigned)EventType);
  vprintf(Spec, arguments);
  printf("\n");
  va_end(arguments);
  return CFE_SUCCESS;
}

// As in cFE 7 on Linux: each tone corrects the mission elapsed time, the first one by most of a
// second. The spacecraft time is later by an hour.
static int64_t mission_time(void)
{
  const int64_t corrected = now / 1000000000 % 2 * -40000;
  return now + INT64_C(2000000000) + (now < 1000000000 ? 947321000 : corrected);
}

CFE_TIME_SysTime_t CFE_TIME_GetMET(void)
{
  return system_time(mission_time());
}

CFE_TIME_SysTime_t CFE_TIME_GetTime(void)
{
  return system_time(now + INT64_C(3600000000000));
}

void CFE_PSP_GetTime(OS_time_t * LocalTime)
{
  LocalTime->ticks = now / 100;
}

CFE_Status_t CFE_MSG_Init(CFE_MSG_Message_t * MsgPtr, CFE_SB_MsgId_t MsgId, CFE_MSG_Size_t Size)
{
  memcpy(MsgPtr->Bytes, &MsgId.Value, sizeof(MsgId.Value));
  MsgPtr->Bytes[4] = (uint8)(Size >> 8);
  MsgPtr->Bytes[5] = (uint8)Size;
  return CFE_SUCCESS;
}

CFE_Status_t CFE_MSG_GetSize(const CFE_MSG_Message_t * MsgPtr, CFE_MSG_Size_t * Size)
{
  check(MsgPtr == &next.buffer.align.Msg, "another message");
  *Size = next.size;
  return CFE_SUCCESS;
}

CFE_Status_t CFE_MSG_GetFcnCode(const CFE_MSG_Message_t * MsgPtr, CFE_MSG_FcnCode_t * FcnCode)
{
  check(MsgPtr == &next.buffer.align.Msg, "another message");
  *FcnCode = next.code;
  return CFE_SUCCESS;
}

CFE_Status_t CFE_MSG_GetMsgTime(const CFE_MSG_Message_t * MsgPtr, CFE_TIME_SysTime_t * Time)
{
  check(MsgPtr == &next.buffer.align.Msg, "another message");
  *Time = system_time(next.stamp + INT64_C(3600000000000));
  return next.code == 0 ? CFE_SUCCESS : CFE_MSG_WRONG_MSG_TYPE;
}

CFE_Status_t CFE_MSG_GetMsgId(const CFE_MSG_Message_t * MsgPtr, CFE_SB_MsgId_t * MsgId)
{
  check(MsgPtr == &next.buffer.align.Msg, "another message");
  MsgId->Value = next.id;
  return CFE_SUCCESS;
}

CFE_Status_t CFE_SB_CreatePipe(CFE_SB_PipeId_t * PipeIdPtr, uint16 Depth, const char * PipeName)
{
  check(Depth > 0 && strlen(PipeName) < 20, "pipe");
  *PipeIdPtr = 7;
  return CFE_SUCCESS;
}

CFE_Status_t CFE_SB_SubscribeEx(
  CFE_SB_MsgId_t MsgId, CFE_SB_PipeId_t PipeId, CFE_SB_Qos_t Quality, uint16 MsgLim)
{
  check(PipeId == 7 && Quality.Priority == 0 && MsgLim > 0 && n_subscribed < MOST_IDS, "pipe");
  subscribed[n_subscribed++] = MsgId.Value;
  return CFE_SUCCESS;
}

static bool is_subscribed(uint32 id)
{
  for (uint32 i = 0; i < n_subscribed; ++i) {
    if (subscribed[i] == id) {
      return true;
    }
  }
  return false;
}

// As in cFE 7: some of the timeout is over before the pipe is read, the rest is cut to whole
// milliseconds, and if nothing is left, the pipe is polled.
CFE_Status_t CFE_SB_ReceiveBuffer(CFE_SB_Buffer_t ** BufPtr, CFE_SB_PipeId_t PipeId, int32 TimeOut)
{
  const int64_t wait = TimeOut > 1 ? (TimeOut - 1) * INT64_C(1000000) : 0;
  check(PipeId == 7 && TimeOut >= CFE_SB_PEND_FOREVER, "timeout");
  n_reads += 1;
  read_next();
  if (TimeOut != CFE_SB_PEND_FOREVER && next.time > now + wait) {
    now += wait > 0 ? wait : TICK;
    return wait > 0 ? CFE_SB_TIME_OUT : CFE_SB_NO_MESSAGE;
  }
  now = next.time > now ? next.time : now;
  next.is_read = false;
  is_over = next.id == 0;
  if (is_over) {
    return CFE_SB_TIME_OUT;
  }
  check(is_subscribed(next.id), "not subscribed");
  *BufPtr = &next.buffer.align;
  return CFE_SUCCESS;
}

CFE_Status_t CFE_SB_TransmitMsg(const CFE_MSG_Message_t * MsgPtr, bool IsOrigination)
{
  const size_t size = (size_t)MsgPtr->Bytes[4] << 8 | MsgPtr->Bytes[5];
  check(IsOrigination, "origination");
  printf("%lld telemetry ", (long long)now);
  for (size_t i = sizeof(CFE_MSG_TelemetryHeader_t); i < size; ++i) {
    printf("%02x", ((const unsigned char *)MsgPtr)[i]);
  }
  printf("\n");
  return CFE_SUCCESS;
}

void CFE_SB_TimeStampMsg(CFE_MSG_Message_t * MsgPtr)
{
  (void)MsgPtr;
}

int main(int n_arguments, char ** arguments)
{
  check(n_arguments == 2 || n_arguments == 3, "usage: program NUMBER [EVENTS] < script");
  if (n_arguments == 3) {
    most_in_second = (unsigned)atoi(arguments[2]);
  }
  applications[atoi(arguments[1])]();
  return 0;
}
