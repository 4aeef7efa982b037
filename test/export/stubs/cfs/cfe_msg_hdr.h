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

// Stub: headers of messages. Names and sizes are those of cFE 7 with CCSDS primary headers; what
// the stubs need lies in bytes of their own.

#ifndef CFE_MSG_HDR_H
#define CFE_MSG_HDR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef int8_t int8;
typedef int16_t int16;
typedef int32_t int32;
typedef int64_t int64;
typedef uint8_t uint8;
typedef uint16_t uint16;
typedef uint32_t uint32;
typedef uint64_t uint64;

typedef struct CFE_MSG_Message
{
  uint8 Bytes[6];
} CFE_MSG_Message_t;

typedef struct CFE_MSG_CommandHeader
{
  CFE_MSG_Message_t Msg;
  uint8 Sec[2];
} CFE_MSG_CommandHeader_t;

typedef struct CFE_MSG_TelemetryHeader
{
  CFE_MSG_Message_t Msg;
  uint8 Sec[6];
  uint8 Spare[4];
} CFE_MSG_TelemetryHeader_t;

#define CFE_MSG_PTR(shdr) (&((shdr).Msg))

#endif  // CFE_MSG_HDR_H
