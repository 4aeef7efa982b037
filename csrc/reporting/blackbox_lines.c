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

/// blackbox_lines.c: see blackbox_lines.h for the contract.

#include "blackbox_lines.h"

#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

void fm_add_blackbox_lines(struct fm_lines * lines, struct fm_blackbox_writer * writer)
{
  struct fm_blackbox_event event;
  while (fm_blackbox_writer_take(writer, &event)) {
    if (event.error == 0) {
      fm_lines_add(lines, FM_INFO, "the last messages are in %s", event.path);
    } else {
      fm_lines_add(
        lines, FM_ERROR, "the black box cannot write to %s: %s; /diagnostics counts the files "
        "that are missing", event.path, strerror(event.error));
    }
    free(event.path);
  }
}

void fm_add_blackbox_refusal(
  struct fm_lines * lines, const struct fm_blackbox_options * options, int error)
{
  if (error == ENOMEM) {
    fm_lines_add(lines, FM_ERROR, "parameter 'blackbox_bytes': no %" PRIu64 " bytes of memory",
      options->memory);
  } else if (error == EPROTOTYPE) {
    fm_lines_add(lines, FM_ERROR, "parameter 'blackbox': not supported yet with several `where` "
      "of one topic: leave it out");
  } else {
    fm_lines_add(lines, FM_ERROR, "parameter 'blackbox': cannot write to the folder '%s': %s",
      options->folder, strerror(error));
  }
}
