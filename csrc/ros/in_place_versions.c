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


/// in_place_versions.c: see in_place_versions.h for the contract.

#define _POSIX_C_SOURCE 200809L

#include "in_place_versions.h"

#include <dirent.h>
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "in_place.h"

#define FAST_DDS "rmw_fastrtps_cpp"
#define FAST_CDR "libfastcdr.so.2"
// FastBuffer(char *, size_t) and Cdr(FastBuffer &, Endianness, CdrVersion) of Fast CDR
#define MAKE_BUFFER "_ZN8eprosima7fastcdr10FastBufferC1EPcm"
#define MAKE_CDR "_ZN8eprosima7fastcdr3CdrC1ERNS0_10FastBufferENS1_10EndiannessENS0_10CdrVersionE"

enum { PATH_BYTES = 4096, VERSION_BYTES = 64, PACKAGE_BYTES = 8192, MAPS_BYTES = 1 << 20 };

// A name in three parts. The result is cut off if it does not fit.
static void join(char * out, size_t room, const char * a, const char * b, const char * c)
{
  (void)snprintf(out, room, "%s%s%s", a, b, c);
}

// The path of a loaded library. Returns whether it is there.
static bool find_path(const char * maps, const char * library, char * path)
{
  char wanted[PATH_BYTES];
  join(wanted, sizeof(wanted), "/lib", library, ".so");
  for (const char * found = strstr(maps, wanted); found != NULL;
    found = strstr(found + 1, wanted))
  {
    const char * line = found;
    while (line > maps && line[-1] != '\n') {
      line -= 1;
    }
    const char * begin = strchr(line, '/');
    const size_t length = strcspn(begin, "\n");
    const char after = found[strlen(wanted)];
    if (length < PATH_BYTES && (after == '\n' || after == '.' || after == '\0')) {
      memcpy(path, begin, length);
      path[length] = '\0';
      return true;
    }
  }
  return false;
}

static void cut_last_part(char * path)
{
  char * slash = strrchr(path, '/');
  if (slash != NULL) {
    *slash = '\0';
  }
}

static bool read_package(const char * prefix, const char * library, char * version)
{
  char path[2 * PATH_BYTES];
  char text[PACKAGE_BYTES + 1] = {0};
  char place[PATH_BYTES];
  join(place, sizeof(place), "/share/", library, "/package.xml");
  join(path, sizeof(path), prefix, place, "");
  FILE * file = fopen(path, "r");
  if (file == NULL) {
    return false;
  }
  const size_t n = fread(text, 1, PACKAGE_BYTES, file);
  (void)fclose(file);
  const char * found = strstr(text, "<version>");
  return n > 0 && found != NULL && sscanf(found + strlen("<version>"), " %63[0-9.]", version) == 1;
}

// The longest number after the name of the library in the names of files.
static void read_names(const char * folder, const char * library, char * version)
{
  char begin[PATH_BYTES];
  join(begin, sizeof(begin), "lib", library, ".so.");
  DIR * opened = opendir(folder);
  for (struct dirent * entry = opened == NULL ? NULL : readdir(opened); entry != NULL;
    entry = readdir(opened))
  {
    const char * rest = entry->d_name + strlen(begin);
    if (strncmp(entry->d_name, begin, strlen(begin)) == 0 && strlen(rest) > strlen(version) &&
      strlen(rest) < VERSION_BYTES)
    {
      memcpy(version, rest, strlen(rest) + 1);
    }
  }
  if (opened != NULL) {
    (void)closedir(opened);
  }
}

static void find_version(const char * maps, const char * library, char * version)
{
  char folder[PATH_BYTES];
  char prefix[PATH_BYTES];
  version[0] = '\0';
  if (find_path(maps, library, folder)) {
    cut_last_part(folder);
    memcpy(prefix, folder, sizeof(prefix));
    cut_last_part(prefix);
    if (!read_package(prefix, library, version)) {
      read_names(folder, library, version);
    }
  }
}

bool fm_in_place_is_known(const char * maps, char * why, size_t room)
{
  static const struct
  {
    const char * library;
    const char * version;  // without its last part
  } known[] = {
    {"rmw_fastrtps_cpp", "8.4"}, {"rosidl_typesupport_fastrtps_c", "3.6"}, {"fastcdr", "2.2"}};
  for (size_t k = 0; k < sizeof(known) / sizeof(known[0]); ++k) {
    char version[VERSION_BYTES];
    const size_t length = strlen(known[k].version);
    find_version(maps, known[k].library, version);
    if (strncmp(version, known[k].version, length) != 0 ||
      (version[length] != '.' && version[length] != '\0'))
    {
      (void)snprintf(why, room, "it is known to work with %s %s, not with %s", known[k].library,
        known[k].version, version[0] == '\0' ? "unknown" : version);
      return false;
    }
  }
  return true;
}

static bool are_versions_known(char * why, size_t room)
{
  char * maps = calloc(1, MAPS_BYTES + 1);
  FILE * file = maps == NULL ? NULL : fopen("/proc/self/maps", "r");
  if (file != NULL) {
    maps[fread(maps, 1, MAPS_BYTES, file)] = '\0';
    (void)fclose(file);
  }
  const bool is_known = fm_in_place_is_known(maps == NULL ? "" : maps, why, room);
  free(maps);
  return is_known;
}

// A function of a library. POSIX lets a pointer to an object be copied to one to a function.
static bool find(void * library, const char * name, void * function)
{
  void * found = library == NULL ? NULL : dlsym(library, name);
  memcpy(function, &found, sizeof(found));
  return found != NULL;
}

static bool find_members(struct fm_in_place * found)
{
  void (* make_buffer)(void *, char *, size_t);
  void (* make_cdr)(void *, void *, int, int);
  void * library = dlopen(FAST_CDR, RTLD_LAZY);  // it is loaded; never closed
  return find(library, MAKE_BUFFER, (void *)&make_buffer) &&
         find(library, MAKE_CDR, (void *)&make_cdr) &&
         fm_in_place_find(make_buffer, make_cdr, found);
}

bool fm_in_place_prepare(
  const char * middleware, struct fm_in_place * found, char * why, size_t room)
{
  if (strcmp(middleware, FAST_DDS) != 0) {
    (void)snprintf(why, room, "%s is not " FAST_DDS, middleware);
    return false;
  }
  if (!are_versions_known(why, room)) {
    return false;
  }
  const bool is_found = find_members(found);
  (void)snprintf(why, room, "%s", is_found ? "" : "objects of Fast CDR are not as expected");
  return is_found;
}
