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
The fuzz targets: one for each kind of text from outside.

A target takes any bytes. It succeeds, or raises one of its documented errors. Any other exception
is a bug, and so is an input that takes longer than `TIMEOUT_S`.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache
import json
from pathlib import Path
import re
import shutil
import signal
import tempfile
from types import FrameType

from fret_monitor.build import build, generate_monitor, read
from fret_monitor.elaboration.formalize import formalize
from fret_monitor.importing import import_bundles
from fret_monitor.language.fretish import parse_fretish
from fret_monitor.model.diagnostics import CompileError, Source, Text
from fret_monitor.model.manifest import Manifest, ManifestError
from fret_monitor.native.monitor import Monitor
from fret_monitor.traces.simulate import simulate
from importing.examples import DATABASE, DOCUMENT, LUSTRE, SPECIFICATION
from stages import parse_message

HERE = Path(__file__).resolve().parent
GOLDEN = HERE.parent / 'golden'
CORPUS = HERE / 'corpus'
TIMEOUT_S = 20  # for one input; the machine may be busy

INPUTS = """\
format: 1
component: rover
constants: {limit: 3.5, n: 4}
inputs:
  p: {type: bool}
  q: {type: bool}
  i: {type: int32}
  u: {type: uint64}
  f: {type: float32}
  x: {type: float64}
  mode: {type: uint8, values: {IDLE: 0, LANDING: 7}}
definitions: {fast: x > limit}
"""
COLUMNS = 'p,q,i,u,f,x,mode\n'


class TookTooLong(Exception):
    """A target did not end within `TIMEOUT_S`."""


class Leaked(Exception):
    """Text of an input is in generated C outside comments and literals."""


@dataclass(frozen=True)
class Target:
    """A function of an input, its documented errors, its seeds, and words to insert."""

    run: Callable[[bytes], object]
    errors: tuple[type[Exception], ...]
    seeds: Callable[[], Iterable[bytes]]
    words: tuple[str, ...] = ()


def attempt(target: Target, data: bytes) -> bool:
    """
    Give an input to a target; return whether it was accepted.

    Raises undocumented errors of the target, and `TookTooLong`.
    """
    before = signal.signal(signal.SIGALRM, _ring)
    signal.alarm(TIMEOUT_S)
    try:
        target.run(data)
        return True
    except target.errors as error:
        # It must also be possible to print the error.
        str(error).encode(errors='surrogatepass')
        return False
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def _ring(number: int, frame: FrameType | None) -> None:
    raise TookTooLong


def kept(name: str) -> dict[str, bytes]:
    """Return the corpus of a target; each character in its file is a byte."""
    inputs = json.loads((CORPUS / f'{name}.json').read_text(encoding='utf-8'))
    return {label: text.encode('latin-1') for label, text in inputs.items()}


@cache
def scratch() -> Path:
    """Return a folder for the files of this process."""
    return Path(tempfile.mkdtemp(prefix='fret_monitor-fuzz-'))


def remove_scratch() -> None:
    """Remove that folder."""
    shutil.rmtree(scratch(), ignore_errors=True)
    scratch.cache_clear()


def text_of(data: bytes) -> str:
    """Decode bytes as the arguments of a command line are decoded."""
    return data.decode(errors='replace')


# -- the functions ----------------------------------------------------------------------------


def bundle(data: bytes) -> None:
    """Read a bundle, and write its C."""
    path = scratch() / 'bundle.yaml'
    path.write_bytes(data)
    generated = generate_monitor(read(path))
    Manifest.from_json(generated.manifest.to_json())
    for _, text in (generated.module.header, *generated.module.sources):
        check_c(text)


_TOKEN = re.compile(
    r'//[^\n]*\n|"(?:[ -!#-\[\]-~]|\\[0-7]{3})*"|[A-Za-z_][A-Za-z0-9_]*'
    r'|[-+*/%&|<>=!?:;,.(){}\[\]#~^ \n]|[0-9][0-9A-Za-z.+-]*|\\\n')


def check_c(text: str) -> None:
    """Raise `Leaked` for C with a character outside the tokens that the generator writes."""
    end = 0
    for found in _TOKEN.finditer(text):
        if found.start() != end:
            break
        end = found.end()
        comment = found[0].rstrip('\n')
        if comment.startswith('//') and (
                comment.endswith('\\') or '??/' in comment or not comment.isprintable()):
            raise Leaked(f'the comment does not end with its line: {comment!r}')
    if end != len(text):
        raise Leaked(repr(text[max(0, end - 60):end + 60]))


