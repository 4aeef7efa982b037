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

# PYTHON_ARGCOMPLETE_OK

"""`fret-monitor VERB`: parse the arguments, run the verb, print errors."""

from argparse import ArgumentParser, Namespace
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from io import TextIOWrapper
from keyword import iskeyword
import logging
import os
import signal
import sys
from threading import current_thread, main_thread
from types import FrameType
from typing import NoReturn, TYPE_CHECKING

from fret_monitor import __version__

if TYPE_CHECKING:
    from fret_monitor.model.diagnostics import Diagnostic

# The verbs, each with its line in --help. A module of this folder has the name of its verb.
_VERBS = {
    'check': 'print all problems of a bundle, or its requirements',
    'formalize': 'print the formula of a FRETish sentence',
    'simulate': 'run the monitors over a CSV trace',
    'bag': 'run the compiled monitors over recordings',
    'compile': 'write C, libraries and manifest to a folder',
    'export': 'write the monitors as sources that build without this package',
    'bench': 'measure step time, state and compile time',
    'new': 'write a first bundle from recordings',
    'fit': 'the tightest value of a constant that recordings support',
    'import': 'make a bundle from a FRET project or an Ogma set-up',
    'explain': 'describe what requirements mean, with examples',
    'analyze': 'find requirements that conflict, are vacuous or redundant',
    'tests': 'write traces that test each requirement',
    'prove': 'prove that the generated C is right',
    'studio': 'write, understand and try requirements in a page',
    'schema': 'print the JSON schema of a bundle, for editors',
    'lsp': 'serve an editor: diagnostics, completion, hover and more',
    'layout': 'write a layout of Foxglove, Lichtblick or PlotJuggler',
}


class _Terminated(BaseException):
    """The process received SIGTERM."""


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Run the command line.

    Returns
    -------
    int
        0 for success, 1 for a bad bundle or trace (or no compiler), 2 for wrong usage, 130 after
        SIGINT and 143 after SIGTERM, as shells do.
    """
    try:
        with _terminable():
            return _main(arguments)
    except KeyboardInterrupt:
        return 128 + signal.SIGINT
    except _Terminated:
        return 128 + signal.SIGTERM


def _main(arguments: Sequence[str] | None) -> int:
    # Imported here, since these imports are slow, and an interrupt meanwhile is handled above.
    from fret_monitor.model.diagnostics import CompileError, Diagnostic
    from fret_monitor.model.output import drop_output
    from fret_monitor.native.errors import NativeError
    options = Namespace(json=False, has_document=False)
    if '_ARGCOMPLETE' in os.environ:
        _complete(os.environ.get('COMP_LINE', ''))
    try:
        return _run(sys.argv[1:] if arguments is None else arguments, options)
    except (CompileError, NativeError) as error:
        _print_problems(error.diagnostics if isinstance(error, CompileError)
                        else [Diagnostic(str(error))], options)
        return 1
    except BrokenPipeError:
        # The reader of the pipe has closed it, for example `head`: no message.
        drop_output()
        return 1
    except OSError as error:
        place = f"use '{error.filename}'" if error.filename else 'write to standard output'
        if not error.filename:
            drop_output()
            options.has_document = False
        _print_problems([Diagnostic(f'cannot {place}: {error.strerror or error}')], options)
        return 1


def _run(arguments: Sequence[str], options: Namespace) -> int:
    from fret_monitor.model.diagnostics import did_you_mean
    parser = _parser(arguments)
    verb = arguments[0] if arguments else ''
    if verb not in _VERBS and not verb.startswith('-') and (meant := did_you_mean(verb, _VERBS)):
        parser.error(f"there is no verb '{verb}', {meant}")
    parser.parse_args(arguments, options)
    if 'run' not in options:
        parser.print_help(sys.stderr)
        print('\nfret-monitor: error: a verb is missing', file=sys.stderr)
        return 2
    if isinstance(sys.stdout, TextIOWrapper):  # its encoding may lack characters
        sys.stdout.reconfigure(errors='backslashreplace')
    logging.basicConfig(format='warning: %(message)s')
    status: int = options.run(options)
    print(end='', flush=True)
    return status


def _complete(line: str) -> NoReturn:
    """Print the completions of a command line, which a shell asks for; needs argcomplete."""
    with suppress(ImportError):
        import_module('argcomplete').autocomplete(_parser(line.split()[1:]))
    sys.exit(1)


def _print_problems(diagnostics: 'Iterable[Diagnostic]', options: Namespace) -> None:
    """Print the errors that ended a verb, in its document if it has one."""
    from fret_monitor.cli.terminal import print_diagnostics
    if options.json and options.has_document:
        from fret_monitor.cli.document import print_document
        print_document({}, diagnostics)
        return
    with suppress(OSError):
        sys.stdout.flush()  # keep the order of the two streams
    print_diagnostics(diagnostics)


@contextmanager
def _terminable() -> Iterator[None]:
    """
    Raise `_Terminated` on SIGTERM inside this block, so that it can clean up.

    Python's default would end the process at once and leave a compiler running. If the caller has
    set a handler, that stays.
    """
    is_ours = (current_thread() is main_thread()
               and signal.getsignal(signal.SIGTERM) is signal.SIG_DFL)
    if not is_ours:
        yield
        return
    signal.signal(signal.SIGTERM, _terminate)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _terminate(number: int, frame: FrameType | None) -> None:
    signal.signal(number, signal.SIG_IGN)  # a second signal would interrupt the cleaning up
    raise _Terminated


def _parser(arguments: Sequence[str]) -> ArgumentParser:
    """Return a parser that knows all verbs, and the arguments of the one in `arguments`."""
    parser = ArgumentParser(
        'fret-monitor', description='Check, compile and run monitors of requirements.')
    parser.add_argument('--version', action='version', version=f'%(prog)s {__version__}')
    verbs = parser.add_subparsers(
        metavar='VERB', title='verbs (details: fret-monitor VERB --help)')
    wanted = next((word for word in arguments if not word.startswith('-')), None)
    for verb, summary in _VERBS.items():
        added = verbs.add_parser(verb, help=summary)
        if verb == wanted:
            _add_arguments(verb, added)
    return parser


def _add_arguments(verb: str, parser: ArgumentParser) -> None:
    # A verb is imported when it is used, since the imports of all verbs take half a second.
    name = f'{verb}_' if iskeyword(verb) else verb
    import_module(f'fret_monitor.cli.{name}').add_arguments(parser)
