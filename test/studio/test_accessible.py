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
The page under axe-core, which finds what a screen reader or a keyboard cannot use.

axe-core is no part of this project: it is looked for in `node_modules` of this folder and those
above it (`npm install axe-core`), and without it this test is skipped.
"""

from importlib.util import find_spec
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from studio.browser import CHROMIUM, Page

AXE = next((path for folder in Path(__file__).resolve().parents
            if (path := folder / 'node_modules' / 'axe-core' / 'axe.min.js').is_file()), None)
BUNDLE = """\
format: 1
inputs:
  speed: {topic: speed, type: std_msgs/msg/Float64}
requirements:
  - {id: SLOW, fretish: the robot shall always satisfy speed <= 1.5}
  - {id: LATER, ptltl: "speed > nothing"}
"""
SERIOUS = ('serious', 'critical')
needs_axe = pytest.mark.skipif(
    AXE is None or CHROMIUM is None or find_spec('uvicorn') is None,
    reason='needs Chromium, uvicorn, and node_modules/axe-core (npm install axe-core)')


def found(page: Page) -> list[Any]:
    """Return what axe-core finds, that is serious."""
    result = page.get("""axe.run(document, { resultTypes: ['violations'] }).then((all) =>
        all.violations.map((each) => [each.impact, each.id, each.nodes.map((node) => node.html)]))
        """)
    return [item for item in result if item[0] in SERIOUS]


def found_in_all(page: Page) -> list[Any]:
    """Return what axe-core finds on a screen and on a telephone, in light and dark."""
    problems: list[Any] = []
    for width, scheme in product((1400, 390), ('light', 'dark')):
        page.call('Emulation.setDeviceMetricsOverride', width=width, height=900,
                  deviceScaleFactor=1, mobile=width < 800)
        page.call('Emulation.setEmulatedMedia', features=[
            {'name': 'prefers-color-scheme', 'value': scheme}])
        problems += [(width, scheme, *item) for item in found(page)]
    return problems


@needs_axe
def test_axe_finds_nothing_serious(folder: Path, url: str, page: Page) -> None:
    assert AXE is not None
    (folder / 'b.yaml').write_text(BUNDLE.replace('nothing', '0'))
    page.open(url)
    page.see('figure')
    page.wait("!!document.querySelector('.lane[aria-label^=SLOW] rect.is-true')")
    page.get(AXE.read_text(encoding='utf-8') + '; 0')
    assert found_in_all(page) == []
    # With the form of a new requirement.
    page.click('#new-requirement')
    page.see('#new-response')
    page.type('SLOW')
    page.see('#new-problems li')
    assert found_in_all(page) == []
    # With a mistake in the text, and while a monitor is looked for.
    page.get("document.querySelector('#live-connect').click()")
    page.wait("document.querySelectorAll('#live-rows .lane').length > 0")
    page.get("document.querySelector('.cm-content').focus()")
    page.type('requirement: x\n')
    page.see('#problems li')
    assert found_in_all(page) == []


@needs_axe
def test_axe_finds_a_button_without_a_name(folder: Path, url: str, page: Page) -> None:
    assert AXE is not None
    (folder / 'b.yaml').write_text(BUNDLE)
    page.open(url)
    page.see('#live-connect')
    page.get(AXE.read_text(encoding='utf-8') + '; 0')
    page.get("document.querySelector('#live-connect').textContent = ''; 0")
    assert 'button-name' in [name for _, name, _ in found(page)]
