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

/// mcap.c: see mcap.h for the contract.

#define _POSIX_C_SOURCE 200809L

#include "mcap.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define CHUNK_BYTES (UINT64_C(1) << 20)
#define INDEX_BYTES 16u    // of a message
#define CHANNEL_BYTES 35u  // of a topic, in both summaries
#define END_BYTES 300u     // of the last chunk and its index, the statistics, and the file's end
#define FOOTER_BYTES 20u

enum kind
{
  HEADER = 1, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX, STATISTICS = 11,
  METADATA, METADATA_INDEX, DATA_END = 15
};

static const uint8_t magic[] = {0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};

// Bytes that grow; when memory is short, what does not fit is left out.
struct bytes
{
  uint8_t * data;
  size_t size;
  size_t capacity;
  bool is_short;
};

// A message that was not written yet: its record in the chunk.
struct waiting
{
  uint64_t time;
  size_t begin;
  size_t size;
  uint16_t channel;
};

struct channel
{
  char * type;
  uint64_t count;     // messages that are written
  uint32_t waiting;   // messages of the present chunk
  uint64_t index_at;  // in the file: of the last chunk's index
  uint16_t schema;
};

struct fm_mcap
{
  int file;
  int error;
  bool has_ended;
  uint64_t written;
  struct bytes chunk;             // records of messages
  struct waiting * waiting;
  size_t n_waiting;
  size_t most_waiting;
  struct channel * channels;
  uint16_t n_channels;
  uint16_t n_schemas;
  uint32_t n_chunks;
  uint32_t n_metadata;
  uint32_t sequence;
  uint64_t start;
  uint64_t end;
  struct bytes definitions;       // of the summary, as these: records
  struct bytes chunk_indices;
  struct bytes metadata_indices;
  struct bytes record;            // that is being made
  uint32_t checksums[256];        // of one byte
};

// ---- bytes -------------------------------------------------------------------------------------

static bool make_room(struct bytes * bytes, size_t more)
{
  if (bytes->capacity - bytes->size < more) {
    const size_t wanted = bytes->size + more;
    const size_t capacity = wanted < 2 * bytes->capacity ? 2 * bytes->capacity : wanted;
    uint8_t * moved = wanted < more ? NULL : realloc(bytes->data, capacity);
    if (moved == NULL) {
      bytes->is_short = true;
      return false;
    }
    bytes->data = moved;
    bytes->capacity = capacity;
  }
  return !bytes->is_short;
}

static void put(struct bytes * bytes, const void * data, size_t size)
{
  if (size > 0 && make_room(bytes, size)) {
    memcpy(bytes->data + bytes->size, data, size);
    bytes->size += size;
  }
}

// Write a number over bytes: the lowest first.
static void write_number(uint8_t * out, uint64_t value, size_t size)
{
  for (size_t k = 0; k < size; ++k) {
    out[k] = (uint8_t)(value >> (8u * k));
  }
}

static void put_number(struct bytes * bytes, uint64_t value, size_t size)
{
  uint8_t number[8];
  write_number(number, value, size);
  put(bytes, number, size);
}

static void put_text(struct bytes * bytes, const char * text)
{
  const size_t size = strlen(text);
  put_number(bytes, size, 4);
  put(bytes, text, size);
}

// Begin a part that has its size before it, in `size` bytes; returns the place of the size.
static size_t begin_part(struct bytes * bytes, size_t size)
{
  put_number(bytes, 0, size);
  return bytes->size - size;
}

static void end_part(struct bytes * bytes, size_t place, size_t size)
{
  if (!bytes->is_short) {
    write_number(bytes->data + place, bytes->size - place - size, size);
  }
}

static size_t begin_record(struct bytes * bytes, enum kind kind)
{
  put_number(bytes, kind, 1);
  return begin_part(bytes, 8);
}

static void end_record(struct bytes * bytes, size_t place)
{
  end_part(bytes, place, 8);
}

static void put_texts(struct bytes * bytes, const struct fm_mcap_text * texts, uint32_t n)
{
  const size_t place = begin_part(bytes, 4);
  for (uint32_t k = 0; k < n; ++k) {
    put_text(bytes, texts[k].name);
    put_text(bytes, texts[k].value);
  }
  end_part(bytes, place, 4);
}

// ---- the file ----------------------------------------------------------------------------------

static void write_bytes(struct fm_mcap * mcap, const uint8_t * data, size_t size)
{
  while (mcap->error == 0 && size > 0) {
    const ssize_t n = write(mcap->file, data, size);
    if (n < 0 && errno != EINTR) {
      mcap->error = errno;
    } else if (n > 0) {
      data += n;
      size -= (size_t)n;
      mcap->written += (uint64_t)n;
    }
  }
}

