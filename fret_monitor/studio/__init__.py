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
The page of `fret-monitor studio`: write requirements, read what they mean, try them on a trace.

`server.py` answers the browser, `folder.py` reads and writes the bundles of one folder,
`process.py` runs the questions of a page in processes that can be ended (`questions.py`);
`drawn_trace.py` runs a bundle on a trace, part by part. The page itself is in `page/`. No
meaning of its own: all answers are from `editing`, `explain` and the compiled monitors. A
running monitor is watched by another process (`live.py`, `watching.py`), which evaluates
nothing.
"""
