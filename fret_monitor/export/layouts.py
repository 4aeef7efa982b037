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
Layouts of viewers for the inputs and verdicts of a bundle: Foxglove or Lichtblick, PlotJuggler.

The verdicts are those that `monitor` publishes with `verdicts:=true`, and `bag --mcap` writes.
What a viewer cannot compute, such as the least element of an array, is left out, and named.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
import json
from typing import Any
from xml.etree import ElementTree

from fret_monitor.logic.specification import Signal, Specification, written_input
from fret_monitor.model.manifest import SECONDS
from fret_monitor.model.names import absolute, PLACEHOLDER, verdict_topic, VERDICT_TYPE
from fret_monitor.model.paths import LookUp
from fret_monitor.model.policies import InputSource
from fret_monitor.model.values import ValueType

_MOST_LINES = 6  # of one plot
_COLORS = ('#1f77b4', '#d62728', '#1ac938', '#ff7f0e', '#9467bd', '#17becf')


@dataclass(frozen=True)
class DrawnValue:
    """
    A value that a viewer draws: its name in the bundle, its topic, and its path by parts.

    The topic is as written. `values` are the names that the input has for its values.
    """

    name: str
    topic: str
    path: tuple[str, ...]
    is_discrete: bool
    message_type: str
    values: tuple[tuple[str, int | str], ...] = ()


@dataclass(frozen=True)
class ViewerLayout:
    """The text of a layout, and the inputs that the viewer cannot draw."""

    text: str
    left_out: tuple[str, ...]


def foxglove(specification: Specification) -> ViewerLayout:
    """Return a layout that Foxglove and Lichtblick import (JSON)."""
    drawn, left_out = drawn_values(specification, can_filter=True)
    panels: dict[str, Any] = {}
    states = [*_verdicts(specification), *(item for item in drawn if item.is_discrete)]
    panels['StateTransitions!states'] = {
        'foxglovePanelTitle': 'verdicts and states', 'isSynced': True,
        'paths': [_foxglove_path(item) for item in states]}
    for number, group in enumerate(_groups([item for item in drawn if not item.is_discrete])):
        panels[f'Plot!{number}'] = {
            'foxglovePanelTitle': absolute(group[0].topic), 'isSynced': True,
            'xAxisVal': 'timestamp', 'showLegend': True, 'legendDisplay': 'floating',
            'showXAxisLabels': True, 'showYAxisLabels': True, 'showPlotValuesInLegend': True,
            'sidebarDimension': 240,
            'paths': [{**_foxglove_path(item), 'enabled': True} for item in group]}
    panels['DiagnosticSummary!health'] = {
        'minLevel': 0, 'pinnedIds': [], 'hardwareIdFilter': '', 'topicToRender': '/diagnostics'}
    content = {'configById': panels, 'globalVariables': {}, 'userNodes': {},
               'playbackConfig': {'speed': 1}, 'layout': _mosaic(list(panels))}
    return ViewerLayout(json.dumps(content, indent=2) + '\n', left_out)


def _foxglove_path(item: DrawnValue) -> dict[str, Any]:
    return {'value': absolute(item.topic) + ''.join(item.path), 'timestampMethod': 'receiveTime',
            'label': item.name}


def _mosaic(panels: Sequence[str]) -> Any:
    """Return panels one below the other, all of the same height."""
    if len(panels) == 1:
        return panels[0]
    first = len(panels) // 2
    return {'direction': 'column', 'first': _mosaic(panels[:first]),
            'second': _mosaic(panels[first:]), 'splitPercentage': 100 * first / len(panels)}


def plotjuggler(specification: Specification) -> ViewerLayout:
    """Return a layout that PlotJuggler loads (XML), with a tab of verdicts and one of inputs."""
    drawn, left_out = drawn_values(specification, can_filter=False)
    root = ElementTree.Element('root')
    tabs = ElementTree.SubElement(root, 'tabbed_widget', {
        'name': 'Main Window', 'parent': 'main_window'})
    _tab(tabs, 'verdicts', [[item] for item in _verdicts(specification)])
    if drawn:
        _tab(tabs, 'inputs', list(_groups(drawn)))
    ElementTree.SubElement(tabs, 'currentTabIndex', index='0')
    ElementTree.SubElement(root, 'use_relative_time_offset', enabled='1')
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding='unicode')
    return ViewerLayout(f"<?xml version='1.0' encoding='UTF-8'?>\n{text}\n", left_out)


