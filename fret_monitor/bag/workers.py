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

"""The processes that check recordings with `--jobs`."""

from multiprocessing import forkserver, get_context
from multiprocessing.context import ForkServerContext

_IMPORTED = ['fret_monitor.bag.fleet', 'fret_monitor.build']


def workers() -> ForkServerContext:
    """
    Return the context of workers, and start the process from which they are forked.

    It imports once what each of them needs, while the caller goes on. Workers are not forked from
    the caller, which may have threads, and may have loaded the library of a monitor.
    """
    context = get_context('forkserver')
    context.set_forkserver_preload(_IMPORTED)
    forkserver.ensure_running()
    return context
