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

/// blackbox_writer.c: see blackbox_writer.h for the contract.

#define _POSIX_C_SOURCE 200809L

#include "blackbox_writer.h"

#include <dirent.h>
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "thread.h"

#define SECOND_NS INT64_C(1000000000)
#define PART_AGE_NS (120 * SECOND_NS)  // after which a file that is not whole is left over
#define FINISHED ".mcap"
#define UNFINISHED ".part"

struct event
{
  struct fm_blackbox_event event;
  struct event * next;
};

struct fm_blackbox_writer
{
  struct fm_blackbox_options options;
  struct fm_blackbox * box;
  struct fm_engine * engine;
  struct fm_blackbox_file * pending;  // used by the thread only
  pthread_t thread;
  pthread_mutex_t mutex;              // of all below
  pthread_cond_t ends;
  bool is_running;
  bool is_over;
  uint64_t written;
  uint64_t failed;
  struct event * events;
};

// ---- the folder --------------------------------------------------------------------------------

struct found
{
  char * path;
  int64_t time;  // of its last change: system time
  uint64_t size;
};

struct listing
{
  struct found * files;
  size_t n;
};

static bool begins_with(const char * text, const char * prefix)
{
  return strncmp(text, prefix, strlen(prefix)) == 0;
}

static bool ends_with(const char * text, const char * suffix)
{
  const size_t length = strlen(text);
  return length >= strlen(suffix) && strcmp(text + length - strlen(suffix), suffix) == 0;
}

// Add a file of a black box to the list, but not one that is being written.
static int list_file(struct listing * listing, const char * folder, const char * name)
{
  const bool is_part = begins_with(name, ".blackbox_") && ends_with(name, UNFINISHED);
  char path[PATH_MAX];
  struct stat status;
  if (!is_part && !(begins_with(name, "blackbox_") && ends_with(name, FINISHED))) {
    return 0;
  }
  if (snprintf(path, sizeof(path), "%s/%s", folder, name) >= PATH_MAX ||
    lstat(path, &status) != 0 || !S_ISREG(status.st_mode))
  {
    return 0;  // another node has removed it, or it is none
  }
  const int64_t time = (int64_t)status.st_mtim.tv_sec * SECOND_NS + status.st_mtim.tv_nsec;
  if (is_part && fm_read_clock(CLOCK_REALTIME) - time <= PART_AGE_NS) {
    return 0;
  }
  struct found * moved = realloc(listing->files, (listing->n + 1u) * sizeof(*moved));
  if (moved == NULL) {
    return ENOMEM;
  }
  listing->files = moved;
  moved[listing->n] = (struct found) {strdup(path), time, (uint64_t)status.st_size};
  return moved[listing->n++].path == NULL ? ENOMEM : 0;
}

static int list_files(struct listing * listing, const char * folder)
{
  int error = 0;
  DIR * opened = opendir(folder);
  if (opened == NULL) {
    return errno;
  }
  for (const struct dirent * entry = readdir(opened); error == 0 && entry != NULL;
    entry = readdir(opened))
  {
    error = list_file(listing, folder, entry->d_name);
  }
  closedir(opened);
  return error;
}

static int compare_ages(const void * one, const void * other)
{
  const struct found * a = one;
  const struct found * b = other;
  return a->time == b->time ? 0 : a->time < b->time ? -1 : 1;
}

static int remove_oldest(const struct fm_blackbox_writer * writer, struct listing * listing,
  uint64_t used)
{
  const struct fm_blackbox_options * options = &writer->options;
  qsort(listing->files, listing->n, sizeof(*listing->files), compare_ages);
  for (size_t k = 0; k < listing->n; ++k) {
    used += listing->files[k].size;
  }
  for (size_t k = 0; k < listing->n; ++k) {
    if (listing->n - k < options->files && used <= options->disk) {
      return 0;
    }
    if (unlink(listing->files[k].path) != 0 && errno != ENOENT) {
      return errno;
    }
    used -= listing->files[k].size;
  }
  return 0;
}

// Remove the oldest files, so that one of a size and those that stay are not too many. Returns an
// error as in errno.
static int make_room(const struct fm_blackbox_writer * writer, uint64_t size)
{
  struct listing listing = {NULL, 0};
  int error = list_files(&listing, writer->options.folder);
  if (error == 0 && listing.n > 0) {
    error = remove_oldest(writer, &listing, size);
  }
  for (size_t k = 0; k < listing.n; ++k) {
    free(listing.files[k].path);
  }
  free(listing.files);
  return error;
}

