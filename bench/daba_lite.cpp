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

/// daba_lite.cpp: times a step of fm_greatest beside IBM's DABA Lite in C++, on the same values.
///
/// DABALite.hpp is that of github.com/IBM/sliding-window-aggregators (cpp/src); it is no part of
/// this project. Prints a row for each kind of values and length, in nanoseconds of processor
/// time: the median of rounds in which the three take turns, and the median of the rounds' ratios.

#include <time.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <vector>

#include "DABALite.hpp"

extern "C" {
#include "fret_windows.h"
}

static const int STEPS = 1000000, ROUNDS = 15;
static std::vector<double> values(STEPS);
static double checksum;

static double used()
{
  struct timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return 1e9 * static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_nsec);
}

struct Greatest
{
  typedef double In;
  typedef double Partial;
  typedef double Out;
  double lift(double x) const {return x;}
  double combine(double a, double b) const {return a > b ? a : b;}
  double lower(double x) const {return x;}
  double inverse_combine(double, double) const {return 0.0;}
};

// A step is a call, as in a monitor: between two of them, a window is in memory.
template<typename Window>
__attribute__((noinline)) static double step_of_daba(Window & window, int length, double x)
{
  if (window.size() == static_cast<size_t>(length)) {
    window.evict();
  }
  window.insert(x);
  return window.query();
}

__attribute__((noinline)) static double step_of_cells(int64_t * cells, int length, double x)
{
  return fm_of_key_f64(fm_greatest(cells, length + 1, fm_key_f64(x, false)), false);
}

template<typename Window>
static double of_daba(Window & window, int length)
{
  const double begin = used();
  for (double x : values) {
    checksum += step_of_daba(window, length, x);
  }
  return (used() - begin) / STEPS;
}

static double of_cells(std::vector<int64_t> & cells, int length)
{
  const double begin = used();
  for (double x : values) {
    checksum += step_of_cells(cells.data(), length, x);
  }
  return (used() - begin) / STEPS;
}

static double median(std::vector<double> items)
{
  std::sort(items.begin(), items.end());
  return items[items.size() / 2];
}

template<int LENGTH>
static void measure(const char * of)
{
  typedef dabalite::Aggregate<Greatest> Chunks;
  typedef rb_dabalite::Aggregate<Greatest, LENGTH + 1> Ring;
  const double none = -std::numeric_limits<double>::infinity();
  Chunks chunks(Greatest(), none);
  Ring ring(Greatest(), none);
  std::vector<int64_t> cells(FM_WINDOW_HEAD + LENGTH + 1);
  std::vector<double> ours, theirs, rings, ratios, ring_ratios;
  for (int i = 0; i < ROUNDS; ++i) {
    ours.push_back(of_cells(cells, LENGTH));
    theirs.push_back(of_daba(chunks, LENGTH));
    rings.push_back(of_daba(ring, LENGTH));
    ratios.push_back(ours.back() / theirs.back());
    ring_ratios.push_back(ours.back() / rings.back());
  }
  std::printf(
    "%s\t%d\t%.1f\t%.1f\t%.2f\t%.1f\t%.2f\n", of, LENGTH, median(ours), median(theirs),
    median(ratios), median(rings), median(ring_ratios));
}

static void measure_all(const char * of)
{
  measure<10>(of);
  measure<1000>(of);
  measure<100000>(of);
}

int main()
{
  uint64_t random = 88172645463325252u;
  for (double & value : values) {
    random ^= random << 13;
    random ^= random >> 7;
    random ^= random << 17;
    value = 20.0 * (static_cast<double>(random >> 11) / 9007199254740992.0) - 5.0;
  }
  measure_all("random");
  for (int i = 0; i < STEPS; ++i) {
    values[static_cast<size_t>(i)] = -i % 100000;
  }
  measure_all("falling");
  return std::isnan(checksum) ? 1 : 0;
}
