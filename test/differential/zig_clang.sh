# Copyright 2026 The fret_monitor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

# The clang inside ziglang, as a command that compiles and links: `sh zig_clang.sh ZIG ARGUMENT...`.
#
# gcc links, where there is one: zig would first build a C library and a runtime of its own, which
# takes half a minute on a machine where it never ran.

set -eu
zig=$1
shift
for word in "$@"; do
  case $word in -c | -S | -E | -fsyntax-only | --version) exec "$zig" cc "$@" ;; esac
done
command -v gcc >/dev/null || exec "$zig" cc "$@"

# Lists of words, one a line.
IFS='
'
set -f
flags= sources= rest= has_sanitizer=
while test $# -gt 0; do
  case $1 in
    -o) program=$2 && shift ;;
    *.c) sources=$sources$IFS$1 ;;
    *.o | -shared | -l* | -L* | -Wl,*) rest=$rest$IFS$1 ;;
    -fsanitize=* | -fno-sanitize* | -fPIC | -pthread | -g* | -O*)
      flags=$flags$IFS$1 rest=$rest$IFS$1 ;;
    *) flags=$flags$IFS$1 ;;
  esac
  case $1 in -fsanitize=*) has_sanitizer=yes ;; esac
  shift
done
# What zig turns on by itself without -O needs its runtime otherwise.
test -n "$has_sanitizer" || flags=$flags$IFS-fsanitize-trap=undefined

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
objects=
for source in $sources; do
  object=$folder/$(printf '%s' "$objects" | wc -l).o
  "$zig" cc $flags -c "$source" -o "$object"
  objects=$objects$IFS$object
done
gcc $objects $rest -o "$program"