def formula(language: str) -> Callable[[bytes], None]:
    """Return what reads a formula as a requirement of a bundle, and as `formalize` does."""
    def run(data: bytes) -> None:
        text = text_of(data)
        if language == 'fretish':
            try:
                for logic in ('smv', 'cocospec'):
                    formalize(parse_fretish(Text.whole(Source('<sentence>', text))), logic)
            except CompileError as error:
                str(error)
        bundle(f'{INPUTS}requirements:\n- id: R\n  {language}: {json.dumps(text)}\n'.encode())
    return run


@cache
def monitor() -> Monitor:
    """Return a monitor that reads an input of each kind."""
    path = scratch() / 'traced.yaml'
    path.write_text(f'{INPUTS}requirements:\n- id: R\n  ptltl: p & q & i > 0 & u > 0 & f > 0.0 & '
                    'x > 0.0 & mode = LANDING\n')
    return build(path).monitor


def trace(data: bytes) -> None:
    """Run a monitor over a trace."""
    path = scratch() / 'trace.csv'
    path.write_bytes(data)
    simulate(monitor(), path, scratch() / 'verdicts.csv')


def importing(suffix: str, *, beside: object = None) -> Callable[[bytes], None]:
    """
    Return what imports a file; what is made of it is a bundle, right or wrong.

    `beside` is what FRET exports with it.
    """
    def run(data: bytes) -> None:
        path, other = scratch() / f'imported.{suffix}', scratch() / 'beside.json'
        path.write_bytes(data)
        other.write_text(json.dumps(beside))
        paths = [path] if beside is None else [other, path]
        for item in import_bundles(paths, scratch() / 'made.yaml'):
            for warning in item.warnings:
                warning.render()
            try:
                bundle(item.text.encode())
            except CompileError as error:
                str(error)
    return run


def manifest(data: bytes) -> None:
    """Read a manifest; what is written of it is the same."""
    found = Manifest.from_json(text_of(data))
    assert Manifest.from_json(found.to_json()) == found


def message(data: bytes) -> None:
    """Read the definition of a message."""
    parse_message(text_of(data), 'my_msgs')


# -- what it begins with ----------------------------------------------------------------------


def files(*patterns: str) -> list[bytes]:
    return [path.read_bytes() for pattern in patterns for path in sorted(GOLDEN.glob(pattern))]


def lines(*patterns: str) -> list[bytes]:
    """Return the lines of golden files, and the formulas of golden bundles."""
    found = [line for text in files(*patterns) for line in text.splitlines() if line.strip()]
    return [line for line in found if not line.startswith(b'#')]


def written_formulas(key: str) -> list[bytes]:
    pattern = re.compile(rf'{key}: *"?([^"\n]*)'.encode())
    return [found for text in files('*/*.yaml') for found in pattern.findall(text) if found]


def traces() -> list[bytes]:
    """Return traces with all kinds of cells."""
    rows = ['1,0,3,4,0.5,1e300,LANDING\n', 'true,false,-3,18446744073709551615,nan,-inf,7\n']
    return [(COLUMNS + rows[0]).encode(), (COLUMNS + ''.join(rows * 3)).encode(),
            (COLUMNS + '"1",0,3,"4",0.5,"1e300",LANDING\r\n').encode(),
            ('t;' + COLUMNS.replace(',', ';')).encode(), b'\xef\xbb\xbf' + COLUMNS.encode()]


def manifests() -> list[bytes]:
    """Return manifests of golden bundles."""
    return [generate_monitor(read(path, takes_instances=True)).manifest.to_json().encode()
            for path in sorted(GOLDEN.glob('c*/*.yaml'))]


def compiled_texts() -> list[bytes]:
    """Return what FRET and Ogma write, as the tests have it."""
    return [json.dumps(item).encode() for item in (SPECIFICATION, DOCUMENT, DATABASE)]


SMV = ('H', 'O', 'S', 'T', 'SI', 'Y', 'Z', 'FTP', 'TRUE', 'H[0,5]', 'O[<=3]', 'S[2,4]', 'T[=1]',
       '[0,-1]', '->', '<->', 'xor', '&', '|', '!', '<=', '!=', 'mod', '^', 'preInt(3, i)',
       'persisted(3, p)', 'occurred(2, q)', 'ite(p, i, 3)', '9223372036854775807', '1e400',
       'IDLE', 'fast', 'limit', 'mode', 'p', 'q', 'i', 'u', 'f', 'x', '(', ')')
