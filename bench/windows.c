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

/// windows.c: times a step of the windows of csrc/generated/fret_windows.h beside what an engineer
/// would write by hand: a monotone queue for the greatest value, a running sum for the mean.
///
/// Prints a row for each function and length, in nanoseconds: the mean of all steps, in processor
/// time; then of steps that are timed one by one, with the cost of reading the clock, the median,
/// the 99.99 % and the greatest, in which the machine may have done something else. The queue is
/// O(1) on average and O(length) in the worst case; the running sum keeps errors for ever.

#define _POSIX_C_SOURCE 200809L

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fret_windows.h"

#define STEPS 1000000

static double values[STEPS];
static int64_t times[STEPS];
static double checksum;

static int64_t time_of(clockid_t clock)
{
  struct timespec t;
  (void)clock_gettime(clock, &t);
  return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static int64_t now(void) {return time_of(CLOCK_MONOTONIC);}
static int64_t used(void) {return time_of(CLOCK_PROCESS_CPUTIME_ID);}

// A window, whichever it is, and its step.
struct window
{
  int64_t length;
  int64_t * cells;
  uint64_t sum[FM_SUM_LENGTH];
  double * ring;
  int64_t * places;
  int64_t n, head, tail;
  double running;
};

static double greatest(struct window * w, double x)
{
  return fm_of_key_f64(fm_greatest(w->cells, w->length + 1, fm_key_f64(x, false)), false);
}

static double mean(struct window * w, double x)
{
  fm_exact_sum(w->sum, w->cells, w->length, fm_word_f64(x));
  return fm_exact_mean(w->sum);
}

static double sum(struct window * w, double x)
{
  fm_exact_sum(w->sum, w->cells, w->length, fm_word_f64(x));
  return fm_exact_quotient(w->sum, 1u);
}

// places[head..tail): steps whose values fall, in a ring.
static double queue_by_hand(struct window * w, double x)
{
  const int64_t n = w->length;
  while (w->tail > w->head && w->ring[(w->tail - 1) % n] <= x) {
    w->tail -= 1;
  }
  if (w->tail > w->head && w->places[w->head % n] <= w->n - n) {
    w->head += 1;
  }
  w->ring[w->tail % n] = x;
  w->places[w->tail % n] = w->n;
  w->tail += 1;
  w->n += 1;
  return w->ring[w->head % n];
}

static double mean_by_hand(struct window * w, double x)
{
  const int64_t place = w->head;
  w->running += x - w->ring[place];
  w->ring[place] = x;
  w->head = place + 1 == w->length ? 0 : place + 1;
  w->n += w->n < w->length ? 1 : 0;
  return w->running / (double)w->n;
}

static struct window make(int64_t length)
{
  struct window w;
  memset(&w, 0, sizeof(w));
  w.length = length;
  w.cells = calloc((size_t)length + 16u, sizeof(int64_t));
  w.ring = calloc((size_t)length + 1u, sizeof(double));
  w.places = calloc((size_t)length + 1u, sizeof(int64_t));
  if (w.cells == NULL || w.ring == NULL || w.places == NULL) {
    abort();
  }
  return w;
}

static void end(struct window * w)
{
  free(w->cells);
  free(w->ring);
  free(w->places);
}

static int earlier(const void * a, const void * b)
{
  const int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
  return (x > y) - (x < y);
}

static void measure(
  const char * name, double (* step)(struct window *, double), int64_t length, const char * of)
{
  struct window w = make(length);
  for (int i = 0; i < STEPS; ++i) {
    checksum += step(&w, values[i]);
  }
  const int64_t begin = used();
  for (int i = 0; i < STEPS; ++i) {
    checksum += step(&w, values[i]);
  }
  const double average = (double)(used() - begin) / STEPS;
  for (int i = 0; i < STEPS; ++i) {
    const int64_t before = now();
    checksum += step(&w, values[i]);
    times[i] = now() - before;
  }
  qsort(times, STEPS, sizeof(*times), earlier);
  printf(
    "%s\t%s\t%lld\t%.1f\t%lld\t%lld\t%lld\n", name, of, (long long)length, average,
    (long long)times[STEPS / 2], (long long)times[STEPS - STEPS / 10000],
    (long long)times[STEPS - 1]);
  end(&w);
}

static void measure_all(const char * of)
{
  static const int64_t lengths[] = {10, 1000, 100000};
  for (int k = 0; k < 3; ++k) {
    measure("maxOver", greatest, lengths[k], of);
    measure("maxOver, queue by hand", queue_by_hand, lengths[k], of);
    measure("sumOver", sum, lengths[k], of);
    measure("meanOver", mean, lengths[k], of);
    measure("meanOver, running sum by hand", mean_by_hand, lengths[k], of);
  }
}

int main(void)
{
  uint64_t random = 88172645463325252u;
  for (int i = 0; i < STEPS; ++i) {
    random ^= random << 13;
    random ^= random >> 7;
    random ^= random << 17;
    values[i] = 20.0 * ((double)(random >> 11) / 9007199254740992.0) - 5.0;
  }
  measure_all("random");
  for (int i = 0; i < STEPS; ++i) {
    values[i] = -i % 100000;  // each fall fills the queue by hand, and then empties it
  }
  measure_all("falling");
  return isnan(checksum) ? 1 : 0;
}
