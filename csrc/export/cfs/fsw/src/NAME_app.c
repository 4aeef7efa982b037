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

// @NAME@_app.c: receives messages and commands, and reports violations as events.

#include <string.h>

#include "@NAME@_app.h"
#include "@NAME@_app_eventids.h"
#include "@NAME@_app_perfids.h"

#define NS_PER_S INT64_C(1000000000)
#define NS_PER_MS INT64_C(1000000)
#define LONGEST_WAIT_MS INT64_C(3600000)

// The policy periodic: each wakeup is the end of a period.
#define HAS_PERIODS @HAS_PERIODS@

typedef struct
{
  uint32 RunStatus;
  CFE_SB_PipeId_t Pipe;
  uint8 CommandCounter;
  uint8 CommandErrorCounter;
  uint16 MessageErrorCounter;
  uint32 LostEvents;
  @UPPER@_APP_HkTlm_t HkTlm;
  struct @NAME@_runner Runner;
} @UPPER@_APP_Data_t;

static @UPPER@_APP_Data_t Data;

// ---- time --------------------------------------------------------------------------------------

static int64_t ToNanoseconds(CFE_TIME_SysTime_t Time)
{
  const uint64_t part = ((uint64_t)Time.Subseconds * (uint64_t)NS_PER_S) >> 32;
  return (int64_t)Time.Seconds * NS_PER_S + (int64_t)part;
}

// The clock of the PSP is monotonic. The mission elapsed time is not: each tone corrects it, by
// microseconds, and the first one by up to a second.
static int64_t GetNow(void)
{
  OS_time_t Now;
  CFE_PSP_GetTime(&Now);
  return OS_TimeGetTotalNanoseconds(Now);
}

// The mission elapsed time of an instant, as it is counted at present.
static int64_t ToMissionTime(int64_t Instant)
{
  return ToNanoseconds(CFE_TIME_GetMET()) - (GetNow() - Instant);
}

bool @UPPER@_APP_GetAge(const CFE_MSG_Message_t * MsgPtr, double * Age)
{
  CFE_TIME_SysTime_t Sent;
  if (CFE_MSG_GetMsgTime(MsgPtr, &Sent) != CFE_SUCCESS) {
    return false;
  }
  *Age = (double)(ToNanoseconds(CFE_TIME_GetTime()) - ToNanoseconds(Sent)) * 1e-9;
  return true;
}

// How long to wait for a message, in milliseconds, until something is due without one. The
// software bus waits up to a millisecond less, and does not wait at all for less than two.
static int32 GetTimeout(void)
{
  const int64_t Wake = @NAME@_runner_wake(&Data.Runner);
  const int64_t Now = GetNow();
  if (Wake == FM_NEVER) {
    return CFE_SB_PEND_FOREVER;
  }
  if (Wake <= Now) {
    return CFE_SB_POLL;
  }
  const int64_t Wait = (Wake - Now - 1) / NS_PER_MS + 2;
  return (int32)(Wait < LONGEST_WAIT_MS ? Wait : LONGEST_WAIT_MS);
}

// ---- events ------------------------------------------------------------------------------------

static void Announce(void * Context, const struct fm_violation * Found)
{
  const @UPPER@_APP_Violation_t * const Violation = &@UPPER@_APP_Violations[Found->requirement];
  (void)Context;
  const int64_t Stamp = ToMissionTime(Found->stamp);
  const CFE_Status_t Status = CFE_EVS_SendEvent(
    Violation->EventId, Violation->EventType, "%s violated at %lu.%09lu s", Violation->Id,
    (unsigned long)(Stamp / NS_PER_S), (unsigned long)(Stamp % NS_PER_S));
  if (Status != CFE_SUCCESS) {
    ++Data.LostEvents;  // squelched: the application sent too many in a second
  }
}

