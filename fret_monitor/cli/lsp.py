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

"""`lsp`: serve an editor over standard input and output, for bundles."""

from argparse import ArgumentParser, Namespace
import signal

from fret_monitor.model.diagnostics import require_packages

NEEDED = {'pygls': 'pygls'}


def add_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument('--stdio', action='store_true', help='has no effect: editors add it')
    parser.set_defaults(run=run)


def run(options: Namespace) -> int:
    """Serve until the editor ends."""
    require_packages('`lsp`', NEEDED)
    from fret_monitor.lsp.server import serve
    # The thread that waits for input ends with the process only; nothing has to be cleaned up.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_DFL)
    return serve()
