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

"""
The clang inside ziglang, as a command that compiles and links.

gcc links, where there is one: zig would first build a C library and a runtime of its own, which
takes half a minute on a machine where it never ran.
"""

from collections.abc import Sequence
from importlib.util import find_spec
import os
from pathlib import Path
import shutil
import subprocess
import sys
from tempfile import TemporaryDirectory

_INSTALLED = find_spec('ziglang')
# The program itself: `python -m ziglang` would start an interpreter for each file.
ZIG = (str(Path(_INSTALLED.origin).with_name('zig')) if _INSTALLED and _INSTALLED.origin
       else 'zig', 'cc')
_NO_LINK = {'-c', '-S', '-E', '-fsyntax-only', '--version'}
_FOR_BOTH = ('-fsanitize=', '-fno-sanitize', '-fPIC', '-pthread', '-g', '-O')
_FOR_THE_LINK = ('-shared', '-l', '-L', '-Wl,')


def main(arguments: Sequence[str]) -> int:
    gcc = shutil.which('gcc')
    if gcc is None or _NO_LINK & set(arguments):
        os.execvp(ZIG[0], [*ZIG, *arguments])
    program = arguments[arguments.index('-o') + 1]
    words = [word for word in arguments if word not in ('-o', program)]
    sources = [word for word in words if word.endswith('.c')]
    flags = [word for word in words
             if not word.endswith(('.c', '.o')) and not word.startswith(_FOR_THE_LINK)]
    if not any(flag.startswith('-fsanitize=') for flag in flags):
        # What zig turns on by itself without -O needs its runtime otherwise.
        flags.append('-fsanitize-trap=undefined')
    with TemporaryDirectory() as folder:
        objects = [str(Path(folder) / f'{number}.o') for number in range(len(sources))]
        for source, made in zip(sources, objects):
            status = subprocess.run([*ZIG, *flags, '-c', source, '-o', made], check=False)
            if status.returncode != 0:
                return status.returncode
        rest = [word for word in words if word.endswith('.o') or word.startswith(
            (*_FOR_BOTH, *_FOR_THE_LINK))]
        return subprocess.run([gcc, *objects, *rest, '-o', program], check=False).returncode


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