static void ReportSilence(void * Context, uint32_t Input, bool IsSilent)
{
  (void)Context;
  if (IsSilent) {
    CFE_EVS_SendEvent(
      @UPPER@_APP_SILENT_EID, CFE_EVS_EventType_INFORMATION, "input %s is silent",
      @UPPER@_APP_InputNames[Input]);
  } else {
    CFE_EVS_SendEvent(
      @UPPER@_APP_HEARD_EID, CFE_EVS_EventType_INFORMATION, "input %s has a new value",
      @UPPER@_APP_InputNames[Input]);
  }
}

// ---- commands and housekeeping -----------------------------------------------------------------

static void FillHousekeeping(@UPPER@_APP_HkTlm_Payload_t * Payload)
{
  Payload->CommandCounter = Data.CommandCounter;
  Payload->CommandErrorCounter = Data.CommandErrorCounter;
  Payload->MessageErrorCounter = Data.MessageErrorCounter;
  Payload->LostEvents = Data.LostEvents;
  for (uint32 i = 0; i < @UPPER@_APP_N_TOPICS; ++i) {
    Payload->Messages[i] = (uint32)@NAME@_runner_messages(&Data.Runner, i);
  }
  for (uint32 i = 0; i < @UPPER@_APP_N_REQUIREMENTS; ++i) {
    const struct fm_requirement_counts counts = @NAME@_runner_requirement(&Data.Runner, i);
    Payload->Requirements[i].Steps = (uint32)counts.steps;
    Payload->Requirements[i].Violations = (uint32)counts.violations;
    Payload->Requirements[i].Announced = (uint32)counts.announced;
    Payload->Requirements[i].IsViolated = counts.verdict ? 0 : 1;
  }
}

static void SendHousekeeping(void)
{
  CFE_Status_t Status;
  FillHousekeeping(&Data.HkTlm.Payload);
  CFE_SB_TimeStampMsg(CFE_MSG_PTR(Data.HkTlm.TelemetryHeader));
  Status = CFE_SB_TransmitMsg(CFE_MSG_PTR(Data.HkTlm.TelemetryHeader), true);
  if (Status != CFE_SUCCESS) {
    CFE_EVS_SendEvent(
      @UPPER@_APP_HK_ERR_EID, CFE_EVS_EventType_ERROR, "cannot send housekeeping: 0x%08lX",
      (unsigned long)(uint32)Status);
  }
}

static void Noop(void)
{
  ++Data.CommandCounter;
  CFE_EVS_SendEvent(
    @UPPER@_APP_NOOP_INF_EID, CFE_EVS_EventType_INFORMATION,
    "no operation; monitors by fret_monitor @VERSION@");
}

static void ResetCounters(void)
{
  Data.CommandCounter = 0;
  Data.CommandErrorCounter = 0;
  Data.MessageErrorCounter = 0;
  CFE_EVS_SendEvent(
    @UPPER@_APP_RESET_INF_EID, CFE_EVS_EventType_INFORMATION, "counters of commands reset");
}

static void ResetMonitors(void)
{
  ++Data.CommandCounter;
  @NAME@_runner_reset(&Data.Runner, GetNow());
  CFE_EVS_SendEvent(
    @UPPER@_APP_RESET_MONITORS_INF_EID, CFE_EVS_EventType_INFORMATION, "monitors reset");
}

static bool HasSize(const CFE_SB_Buffer_t * BufPtr, size_t Expected)
{
  CFE_MSG_Size_t Size = 0;
  CFE_SB_MsgId_t MsgId = CFE_SB_INVALID_MSG_ID;
  CFE_MSG_GetSize(&BufPtr->Msg, &Size);
  if (Size == Expected) {
    return true;
  }
  CFE_MSG_GetMsgId(&BufPtr->Msg, &MsgId);
  CFE_EVS_SendEvent(
    @UPPER@_APP_LEN_ERR_EID, CFE_EVS_EventType_ERROR,
    "message 0x%X has %u bytes, not %u", (unsigned int)CFE_SB_MsgIdToValue(MsgId),
    (unsigned int)Size, (unsigned int)Expected);
  return false;
}

