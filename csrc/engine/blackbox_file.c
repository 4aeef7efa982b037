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

/// blackbox_file.c: see blackbox_file.h for the contract.

#define _POSIX_C_SOURCE 200809L

#include "blackbox_file.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "mcap.h"

#define SECOND_NS INT64_C(1000000000)
#define JUMP_NS INT64_C(500000000)  // messages so much older than those before are of another run
#define RECORD_BYTES 47u            // of a message in a file, beside its data
#define LAST_BYTES 1024u            // for what is added when a file is complete
#define PIECE_BYTES (UINT64_C(1) << 16)  // copied at once, while messages wait
#define LONGEST_NAME 100u           // characters of a requirement, and of a node, in a file's name
#define MOST_KEY_BYTES 255u
#define MOST_NAME_BYTES 1024u
#define MOST_CHANNELS 60000u
#define NO_CHANNEL UINT16_MAX

// A topic with a key in its name, and its number in the file.
struct keyed_channel
{
  uint32_t topic;
  uint32_t key_size;
  uint8_t key[MOST_KEY_BYTES];
  uint16_t number;
};

struct fm_blackbox_file
{
  const struct fm_blackbox_options * options;
  struct fm_blackbox * box;
  struct fm_mcap * mcap;
  int file;
  int error;
  bool has_part;             // a file is there that is not whole
  char part[PATH_MAX];
  char path[PATH_MAX];
  uint32_t requirement;
  int64_t first;             // CLOCK_MONOTONIC, as these: of the first violation
  int64_t last;              // of the last one that may join
  int64_t until;
  int64_t since;
  uint64_t n;                // violations
  uint64_t place;            // in the ring
  int64_t time;              // of the last message that had one
  int64_t end;               // the node's time until which all messages are in the file
  uint64_t excess;           // bytes of the oldest messages, which are left out
  bool has_excess;
  bool has_jumped;
  int64_t jump;              // when a message of another run was kept
  bool is_full;
  uint8_t * data;            // of the message that is being read
  uint64_t capacity;
  uint16_t * numbers;        // of the topics in the file; NO_CHANNEL: a key is in the name
  struct keyed_channel * keyed;
  uint32_t n_keyed;
};

// ---- the ring ----------------------------------------------------------------------------------

// Read what describes the message at `*place`, or the oldest one if that is overwritten. Returns
// false if there is none yet.
static bool read_kept(struct fm_blackbox * box, uint64_t * place, struct fm_kept * out)
{
  uint64_t begin = *place;
  uint64_t n = fm_blackbox_copy(box, *place, (uint8_t *)out, sizeof(*out), &begin);
  while (n == 0 && begin > *place) {
    *place = begin;
    n = fm_blackbox_copy(box, *place, (uint8_t *)out, sizeof(*out), &begin);
  }
  return n == sizeof(*out);
}

static bool has_room(struct fm_blackbox_file * file, uint64_t size)
{
  if (size > file->capacity) {
    uint8_t * moved = realloc(file->data, (size_t)size);
    if (moved == NULL) {
      file->error = ENOMEM;
      return false;
    }
    file->data = moved;
    file->capacity = size;
  }
  return true;
}

// Read the data of the message at a place, in pieces. Returns false if it was overwritten.
static bool read_data(struct fm_blackbox_file * file, uint64_t place, uint64_t size)
{
  uint64_t read = 0;
  while (read < size) {
    const uint64_t rest = size - read;
    uint64_t begin;
    const uint64_t n = fm_blackbox_copy(
      file->box, place + sizeof(struct fm_kept) + read, file->data + read,
      rest < PIECE_BYTES ? rest : PIECE_BYTES, &begin);
    if (n == 0) {
      return false;
    }
    read += n;
  }
  return true;
}

// Return by how many bytes the messages before the violation are too many.
static uint64_t measure(const struct fm_blackbox_file * file)
{
  const struct fm_blackbox_options * options = file->options;
  const uint64_t size = fm_blackbox_file_size(file);
  // At most three quarters are for what was before the violation.
  const uint64_t room = size < options->disk ? (options->disk - size) / 4u * 3u : 0;
  struct fm_kept kept;
  uint64_t place = 0;
  uint64_t sum = 0;
  if (2u * options->memory <= room) {
    return 0;
  }
  while (read_kept(file->box, &place, &kept)) {
    if (kept.steady >= file->since && kept.steady <= file->first) {
      sum += RECORD_BYTES + kept.size;
    }
    place += sizeof(kept) + kept.size;
  }
  return sum > room ? sum - room : 0;
}

