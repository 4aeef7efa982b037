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

// The monitors of config/quadrotor.yaml in a program of your own: reads lines of seconds (from 0
// on), current and wind, and prints each evaluation at which a response that ROS-001 asks for is
// overdue, also between the lines.
//
//   fret-monitor compile config/quadrotor.yaml --output compiled
//   cc -Icompiled/src -o standalone examples/standalone.c compiled/src/quadrotor_monitor.c -lm
//   printf '0,17.0,9.5\n30,12.0,3.0\n' | ./standalone

#include <stdio.h>

#include "quadrotor_monitor.h"

static int64_t evaluate(
  struct quadrotor_state * state, const struct quadrotor_inputs * inputs, int64_t tick)
{
  bool verdicts[quadrotor_verdicts];
  const int64_t due = quadrotor_step_at(state, inputs, verdicts, tick);
  if (!verdicts[quadrotor_occ_ROS_001]) {
    printf("%.1f s: ROS-001 is violated\n", (double)tick * 1e-9);
  }
  return due;
}

int main(void)
{
  struct quadrotor_inputs inputs, read;
  struct quadrotor_state state;
  int64_t due = FM_NEVER;  // when a verdict can change by itself
  double seconds;

  quadrotor_reset(&state);
  while (scanf("%lf,%f,%f", &seconds, &read.current_consumption, &read.wind_speed) == 3) {
    const int64_t now = (int64_t)(seconds * 1e9 + 0.5);
    while (due < now) {
      due = evaluate(&state, &inputs, due);
    }
    inputs = read;
    due = evaluate(&state, &inputs, now);
  }
  return 0;
}
