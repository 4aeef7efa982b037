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

/// blackbox_files.c: files of the black box, in the folder of the first argument: which violations
/// share one, their names, a disk that is full, and a writer beside a thread that delivers
/// messages. The test reads the files.

#define _GNU_SOURCE

#include "start_lines.h"

#include <errno.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <time.h>

#include "below_one.h"
#include "check.h"

#define SECOND_NS INT64_C(1000000000)
#define N_MESSAGES 2000

static const char * const unknown[] = {NULL};
static const struct fm_blackbox_topic topics[] = {
  {"/x", "std_msgs/msg/Float32", unknown}, {"/end", "std_msgs/msg/Header", unknown}};
static const struct fm_blackbox_requirement names[] = {{"R-1", "R_1"}};
static struct fm_blackbox_options options = {
  NULL, 10 * SECOND_NS, 1 << 16, UINT64_C(1) << 30, 20, FM_BLACKBOX_AFTER_NS,
  FM_BLACKBOX_POLL_NS, "/robot/node", "tank", topics, 1, names};
static char folder[4096];

static const char * in_folder(const char * root, const char * name)
{
  (void)snprintf(folder, sizeof(folder), "%s/%s", root, name);
  CHECK(mkdir(folder, 0777) == 0);
  return folder;
}

static void keep(struct fm_blackbox * box, int64_t steady)
{
  const uint8_t message[8] = {0, 1};
  const struct fm_kept kept = {sizeof(message), steady, 1000 * SECOND_NS + steady, 0, 0, 0};
  fm_blackbox_keep(box, &kept, message);
}

static struct fm_blackbox_file * open_at(
  struct fm_blackbox * box, int64_t steady, const char * stamp)
{
  const struct fm_occurrences found = {1, steady, steady, 0};
  int error = 0;
  struct fm_blackbox_file * file = fm_blackbox_file_open(&options, box, &found, stamp, &error);
  CHECK(error == 0);
  return file;
}

static void finish(struct fm_blackbox_file * file)
{
  CHECK(fm_blackbox_file_finish(file) == 0);
  fm_blackbox_file_close(file);
}

// A violation right after the longest time of a file is in the next, however late one looks.
static void test_longest_time(const char * root)
{
  options.folder = in_folder(root, "longest");
  struct fm_blackbox * box = fm_blackbox_create(1 << 16, 0);
  const int64_t times[] = {SECOND_NS, 60 * SECOND_NS + 900000000, 61 * SECOND_NS + 100000000};
  keep(box, times[0]);
  struct fm_blackbox_file * file = open_at(box, times[0], "a");
  fm_blackbox_file_copy(file, times[0], times[0]);
  for (int k = 1; k < 3; ++k) {
    const struct fm_occurrences found = {1, times[k], times[k], 0};
    keep(box, times[k]);
    CHECK(fm_blackbox_file_join(file, &found) == (k == 1));
  }
  finish(file);
  file = open_at(box, times[2], "b");
  fm_blackbox_file_copy(file, times[2], times[2]);
  finish(file);
  fm_blackbox_destroy(box);
}

// Nodes that share a folder never use one name.
static void test_names(const char * root)
{
  options.folder = in_folder(root, "names");
  struct fm_blackbox * box = fm_blackbox_create(1 << 16, 0);
  struct fm_blackbox_file * made[] = {open_at(box, 0, "name"), open_at(box, 0, "name")};
  finish(made[0]);
  finish(made[1]);
  finish(open_at(box, 0, "name"));
  fm_blackbox_file_close(open_at(box, 0, "name"));  // which is removed
  fm_blackbox_destroy(box);
}

// What does not fit on the disk is an error, and is removed.
static void test_full_disk(const char * root)
{
  struct rlimit before;
  options.folder = in_folder(root, "full");
  struct fm_blackbox * box = fm_blackbox_create(1 << 16, 0);
  for (int64_t k = 0; k < 100; ++k) {
    keep(box, k);
  }
  CHECK(signal(SIGXFSZ, SIG_IGN) != SIG_ERR && getrlimit(RLIMIT_FSIZE, &before) == 0);
  const struct rlimit little = {1000, before.rlim_max};
  CHECK(setrlimit(RLIMIT_FSIZE, &little) == 0);
  struct fm_blackbox_file * file = open_at(box, 99, "full");
  fm_blackbox_file_copy(file, 99, 99);
  CHECK(fm_blackbox_file_finish(file) == EFBIG);
  CHECK(fm_blackbox_file_error(file) == EFBIG);
  fm_blackbox_file_close(file);
  CHECK(setrlimit(RLIMIT_FSIZE, &before) == 0);
  fm_blackbox_destroy(box);
}

// ---- a writer beside a thread that delivers ----------------------------------------------------

static void * deliver(void * engine)
{
  const struct timespec pause = {0, 100000};
  for (int k = 0; k < N_MESSAGES; ++k) {
    const uint8_t message[8] = {0, 1, 0, 0, (uint8_t)(k % 50 == 0), 0, 0, 0};
    const struct fm_origin origin = {(k + 1) * SECOND_NS / 100, 0, 0, NULL, false, NULL, 0};
    CHECK(fm_engine_message(engine, 0, message, sizeof(message), &origin) == FM_RECEIVED);
    nanosleep(&pause, NULL);
  }
  return NULL;
}

static void check_lines(struct fm_blackbox_writer * writer, uint64_t written)
{
  struct fm_lines lines = {NULL, 0, 0};
  fm_add_blackbox_lines(&lines, writer);
  CHECK(lines.n == written);
  for (uint32_t k = 0; k < lines.n; ++k) {
    CHECK(strstr(lines.lines[k].text, "the last messages are in ") == lines.lines[k].text);
  }
  fm_lines_free(&lines);
}

// Folders with the names of files: they are none, and are not removed.
static void make_others(void)
{
  for (int k = 0; k < 25; ++k) {
    char name[4200];
    (void)snprintf(name, sizeof(name), "%s/blackbox_%d_robot_node_R_1.mcap", folder, k);
    CHECK(mkdir(name, 0777) == 0);
  }
}

static void run_writer(struct fm_engine * engine)
{
  struct fm_blackbox_writer * writer;
  pthread_t thread;
  CHECK(fm_blackbox_writer_create(&writer, &options) == 0);
  CHECK(fm_blackbox_writer_start(writer, engine));
  CHECK(pthread_create(&thread, NULL, deliver, engine) == 0);
  for (int k = 0; k < 100; ++k) {
    CHECK(fm_blackbox_writer_facts(writer).failed == 0);
  }
  pthread_join(thread, NULL);
  fm_blackbox_writer_end(writer);
  fm_blackbox_writer_end(writer);
  const struct fm_blackbox_facts facts = fm_blackbox_writer_facts(writer);
  CHECK(facts.kept == N_MESSAGES && facts.written >= 1 && facts.failed == 0);
  check_lines(writer, facts.written);
  destroy_engine(engine);
  fm_blackbox_writer_destroy(writer);
}

static void test_writer(const char * root)
{
  options.folder = in_folder(root, "writer");
  make_others();
  options.memory = 4096;  // less than what is delivered between two looks
  options.poll = 5000000;
  options.after = 20000000;
  run_writer(make_engine(NULL));
}

int main(int argc, char ** argv)
{
  CHECK(argc == 2);
  test_longest_time(argv[1]);
  test_names(argv[1]);
  test_full_disk(argv[1]);
  test_writer(argv[1]);
  return failures == 0 ? 0 : 1;
}
