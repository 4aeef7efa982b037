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

"""Runs a program that is the first argument, as `python -c` does."""

import sys


def main() -> None:
    """Run it with the further arguments."""
    text, sys.argv[0] = sys.argv[0], '-c'
    exec(compile(text, '-c', 'exec'), {'__name__': '__main__'})
