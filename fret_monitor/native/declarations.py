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
Find the declarations for cffi in the headers of csrc, and generate `binding.py` from them.

`words.py` has the words that both nodes say (`csrc/reporting/words.h`), and the parameters that
both have (`parameter_table.h`), so that no library has to be loaded for them.

cffi needs a C parser to read declarations. Parsing would take most of the time of a start, and a
robot may have neither the headers nor the parser. Run this after a header has changed:

    python3 -m fret_monitor.native.declarations
"""

import ast
from collections.abc import Iterator, Mapping
from pathlib import Path
import re
import tempfile

from fret_monitor.native.cache import csrc_file

HEADERS = (
    'fret_monitor.h', 'fret_fields.h', 'evaluator.h', 'gate.h', 'handover.h',
    'kinds.h', 'scopes.h', 'outbox.h', 'blackbox.h', 'mcap.h', 'blackbox_file.h', 'states.h',
    'transforms.h', 'schedule.h', 'payload.h', 'engine.h', 'scheduling.h', 'blackbox_writer.h',
    'snapshot.h', 'records.h', 'figures.h', 'lines.h', 'given.h', 'subscription.h', 'overrides.h',
    'gate_target.h', 'report_table.h', 'reporter.h', 'start_lines.h', 'shared_names.h',
    'details.h', 'violation_log.h', 'review.h', 'sign_of_life.h',
    'thinning.h', 'csv.h', 'keyed_rows.h', 'middleware.h',
    'serialized.h', 'in_place.h', 'in_place_versions.h', 'receiver.h', 'announcer.h',
    'verdict_thread.h', 'reports.h', 'service_call.h', 'action_call.h', 'actions.h', 'relay.h',
    'graph.h', 'keyed_topics.h',
)

_C_LIBRARY = """
void * dlopen(const char * file, int flags);
void * dlsym(void * library, const char * symbol);
int dlclose(void * library);
char * dlerror(void);
"""
_WANTED = re.compile(
    r'^#define FM_\w+ \d+u?$'  # constants
    r'|^(?:struct|union|enum) \w+\n\{.*?^\};'
    r'|^struct \w+;'
    r'|^typedef [^;]*;'
    r'|^FM_EXPORT [^;]*;', re.DOTALL | re.MULTILINE)

_WORDS = re.compile(r'^#define FM_WORDS_(\w+)((?:\s+|\\\n|"(?:[^"\\]|\\.)*")+)$', re.MULTILINE)
_PARAMETER = re.compile(r'^  FM_PARAMETER(\(.*?\))(?: \\)?$', re.DOTALL | re.MULTILINE)
_NUMBER = re.compile(r'^#define (FM_\w+) (\d+) ', re.MULTILINE)

_HEAD = '''# flake8: noqa
# ruff: noqa
# mypy: ignore-errors

"""What cffi makes of the headers of csrc; written by `declarations.py`, not by hand."""

'''


def declarations() -> str:
    """Return the constants, types and exported functions of the headers, as cffi reads them."""
    text = ''.join(csrc_file(name).read_text(encoding='utf-8') for name in HEADERS)
    found = _WANTED.findall(re.sub(r' *//[^\n]*', '', text))
    plain = (re.sub(r'^FM_EXPORT |(?<=\d)u\b', '', item) for item in found)
    return _C_LIBRARY + '\n'.join(plain) + '\n'


def binding_text() -> str:
    """Return the text of `binding.py`, without its licence."""
    # Imported here, because a robot needs only `_cffi_backend` and may have no C parser.
    from cffi import FFI
    ffi = FFI()
    ffi.cdef(declarations())
    ffi.set_source('fret_monitor.native.binding', None)
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / 'binding.py'
        ffi.emit_python_code(str(made))
        text = made.read_text(encoding='utf-8')
    return _HEAD + text.removeprefix('# auto-generated file\n')


def words_text() -> str:
    """Return the text of `words.py`, without its licence."""
    found = {name: ast.literal_eval(f'({text})'.replace('\\\n', '')) for name, text in
             _WORDS.findall(csrc_file('words.h').read_text(encoding='utf-8'))}
    return _HEAD.replace('cffi makes of the headers of csrc', 'csrc/reporting/words.h has, and '
                         'parameter_table.h') + \
        ''.join(f'{name} = {text!r}\n' for name, text in found.items()) + '\nPARAMETERS = (\n' + \
        ''.join(f'    {row},\n' for row in _parameters(found)) + ')\n'


def _parameters(words: Mapping[str, str]) -> Iterator[tuple[object, ...]]:
    """Yield the arguments of each FM_PARAMETER; names that are not defined stay as texts."""
    table = csrc_file('parameter_table.h').read_text(encoding='utf-8')
    known = {'true': True, 'false': False, 'INT32_MAX': 2**31 - 1,
             **{name: int(number) for name, number in _NUMBER.findall(table)},
             **{f'FM_WORDS_{name}': text for name, text in words.items()}}
    for text in _PARAMETER.findall(table):
        row = ast.parse(text.replace('\\\n', ''), mode='eval').body
        assert isinstance(row, ast.Tuple)
        yield tuple(known.get(item.id, item.id) if isinstance(item, ast.Name)
                    else ast.literal_eval(item) for item in row.elts)


def write_all() -> None:
    """Write `binding.py` and `words.py`, with the licence of this file."""
    here = Path(__file__)
    licence = here.read_text(encoding='utf-8').partition('\n"""')[0]
    for name, text in (('binding.py', binding_text()), ('words.py', words_text())):
        here.with_name(name).write_text(f'{licence}\n{text}', encoding='utf-8')


if __name__ == '__main__':
    write_all()
