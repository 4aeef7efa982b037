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

"""Generated C with a part of its text replaced."""

from dataclasses import replace

from fret_monitor.build import GeneratedMonitor


def exchanged(generated: GeneratedMonitor, name: str, old: str, new: str) -> GeneratedMonitor:
    """Return the monitor with the first `old` in one of its files replaced by `new`."""
    module = generated.module

    def changed(file: tuple[str, str]) -> tuple[str, str]:
        if file[0] != name:
            return file
        assert old in file[1]
        return name, file[1].replace(old, new, 1)

    return replace(generated, module=replace(
        module, header=changed(module.header), sources=tuple(map(changed, module.sources))))
