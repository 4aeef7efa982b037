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


/// in_place_versions.h: whether messages can be read in place (in_place.h) in this process: which
/// middleware it has, and whether that was tried with the versions of its libraries.

#ifndef IN_PLACE_VERSIONS_H_
#define IN_PLACE_VERSIONS_H_

#include "middleware.h"

/// Whether it was tried with the versions of rmw_fastrtps_cpp, rosidl_typesupport_fastrtps_c and
/// fastcdr (of ROS 2 Jazzy) that `maps` names as loaded: the text of /proc/self/maps. The version
/// of a library is that of its package.xml, or else of its file names; the last part of it does
/// not matter. If not, writes why to `why`, at most `room` bytes. Reads files; any thread.
/// O(characters).
FM_EXPORT bool fm_in_place_is_known(const char * maps, char * why, size_t room);

/// Whether messages can be read in place with a middleware, the loaded one (as rmw names it); if
/// so, writes to `found` what that needs. If not, writes why to `why`, at most `room` bytes; else
/// "". One thread at a time for one `found`. As fm_in_place_is_known otherwise.
FM_EXPORT bool fm_in_place_prepare(
  const char * middleware, struct fm_in_place * found, char * why, size_t room);

#endif  // IN_PLACE_VERSIONS_H_