static void write_record(struct fm_mcap * mcap, struct bytes * bytes)
{
  if (bytes->is_short && mcap->error == 0) {
    mcap->error = ENOMEM;
  }
  write_bytes(mcap, bytes->data, bytes->size);
}

static void fill_checksums(struct fm_mcap * mcap)
{
  for (uint32_t byte = 0; byte < 256u; ++byte) {
    uint32_t sum = byte;
    for (int bit = 0; bit < 8; ++bit) {
      sum = (sum >> 1) ^ ((sum & 1u) != 0 ? UINT32_C(0xedb88320) : 0u);
    }
    mcap->checksums[byte] = sum;
  }
}

// CRC-32 as of zlib, of bytes after others with the checksum `sum`.
static uint32_t checksum(
  const struct fm_mcap * mcap, uint32_t sum, const uint8_t * data, size_t size)
{
  sum = ~sum;
  for (size_t k = 0; k < size; ++k) {
    sum = (sum >> 8) ^ mcap->checksums[(sum ^ data[k]) & 0xffu];
  }
  return ~sum;
}

struct fm_mcap * fm_mcap_create(int file)
{
  struct fm_mcap * mcap = calloc(1, sizeof(*mcap));
  if (mcap == NULL) {
    return NULL;
  }
  mcap->file = file;
  fill_checksums(mcap);
  write_bytes(mcap, magic, sizeof(magic));
  const size_t place = begin_record(&mcap->record, HEADER);
  put_text(&mcap->record, "ros2");
  put_text(&mcap->record, "fret_monitor");
  end_record(&mcap->record, place);
  write_record(mcap, &mcap->record);
  return mcap;
}

void fm_mcap_destroy(struct fm_mcap * mcap)
{
  for (uint16_t k = 0; k < mcap->n_channels; ++k) {
    free(mcap->channels[k].type);
  }
  free(mcap->channels);
  free(mcap->waiting);
  free(mcap->chunk.data);
  free(mcap->definitions.data);
  free(mcap->chunk_indices.data);
  free(mcap->metadata_indices.data);
  free(mcap->record.data);
  free(mcap);
}

uint64_t fm_mcap_size(const struct fm_mcap * mcap)
{
  return mcap->has_ended ? mcap->written :
         mcap->written + mcap->chunk.size + INDEX_BYTES * mcap->n_waiting +
         CHANNEL_BYTES * (uint64_t)mcap->n_channels + mcap->definitions.size +
         mcap->chunk_indices.size + mcap->metadata_indices.size + END_BYTES;
}

int fm_mcap_error(const struct fm_mcap * mcap) {return mcap->error;}

// ---- chunks ------------------------------------------------------------------------------------

static int compare_times(const void * one, const void * other)
{
  const struct waiting * a = one;
  const struct waiting * b = other;
  return a->time != b->time ? (a->time < b->time ? -1 : 1) : a->begin < b->begin ? -1 : 1;
}

static uint32_t checksum_of_waiting(const struct fm_mcap * mcap)
{
  uint32_t sum = 0;
  for (size_t k = 0; k < mcap->n_waiting; ++k) {
    const struct waiting * item = &mcap->waiting[k];
    sum = checksum(mcap, sum, mcap->chunk.data + item->begin, item->size);
  }
  return sum;
}

static void write_content(struct fm_mcap * mcap)
{
  struct bytes * record = &mcap->record;
  const uint64_t size = mcap->chunk.size;
  record->size = 0;
  put_number(record, CHUNK, 1);
  put_number(record, 8u + 8u + 8u + 4u + 4u + 8u + size, 8);
  put_number(record, mcap->waiting[0].time, 8);
  put_number(record, mcap->waiting[mcap->n_waiting - 1u].time, 8);
  put_number(record, size, 8);
  put_number(record, checksum_of_waiting(mcap), 4);
  put_text(record, "");  // not compressed
  put_number(record, size, 8);
  write_record(mcap, record);
  for (size_t k = 0; k < mcap->n_waiting; ++k) {
    write_bytes(mcap, mcap->chunk.data + mcap->waiting[k].begin, mcap->waiting[k].size);
  }
}

static void write_message_index(struct fm_mcap * mcap, uint16_t channel)
{
  struct bytes * record = &mcap->record;
  uint64_t offset = 0;
  record->size = 0;
  const size_t place = begin_record(record, MESSAGE_INDEX);
  put_number(record, channel, 2);
  const size_t entries = begin_part(record, 4);
  for (size_t k = 0; k < mcap->n_waiting; ++k) {
    if (mcap->waiting[k].channel == channel) {
      put_number(record, mcap->waiting[k].time, 8);
      put_number(record, offset, 8);
    }
    offset += mcap->waiting[k].size;
  }
  end_part(record, entries, 4);
  end_record(record, place);
  mcap->channels[channel].index_at = mcap->written;
  write_record(mcap, record);
}

