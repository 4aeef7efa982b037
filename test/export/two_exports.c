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

// Two exports in one program, which share inputs: `left` takes steps, `right` counts time. Each
// line of standard input is a row; what handlers are called is printed. With an argument, `right`
// is called at its deadlines too, and not only with rows.

#include <assert.h>
#include <stdio.h>
#include <stdlib.h>

#include "left.h"
#include "right.h"

#ifdef __cplusplus
extern "C" {
#endif

bool p;
float x;
uint8_t a_DOT_b;
uint8_t mode;
int32_t word;

int depth, sections;  // of hooks.h
static int64_t now;

void left_handlerpropR_1(bool p_value, float x_value)
{
  printf("left R-1 %d %.9g\n", p_value, (double)x_value);
  x = 1e30f;  // has no effect on this step
}

void left_handlerprop___int_main_void_____(uint8_t a_value, uint8_t mode_value)
{
  printf("left int %d %d\n", a_value, mode_value);
}

void left_handlerpropInt(float x_value, int32_t word_value)
{
  printf("left word %.9g %d\n", (double)x_value, word_value);
}

void right_handlerpropR_1(void) {printf("right R-1 %lld\n", (long long)now);}
void right_handlerpropR_2(void) {printf("right R-2 %lld\n", (long long)now);}

#ifdef __cplusplus
}
#endif

int main(int n_arguments, char ** arguments)
{
  const bool is_punctual = n_arguments > 1;
  long long time;
  int truth, a, m, w;
  float read;
  assert(right_deadline() == INT64_MIN);
  while (scanf("%lld %d %f %d %d %d", &time, &truth, &read, &a, &m, &w) == 6) {
    while (is_punctual && right_deadline() != INT64_MIN && right_deadline() < time) {
      now = right_deadline();
      right_step_at(now);
    }
    x = read;
    p = truth != 0;
    a_DOT_b = (uint8_t)a;
    mode = (uint8_t)(m ? left_mode_LANDING : left_mode_IDLE);
    word = w ? left_word_moving : left_word_stopped;
    left_step();
    x = read;
    now = time;
    right_step_at(time);
  }
  assert(depth == 0);
  fprintf(stderr, "%d sections\n", sections);
  (void)arguments;
  return 0;
}
