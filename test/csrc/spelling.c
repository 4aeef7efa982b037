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

// For each line of names with tabs between: the first as FRET writes it, and which of the others
// may be meant by it.

#include <stdio.h>
#include <string.h>

#include "spelling.h"

int main(void)
{
  char line[4096];
  struct fm_text text = {NULL, 0, 0};
  while (fgets(line, sizeof(line), stdin) != NULL) {
    const char * names[64];
    uint32_t n = 0;
    for (char * name = strtok(line, "\t\n"); name != NULL; name = strtok(NULL, "\t\n")) {
      names[n++] = name;
    }
    fm_text_clear(&text);
    fm_text_add_spelled(&text, names[0]);
    fm_text_add(&text, "\t");
    const bool has_hint = fm_text_add_hint(&text, names[0], names + 1, n - 1u);
    printf("%s\t%d\n", fm_text_get(&text), has_hint);
  }
  fm_text_free(&text);
  return 0;
}