static int make_folder(const char * folder)
{
  char path[PATH_MAX];
  if (snprintf(path, sizeof(path), "%s", folder) >= PATH_MAX) {
    return ENAMETOOLONG;
  }
  for (char * at = strchr(path + 1, '/'); at != NULL; at = strchr(at + 1, '/')) {
    *at = '\0';
    if (mkdir(path, 0777) != 0 && errno != EEXIST && errno != EROFS && errno != EACCES) {
      return errno;
    }
    *at = '/';
  }
  return mkdir(path, 0777) == 0 || errno == EEXIST ? 0 : errno;
}

static int prepare_folder(const char * folder)
{
  char path[PATH_MAX];
  int error = make_folder(folder);
  if (error == 0 && snprintf(path, sizeof(path), "%s/.blackbox_XXXXXX", folder) >= PATH_MAX) {
    error = ENAMETOOLONG;
  }
  const int file = error == 0 ? mkstemp(path) : -1;
  if (error != 0 || file < 0) {
    return error != 0 ? error : errno;
  }
  error = write(file, "", 1) == 1 ? 0 : errno;
  (void)unlink(path);
  return close(file) == 0 || error != 0 ? error : errno;
}

// ---- events ------------------------------------------------------------------------------------

static void add_event(struct fm_blackbox_writer * writer, const char * path, int error)
{
  struct event * made = malloc(sizeof(*made));
  char * copy = strdup(path);
  if (made == NULL || copy == NULL) {
    free(made);
    free(copy);
    return;
  }
  *made = (struct event) {{copy, error}, NULL};
  struct event ** last = &writer->events;
  while (*last != NULL) {
    last = &(*last)->next;
  }
  *last = made;
}

bool fm_blackbox_writer_take(struct fm_blackbox_writer * writer, struct fm_blackbox_event * out)
{
  pthread_mutex_lock(&writer->mutex);
  struct event * first = writer->events;
  if (first != NULL) {
    writer->events = first->next;
    *out = first->event;
  }
  pthread_mutex_unlock(&writer->mutex);
  free(first);
  return first != NULL;
}

static void note_written(struct fm_blackbox_writer * writer)
{
  pthread_mutex_lock(&writer->mutex);
  writer->written += 1u;
  add_event(writer, fm_blackbox_file_path(writer->pending), 0);
  pthread_mutex_unlock(&writer->mutex);
}

static void note_failure(struct fm_blackbox_writer * writer, int error)
{
  pthread_mutex_lock(&writer->mutex);
  writer->failed += 1u;
  if (writer->failed == 1u) {
    add_event(writer, writer->options.folder, error);
  }
  pthread_mutex_unlock(&writer->mutex);
}

// ---- the thread --------------------------------------------------------------------------------

static void close_pending(struct fm_blackbox_writer * writer)
{
  if (writer->pending != NULL) {
    fm_blackbox_file_close(writer->pending);
    writer->pending = NULL;
  }
}

static int begin(struct fm_blackbox_writer * writer, const struct fm_occurrences * found)
{
  const int64_t began =
    fm_read_clock(CLOCK_REALTIME) - (fm_steady_time() - found->first);
  const time_t seconds = (time_t)(began / SECOND_NS);
  char day[32] = "";
  char stamp[48];
  struct tm parts;
  int error = make_room(writer, 0);
  if (error != 0) {
    return error;
  }
  if (gmtime_r(&seconds, &parts) != NULL) {
    (void)strftime(day, sizeof(day), "%Y%m%dT%H%M%S", &parts);
  }
  (void)snprintf(
    stamp, sizeof(stamp), "%s.%03dZ", day, (int)(began % SECOND_NS / (SECOND_NS / 1000)));
  writer->pending =
    fm_blackbox_file_open(&writer->options, writer->box, found, stamp, &error);
  return error;
}

static int finish(struct fm_blackbox_writer * writer)
{
  const int error = fm_blackbox_file_finish(writer->pending);
  if (error == 0) {
    note_written(writer);
    close_pending(writer);
  }
  return error;
}

// Begin a file at violations, or let them join the one that is pending.
static int answer(struct fm_blackbox_writer * writer, const struct fm_occurrences * found)
{
  int error = 0;
  if (writer->pending != NULL) {
    if (fm_blackbox_file_join(writer->pending, found)) {
      return fm_blackbox_file_error(writer->pending);
    }
    error = finish(writer);
  }
  return error != 0 ? error : begin(writer, found);
}

