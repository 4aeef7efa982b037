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

// @NAME@_app_platform_cfg.h: the pipe.

#ifndef @UPPER@_APP_PLATFORM_CFG_H_
#define @UPPER@_APP_PLATFORM_CFG_H_

#define @UPPER@_APP_PIPE_NAME "@PIPE@"
#define @UPPER@_APP_PIPE_DEPTH 50
#define @UPPER@_APP_MSG_LIMIT 10  // messages of one identifier that may wait in the pipe

#endif  // @UPPER@_APP_PLATFORM_CFG_H_
