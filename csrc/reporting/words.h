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

/// words.h: words in which both nodes (and `bag`) log and refuse where nothing else is to be
/// decided, and why an action failed; formats of printf, of which Python reads %s, %d and %.3f
/// alike (`native/words.py`, generated).

#ifndef WORDS_H_
#define WORDS_H_

// ---- a node ------------------------------------------------------------------------------------

#define FM_WORDS_WAITING "waiting to be configured and activated: autostart is false"
#define FM_WORDS_INACTIVE "nothing is monitored until the node is active again"
#define FM_WORDS_NO_RESTART "nothing to restart: the node is not active"
#define FM_WORDS_NAMESAKE \
  "there is another node %s: both watch and announce; give one another name (-r __node:=NAME) " \
  "to tell them apart in /diagnostics, ~/reset and transitions"
#define FM_WORDS_NO_ENDPOINT "cannot subscribe or advertise"
#define FM_WORDS_NO_THREAD "no thread can be started"
#define FM_WORDS_NO_WORKING_DIRECTORY \
  "parameter 'blackbox' is '%s', in a working directory that was deleted: give the whole path"
#define FM_WORDS_UNANSWERED "gate '%s': no server of %s answers; the request is refused"
#define FM_WORDS_RESPONSE_NOT_SENT "the response of %s is not sent: %s"
#define FM_WORDS_NEGATIVE_TIME "a message on /clock is ignored: its time is negative, %.3f s"
#define FM_WORDS_KEY_SIZE "a key has 1 to 255 bytes"

// ---- why an action failed ----------------------------------------------------------------------

#define FM_WORDS_NO_SERVER "no server of %s in %g s"
#define FM_WORDS_NO_ANSWER "%s has not answered in %g s"
#define FM_WORDS_NO_SUCCESS "%s answered without success%s%s"
#define FM_WORDS_NOT_SENT "the middleware does not send the request to %s"
#define FM_WORDS_NO_REQUEST "the middleware does not read its request"
#define FM_WORDS_NOT_PUBLISHED "the middleware does not publish its message"
#define FM_WORDS_REFUSED "%s refused to leave the state %s"
#define FM_WORDS_STILL_IN "%s is %s"
#define FM_WORDS_NO_WAY "%s is %s, from where no transition leads to %s"

// ---- how messages are taken --------------------------------------------------------------------

#define FM_WORDS_WAKES "messages are taken in C, in a thread of its own: "
#define FM_WORDS_HOT_PATH_IS_OFF "hot_path is off"
#define FM_WORDS_UNKNOWN_CALLBACKS "the callbacks of %s are not known to allow it"
#define FM_WORDS_TAKES "messages are taken in C, inside %s%s%s"
#define FM_WORDS_ALL_COPIED ", and copied before they are read: "
#define FM_WORDS_COPIED "messages on %s are copied before they are read: "
#define FM_WORDS_NO_SUPPORT "%s has no type support for Fast DDS"

// ---- parameters --------------------------------------------------------------------------------

#define FM_WORDS_NO_MARGINS \
  "parameter 'margins': it was compiled without margins: give --margins to compile or export"
#define FM_WORDS_NO_MARGINS_OF_GATES "parameter 'margins': a gate has no margins"
#define FM_WORDS_COUNT "a number of messages, 1 to 2147483647"
#define FM_WORDS_READ_AT_START "%s: read at the start of the process only"
#define FM_WORDS_READ_ONCE "%s: read when the node is configured, so deactivate and clean up first"
#define FM_WORDS_NOT_WANTED "parameter '%s' is %s, and has to be %s"
#define FM_WORDS_NO_PARAMETER "there is no parameter '%s'"
#define FM_WORDS_IGNORED "ignored parameter '%s': %s"
#define FM_WORDS_ALL_PARAMETERS "this node has %s, constants.NAME"
#define FM_WORDS_NO_CONSTANT "parameter '%s': no bundle has this constant: %s"
#define FM_WORDS_ALL_CONSTANTS "the constants are %s"
#define FM_WORDS_NO_CONSTANTS "there are none"

// ---- what the system is asked for --------------------------------------------------------------

#define FM_WORDS_NO_PRIORITY "the priority %d is not possible: %s"
#define FM_WORDS_NO_PROCESSORS "to run on the processors %s is not possible: %s"
#define FM_WORDS_NO_LOCKED_MEMORY "to lock the memory is not possible: %s"

// ---- what is given of the quality of service ---------------------------------------------------

#define FM_WORDS_OVERRIDES "qos_overrides."
#define FM_WORDS_OVERRIDE "%s.subscription.%s"
#define FM_WORDS_POLICY "%s of the subscription to %s; read at the start of the process%s"

#endif  // WORDS_H_
