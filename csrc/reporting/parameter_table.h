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

/// parameter_table.h: the parameters that both nodes have, and which values they take.
///
/// `PARAMETERS` of `native/words.py` is generated from it, since Python reads parameters before it
/// loads a library. A value that cannot be used is refused with what it has to be (`wanted`).

#ifndef PARAMETER_TABLE_H_
#define PARAMETER_TABLE_H_

#include "words.h"

/// Which values a parameter takes.
enum fm_parameter_kind
{
  FM_KIND_FLAG,     // true or false
  FM_KIND_COUNT,    // a whole number from `least` to `most`
  FM_KIND_SECONDS,  // a number above `least`, at most `most`
  FM_KIND_CHOICE,   // a word of `wanted`, which is "one of A, B", or an empty text
  FM_KIND_SWITCH,   // likewise, or true or false: YAML makes them of `on` and `off`
  FM_KIND_TEXT,     // a text
  FM_KIND_NUMBERS   // a text, or a whole number: YAML makes it of "3"
};

/// When a parameter may be set.
enum fm_settable
{
  FM_ALWAYS,         // and takes effect at once
  FM_UNCONFIGURED,   // read by `configure`
  FM_AT_START        // given at the start only
};

#define FM_MOST 4611686018427387903  // of a count, so that two can be added
#define FM_ONE_OF "one of "

// FM_PARAMETER(name, kind, when it may be set, default, least, most, wanted, description)
#define FM_PARAMETERS \
  FM_PARAMETER("hot_path", SWITCH, UNCONFIGURED, "auto", 0, 0, "one of auto, on, off", \
    "whether the middleware's callbacks take the messages: auto (where this is known to work)," \
    " on, off (they wake a thread that does); read by `configure`") \
  FM_PARAMETER("handler_depth", COUNT, UNCONFIGURED, 1000, 1, INT32_MAX, FM_WORDS_COUNT, \
    "violations that a slow listener of one handler may be behind before it loses some; read " \
    "by `configure`") \
  FM_PARAMETER("log_violations", FLAG, UNCONFIGURED, true, 0, 0, "true or false", \
    "whether the node logs violations and their ends; false if the logger does; read by " \
    "`configure`") \
  FM_PARAMETER("verdicts", FLAG, UNCONFIGURED, false, 0, 0, "true or false", \
    "whether the verdict of each requirement is published on copilot/verdict/ID; read by " \
    "`configure`") \
  FM_PARAMETER("margins", FLAG, UNCONFIGURED, false, 0, 0, "true or false", \
    "whether margins are published on copilot/margin, and shown with violations; read by " \
    "`configure`") \
  FM_PARAMETER("blackbox", TEXT, UNCONFIGURED, "", 0, 0, "the path of a folder", \
    "a folder to which the last messages of all topics are written at each violation; empty: " \
    "none are kept; read by `configure`") \
  FM_PARAMETER("blackbox_seconds", SECONDS, UNCONFIGURED, 10.0, 0, 1000000000, \
    "a number above 0, at most 1000000000 (seconds, say 10.0)", \
    "seconds of messages before a violation that a file has; read by `configure`") \
  FM_PARAMETER("blackbox_bytes", COUNT, UNCONFIGURED, 67108864, 4096, FM_MOST, \
    "a number of bytes, at least 4096: -p blackbox_bytes:=4096", \
    "memory for the last messages, in bytes, for each bundle; read by `configure`") \
  FM_PARAMETER("blackbox_files", COUNT, UNCONFIGURED, 20, 1, FM_MOST, \
    "a number of files, at least 1: -p blackbox_files:=1", \
    "files of black boxes in the folder, at most: the oldest are removed; read by `configure`") \
  FM_PARAMETER("blackbox_disk_bytes", COUNT, UNCONFIGURED, 1073741824, 1048576, FM_MOST, \
    "a number of bytes, at least 1048576: -p blackbox_disk_bytes:=1048576", \
    "bytes of these files together, at most; read by `configure`") \
  FM_PARAMETER("priority", COUNT, UNCONFIGURED, 0, 0, 99, \
    "a priority from 1 to 99, or 0 to leave it", \
    "the priority of all threads under SCHED_FIFO, 1 to 99; 0: as the process was started; " \
    "read by `configure`") \
  FM_PARAMETER("processors", NUMBERS, UNCONFIGURED, "", 0, 0, \
    "numbers of processors, such as 0,2-3", \
    "the processors that all threads run on, such as 0,2-3; empty: as the process was started;" \
    " read by `configure`") \
  FM_PARAMETER("lock_memory", FLAG, UNCONFIGURED, false, 0, 0, "true or false", \
    "whether all memory stays in memory once it was touched; read by `configure`") \
  FM_PARAMETER("autostart", FLAG, AT_START, true, 0, 0, "true or false", \
    "whether the node configures and activates itself at its start") \
  FM_PARAMETER("log_level", CHOICE, ALWAYS, "", 0, 0, "one of debug, info, warn, error, fatal", \
    "the least severity that this node logs: debug, info, warn, error or fatal; empty for the " \
    "process's")

#endif  // PARAMETER_TABLE_H_