// Add the index of a chunk that begins at a place of the file, and whose indices of messages begin
// at another.
static void add_chunk_index(struct fm_mcap * mcap, uint64_t begin, uint64_t indices)
{
  struct bytes * out = &mcap->chunk_indices;
  const size_t place = begin_record(out, CHUNK_INDEX);
  put_number(out, mcap->waiting[0].time, 8);
  put_number(out, mcap->waiting[mcap->n_waiting - 1u].time, 8);
  put_number(out, begin, 8);
  put_number(out, indices - begin, 8);
  const size_t places = begin_part(out, 4);
  for (uint16_t k = 0; k < mcap->n_channels; ++k) {
    if (mcap->channels[k].waiting > 0) {
      put_number(out, k, 2);
      put_number(out, mcap->channels[k].index_at, 8);
    }
  }
  end_part(out, places, 4);
  put_number(out, mcap->written - indices, 8);
  put_text(out, "");
  put_number(out, mcap->chunk.size, 8);
  put_number(out, mcap->chunk.size, 8);
  end_record(out, place);
}

static void note_times(struct fm_mcap * mcap, uint64_t first, uint64_t last)
{
  mcap->start = mcap->n_chunks == 0 || first < mcap->start ? first : mcap->start;
  mcap->end = last > mcap->end ? last : mcap->end;
}

// Write the messages that wait, in the order of their times, and their index.
static void write_chunk(struct fm_mcap * mcap)
{
  if (mcap->n_waiting == 0) {
    return;
  }
  const uint64_t begin = mcap->written;
  qsort(mcap->waiting, mcap->n_waiting, sizeof(*mcap->waiting), compare_times);
  note_times(mcap, mcap->waiting[0].time, mcap->waiting[mcap->n_waiting - 1u].time);
  write_content(mcap);
  const uint64_t indices = mcap->written;
  for (uint16_t k = 0; k < mcap->n_channels; ++k) {
    if (mcap->channels[k].waiting > 0) {
      write_message_index(mcap, k);
    }
  }
  add_chunk_index(mcap, begin, indices);
  for (uint16_t k = 0; k < mcap->n_channels; ++k) {
    mcap->channels[k].count += mcap->channels[k].waiting;
    mcap->channels[k].waiting = 0;
  }
  mcap->n_chunks += 1u;
  mcap->n_waiting = 0;
  mcap->chunk.size = 0;
}

// ---- what a file has ---------------------------------------------------------------------------

// Write what was added to the definitions.
static void write_definition(struct fm_mcap * mcap, size_t from)
{
  write_chunk(mcap);
  if (mcap->definitions.is_short && mcap->error == 0) {
    mcap->error = ENOMEM;
  }
  write_bytes(mcap, mcap->definitions.data + from, mcap->definitions.size - from);
}

static void add_schema(
  struct fm_mcap * mcap, const char * type, const char * const * definition)
{
  struct bytes * out = &mcap->definitions;
  const size_t from = out->size;
  const size_t place = begin_record(out, SCHEMA);
  mcap->n_schemas = (uint16_t)(mcap->n_schemas + 1u);
  put_number(out, mcap->n_schemas, 2);
  put_text(out, type);
  put_text(out, definition[0] == NULL || definition[0][0] == '\0' ? "" : "ros2msg");
  const size_t text = begin_part(out, 4);
  for (; *definition != NULL; ++definition) {
    put(out, *definition, strlen(*definition));
  }
  end_part(out, text, 4);
  end_record(out, place);
  write_definition(mcap, from);
}

static uint16_t schema_of(
  struct fm_mcap * mcap, const char * type, const char * const * definition)
{
  for (uint16_t k = 0; k < mcap->n_channels; ++k) {
    if (mcap->channels[k].type != NULL && strcmp(mcap->channels[k].type, type) == 0) {
      return mcap->channels[k].schema;
    }
  }
  add_schema(mcap, type, definition);
  return mcap->n_schemas;
}

static char * copy_of(const char * text)
{
  const size_t size = strlen(text) + 1u;
  char * copy = malloc(size);
  return copy == NULL ? NULL : memcpy(copy, text, size);
}

uint16_t fm_mcap_add_channel(
  struct fm_mcap * mcap, const char * topic, const char * type, const char * const * definition)
{
  const uint16_t number = mcap->n_channels;
  struct channel * moved =
    realloc(mcap->channels, (number + (size_t)1) * sizeof(*mcap->channels));
  if (moved == NULL) {
    mcap->error = ENOMEM;
    return 0;
  }
  mcap->channels = moved;
  const uint16_t schema = schema_of(mcap, type, definition);
  mcap->channels[number] = (struct channel) {copy_of(type), 0, 0, 0, schema};
  mcap->n_channels = (uint16_t)(number + 1u);
  const size_t from = mcap->definitions.size;
  const size_t place = begin_record(&mcap->definitions, CHANNEL);
  put_number(&mcap->definitions, number, 2);
  put_number(&mcap->definitions, schema, 2);
  put_text(&mcap->definitions, topic);
  put_text(&mcap->definitions, "cdr");
  put_texts(&mcap->definitions, NULL, 0);
  end_record(&mcap->definitions, place);
  write_definition(mcap, from);
  return number;
}

