# Copyright 2026 The fret_monitor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

# The headers of @NAME@_app that a mission can replace: a file of the same name, without default_,
# in the folder of its definitions takes the place of config/default_*.

set(@UPPER@_APP_MISSION_HEADERS
  @NAME@_app_fcncodes.h
  @NAME@_app_messages.h
  @NAME@_app_msgstruct.h
  @NAME@_app_perfids.h
  @NAME@_app_topicids.h)

foreach(HEADER ${@UPPER@_APP_MISSION_HEADERS})
  generate_config_includefile(
    FILE_NAME "${HEADER}"
    FALLBACK_FILE "${CMAKE_CURRENT_LIST_DIR}/config/default_${HEADER}")
endforeach()
