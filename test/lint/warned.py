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

"""The warnings about a bundle."""

from pathlib import Path

from fret_monitor.build import read


def warned(folder: Path, text: str) -> list[tuple[str, str]]:
    """Return the titles and the advice of the warnings about a bundle."""
    path = folder / 'bundle.yaml'
    path.write_text(text, encoding='utf-8')
    return [(item.title, item.help) for item in read(path).warnings]