def _tab(tabs: ElementTree.Element, name: str, groups: Sequence[Sequence[DrawnValue]]) -> None:
    tab = ElementTree.SubElement(tabs, 'Tab', tab_name=name, containers='1')
    inside = ElementTree.SubElement(tab, 'Container')
    sizes = ';'.join([f'{1 / len(groups):.6g}'] * len(groups))
    rows = ElementTree.SubElement(inside, 'DockSplitter', orientation='-',
                                  count=str(len(groups)), sizes=sizes)
    for group in groups:
        area = ElementTree.SubElement(rows, 'DockArea', name=group[0].name if len(group) == 1
                                      else absolute(group[0].topic))
        is_steps = all(item.is_discrete for item in group)
        plot = ElementTree.SubElement(area, 'plot', mode='TimeSeries',
                                      style='Steps' if is_steps else 'Lines')
        for item, color in zip(group, _COLORS, strict=False):
            path = ''.join(part.replace('.', '/') for part in item.path)
            ElementTree.SubElement(plot, 'curve', name=absolute(item.topic) + path, color=color)


def _groups(drawn: Sequence[DrawnValue]) -> Iterator[list[DrawnValue]]:
    """Yield the values of one topic together, a few in each group."""
    topics = dict.fromkeys(item.topic for item in drawn)
    for topic in topics:
        own = [item for item in drawn if item.topic == topic]
        for start in range(0, len(own), _MOST_LINES):
            yield own[start:start + _MOST_LINES]


def _verdicts(specification: Specification) -> Iterator[DrawnValue]:
    for item in specification.properties:
        yield DrawnValue(item.id, verdict_topic(item.handler), ('.data',), True, VERDICT_TYPE)


def drawn_values(specification: Specification, *,
                 can_filter: bool) -> tuple[list[DrawnValue], tuple[str, ...]]:
    """
    Return what can be drawn, and the names of the other inputs.

    `can_filter`: the viewer finds an element of an array by a name, and draws strings.
    """
    drawn, left_out = [], []
    keys = {item.name: item.keys for item in specification.instance_variables}
    for signal in specification.signals:
        is_added = written_input(specification.signals, signal) is not signal
        if is_added or signal.source is InputSource.INSTANCES:
            continue  # by a formula
        found = [*_drawn(signal, keys, can_filter)]
        drawn += found
        left_out += [] if found else [signal.name]
    return drawn, tuple(left_out)


def _drawn(signal: Signal, keys: dict[str, tuple[str, ...]],
           can_filter: bool) -> Iterator[DrawnValue]:
    """Yield a value for each listed key of its topic; none if it cannot be drawn."""
    is_field = signal.source is InputSource.FIELD and signal.reduction in ('', SECONDS)
    parts = _parts(signal, can_filter)
    topic = signal.topic
    if not is_field or parts is None or topic is None or signal.made or signal.where or (
            signal.is_string and not can_filter):
        return
    names = [name for name in dict.fromkeys(PLACEHOLDER.findall(topic)) if name in keys]
    is_discrete = signal.type is ValueType.BOOL or bool(signal.values)
    for chosen in product(*(keys[name] for name in names)):
        values = dict(zip(names, chosen, strict=True))
        key = f'[{", ".join(f"{name}={value}" for name, value in values.items())}]'
        full = topic
        for name, value in values.items():
            full = full.replace(f'{{{name}}}', value)
        yield DrawnValue(signal.name + (key if values else ''), full, parts, is_discrete,
                         signal.message_type or '', signal.values)


def _parts(signal: Signal, can_filter: bool) -> tuple[str, ...] | None:
    """Return a path as a viewer has it; None if it has nothing like it."""
    found: list[str] = []
    for step in signal.path:
        match step:
            case str():
                found.append(f'.{step}')
            case int():
                found.append(f'[{step}]')
            case LookUp(key, name, False, '') if can_filter:
                found.append(f'[:]{{{".".join(key)}=={json.dumps(name)}}}')
            case _:
                return None
    return (*found, '.sec') if signal.reduction == SECONDS else tuple(found)


LAYOUTS = {'foxglove': foxglove, 'plotjuggler': plotjuggler}
"""The layouts by the names of their viewers; Lichtblick takes Foxglove's."""
