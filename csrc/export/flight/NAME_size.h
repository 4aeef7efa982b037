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

/// @NAME@_size.h: how many bytes the evaluator of @BUNDLE_IN_C@ takes, as a constant.
///
/// So a program can hold an evaluator in static memory.

#ifndef @UPPER@_SIZE_H_
#define @UPPER@_SIZE_H_

#include "evaluator.h"
#include "@NAME@_monitor.h"

#ifdef __cplusplus
extern "C" {
#endif

#include "tables.h"

#ifdef __cplusplus
}
#endif

#define @UPPER@_N_INPUTS @INPUTS@u
#define @UPPER@_N_TOPICS @TOPICS@u
#define @UPPER@_N_REQUIREMENTS @REQUIREMENT_COUNT@u
#define @UPPER@_N_GROUPS @GROUPS@u
#define @UPPER@_N_READINGS @READINGS@u  // inputs of groups, summed over the groups
#define @UPPER@_N_CONSTANT_GROUPS @CONSTANT_GROUPS@u  // groups without inputs
#define @UPPER@_N_MEASURE_WORDS @MEASURE_WORDS@u  // of rates and periods

/// What fm_evaluator_bytes returns for these monitors, or more.
#define @UPPER@_PART(count, size) ((((size_t)(count)) * (size) + 15u) / 16u * 16u)
#define @UPPER@_EVALUATOR_BYTES ( \
    @UPPER@_PART(1u, sizeof(struct fm_evaluator)) + \
    @UPPER@_PART(@UPPER@_N_INPUTS, sizeof(struct fm_input_cell)) + \
    @UPPER@_PART(@UPPER@_N_REQUIREMENTS, sizeof(struct fm_requirement_cell)) + \
    @UPPER@_PART(@UPPER@_N_REQUIREMENTS, sizeof(struct fm_nearest)) + \
    @UPPER@_PART(@UPPER@_N_TOPICS, sizeof(struct fm_topic_cell)) + \
    @UPPER@_PART(@UPPER@_N_INPUTS, sizeof(uint32_t)) + \
    @UPPER@_PART(@UPPER@_N_GROUPS, sizeof(uint64_t)) + \
    2u * @UPPER@_PART(@UPPER@_N_READINGS, sizeof(uint32_t)) + \
    @UPPER@_PART(@UPPER@_N_CONSTANT_GROUPS * @UPPER@_N_TOPICS, sizeof(uint32_t)) + \
    @UPPER@_PART(1u, sizeof(struct fm_instance_time)) + \
    @UPPER@_PART(@UPPER@_N_INPUTS, sizeof(struct fm_instance_input)) + \
    @UPPER@_PART(@UPPER@_N_GROUPS, sizeof(struct fm_instance_group)) + \
    @UPPER@_PART(@NAME@_verdicts, sizeof(bool)) + \
    @UPPER@_PART(@UPPER@_N_REQUIREMENTS, sizeof(bool)) + \
    @UPPER@_PART(1u, sizeof(struct @NAME@_inputs)) + \
    @UPPER@_PART(@UPPER@_N_MEASURE_WORDS, sizeof(int64_t)) + \
    @UPPER@_PART(1u, sizeof(struct @NAME@_state)))

#endif  // @UPPER@_SIZE_H_
