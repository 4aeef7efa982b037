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
import sys

from fret_monitor.ros.signals import StopRequest


def main() -> int:
    """Run the node until a signal ends it; return the exit status."""
    stop = StopRequest()
    gc.disable()  # until the node is made: `run` enables it
    # Imported after the signal handlers are set, since these imports are slow.
    from fret_monitor.ros.native_start import become_native
    reason = become_native(sys.argv)
    from fret_monitor.ros.nodes.monitor_node import MonitorNode
    from fret_monitor.ros.process import run
    return run('monitor', MonitorNode, stop, reason)
