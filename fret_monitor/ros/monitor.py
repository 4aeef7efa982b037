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

"""The executable `monitor`: monitors the requirements of bundles on ROS 2 topics."""

import gc
from importlib import import_module
import sys

from fret_monitor.ros.signals import StopRequest

_NODES = {'monitor': 'MonitorNode', 'gate': 'GateNode', 'logger': 'LoggerNode'}


def main(name: str = 'monitor') -> int:
    """Run a node until a signal ends it, by the name of its executable; return the exit status."""
    stop = StopRequest()
    gc.disable()  # until the node is made: `run` enables it
    # Imported after the signal handlers are set, since these imports are slow.
    from fret_monitor.ros.native_start import become_native
    not_native = '' if name == 'logger' else become_native(sys.argv, f'fret_{name}')
    node = getattr(import_module('fret_monitor.ros'), _NODES[name])
    from fret_monitor.ros.process import run
    return run(name, node, stop, not_native)