// ---- the file ----------------------------------------------------------------------------------

uint32_t fm_blackbox_first(const struct fm_blackbox_options * options, uint32_t k)
{
  uint32_t first = 0;
  while (strcmp(options->topics[first].name, options->topics[k].name) != 0) {
    first += 1;
  }
  return first;
}

// Add the topic `k`, and return its number. One that has several `where` is there once, and one
// with a key in its name when a message says the key.
static uint16_t add_topic(struct fm_blackbox_file * file, uint32_t k)
{
  const struct fm_blackbox_topic * topics = file->options->topics;
  const uint32_t first = fm_blackbox_first(file->options, k);
  if (first != k) {
    return file->numbers[first];
  }
  return strchr(topics[k].name, '{') != NULL ? NO_CHANNEL :
         fm_mcap_add_channel(file->mcap, topics[k].name, topics[k].type, topics[k].definition);
}

static void write_head(struct fm_blackbox_file * file)
{
  if (file->mcap != NULL) {
    fm_mcap_destroy(file->mcap);
    file->mcap = NULL;
    if (lseek(file->file, 0, SEEK_SET) != 0 || ftruncate(file->file, 0) != 0) {
      file->error = errno;
      return;
    }
  }
  file->mcap = fm_mcap_create(file->file);
  file->n_keyed = 0;
  if (file->mcap == NULL) {
    file->error = ENOMEM;
    return;
  }
  for (uint32_t k = 0; k <= file->options->n_topics; ++k) {
    file->numbers[k] = add_topic(file, k);
  }
}

static const char * last_part(const char * text)
{
  const size_t length = strlen(text);
  return length > LONGEST_NAME ? text + length - LONGEST_NAME : text;
}

// Write the two paths; the node's slashes become underscores. Returns false if they are too long.
static bool name_file(struct fm_blackbox_file * file, const char * stamp, uint32_t number)
{
  const struct fm_blackbox_options * options = file->options;
  char node[LONGEST_NAME + 1u];
  char name[3u * LONGEST_NAME];
  char suffix[16] = "";
  const char * full = options->node[0] == '/' ? options->node + 1 : options->node;
  (void)snprintf(node, sizeof(node), "%s", last_part(full));
  for (char * at = strchr(node, '/'); at != NULL; at = strchr(at, '/')) {
    *at = '_';
  }
  if (number > 1u) {
    (void)snprintf(suffix, sizeof(suffix), "_%" PRIu32, number);
  }
  (void)snprintf(name, sizeof(name), "%s_%s_%.*s%s", stamp, node, (int)LONGEST_NAME,
    options->requirements[file->requirement].name, suffix);
  return snprintf(file->part, PATH_MAX, "%s/.blackbox_%s.part", options->folder, name) <
         PATH_MAX &&
         snprintf(file->path, PATH_MAX, "%s/blackbox_%s.mcap", options->folder, name) < PATH_MAX;
}

static void remove_part(struct fm_blackbox_file * file)
{
  if (file->has_part) {
    (void)close(file->file);
    (void)unlink(file->part);
    file->has_part = false;
  }
}

