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

"""`studio [BUNDLE]`: a page to write, understand and try requirements."""

from argparse import ArgumentParser, Namespace
from pathlib import Path
import webbrowser

from fret_monitor.model.bundle_files import BUNDLE_HELP, existing_bundle
from fret_monitor.model.diagnostics import refuse, require_packages

NEEDED = {'starlette': 'starlette', 'uvicorn': 'uvicorn', 'websockets': 'websockets'}


def add_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument('bundle', metavar='BUNDLE', nargs='?',
                        help=f'{BUNDLE_HELP}; default: choose one of this folder in the page')
    parser.add_argument('--print-url', action='store_true',
                        help='print the address of the page, and open no browser')
    parser.add_argument('--port', metavar='PORT', type=int, default=0,
                        help='the port on 127.0.0.1; default: one that is free')
    parser.set_defaults(run=run)


def run(options: Namespace) -> int:
    """Serve the page until SIGINT."""
    require_packages('`studio`', NEEDED)
    from fret_monitor.studio.folder import Folder
    from fret_monitor.studio.server import listening, serve
    folder, name = Path.cwd(), None
    if options.bundle is not None:
        bundle = existing_bundle(options.bundle).resolve()
        folder, name = bundle.parent, bundle.name
        try:
            Folder(folder).read(name)
        except ValueError as error:
            refuse(f'the page cannot open this bundle: {error}')
    try:
        listener, address = listening(options.port)
    except (OSError, OverflowError) as error:
        refuse(f'cannot listen on port {options.port}: {getattr(error, "strerror", "") or error}')

    def begun() -> None:
        if options.print_url:
            print(address.url, flush=True)
        elif not webbrowser.open(address.url):
            print(f'no browser can be opened here: open {address.url}', flush=True)

    serve(folder, name, listener, address, begun)
    return 0
