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

// @NAME@_app_msgids.h: the message identifiers of the application itself.

#ifndef @UPPER@_APP_MSGIDS_H_
#define @UPPER@_APP_MSGIDS_H_

#include "cfe_core_api_base_msgids.h"

#include "@NAME@_app_topicids.h"

#define @UPPER@_APP_CMD_MID CFE_PLATFORM_CMD_TOPICID_TO_MIDV(CFE_MISSION_@UPPER@_APP_CMD_TOPICID)
#define @UPPER@_APP_SEND_HK_MID \
  CFE_PLATFORM_CMD_TOPICID_TO_MIDV(CFE_MISSION_@UPPER@_APP_SEND_HK_TOPICID)
#define @UPPER@_APP_WAKEUP_MID \
  CFE_PLATFORM_CMD_TOPICID_TO_MIDV(CFE_MISSION_@UPPER@_APP_WAKEUP_TOPICID)
#define @UPPER@_APP_HK_TLM_MID \
  CFE_PLATFORM_TLM_TOPICID_TO_MIDV(CFE_MISSION_@UPPER@_APP_HK_TLM_TOPICID)

#endif  // @UPPER@_APP_MSGIDS_H_
