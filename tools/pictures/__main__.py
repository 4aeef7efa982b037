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
Draw docs/pictures from real runs; the same version draws the same bytes.

    .venv/bin/python -m tools.pictures [NAME ...]

`policies` and `report` need rosbags, `report` needs Chromium too. `blackbox` is drawn from
blackbox.csv, which `.venv/bin/python -m tools.pictures.blackbox` records anew with real nodes.
"""

import sys

from tools.pictures import blackbox, gate, policies, report, trust
from tools.pictures.pages import ROOT

PICTURES = {'policies': policies, 'gate': gate, 'blackbox': blackbox, 'trust': trust,
            'report': report}


if __name__ == '__main__':
    for name in sys.argv[1:] or PICTURES:
        path = ROOT / 'docs' / 'pictures' / f'{name}.svg'
        path.write_text(PICTURES[name].drawn(), encoding='utf-8')
