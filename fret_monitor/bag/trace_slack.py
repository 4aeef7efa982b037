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

"""The slack of FRETish sentences in a trace of `simulate`, which needs no reader of recordings."""

import csv
from pathlib import Path
from tempfile import TemporaryDirectory

from fret_monitor.bag.deadlines import with_lanes
from fret_monitor.bag.waits import FoundSlack, lanes_of, Waits
from fret_monitor.build import compile_monitor, generate_monitor, Reading
from fret_monitor.elaboration.signals import FindMessage
from fret_monitor.traces.simulate import simulate


def slack_of_trace(reading: Reading, find: FindMessage, trace: Path,
                   until: int | None = None) -> dict[str, FoundSlack]:
    """
    Return by id the slack of the sentences with a deadline in a trace, as `simulate` takes it.

    Triggers and responses are numbers of rows, under `timed` times (ns). Without those of
    instances: a trace has no verdicts of a key in rows of others.
    """
    lanes_reading = with_lanes(reading, find)
    specification = lanes_reading.specification
    keyed = {item.name for item in specification.signals if item.variables}
    lanes = [*lanes_of(item.id for item in specification.properties
                       if keyed.isdisjoint(item.inputs))]
    if not lanes:
        return {}
    monitor = compile_monitor(generate_monitor(lanes_reading)).monitor
    waits = Waits(monitor.manifest)
    with TemporaryDirectory() as folder:
        table = Path(folder, 'verdicts.csv')
        summary = simulate(monitor, trace, table, until=until)
        with table.open(newline='', encoding='utf-8') as file:
            last = waits.take_table(csv.DictReader(file), [*summary.violations])
    end = last if until is None else until
    found = {each.id: waits.found(each, end, lambda name, _: summary.violations[name])
             for each in lanes}
    return {name: of_keys[None] for name, of_keys in found.items() if None in of_keys}