static void ProcessCommand(const CFE_SB_Buffer_t * BufPtr)
{
  CFE_MSG_FcnCode_t Code = 0;
  if (!HasSize(BufPtr, sizeof(@UPPER@_APP_NoArgsCmd_t))) {
    ++Data.CommandErrorCounter;
    return;
  }
  CFE_MSG_GetFcnCode(&BufPtr->Msg, &Code);
  switch (Code) {
    case @UPPER@_APP_NOOP_CC: Noop(); break;
    case @UPPER@_APP_RESET_COUNTERS_CC: ResetCounters(); break;
    case @UPPER@_APP_RESET_MONITORS_CC: ResetMonitors(); break;
    default:
      ++Data.CommandErrorCounter;
      CFE_EVS_SendEvent(
        @UPPER@_APP_CC_ERR_EID, CFE_EVS_EventType_ERROR, "unknown command code %u",
        (unsigned int)Code);
      break;
  }
}

// ---- messages ----------------------------------------------------------------------------------

static void ProcessTopic(uint32 Topic, const CFE_SB_Buffer_t * BufPtr)
{
  if (!HasSize(BufPtr, @UPPER@_APP_GetTopicSize(Topic))) {
    ++Data.MessageErrorCounter;
    return;
  }
  @NAME@_runner_arrive(&Data.Runner, GetNow());
  @UPPER@_APP_StoreInputs(&Data.Runner, Topic, BufPtr);
  @NAME@_runner_message(&Data.Runner, Topic);
}

static void Wakeup(void)
{
  if (HAS_PERIODS) {
    @NAME@_runner_period(&Data.Runner, GetNow());
  } else {
    @NAME@_runner_advance(&Data.Runner, GetNow());
  }
}

static void ProcessMessage(const CFE_SB_Buffer_t * BufPtr)
{
  CFE_SB_MsgId_t MsgId = CFE_SB_INVALID_MSG_ID;
  CFE_MSG_GetMsgId(&BufPtr->Msg, &MsgId);
  const uint32 Topic = @UPPER@_APP_FindTopic(CFE_SB_MsgIdToValue(MsgId));
  if (Topic < @UPPER@_APP_N_TOPICS) {
    ProcessTopic(Topic, BufPtr);
    return;
  }
  switch (CFE_SB_MsgIdToValue(MsgId)) {
    case @UPPER@_APP_WAKEUP_MID: Wakeup(); break;
    case @UPPER@_APP_CMD_MID: ProcessCommand(BufPtr); break;
    case @UPPER@_APP_SEND_HK_MID: SendHousekeeping(); break;
    default:
      CFE_EVS_SendEvent(
        @UPPER@_APP_MID_ERR_EID, CFE_EVS_EventType_ERROR, "unknown message 0x%X",
        (unsigned int)CFE_SB_MsgIdToValue(MsgId));
      break;
  }
}

// ---- the application ---------------------------------------------------------------------------

static CFE_Status_t Subscribe(CFE_SB_MsgId_Atom_t MsgId)
{
  const CFE_Status_t Status = CFE_SB_SubscribeEx(
    CFE_SB_ValueToMsgId(MsgId), Data.Pipe, CFE_SB_DEFAULT_QOS, @UPPER@_APP_MSG_LIMIT);
  if (Status != CFE_SUCCESS) {
    CFE_EVS_SendEvent(
      @UPPER@_APP_SUB_ERR_EID, CFE_EVS_EventType_ERROR, "cannot subscribe to 0x%X: 0x%08lX",
      (unsigned int)MsgId, (unsigned long)(uint32)Status);
  }
  return Status;
}

