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

/// node_blackbox.c: see session.h for the contract.

#define _POSIX_C_SOURCE 200809L

#include "session.h"

#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "words.h"

#define END_TOPIC "~/blackbox_end"
#define END_TYPE "std_msgs/msg/Header"

// Add the parts of a path but those that are empty or '.', each after a slash; returns the end.
static char * add_parts(char * end, const char * folder)
{
  while (*folder != '\0') {
    const size_t size = strcspn(folder, "/");
    if (size > 0 && (size != 1 || folder[0] != '.')) {
      *end = '/';
      memcpy(end + 1, folder, size);
      end += size + 1u;
    }
    folder += size + (folder[size] == '/' ? 1u : 0u);
  }
  return end;
}

// Return the whole path of a folder; NULL if there is none, or memory is short.
static const char * whole_path(struct fm_memory * memory, const char * folder)
{
  const bool is_at_home = folder[0] == '~' && (folder[1] == '/' || folder[1] == '\0');
  const char * home = is_at_home ? getenv("HOME") : NULL;
  const char * first = home != NULL ? home : folder;
  char here[PATH_MAX] = "";
  if (first[0] != '\0' && first[0] != '/' && getcwd(here, sizeof(here)) == NULL) {
    return NULL;
  }
  const char * rest = home != NULL ? folder + 1 : "";
  char * path = fm_reserve(memory, strlen(here) + strlen(first) + strlen(rest) + 4u, 1);
  if (path != NULL && add_parts(add_parts(add_parts(path, here), first), rest) == path) {
    path[0] = '/';
  }
  return path;
}

static struct fm_blackbox_topic * list_topics(
  struct fm_node_blackbox * box, const struct fm_node_table * table, const char * const * names)
{
  const uint32_t n = table->report.n_topics;
  const char * end_topic = fm_resolve(box->node, &box->memory, END_TOPIC, false);
  struct fm_blackbox_topic * topics = fm_reserve(&box->memory, n + 1u, sizeof(*topics));
  if (end_topic == NULL || topics == NULL) {
    fm_log_failure(box->node, FM_WORDS_NO_ENDPOINT);
    return NULL;
  }
  for (uint32_t k = 0; k < n; ++k) {
    topics[k] = (struct fm_blackbox_topic) {
      names[k], table->report.topics[k].type, table->topics[k].definition};
  }
  topics[n] = (struct fm_blackbox_topic) {end_topic, END_TYPE, table->end_definition};
  return topics;
}

static bool make_writer(struct fm_node_blackbox * box)
{
  struct fm_lines lines = {NULL, 0, 0};
  const int error = fm_blackbox_writer_create(&box->writer, &box->options);
  if (error != 0) {
    fm_add_blackbox_refusal(&lines, &box->options, error);
    fm_log_lines(box->node, &lines);
  }
  return error == 0;
}

bool fm_node_blackbox_begin(
  struct fm_node_blackbox * box, struct fm_node * node, const struct fm_node_table * table,
  const char * const * names, const struct fm_parameters * parameters)
{
  const char * given = fm_parameter_find(parameters, "blackbox")->value.string_value.data;
  *box = (struct fm_node_blackbox) {.node = node};
  if (given[0] == '\0') {
    return true;
  }
  const char * folder = whole_path(&box->memory, given);
  if (folder == NULL) {
    if (!box->memory.is_short) {
      fm_log(node, FM_ERROR, FM_WORDS_NO_WORKING_DIRECTORY, given);
    }
    return false;
  }
  box->options = (struct fm_blackbox_options) {
    .folder = folder,
    .lasts = (int64_t)(fm_parameter_real(parameters, "blackbox_seconds") * 1e9),
    .memory = (uint64_t)fm_parameter_whole(parameters, "blackbox_bytes"),
    .disk = (uint64_t)fm_parameter_whole(parameters, "blackbox_disk_bytes"),
    .files = (uint64_t)fm_parameter_whole(parameters, "blackbox_files"),
    .after = FM_BLACKBOX_AFTER_NS, .poll = FM_BLACKBOX_POLL_NS,
    .node = rcl_node_get_fully_qualified_name(&node->node), .bundle = table->bundle,
    .topics = list_topics(box, table, names), .n_topics = table->report.n_topics,
    .requirements = table->in_blackbox};
  return box->options.topics != NULL && make_writer(box);
}

bool fm_node_blackbox_start(struct fm_node_blackbox * box, struct fm_engine * engine)
{
  return box->writer == NULL || fm_blackbox_writer_start(box->writer, engine);
}

void fm_node_blackbox_look(struct fm_node_blackbox * box)
{
  struct fm_lines lines = {NULL, 0, 0};
  if (box->writer != NULL) {
    fm_add_blackbox_lines(&lines, box->writer);
    fm_log_lines(box->node, &lines);
  }
}

void fm_node_blackbox_stop(struct fm_node_blackbox * box)
{
  if (box->writer != NULL) {
    fm_blackbox_writer_end(box->writer);
    fm_node_blackbox_look(box);
  }
}

void fm_node_blackbox_end(struct fm_node_blackbox * box)
{
  if (box->writer != NULL) {
    fm_blackbox_writer_destroy(box->writer);
  }
  fm_memory_free(&box->memory);
  memset(box, 0, sizeof(*box));
}