// Copy messages to the file that is pending, and end it in time.
static int go_on(struct fm_blackbox_writer * writer, bool is_over)
{
  // Before copying: the file then has all messages until this time.
  const int64_t steady = fm_steady_time();
  fm_blackbox_file_copy(writer->pending, steady, fm_engine_ros_time(writer->engine));
  int error = fm_blackbox_file_error(writer->pending);
  if (error == 0) {
    error = make_room(writer, fm_blackbox_file_size(writer->pending));
  }
  return error == 0 && (is_over || fm_blackbox_file_is_complete(writer->pending, steady)) ?
         finish(writer) : error;
}

static void look(struct fm_blackbox_writer * writer, bool is_over)
{
  const struct fm_occurrences found = fm_blackbox_take_occurrences(writer->box);
  int error = found.n > 0 ? answer(writer, &found) : 0;
  if (error == 0 && writer->pending != NULL) {
    error = go_on(writer, is_over);
  }
  if (error != 0) {
    close_pending(writer);
    note_failure(writer, error);
  }
}

static void * run(void * argument)
{
  struct fm_blackbox_writer * writer = argument;
  bool is_over = false;
  while (!is_over) {
    const int64_t next = fm_steady_time() + writer->options.poll;
    pthread_mutex_lock(&writer->mutex);
    while (!writer->is_over && fm_steady_time() < next) {
      fm_wait_until(&writer->ends, &writer->mutex, next);
    }
    is_over = writer->is_over;
    pthread_mutex_unlock(&writer->mutex);
    look(writer, is_over);
  }
  return NULL;
}

// ---- its life ----------------------------------------------------------------------------------

static int make_parts(struct fm_blackbox_writer * writer)
{
  const int error = prepare_folder(writer->options.folder);
  if (error != 0) {
    return error;
  }
  writer->box = fm_blackbox_create(writer->options.memory, writer->options.lasts);
  if (writer->box == NULL) {
    return ENOMEM;
  }
  if (!fm_make_condition(&writer->ends)) {
    fm_blackbox_destroy(writer->box);
    return ENOMEM;
  }
  return 0;
}

// Several topics of the bundle are one that has several `where`: its messages are kept once.
static void keep_once(const struct fm_blackbox_options * options, struct fm_engine * engine)
{
  for (uint32_t k = 0; k < options->n_topics; ++k) {
    const uint32_t first = fm_blackbox_first(options, k);
    if (first != k) {
      fm_engine_keep_of(engine, first, FM_KEEP_ALL);
      fm_engine_keep_of(engine, k, FM_KEEP_NONE);
    }
  }
}

int fm_blackbox_writer_create(
  struct fm_blackbox_writer ** out, const struct fm_blackbox_options * options)
{
  struct fm_blackbox_writer * writer = calloc(1, sizeof(*writer));
  *out = NULL;
  if (writer == NULL || pthread_mutex_init(&writer->mutex, NULL) != 0) {
    free(writer);
    return ENOMEM;
  }
  writer->options = *options;
  const int error = make_parts(writer);
  if (error != 0) {
    pthread_mutex_destroy(&writer->mutex);
    free(writer);
    return error;
  }
  *out = writer;
  return 0;
}

bool fm_blackbox_writer_start(struct fm_blackbox_writer * writer, struct fm_engine * engine)
{
  fm_engine_keep_messages(engine, writer->box);
  keep_once(&writer->options, engine);
  writer->engine = engine;
  writer->is_over = false;
  writer->is_running = fm_start_thread(&writer->thread, run, writer);
  return writer->is_running;
}

void fm_blackbox_writer_end(struct fm_blackbox_writer * writer)
{
  if (writer->is_running) {
    pthread_mutex_lock(&writer->mutex);
    writer->is_over = true;
    pthread_cond_signal(&writer->ends);
    pthread_mutex_unlock(&writer->mutex);
    pthread_join(writer->thread, NULL);
    writer->is_running = false;
    close_pending(writer);
  }
}

void fm_blackbox_writer_destroy(struct fm_blackbox_writer * writer)
{
  struct fm_blackbox_event event;
  fm_blackbox_writer_end(writer);
  while (fm_blackbox_writer_take(writer, &event)) {
    free(event.path);
  }
  fm_blackbox_destroy(writer->box);
  pthread_cond_destroy(&writer->ends);
  pthread_mutex_destroy(&writer->mutex);
  free(writer);
}

struct fm_blackbox_facts fm_blackbox_writer_facts(struct fm_blackbox_writer * writer)
{
  const struct fm_blackbox_counts counts = fm_blackbox_count(writer->box);
  pthread_mutex_lock(&writer->mutex);
  const struct fm_blackbox_facts facts =
  {writer->written, writer->failed, counts.kept, counts.left_out, counts.early};
  pthread_mutex_unlock(&writer->mutex);
  return facts;
}