// Open a file with a name that no other has.
static void open_part(struct fm_blackbox_file * file, const char * stamp)
{
  for (uint32_t number = 1; file->error == 0 && !file->has_part; ++number) {
    if (!name_file(file, stamp, number)) {
      file->error = ENAMETOOLONG;
      return;
    }
    file->file = open(file->part, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    file->has_part = file->file >= 0;
    if (!file->has_part && errno != EEXIST) {
      file->error = errno;
    } else if (file->has_part && access(file->path, F_OK) == 0) {
      remove_part(file);
    }
  }
}

struct fm_blackbox_file * fm_blackbox_file_open(
  const struct fm_blackbox_options * options, struct fm_blackbox * box,
  const struct fm_occurrences * found, const char * stamp, int * error)
{
  struct fm_blackbox_file * file = calloc(1, sizeof(*file));
  uint16_t * numbers = calloc(options->n_topics + (size_t)1, sizeof(*numbers));
  if (file == NULL || numbers == NULL) {
    free(file);
    free(numbers);
    *error = ENOMEM;
    return NULL;
  }
  file->options = options;
  file->numbers = numbers;
  file->box = box;
  file->requirement = found->requirement;
  file->first = found->first;
  file->last = found->first + FM_BLACKBOX_LONGEST_NS;
  file->since = found->first - options->lasts;
  open_part(file, stamp);
  if (file->error == 0) {
    write_head(file);
  }
  *error = fm_blackbox_file_error(file);
  if (*error != 0) {
    fm_blackbox_file_close(file);
    return NULL;
  }
  // All of them belong to it.
  file->until = found->last + options->after < file->last ?
    found->last + options->after : file->last;
  file->n = found->n;
  return file;
}

uint64_t fm_blackbox_file_size(const struct fm_blackbox_file * file)
{
  return fm_mcap_size(file->mcap) + LAST_BYTES;
}

const char * fm_blackbox_file_path(const struct fm_blackbox_file * file) {return file->path;}

int fm_blackbox_file_error(const struct fm_blackbox_file * file)
{
  return file->error != 0 || file->mcap == NULL ? file->error : fm_mcap_error(file->mcap);
}

// ---- messages ----------------------------------------------------------------------------------

static uint16_t add_keyed(struct fm_blackbox_file * file, const struct fm_kept * kept)
{
  const struct fm_blackbox_topic * topic = &file->options->topics[kept->topic];
  const size_t before = strcspn(topic->name, "{");
  const char * after = topic->name + before + strcspn(topic->name + before, "}");
  const size_t n = file->n_keyed;
  struct keyed_channel * moved = realloc(file->keyed, (n + 1u) * sizeof(*moved));
  char name[MOST_NAME_BYTES];
  if (moved == NULL || n + file->options->n_topics >= MOST_CHANNELS) {
    file->keyed = moved == NULL ? file->keyed : moved;
    file->error = ENOMEM;
    return 0;
  }
  (void)snprintf(name, sizeof(name), "%.*s%.*s%s", (int)before, topic->name, (int)kept->key_size,
    (const char *)file->data, *after == '}' ? after + 1 : after);
  file->keyed = moved;
  moved[n] = (struct keyed_channel) {kept->topic, kept->key_size, {0},
    fm_mcap_add_channel(file->mcap, name, topic->type, topic->definition)};
  memcpy(moved[n].key, file->data, kept->key_size);
  file->n_keyed += 1u;
  return moved[n].number;
}

// The number in the file of the topic of a message, whose key is in its data.
static uint16_t channel_of(struct fm_blackbox_file * file, const struct fm_kept * kept)
{
  if (kept->key_size == 0) {
    return file->numbers[kept->topic];
  }
  for (uint32_t k = 0; k < file->n_keyed; ++k) {
    const struct keyed_channel * item = &file->keyed[k];
    if (item->topic == kept->topic && item->key_size == kept->key_size &&
      memcmp(item->key, file->data, kept->key_size) == 0)
    {
      return item->number;
    }
  }
  return add_keyed(file, kept);
}

static void add(struct fm_blackbox_file * file, const struct fm_kept * kept)
{
  const uint64_t size = RECORD_BYTES + kept->size;
  const bool is_before = kept->steady <= file->first;
  if (is_before && size <= file->excess) {
    file->excess -= size;
  } else if (!is_before && fm_blackbox_file_size(file) + size > file->options->disk) {
    file->is_full = true;
  } else {
    const uint16_t channel = channel_of(file, kept);
    file->excess = 0;
    fm_mcap_add_message(
      file->mcap, channel, file->time, kept->sent > 0 ? kept->sent : 0,
      file->data + kept->key_size, (size_t)kept->size - kept->key_size);
  }
}

// Take a message if it belongs to the file. Returns whether the next one may, too.
static bool take(struct fm_blackbox_file * file, const struct fm_kept * kept)
{
  if (kept->time > 0 && kept->time < file->time - JUMP_NS) {  // /clock began anew
    if (kept->steady > file->first) {
      file->has_jumped = true;
      file->jump = kept->steady;
      return false;
    }
    write_head(file);
  }
  file->time = kept->time != 0 ? kept->time : file->time;
  // Without a time: they came before /clock, or before time 0.
  if (kept->steady >= file->since && file->time > 0 && fm_blackbox_file_error(file) == 0) {
    add(file, kept);
  }
  return true;
}

static void copy_messages(struct fm_blackbox_file * file)
{
  struct fm_kept kept;
  if (!file->has_excess) {
    file->has_excess = true;
    file->excess = measure(file);
  }
  while (fm_blackbox_file_error(file) == 0 && read_kept(file->box, &file->place, &kept)) {
    if (kept.steady > file->until || file->is_full || !has_room(file, kept.size)) {
      return;
    }
    if (read_data(file, file->place, kept.size)) {
      if (!take(file, &kept)) {
        return;
      }
      file->place += sizeof(kept) + kept.size;
    }
  }
}

void fm_blackbox_file_copy(struct fm_blackbox_file * file, int64_t steady, int64_t now)
{
  if (steady <= file->until) {
    file->end = now;
  }
  copy_messages(file);
}

bool fm_blackbox_file_join(
  struct fm_blackbox_file * file, const struct fm_occurrences * found)
{
  const bool is_in_time = found->last <= file->last;
  if (is_in_time) {
    const int64_t until = found->last + file->options->after;
    file->until = until < file->last ? until : file->last;
  }
  copy_messages(file);
  if (!is_in_time || file->is_full || (file->has_jumped && found->last >= file->jump)) {
    return false;
  }
  file->n += found->n;
  return true;
}

bool fm_blackbox_file_is_complete(const struct fm_blackbox_file * file, int64_t steady)
{
  return steady > file->until || file->is_full || file->has_jumped;
}

// ---- the end -----------------------------------------------------------------------------------

static void put_number(uint8_t * out, uint32_t value)
{
  for (int k = 0; k < 4; ++k) {
    out[k] = (uint8_t)(value >> (8 * k));
  }
}

// A recording ends with its last message, and what is due later would not be judged: add a message
// std_msgs/msg/Header at the time until which the file has all.
static void add_end(struct fm_blackbox_file * file)
{
  const char * id = file->options->requirements[file->requirement].id;
  const size_t length = strlen(id) + 1u;
  if (!has_room(file, 16u + length)) {
    return;
  }
  memcpy(file->data, "\0\1\0", 4);  // CDR, the lowest byte first
  put_number(file->data + 4, (uint32_t)(file->end / SECOND_NS));
  put_number(file->data + 8, (uint32_t)(file->end % SECOND_NS));
  put_number(file->data + 12, (uint32_t)length);
  memcpy(file->data + 16, id, length);
  fm_mcap_add_message(
    file->mcap, file->numbers[file->options->n_topics], file->end, 0, file->data, 16u + length);
}

static void add_metadata(struct fm_blackbox_file * file)
{
  char n[24];
  (void)snprintf(n, sizeof(n), "%" PRIu64, file->n);
  const struct fm_mcap_text texts[] = {
    {"bundle", file->options->bundle},
    {"requirement", file->options->requirements[file->requirement].id}, {"occurrences", n}};
  fm_mcap_add_metadata(file->mcap, "fret_monitor", texts, sizeof(texts) / sizeof(texts[0]));
}

int fm_blackbox_file_finish(struct fm_blackbox_file * file)
{
  if (fm_blackbox_file_error(file) != 0) {
    return fm_blackbox_file_error(file);
  }
  if (!file->is_full && !file->has_jumped && file->end > file->time) {
    add_end(file);
  }
  add_metadata(file);
  fm_mcap_end(file->mcap);
  const int error = fm_blackbox_file_error(file);
  if (error != 0) {
    return error;
  }
  if (fsync(file->file) != 0 || rename(file->part, file->path) != 0) {
    return errno;
  }
  file->has_part = false;
  return close(file->file) == 0 ? 0 : errno;
}

void fm_blackbox_file_close(struct fm_blackbox_file * file)
{
  remove_part(file);
  if (file->mcap != NULL) {
    fm_mcap_destroy(file->mcap);
  }
  free(file->data);
  free(file->keyed);
  free(file->numbers);
  free(file);
}
