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

// A compiled monitor in a program of one's own, with no Python and no ROS. Reads lines of
// "current,wind" and tells each step that violates ROS-001.
//
//   fret-monitor compile config/quadrotor.yaml --output compiled
//   cd compiled/src
//   cc -std=c99 -I. ../../examples/standalone.c quadrotor_monitor.c -lm -o ../../standalone
//   printf '12.5,3.0\n17.0,9.5\n' | ../../standalone

#include <stdio.h>

#include "quadrotor_monitor.h"

int main(void)
{
  struct quadrotor_inputs inputs;
  struct quadrotor_state state;
  bool verdicts[quadrotor_requirements];
  unsigned long step = 0;

  quadrotor_reset(&state);
  while (scanf("%f,%f", &inputs.current_consumption, &inputs.wind_speed) == 2) {
    quadrotor_step(&state, &inputs, verdicts);
    if (!verdicts[quadrotor_req_ROS_001]) {
      printf("step %lu: ROS-001 is violated\n", step);
    }
    ++step;
  }
  return 0;
}
