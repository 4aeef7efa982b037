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
Tables and numbers of the pages are those of the program.

Compared are keys of bundles, parameters, launch arguments, verbs, options, exit statuses, limits
and defaults; that measured tables stand on one page, with date and command; and that links lead to
headings.
"""

from argparse import ArgumentParser
import ast
from importlib import import_module
from keyword import iskeyword
from pathlib import Path
import re
import signal
from typing import Any

from fret_monitor.bag import overview, report
from fret_monitor.build import read
from fret_monitor.bundle import yaml_tree
from fret_monitor.bundle.actions import ACTION_KEYS, KIND_KEYS
from fret_monitor.bundle.gates import GATE_KEYS, OTHERWISE_KEYS
from fret_monitor.bundle.inputs import BLOCK_KEYS, FIELD_KEYS, INPUT_KEYS, QOS_KEYS
from fret_monitor.bundle.reader import BUNDLE_KEYS, EVALUATION_KEYS
from fret_monitor.bundle.requirements import REQUIREMENT_KEYS
from fret_monitor.bundle.source_file import MAX_BYTES
from fret_monitor.cli.main import _VERBS as VERBS, main
from fret_monitor.elaboration.durations import MAX_BOUND
from fret_monitor.export.targets import TARGETS
from fret_monitor.logic.specification import Specification
from fret_monitor.native import cache, compiler, words as node_words
from fret_monitor.native.binding import ffi
from fret_monitor.program.cost import step_cost
from fret_monitor.program.layout import lay_out
from fret_monitor.program.lower import lower
from fret_monitor.runtime.subscription import LOOK_AGAIN_S, LOOKS_AT_ONCE
import pytest
from tools.pictures.__main__ import PICTURES

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / 'docs'

if not (ROOT / 'README.md').is_file():
    pytest.skip('needs the source tree', allow_module_level=True)

PAGES = [ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', *sorted(DOCS.glob('*.md'))]
COUNTS = {2: 'two', 3: 'three', 4: 'four', 5: 'five', 6: 'six'}


def text_of(page: str) -> str:
    """Return the text of a page of docs, or of the root."""
    path = DOCS / page if (DOCS / page).is_file() else ROOT / page
    return path.read_text(encoding='utf-8')


def table(page: str, *headings: str) -> list[list[str]]:
    """Return the rows of the table of a page whose first headings are these."""
    start = '| ' + ''.join(f'{heading} | ' if heading else '| ' for heading in headings).rstrip()
    _, found, rest = text_of(page).partition(start)
    assert found, f'{page} has no table {start}'
    rows = re.match(r'[^\n]*\n\|[-|]+\n((?:\|.*\n)+)', rest)
    assert rows is not None
    return [[cell.strip().replace('\0', '|') for cell in row.replace('\\|', '\0')[1:-1].split('|')]
            for row in rows[1].splitlines()]


def words(cell: str) -> list[str]:
    """Return what stands between backquotes."""
    return re.findall(r'`([^`]+)`', cell)


def parser_of(verb: str) -> ArgumentParser:
    """Return a parser with the arguments of a verb."""
    parser = ArgumentParser()
    import_module(f'fret_monitor.cli.{verb}_' if iskeyword(verb) else
                  f'fret_monitor.cli.{verb}').add_arguments(parser)
    return parser


def options_of(verb: str) -> set[str]:
    """Return the options of a verb, long and short."""
    return set(parser_of(verb)._option_string_actions) - {'-h', '--help'}


def constants(path: str) -> dict[str, Any]:
    """Return the literal values that a module assigns, without importing it."""
    found = {}
    for node in ast.parse((ROOT / path).read_text(encoding='utf-8')).body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            try:
                found[node.targets[0].id] = ast.literal_eval(node.value)
            except ValueError:
                continue
    return found


# -- bundles -------------------------------------------------------------------------------------

def test_the_page_on_bundles_has_every_key_where_it_may_stand() -> None:
    found: dict[str, set[str]] = {}
    for keys, where, *_ in table('bundle.md', 'key', 'where'):
        for place in where.split(', '):
            found.setdefault(place, set()).update(words(keys))
    assert found == {'bundle': set(BUNDLE_KEYS), 'input': set(INPUT_KEYS),
                     'requirement': set(REQUIREMENT_KEYS)}


def test_the_page_on_bundles_has_the_keys_of_a_topic_and_of_its_fields() -> None:
    said = re.search(r'Under `topics` the (.*?) of a topic are written once\. Each of its `fields`'
                     r' is an input: a\npath, or a mapping with (.*?)\. Both',
                     text_of('bundle.md'))
    assert said is not None
    assert {*words(said[1]), 'fields'} == set(BLOCK_KEYS)
    assert set(words(said[2])) == set(FIELD_KEYS)


def test_the_page_on_bundles_has_the_keys_of_an_evaluation_and_of_qos() -> None:
    rows = {keys: meaning for keys, _, meaning in table('bundle.md', 'key', 'where')}
    assert set(words(rows['`evaluation`'])) - {'timed', 'periodic'} == set(EVALUATION_KEYS)
    assert set(words(rows['`qos`'])) == set(QOS_KEYS)


def test_the_page_on_time_has_the_keys_of_timed() -> None:
    timed = {key for row in table('time.md', 'key', 'meaning, default') for key in words(row[0])}
    assert timed == set(EVALUATION_KEYS) - {'policy', 'period', 'rate'}


def test_the_page_on_bundles_has_the_keys_of_a_gate() -> None:
    rows = {key: meaning for keys, meaning in table('bundle.md', 'key', 'meaning, default')
            for key in words(keys)}
    assert set(rows) == set(GATE_KEYS)
    assert set(OTHERWISE_KEYS) <= {*re.findall(r'\w+', rows['otherwise'])}


def test_the_page_on_actions_has_the_keys_of_each_kind() -> None:
    found: dict[str, set[str]] = {}
    for keys, where, _ in table('actions.md', 'key', 'of'):
        for place in words(where) if '`' in where and 'all but' not in where else ['action']:
            found.setdefault(place, set()).update(words(keys))
    assert found.pop('action') == set(ACTION_KEYS) - {kind.value for kind in KIND_KEYS}
    assert found == {kind.value: set(keys) for kind, keys in KIND_KEYS.items()}


# -- the command line ----------------------------------------------------------------------------

def test_the_readme_has_every_verb() -> None:
    commands = ' '.join(row[1] for row in table('README.md', 'to', 'command', 'page'))
    assert set(re.findall(r'fret-monitor ([\w-]+)', commands)) == set(VERBS)


def test_the_page_on_the_command_line_has_the_verbs_with_json_and_with_progress() -> None:
    text = text_of('command_line.md')
    with_json = {verb for verb in VERBS if '--json' in options_of(verb)}
    documents = {words(row[0])[0] for row in table('command_line.md', 'verb')}
    said = re.search(r'^(.*) take `--json`', text, re.MULTILINE)
    assert said is not None and set(words(said[1])) == documents == with_json - {'bag'}
    shown = re.search(r'^(.*) \(its proof\) show on standard error', text, re.MULTILINE)
    sources = {verb: (ROOT / 'fret_monitor/cli' / f'{verb}{"_" * iskeyword(verb)}.py').read_text()
               for verb in VERBS}
    assert shown is not None and set(words(shown[1])) == {
        verb for verb, source in sources.items() if 'with progress(' in source}


def test_the_page_on_the_command_line_has_the_exit_statuses() -> None:
    rows = table('command_line.md', 'exit status', 'means')
    statuses = {int(number) for row in rows for number in row[0].split(', ')}
    assert statuses == {0, 1, 2, 128 + signal.SIGINT, 128 + signal.SIGTERM}
    answers = {verb for verb in VERBS if '--fail-on-violation' in options_of(verb)}
    said = re.search(r'a violation with `--fail-on-violation` \((.*?)\)', rows[1][1])
    assert said is not None and set(words(said[1])) == answers


def test_the_page_on_bundles_has_the_verbs_that_take_constants() -> None:
    said = re.search(r'`--constant NAME=VALUE` of (.*?), and the', text_of('bundle.md'))
    assert said is not None and set(words(said[1])) == {
        verb for verb in VERBS if '--constant' in options_of(verb)}


@pytest.mark.parametrize(('page', 'verb'), [
    ('recordings.md', 'bag'), ('export.md', 'export'), ('analysis.md', 'analyze'),
    ('tests.md', 'tests'), ('prove.md', 'prove'), ('explain.md', 'explain'),
    ('simulate.md', 'simulate'), ('import.md', 'import'), ('new.md', 'new'), ('c.md', 'compile')])
def test_the_page_of_a_verb_has_its_name_in_the_title_and_its_options(
    page: str, verb: str,
) -> None:
    assert f'`{verb}`' in text_of(page).split('\n')[0]
    everywhere = {'--constant', '--json'}  # bundle.md and command_line.md have them
    long = {option for option in options_of(verb) if option.startswith('--')} - everywhere
    text = text_of(page)
    short = {option: action.option_strings for option, action in
             parser_of(verb)._option_string_actions.items()}
    assert [option for option in sorted(long)
            if not any(re.search(rf'(?<![\w-]){each}(?![\w-])', text)
                       for each in short[option])] == []


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_the_commands_of_a_page_use_options_that_exist(page: Path) -> None:
    text = re.sub(r'\\\n', ' ', page.read_text(encoding='utf-8'))
    wrong = []
    for verb, rest in re.findall(r'fret-monitor ([a-z]+)([^`\n|#>]*)', text):
        if verb not in VERBS:
            continue
        options = re.findall(r'(?<!\S)\[?(--?[a-z][a-z-]*)', rest.partition('cc -')[0])
        wrong += [f'{verb} {option}' for option in options
                  if option not in options_of(verb) | {'--help'}]
    assert wrong == []


def test_every_option_has_a_line_in_its_help() -> None:
    assert [f'{verb} {action.option_strings or action.dest}' for verb in VERBS
            for action in parser_of(verb)._actions if not action.help] == []


def test_the_page_on_export_has_its_targets() -> None:
    assert {words(row[0])[0] for row in table('export.md', 'target', 'is')} == set(TARGETS)


def test_the_pages_name_targets_of_make_that_exist_and_make_lists_all() -> None:
    makefile = text_of('Makefile')
    targets = set(re.search(r'^\.PHONY: (.*)', makefile, re.MULTILINE)[1].split())  # type: ignore
    listed = set(re.findall(r"^\t@echo 'make ([\w-]+)", makefile, re.MULTILINE))
    assert listed == targets - {'help', 'setup-test'}
    named = {(page.name, name) for page in PAGES for name in
             re.findall(r'(?:`|^)make ([\w-]+)', page.read_text(encoding='utf-8'), re.MULTILINE)}
    assert [item for item in sorted(named) if item[1] not in targets] == []


# -- the nodes -----------------------------------------------------------------------------------

def parameter_rows() -> dict[str, tuple[str, str]]:
    """Return what the page says of each parameter: of which nodes, and its meaning."""
    return {name: (of, meaning) for names, of, meaning in
            table('ros_interface.md', 'parameter', 'of') for name in words(names)}


def test_the_page_on_ros_has_the_parameters_of_each_node() -> None:
    pytest.importorskip('rclpy')
    from fret_monitor.ros.settings import parameters
    rows = parameter_rows()
    of_all = {'constants.NAME', 'use_sim_time', 'qos_overrides.TOPIC.subscription.POLICY'}
    monitor = set(parameters.MONITOR_PARAMETERS)
    logger = set(parameters.LOGGER_PARAMETERS)
    assert {name for name, (of, _) in rows.items() if of in ('monitor', 'both')} == \
        monitor | of_all
    assert {name for name, (of, _) in rows.items() if of == 'both'} == logger | of_all
    assert {name for name, (of, _) in rows.items() if of == 'gate'} == \
        set(parameters.GATE_PARAMETERS) - monitor
    assert 'no `period` or `rate`' in rows['gates'][1]
    assert monitor - set(parameters.GATE_PARAMETERS) == {'period', 'rate'}


def test_the_page_on_ros_has_the_defaults_and_least_values_of_parameters() -> None:
    pytest.importorskip('rclpy')
    from fret_monitor.ros.settings import parameters
    rows = parameter_rows()

    def numbers(name: str, word: str) -> list[float]:
        said = re.search(rf'{word} ([^;.]*)', rows[name][1])
        assert said is not None, (name, word)
        return [float(item) for item in re.findall(r'(?<![(\d])\d+\b(?! [MG]iB)', said[1])]

    defaults = {name: item.default for name, item in parameters.MONITOR_PARAMETERS.items()}
    for name in ('handler_depth', 'blackbox_seconds'):
        assert numbers(name, 'default') == [defaults[name]]
    assert numbers('blackbox_bytes', 'default')[0] == defaults['blackbox_bytes']
    assert numbers('blackbox_bytes', 'at least') == [parameters.OF_BOTH['blackbox_bytes'].least]
    pair = (defaults['blackbox_files'], defaults['blackbox_disk_bytes'])
    assert tuple(numbers('blackbox_files', 'default')) == pair
    assert numbers('blackbox_files', 'at least') == [
        1, parameters.OF_BOTH['blackbox_disk_bytes'].least]


def test_the_page_on_ros_has_the_arguments_of_the_launch_file() -> None:
    arguments = constants('launch/monitor.launch.py')['ARGUMENTS']
    said = re.search(r'^Arguments are (.*?)\. The monitor is', text_of('ros.md'),
                     re.MULTILINE | re.DOTALL)
    assert said is not None and words(said[1]) == list(arguments)


def test_the_page_on_ros_has_every_executable_and_the_name_of_its_node() -> None:
    setup = text_of('setup.py')
    names = set(re.findall(r"f'(\S+) = \{NAME\}", setup)) - {'fret-monitor'}
    head = text_of('ros.md').split('```')[0]
    assert f'There are {COUNTS[len(names)]} executables' in head
    assert names <= set(words(head))
    assert {f'fret_{name}' for name in names - {'monitor'}} | {'fret_monitor'} <= set(words(head))


def test_the_page_on_the_exported_node_has_its_parameters() -> None:
    own = [name for path in ('node/parameters.c', 'reporting/parameter_table.h')
           for name in re.findall(r'^  FM_PARAMETER\("(\w+)",', text_of(f'csrc/{path}'),
                                  re.MULTILINE)]
    assert 'lock_memory' in own
    row = next(row for row in table('export_ros2.md', '', 'monitor in Python')
               if row[0] == 'parameters')
    assert set(words(row[2])) == {*own, 'qos_overrides'}


def test_specs_in_commands_of_the_pages_are_found() -> None:
    wrong = []
    for page in PAGES:
        text = page.read_text(encoding='utf-8')
        written = set(re.findall(r'^# (\S+\.yaml)$', text, re.MULTILINE))
        for spec in re.findall(r'\bspec:="?\[?([\w./-]+(?:://[\w./-]+)?\.yaml)', text):
            name = spec.removeprefix('package://fret_monitor/')
            is_there = (ROOT / name).is_file() if name != spec else (
                name in written or (ROOT / 'config' / name).is_file() or name in
                ('tank.yaml', 'vehicle.yaml', 'drive.yaml', 'NAME.yaml', 'hello.yaml'))
            if not is_there:
                wrong.append(f'{page.name}: {spec}')
    assert wrong == []


# What is added to an example that is a part of a bundle.
REST = {'format': '1', 'requirements': '[{id: ADDED, ptltl: "speed > 0.0"}]',
        'inputs': '{speed: {topic: odom, type: nav_msgs/msg/Odometry, '
                  'field: twist.twist.linear.x, max_rate: 100}}'}


def in_full(example: str) -> str:
    """Return an example with the keys that it lacks."""
    missing = [f'{key}: {value}' for key, value in REST.items()
               if not re.search(f'^{key}:', example, re.MULTILINE)
               and not (key == 'inputs' and 'signals:' in example)]
    found = re.search(r'^  (\w+): \{topic:', example, re.MULTILINE)
    read = found[1] if found else 'speed'
    return '\n'.join([example, *missing]).replace('"speed >', f'"{read} >')


@pytest.mark.parametrize('page', ['over_time', 'bundle', 'for_each', 'future', 'new'])
def test_bundles_of_a_page_pass_check(
        page: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    examples = re.findall(r'^```yaml\n(.*?)^```', text_of(f'{page}.md'), re.MULTILINE | re.DOTALL)
    assert examples
    for number, example in enumerate(examples):
        name = re.match(r'# (\S+)\n', example)
        file = tmp_path / (name[1] if name else f'{number}.yaml')
        file.write_text(in_full(example), encoding='utf-8')
        assert main(['check', str(file)]) == 0, capsys.readouterr().err
        file.write_text(example, encoding='utf-8')  # as others share it


# -- lines of the log, and statuses --------------------------------------------------------------

# Functions of C that word a line or status, and their arguments that are its words.
WORDED = {'fm_lines_add': (2,), 'log_of': (3,), 'add_trouble': (2,), 'add_increase': (4,),
          'add_status': (4,), 'add_judged': (4,), 'add_reason': (1,), 'add_listed': (2,),
          'add_requirements': (4,),
          'fm_text_join': (2,), 'fm_log': (2,), 'fm_log_failure': (1,), 'count_result': (5,)}
# Files in which `fm_text_add` words reasons that stand in lines or statuses.
REASONS = ('action_call.c', 'health.c', 'input_log.c', 'condition_log.c',
           'monitor_node.c', 'graph_lines.c', 'instance_lines.c', 'figures.c')
# Functions of Python that word what a node logs, but do not log it.
WORDING = {'fret_monitor/ros/nodes/logger_node.py': '_contents',
           'fret_monitor/model/parts.py': 'judged_by_gates',
           'fret_monitor/ros/native_start.py': '_compiling'}


def arguments(source: str, start: int) -> list[str]:
    """Return the arguments of a call in C whose parenthesis opens before `start`."""
    found, depth = [''], 1
    for token in re.finditer(r'"(?:[^"\\]|\\.)*"|.', source[start:], re.DOTALL):
        depth += {'(': 1, ')': -1}.get(token[0], 0)
        if depth == 0:
            break
        if token[0] == ',' and depth == 1:
            found.append('')
        else:
            found[-1] += token[0]
    return found


def literals(argument: str) -> list[str]:
    """Return the texts in an argument, `…` for each value; adjacent literals are one."""
    joined = re.sub(r'"\s*PRI\w+(?:\s*"|(?=\s*$))', 'd', argument)
    joined = re.sub(r'"\s*[A-Z]\w*\s*"', '…', joined)
    joined = re.sub(r'"\s*"', '', joined)
    return [re.sub(r'%[-.\d*]*(?:ll)?[a-z]', '…', text).replace('\\x', '…')
            for text in re.findall(r'"((?:[^"\\]|\\.)*)"', joined)]


def texts_of_c(path: Path) -> set[str]:
    """Return the texts that a file of C logs, or says in /diagnostics."""
    source = re.sub(r'FM_WORDS_(\w+)', lambda found: f'"{getattr(node_words, found[1])}"',
                    re.sub(r'//[^\n]*', '', path.read_text(encoding='utf-8')))
    worded = WORDED | ({'fm_text_add': (1,)} if path.name in REASONS else {})
    found: set[str] = set()
    for call in re.finditer(r'\b(\w+)\(', source):
        given = arguments(source, call.end()) if call[1] in worded else []
        if given[:1] == ['&key'] or (call[1] == 'fm_text_join' and given[1].strip() != '"; "'):
            continue  # of a value, or a refusal, not the message of a status
        if call[1] == 'fm_text_add' and given and given[1].strip() == '"%s"':
            given = given[1:]
        for place in worded.get(call[1], ()):
            texts = literals(given[place]) if place < len(given) else []
            if call[1] == 'log_of':
                texts = [f"{kind} '…' {text}" for text in texts for kind in ('lock', 'gate')]
            elif call[1] == 'fm_log_failure':
                texts = [f'{text}: …' for text in texts]
            elif call[1] == 'add_increase':
                texts = [f'… {text} since the last report' for text in texts]
            found.update(re.sub(r'^(?=,)|(?<= )$', '…', text) for text in texts)
    return found


def text_of_node(node: ast.expr) -> str:
    """Return the text of an expression of Python, `…` for each value."""
    match node:
        case ast.Constant(value=str(text)):
            return text
        case ast.JoinedStr(values=values):
            return ''.join(map(text_of_node, values))
        case ast.Attribute(value=ast.Name(id='words'), attr=name):
            return str(getattr(node_words, name))
        case ast.BinOp(left=left, op=ast.Mod()):
            return re.sub(r'%[.\d]*[a-z]', '…', text_of_node(left))
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            return text_of_node(left) + text_of_node(right)
        case ast.IfExp(body=body):
            return text_of_node(body)
        case _:
            return '…'


def texts_of_python(path: Path) -> set[str]:
    """Return the texts that a module logs."""
    found: set[str] = set()
    wording = WORDING.get(path.relative_to(ROOT).as_posix())
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        match node:
            case ast.Call(func=ast.Attribute(value=value, attr=attr), args=[text, *_]) if (
                    'logger' in ast.unparse(value)
                    and attr in ('debug', 'info', 'warning', 'error', 'fatal')):
                found.add(text_of_node(text))
            case ast.FunctionDef(name=name) if name == wording:
                found |= {text_of_node(inner.value) for inner in ast.walk(node)
                          if isinstance(inner, ast.Return | ast.Yield) and inner.value}
                found |= {text_of_node(inner.elt) for inner in ast.walk(node)
                          if isinstance(inner, ast.ListComp)}
    return found


def texts_of_nodes() -> set[str]:
    """Return every line and status of the nodes that has words of its own."""
    found = {text for folder in ('reporting', 'ros', 'node')
             for path in sorted((ROOT / 'csrc' / folder).glob('*.c')) for text in texts_of_c(path)}
    for path in [*sorted((ROOT / 'fret_monitor/ros').rglob('*.py')),
                 ROOT / 'fret_monitor/model/parts.py']:
        found |= texts_of_python(path)
    return {text for text in found if len(re.findall('[a-z]', text)) > 3}


def is_like(pattern: str, text: str) -> bool:
    """Return whether a text fits a pattern, in which `…` is anything."""
    return re.fullmatch('.*'.join(map(re.escape, pattern.split('…'))), text, re.DOTALL) is not None


def entries() -> list[str]:
    """Return the lines and statuses that the page on operations explains."""
    rows = [row.split('|') for row in
            re.findall(r'^\|(.*)\|$', text_of('operations.md'), re.MULTILINE)]
    return [entry for row in rows for entry in words(row[2 if len(row) == 5 else 0])]


def test_the_page_on_operations_has_every_line_and_status_of_the_nodes() -> None:
    said = entries()
    texts = texts_of_nodes()
    assert len(texts) > 100
    assert [text for text in sorted(texts)
            if not any(is_like(entry, text) or is_like(text, entry) for entry in said)] == []


def test_the_page_on_operations_explains_no_line_that_nothing_logs() -> None:
    texts = texts_of_nodes()
    assert [entry for entry in entries()
            if not any(is_like(entry, text) or is_like(text, entry) for text in texts)] == []


def test_the_page_on_topics_has_the_values_of_every_status() -> None:
    source = ''.join((ROOT / 'csrc/reporting' / name).read_text(encoding='utf-8')
                     for name in ('health.c', 'instance_lines.c'))
    keys = {f'{text} INPUT' if call[0] == 'add_count_of_input(' else text for call in re.finditer(
                r'\b(?:add_count|add_count_of_input|fm_status_\w+)\(', source)
            for given in [arguments(source, call.end())]
            for text in literals(given[1])}
    rows = table('ros_interface.md', 'of', 'name', 'values')
    said = {word for row in rows for word in words(row[2])}
    assert len(keys) > 40 and keys - said == set()
    assert said - keys <= {'timed', 'report: occurrence', 'stamp: header', 'max_rate', 'H p', 'p',
                           'margins:=true'}
    calls = [arguments(source, call.end())
             for call in re.finditer(r'\badd_(?:status|judged)\(', source)]
    kinds = {kind for given in calls for kind in literals(given[2])}
    named = {word.removeprefix('NODE: ').rstrip('ABDEILMNU') for row in rows
             for word in words(row[1])}
    assert kinds | {''} == named  # without a kind: a requirement


# -- limits and defaults -------------------------------------------------------------------------

# A value, or `PATH:NAME` of a constant that is read without importing its module.
LIMITS: list[tuple[str, str, float | str]] = [
    ('bundle.md', r'UTF-8, up to (\d+) MiB', MAX_BYTES >> 20),
    ('security.md', r'Python objects, (\d+) MiB', MAX_BYTES >> 20),
    ('security.md', r'MiB and (\d+) levels', yaml_tree.MAX_DEPTH),
    ('security.md', r'unused for (\d+) days', cache._UNUSED_AGE / 86400),
    ('security.md', r'above (\d+) libraries', cache._MOST),
    ('security.md', r'\((\d+) notes\)', 'fret_monitor/start.py:_MOST_NOTES'),
    ('language.md', r'one above (\d+), or', MAX_BOUND),
    ('language.md', r'sentence above (\d+)', MAX_BOUND - 1),
    ('recordings.md', r'the first (\d+) times', report._MOST_LISTED),
    ('design.md', r'of all topics, (\d+) of them', LOOKS_AT_ONCE),
    ('design.md', r'looks for all publishers every (\d+) seconds', LOOK_AGAIN_S),
    ('ros_interface.md', r'at most (\d+) a second get them',
     ffi.integer_const('FM_MOST_DETAILS_PER_S')),
    ('ros_interface.md', r'\((\d+) without a subscriber\)',
     ffi.integer_const('FM_LOGGED_PER_S')),
    ('operations.md', r'with a lease of (\d+) s', ffi.integer_const('FM_SIGN_LEASE_S')),
    ('bundle.md', r'default: (\d+), or the `timeout`',
     'fret_monitor/elaboration/signals.py:_USUAL_STARTUP_S'),
    ('actions.md', r'first one that failed \((\d+)\)',
     'fret_monitor/bundle/actions.py:_USUAL_RETRIES'),
]


@pytest.mark.parametrize(('page', 'pattern', 'value'), LIMITS)
def test_a_limit_or_default_of_a_page_is_that_of_the_program(
    page: str, pattern: str, value: float | str,
) -> None:
    if isinstance(value, str):
        path, _, name = value.partition(':')
        value = constants(path)[name]
    said = re.search(pattern.replace(' ', r'\s+'), text_of(page))
    assert said is not None and float(said[1]) == value


def test_times_and_counts_in_words_are_those_of_the_program() -> None:
    security = text_of('security.md')
    assert (compiler.TIMEOUT, compiler._VERSION_TIMEOUT) == (600, 20)
    assert 'After ten minutes (`--version`: twenty seconds)' in security
    assert f'Up to {COUNTS[overview.MOST_SHOWN]} of each are drawn' in text_of('recordings.md')


def test_the_page_on_design_names_every_file_of_a_room() -> None:
    rows = {words(row[0])[0].rstrip('/') for row in table('design.md', 'folder', 'holds')}
    assert rows == {path.name for path in (ROOT / 'csrc').iterdir() if path.is_dir()}
    folders = {f'csrc/{folder}': '*.c' for folder in rows if folder not in ('generated', 'export')}
    folders |= {f'fret_monitor/ros/{path.parent.name}': '[!_]*.py' for path in
                (ROOT / 'fret_monitor/ros').glob('*/__init__.py')}
    for folder, pattern in folders.items():
        named = [name for row in table('design.md', f'`{folder.removeprefix("fret_monitor/")}/`')
                 for name in words(row[0])]
        assert [path.name for path in sorted((ROOT / folder).glob(pattern))
                if path.name not in named] == [], folder


# -- what was measured ---------------------------------------------------------------------------

MEASURED = re.compile(r'^[\d.,]+ (?:ns|us|µs|ms|MB|GB)$')
DATE = re.compile(r'\b\d{1,2} (?:November|December) 20\d\d\b|\b20\d\d-\d\d-\d\d\b')


def test_measured_tables_stand_on_one_page() -> None:
    wrong = []
    for page in PAGES:
        if page.name == 'benchmarks.md':
            continue
        for row in re.findall(r'^\|(.*)\|$', page.read_text(encoding='utf-8'), re.MULTILINE):
            cells = [cell.strip() for cell in row.split('|')]
            if any(MEASURED.match(cell) for cell in cells) or {'seconds', 'ratio'} & set(cells):
                wrong.append(f'{page.name}: {row}')
    assert wrong == []


def test_every_measured_table_has_a_date_and_a_command() -> None:
    chapters = re.split(r'^## ', text_of('benchmarks.md'), flags=re.MULTILINE)[1:]
    assert [chapter.split('\n')[0] for chapter in chapters if '\n|' in chapter and not (
                DATE.search(chapter) and re.search(r'bench\.\w+|make \w+', chapter))] == []


def test_a_figure_beside_a_link_to_the_benchmarks_is_there() -> None:
    page = text_of('benchmarks.md')
    wrong = []
    for path in PAGES:
        for line in re.split(r'(?<=[.:|])\s', path.read_text(encoding='utf-8')):
            if 'benchmarks.md' not in line or path.name == 'README.md':
                continue
            wrong += [f'{path.name}: {found}' for found in re.findall(
                r'(?<![\w.-])\d+\.\d+(?![\w.])|\d[\d,]* (?:ns|us|µs|MB)\b', line)
                if found not in page]
    assert wrong == []


def test_the_figures_of_the_readme_are_those_of_the_benchmarks() -> None:
    rows = [[cell.strip() for cell in row.split('|')] for row in
            re.findall(r'^\| (.*) \|$', text_of('benchmarks.md'), re.MULTILINE)]
    readme = text_of('README.md')
    step = next(row for row in rows if row[:2] == ['running example', 'random'])
    said = re.search(r'\(ratio ([\d.]+)\), in (\d+) bytes of state', readme)
    assert said is not None
    assert (said[1], f'{said[2]} B') == (f'{float(step[4]):.1f}', step[5])
    node = next(row for row in rows if row[:2] == ['CPU a message, no violation', 'monitor'])
    share = re.search(r'took (\d+) % of the processor\s+time of a subscriber', readme)
    assert share is not None and int(share[1]) == round(100 * float(node[4]))


def specification(name: str) -> Specification:
    """Return what a bundle of `config` requires."""
    return read(ROOT / 'config' / name).specification


def test_the_bounds_of_instructions_are_those_that_compile_prints() -> None:
    said = re.search(r'largest counts on (.*?)\n\n', text_of('worst_case.md'), re.DOTALL)
    assert said is not None
    rows = re.findall(r'`(\w+\.yaml)` (\d+) \((?:bound )?(\d+)\)', said[1])
    bounds = {name: step_cost(tuple(map(lay_out, lower(specification(name)).groups))).own
              for name in ('quadrotor.yaml', 'arm.yaml', 'mobile_base.yaml')}
    assert {name: int(bound) for name, _, bound in rows} == bounds
    times = re.search(r'([\d.]+) times for `quadrotor\.yaml`', text_of('assurance.md'))
    assert times is not None
    assert {name: float(bound) / float(count) for name, count, bound in rows}[
        'quadrotor.yaml'] == pytest.approx(float(times[1]), abs=0.05)


def test_the_number_of_obligations_is_that_of_a_proof() -> None:
    pytest.importorskip('z3')
    pytest.importorskip('pycparser')
    from fret_monitor.build import generate_monitor
    from fret_monitor.proving.verification import verify
    rows = {row[0]: int(row[1]) for row in table('benchmarks.md', 'proof of', 'obligations')}
    for name in ('quadrotor.yaml', 'arm.yaml', 'mobile_base.yaml'):
        found = verify(generate_monitor(read(ROOT / 'config' / name)), seconds=60.0)
        assert rows[name] == sum(len(item.proofs) for item in found.groups)
        assert rows['cells'] == len(found.cells)


def test_the_page_on_benchmarks_has_the_figures_that_can_be_asked_for() -> None:
    source = (ROOT / 'bench/ros.py').read_text(encoding='utf-8')
    figures = re.search(r'^FIGURES: .* = \{(.*?)^\}', source, re.MULTILINE | re.DOTALL)
    said = re.search(r'`--only` is one of (.*?);', text_of('benchmarks.md'), re.DOTALL)
    assert figures is not None and said is not None
    assert words(said[1]) == re.findall(r"'(\w+)':", figures[1])


# -- pictures ------------------------------------------------------------------------------------

def picture(name: str) -> str:
    """Return a picture of the pages."""
    return (ROOT / 'docs/pictures' / f'{name}.svg').read_text(encoding='utf-8')


@pytest.mark.parametrize('name', sorted(set(PICTURES) - {'report'}))
def test_a_picture_is_what_runs_give(name: str) -> None:
    if name == 'policies':
        pytest.importorskip('rosbags')
    assert PICTURES[name].drawn() == picture(name)


def test_the_picture_of_a_report_is_of_the_report_that_is_made_today() -> None:
    pytest.importorskip('rosbags')
    assert PICTURES['report'].source(PICTURES['report'].made()) in picture('report')


def test_every_picture_is_on_a_page() -> None:
    shown = [name for page in PAGES
             for name in re.findall(r'!\[[^]]+\]\(pictures/(\w+)\.svg\)', text_of(page.name))]
    assert sorted(shown) == sorted(PICTURES)


def test_the_page_on_time_says_of_the_policies_what_the_picture_says() -> None:
    said = [re.search(r'(at [\d.]+ s|never):', row)
            for row in text_of('time.md').split('where OPENS is evaluated')[1].splitlines()[1:6]]
    assert [found and found[1] for found in said] == [
        text.removeprefix('violated ').replace('not violated', 'never')
        for text in re.findall(r'violated at [\d.]+ s|not violated', picture('policies'))]


# -- links ---------------------------------------------------------------------------------------

def anchors(page: Path) -> set[str]:
    """Return the anchors that GitHub gives the headings of a page."""
    text = re.sub(r'^```.*?^```$', '', page.read_text(encoding='utf-8'),
                  flags=re.MULTILINE | re.DOTALL)
    return {re.sub(r'[^\w\- ]', '', heading.lower()).replace(' ', '-')
            for heading in re.findall(r'^#+ (.*)$', text, re.MULTILINE)}


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_a_link_to_a_heading_leads_to_one(page: Path) -> None:
    links = re.findall(r'\]\((?!\w+:)([^)#]*)#([^)]+)\)', page.read_text(encoding='utf-8'))
    assert [f'{file}#{anchor}' for file, anchor in links
            if anchor not in anchors(page.parent / file if file else page)] == []


def test_every_page_can_be_reached_from_the_readme() -> None:
    seen, left = set(), [ROOT / 'README.md']
    while left:
        page = left.pop()
        if page in seen:
            continue
        seen.add(page)
        left += [(page.parent / link).resolve() for link in
                 re.findall(r'\]\((?!\w+:|#)([^)#]+\.md)', page.read_text(encoding='utf-8'))]
    assert sorted(path.name for path in set(PAGES) - seen) == []


def test_every_file_that_a_page_names_exists() -> None:
    named = re.compile(r'(?<![\w./$-])((?:bench|config|csrc|examples|fret_monitor|launch|test)'
                       r'/[\w./-]*[a-z0-9_])(?![\w*{-])')
    wrong = []
    for page in PAGES:
        if page.name.startswith('export'):
            continue  # names files of an export
        text = re.sub(r'^```.*?^```$', '', page.read_text(encoding='utf-8'),
                      flags=re.MULTILINE | re.DOTALL)
        for span in re.findall(r'`([^`\n]+)`', text):
            wrong += [f'{page.name}: {path}' for path in named.findall(span)
                      if not (ROOT / path).exists()]
    assert wrong == []


def test_the_numbers_of_formats_are_those_of_the_program() -> None:
    rows = table('CONTRIBUTING.md', 'format', 'number')
    assert len(rows) == 4
    for _, number, _ in rows:
        (path,) = words(number)
        assert number.split()[0] == str(constants(path)['FORMAT'])