static CFE_Status_t SubscribeToAll(void)
{
  CFE_Status_t Status = Subscribe(@UPPER@_APP_CMD_MID);
  if (Status == CFE_SUCCESS) {
    Status = Subscribe(@UPPER@_APP_SEND_HK_MID);
  }
  if (Status == CFE_SUCCESS) {
    Status = Subscribe(@UPPER@_APP_WAKEUP_MID);
  }
  for (uint32 i = 0; i < @UPPER@_APP_N_TOPICS && Status == CFE_SUCCESS; ++i) {
    Status = Subscribe(@UPPER@_APP_GetTopicMsgId(i));
  }
  return Status;
}

static bool Init(void)
{
  CFE_Status_t Status = CFE_EVS_Register(NULL, 0, CFE_EVS_EventFilter_BINARY);
  if (Status != CFE_SUCCESS) {
    CFE_ES_WriteToSysLog(
      "@NAME@_app: cannot register events: 0x%08lX\n", (unsigned long)(uint32)Status);
    return false;
  }
  CFE_MSG_Init(
    CFE_MSG_PTR(Data.HkTlm.TelemetryHeader), CFE_SB_ValueToMsgId(@UPPER@_APP_HK_TLM_MID),
    sizeof(Data.HkTlm));
  Status = CFE_SB_CreatePipe(&Data.Pipe, @UPPER@_APP_PIPE_DEPTH, @UPPER@_APP_PIPE_NAME);
  if (Status != CFE_SUCCESS) {
    CFE_EVS_SendEvent(
      @UPPER@_APP_PIPE_ERR_EID, CFE_EVS_EventType_ERROR, "cannot create the pipe: 0x%08lX",
      (unsigned long)(uint32)Status);
    return false;
  }
  if (SubscribeToAll() != CFE_SUCCESS) {
    return false;
  }
  if (!@NAME@_runner_start(&Data.Runner, GetNow(), Announce, ReportSilence, NULL)) {
    CFE_EVS_SendEvent(
      @UPPER@_APP_START_ERR_EID, CFE_EVS_EventType_ERROR,
      "the files of the export do not match");
    return false;
  }
  CFE_EVS_SendEvent(
    @UPPER@_APP_INIT_INF_EID, CFE_EVS_EventType_INFORMATION, "%u requirements",
    (unsigned int)@UPPER@_APP_N_REQUIREMENTS);
  return true;
}

// Receive a message, and process it with what is due before it.
static void RunOnce(void)
{
  CFE_SB_Buffer_t * BufPtr = NULL;
  CFE_ES_PerfLogExit(@UPPER@_APP_PERF_ID);
  const CFE_Status_t Status = CFE_SB_ReceiveBuffer(&BufPtr, Data.Pipe, GetTimeout());
  CFE_ES_PerfLogEntry(@UPPER@_APP_PERF_ID);
  if (Status == CFE_SUCCESS) {
    ProcessMessage(BufPtr);
  } else if (Status == CFE_SB_TIME_OUT || Status == CFE_SB_NO_MESSAGE) {
    @NAME@_runner_advance(&Data.Runner, GetNow());
  } else {
    CFE_EVS_SendEvent(
      @UPPER@_APP_PIPE_ERR_EID, CFE_EVS_EventType_ERROR, "cannot read the pipe: 0x%08lX",
      (unsigned long)(uint32)Status);
    Data.RunStatus = CFE_ES_RunStatus_APP_ERROR;
  }
}

void @UPPER@_APP_Main(void)
{
  CFE_ES_PerfLogEntry(@UPPER@_APP_PERF_ID);
  memset(&Data, 0, sizeof(Data));
  Data.RunStatus = CFE_ES_RunStatus_APP_RUN;
  if (!Init()) {
    Data.RunStatus = CFE_ES_RunStatus_APP_ERROR;
  }
  while (CFE_ES_RunLoop(&Data.RunStatus)) {
    RunOnce();
  }
  CFE_ES_PerfLogExit(@UPPER@_APP_PERF_ID);
  CFE_ES_ExitApp(Data.RunStatus);
}