static bool has_room_to_wait(struct fm_mcap * mcap)
{
  if (mcap->n_waiting == mcap->most_waiting) {
    const size_t most = 2 * mcap->most_waiting + 64u;
    struct waiting * moved = realloc(mcap->waiting, most * sizeof(*moved));
    if (moved == NULL) {
      mcap->error = ENOMEM;
      return false;
    }
    mcap->waiting = moved;
    mcap->most_waiting = most;
  }
  return true;
}

void fm_mcap_add_message(
  struct fm_mcap * mcap, uint16_t channel, int64_t time, int64_t sent, const uint8_t * data,
  size_t size)
{
  struct bytes * chunk = &mcap->chunk;
  if (mcap->error != 0 || channel >= mcap->n_channels || !has_room_to_wait(mcap)) {
    return;
  }
  const size_t begin = chunk->size;
  const size_t place = begin_record(chunk, MESSAGE);
  put_number(chunk, channel, 2);
  put_number(chunk, ++mcap->sequence, 4);
  put_number(chunk, (uint64_t)time, 8);
  put_number(chunk, (uint64_t)(sent == 0 ? time : sent), 8);
  put(chunk, data, size);
  end_record(chunk, place);
  if (chunk->is_short) {
    mcap->error = ENOMEM;
    return;
  }
  mcap->waiting[mcap->n_waiting++] =
    (struct waiting) {(uint64_t)time, begin, chunk->size - begin, channel};
  mcap->channels[channel].waiting += 1u;
  if (chunk->size >= CHUNK_BYTES) {
    write_chunk(mcap);
  }
}

void fm_mcap_add_metadata(
  struct fm_mcap * mcap, const char * name, const struct fm_mcap_text * texts, uint32_t n)
{
  struct bytes * out = &mcap->metadata_indices;
  write_chunk(mcap);
  const uint64_t begin = mcap->written;
  mcap->record.size = 0;
  size_t place = begin_record(&mcap->record, METADATA);
  put_text(&mcap->record, name);
  put_texts(&mcap->record, texts, n);
  end_record(&mcap->record, place);
  write_record(mcap, &mcap->record);
  place = begin_record(out, METADATA_INDEX);
  put_number(out, begin, 8);
  put_number(out, mcap->written - begin, 8);
  put_text(out, name);
  end_record(out, place);
  mcap->n_metadata += 1u;
}

static void put_statistics(const struct fm_mcap * mcap, struct bytes * out)
{
  uint64_t n = 0;
  for (uint16_t k = 0; k < mcap->n_channels; ++k) {
    n += mcap->channels[k].count;
  }
  const size_t place = begin_record(out, STATISTICS);
  put_number(out, n, 8);
  put_number(out, mcap->n_schemas, 2);
  put_number(out, mcap->n_channels, 4);
  put_number(out, 0, 4);  // attachments
  put_number(out, mcap->n_metadata, 4);
  put_number(out, mcap->n_chunks, 4);
  put_number(out, mcap->start, 8);
  put_number(out, mcap->end, 8);
  const size_t counts = begin_part(out, 4);
  for (uint16_t k = 0; k < mcap->n_channels; ++k) {
    put_number(out, k, 2);
    put_number(out, mcap->channels[k].count, 8);
  }
  end_part(out, counts, 4);
  end_record(out, place);
}

static void put_bytes(struct bytes * out, const struct bytes * more)
{
  put(out, more->data, more->size);
  out->is_short = out->is_short || more->is_short;
}

void fm_mcap_end(struct fm_mcap * mcap)
{
  struct bytes * record = &mcap->record;
  write_chunk(mcap);
  record->size = 0;
  const size_t place = begin_record(record, DATA_END);
  put_number(record, 0, 4);  // no checksum of the whole
  end_record(record, place);
  write_record(mcap, record);
  const uint64_t begin = mcap->written;
  record->size = 0;
  put_bytes(record, &mcap->definitions);
  put_statistics(mcap, record);
  put_bytes(record, &mcap->chunk_indices);
  put_bytes(record, &mcap->metadata_indices);
  put_number(record, FOOTER, 1);
  put_number(record, FOOTER_BYTES, 8);
  put_number(record, begin, 8);
  put_number(record, 0, 8);  // no offsets of groups
  put_number(record, checksum(mcap, 0, record->data, record->size), 4);
  put(record, magic, sizeof(magic));
  write_record(mcap, record);
  mcap->has_ended = true;
}
