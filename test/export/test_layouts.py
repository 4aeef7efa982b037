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

"""Layouts of viewers have the inputs of a bundle and its verdicts, where the viewers look."""

import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from fret_monitor.cli.main import main
import pytest

BUNDLE = """\
format: 1
for_each: {robot: [alpha, beta]}
inputs:
  speed: {topic: "/{robot}/odom", type: nav_msgs/msg/Odometry, field: twist.twist.linear.x}
  first: {topic: scan, type: sensor_msgs/msg/LaserScan, field: "ranges[3]"}
  nearest: {topic: scan, type: sensor_msgs/msg/LaserScan, field: min(ranges)}
  seen: {topic: scan, type: sensor_msgs/msg/LaserScan, field: header.stamp}
  alarm: {topic: alarm, type: std_msgs/msg/Bool}
  level: {topic: /diagnostics, type: diagnostic_msgs/msg/DiagnosticArray,
          field: "status[name = imu].level"}
requirements:
  - {id: SLOW-1, ptltl: H (speed <= 1.0)}
  - {id: FAR, ptltl: "first > 0.1 & nearest > 0.1 & seen > 0.0 & !alarm & level < 2"}
"""


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    path = tmp_path / 'b.yaml'
    path.write_text(BUNDLE, encoding='utf-8')
    return path


def leaves(layout: Any) -> list[str]:
    """Return the panels of a mosaic, from top to bottom."""
    if isinstance(layout, str):
        return [layout]
    assert layout['direction'] == 'column' and 0 < layout['splitPercentage'] < 100
    return [*leaves(layout['first']), *leaves(layout['second'])]


def test_a_layout_of_foxglove_has_lanes_and_plots(bundle: Path,
                                                  capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['layout', str(bundle)]) == 0
    said = capsys.readouterr()
    layout = json.loads(said.out)
    assert leaves(layout['layout']) == list(layout['configById'])
    assert {'globalVariables', 'userNodes', 'playbackConfig'} < set(layout)
    drawn = {kind: [item['value'] for panel, config in layout['configById'].items()
                    if panel.startswith(kind) for item in config['paths']]
             for kind in ('StateTransitions!', 'Plot!')}
    assert drawn == {
        'StateTransitions!': ['/copilot/verdict/SLOW_1.data',
                              '/copilot/verdict/FAR.data', '/alarm.data',
                              '/diagnostics.status[:]{name=="imu"}.level'],
        'Plot!': ['/alpha/odom.twist.twist.linear.x', '/beta/odom.twist.twist.linear.x',
                  '/scan.ranges[3]', '/scan.header.stamp.sec']}
    assert 'warning: the viewer cannot draw nearest\n' in said.err


def test_a_layout_of_plotjuggler_has_a_tab_of_verdicts_and_one_of_inputs(
        bundle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / 'layout.xml'
    assert main(['layout', str(bundle), '--to', 'plotjuggler', '-o', str(path)]) == 0
    root = ElementTree.parse(path).getroot()
    window = root.find('tabbed_widget')
    assert window is not None and window.attrib == {'name': 'Main Window', 'parent': 'main_window'}
    curves = {tab.get('tab_name'): [item.get('name') for item in tab.iter('curve')]
              for tab in window.iter('Tab')}
    assert curves == {
        'verdicts': ['/copilot/verdict/SLOW_1/data',
                     '/copilot/verdict/FAR/data'],
        'inputs': ['/alpha/odom/twist/twist/linear/x', '/beta/odom/twist/twist/linear/x',
                   '/scan/ranges[3]', '/scan/header/stamp/sec', '/alarm/data']}
    for splitter in root.iter('DockSplitter'):
        sizes = [float(size) for size in (splitter.get('sizes') or '').split(';')]
        assert len(sizes) == int(splitter.get('count') or 0) == len(splitter)
    assert 'cannot draw nearest, level' in capsys.readouterr().err


def test_a_layout_does_not_overwrite_its_bundle(bundle: Path,
                                                capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['layout', str(bundle), '-o', str(bundle)]) == 1
    assert bundle.read_text(encoding='utf-8') == BUNDLE
    assert 'error:' in capsys.readouterr().err