COCOSPEC = ('H(p)', 'O(p)', 'S(p,q)', 'OT(5,0,p)', 'HT(3,1,q)', 'ST(4,2,p,q)', 'YtoPre', 'ZtoPre',
            'pre', '->', 'if', 'then', 'else', 'and', 'or', 'not', 'xor', '=>', 'FTP', 'mod',
            'div', 'real(i)', 'p', 'i', 'x', '0.1', '(', ')')
FRETISH = ('rover', 'shall', 'satisfy', 'always', 'never', 'eventually', 'immediately', 'within',
           'ticks', 'seconds', 'for', 'after', 'until', 'before', 'at the next timepoint', 'upon',
           'when', 'whenever', 'if', 'unless', 'in', 'not in', 'only in', 'only before', 'mode',
           'while', 'initially', 'finally', 'the', 'and', 'p', 'q', 'fast', 'x > 3', '10')
YAML = ('format: 1', 'inputs:', 'requirements:', '- id: R', 'ptltl: ', 'fretish: ', 'cocospec: ',
        'definitions:', 'constants:', 'evaluation: ', 'policy: periodic', 'period: ', 'values: ',
        'type: bool', 'topic: a', 'field: ', '{', '}', '[', ']', '&a', '*a', '<<: ', '!!python/',
        '|', '>-', '"', "'", '\n', '\t', '  ', '---', '...', '#', '%YAML 1.1', '\u2028', '\0')
JSON = ('{', '}', '[', ']', ':', ',', '"', 'null', 'true', '1e999', '-0', '\\ud800',
        '"requirements"', '"semantics"', '"ptExpanded"', '"CoCoSpecCode"', '"variables"',
        '"idType"', '"dataType"')
LUSTRE_WORDS = ('node', 'contract', 'let', 'tel', 'var', 'guarantee', 'assume', 'returns', '--',
                '(*', '*)', '(*@', 'Req text:', 'mode', 'require', 'ensure', ': real', ';')

SENTENCES = (
    b'rover shall always satisfy p',
    b'in fast mode rover shall within 3 ticks satisfy q | x > limit',
    b'before fast upon p & !q the rover shall immediately satisfy preInt(3, i) < i',
    b'only after fast whenever persisted(3, p) rover shall until q satisfy f <= 2.5',
    b'if p then rover shall for 5 ticks satisfy mode = LANDING',
    b'rover shall after 2 ticks satisfy if p then q',
)

TARGETS = {
    'bundle': Target(bundle, (CompileError,), lambda: files('*/*.yaml'), YAML + SMV),
    'smv': Target(formula('ptltl'), (CompileError,), lambda: [
        *lines('formula/*.smv'), *written_formulas('ptltl')], SMV),
    'cocospec': Target(formula('cocospec'), (CompileError,), lambda: [
        *lines('formula/*.cocospec'), *written_formulas('cocospec')], COCOSPEC),
    'fretish': Target(formula('fretish'), (CompileError,), lambda: [
        *lines('fretish/*.fretish'), *written_formulas('fretish'), *SENTENCES], FRETISH),
    'trace': Target(trace, (CompileError,), traces,
                    ('p', 'mode', ',', ';', '\t', '"', '""', '\r\n', '\0', 'nan', '-inf', '1e999',
                     '1_000', '0x10', '٣', 'LANDING', '18446744073709551616', ' ')),
    'fret': Target(importing('json'), (CompileError,), compiled_texts, JSON + SMV),
    'lustre': Target(importing('lus'), (CompileError,), lambda: [LUSTRE.encode()],
                     LUSTRE_WORDS + COCOSPEC),
    'ogma': Target(importing('json', beside=SPECIFICATION), (CompileError,), lambda: [
        json.dumps(DATABASE).encode()], JSON),
    'topics': Target(importing('txt', beside=SPECIFICATION), (CompileError,), lambda: [
        b'speed /wheels/speed std_msgs/msg/Float32 data\n', b'speed,/wheels/speed\narmed,/a\n',
        b'# a list\nspeed: /wheels/speed\n'], (' ', '\t', '\n', '/', ',', 'speed', 'armed')),
    'manifest': Target(manifest, (ManifestError,), manifests, JSON),
    'message': Target(message, (CompileError,), lambda: [
        b'# a\nuint8 A=3\nfloat32[<=4] xs  # b\nstring<=10 name "d"\nint32 x 5\n',
        b'std_msgs/Header header\ngeometry_msgs/Pose[3] poses\n', b'string A="a # b"\n'],
        ('uint8', 'string<=', '[<=', ']', '=', '#', 'wstring', 'Header', '/', '---', '"')),
}
