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
Take docs/pictures/studio.png: the page of `studio` while it watches a simulated quadrotor.

    .venv/bin/python -m tools.pictures.studio

Needs ROS 2, Chromium and the extra `studio`. It takes a minute, and no two runs give the same
picture, so that no test compares it: look at it, and commit it when the page looks different.
"""

from contextlib import ExitStack
import os
from pathlib import Path
import shutil
import subprocess
import sys
import tempfile

from tools.pictures.pages import ROOT

PICTURE = ROOT / 'docs' / 'pictures' / 'studio.png'
WIDTH, HEIGHT = 1200, 900
DOMAIN = '77'


def main() -> None:
    """Fly, monitor, watch, and write the picture when a violation is seen."""
    sys.path.insert(0, str(ROOT / 'test'))
    from studio.browser import browser
    from studio.serving import studio
    os.environ |= {'ROS_DOMAIN_ID': DOMAIN, 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
    bundle = ROOT / 'config' / 'quadrotor.yaml'
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        folder = Path(name)
        shutil.copy(bundle, folder)
        _start(stack, '-c', 'from fret_monitor.ros.monitor import main; main()', '--ros-args',
               '-p', f'spec:={bundle}', '-p', 'use_sim_time:=true', '-p', 'verdicts:=true')
        url = stack.enter_context(studio(folder, bundle.name))
        page = stack.enter_context(browser(folder / 'profile'))
        page.call('Emulation.setDeviceMetricsOverride', width=WIDTH, height=HEIGHT,
                  deviceScaleFactor=1, mobile=False)
        page.open(url)
        page.wait('!!document.body.dataset.checked')
        page.get("document.querySelector('#live-connect').click()")
        page.wait("/^watching/.test(document.querySelector('#live-status').textContent)")
        _start(stack, str(ROOT / 'examples' / 'quadrotor.py'), '--ros-args',
               '-p', 'fault:=true', '-p', 'speed:=2.0')
        page.wait("document.querySelectorAll('#live-occurrences li').length > 1")
        page.get("document.querySelector('#live').scrollIntoView()")
        page.wait("document.querySelectorAll('#live-occurrences li').length > 2")
        page.shoot(PICTURE, '#live')


def _start(stack: ExitStack, *arguments: str) -> None:
    process = subprocess.Popen([sys.executable, *arguments], stdout=subprocess.DEVNULL,
                               stderr=subprocess.DEVNULL)
    stack.callback(process.wait)
    stack.callback(process.send_signal, 2)


if __name__ == '__main__':
    main()
