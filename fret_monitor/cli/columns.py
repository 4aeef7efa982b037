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

"""The argument `--columns`: which columns of a table are what."""

from argparse import ArgumentTypeError


def columns(text: str) -> dict[str, str]:
    """Return the heads of columns by what they are, from `id=ID,fretish=Requirement`."""
    from fret_monitor.importing.tables import ROLES
    found = {}
    for part in text.split(','):
        role, _, head = part.partition('=')
        if role.strip() not in ROLES or not head.strip():
            raise ArgumentTypeError(f"'{part}' is not ROLE=HEAD: ROLE is one of "
                                    + ', '.join(ROLES))
        found[role.strip()] = head.strip()
    return found
