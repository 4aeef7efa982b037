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

"""The command line as a whole: output, exit status and signals."""

from collections.abc import Callable
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
from time import monotonic, sleep

from cli.command import command, environment, HEADING, Here, PUMP, run, START
import fret_monitor
from fret_monitor import __version__
import pytest
from strategies import some

BAD = PUMP.replace('n < 5', 'N < 5').replace('x > 0.1', 'x > true')
VERBS = ('check', 'simulate', 'compile', 'bench')


def arguments(verb: str, bundle: Path) -> tuple[object, ...]:
    """Return arguments with which a verb succeeds on a bundle."""
    more = {'simulate': ('--trace', bundle.parent / 'trace.csv'),
            'compile': ('--output', bundle.parent / 'out')}
    return (verb, bundle, *more.get(verb, ()))


@pytest.mark.parametrize('verb', VERBS)
def test_success_is_status_0_with_output_on_standard_output_only(here: Here, verb: str) -> None:
    here.file('trace.csv', HEADING)
    done = here.run(*arguments(verb, here.file('pump.yaml', PUMP)))
    assert (done.status, done.err) == (0, '')
    assert done.out


@pytest.mark.parametrize('verb', VERBS)
def test_a_bad_bundle_is_status_1_with_only_errors_on_stderr(here: Here, verb: str) -> None:
    here.file('trace.csv', HEADING)
    done = here.run(*arguments(verb, here.file('pump.yaml', BAD)))
    assert (done.status, done.out) == (1, '')
    assert done.err.count(': error: ') == 2
    assert f"{here.folder / 'pump.yaml'}:9:" in done.err
    assert sorted(os.listdir(here.folder)) == ['pump.yaml', 'trace.csv']


@pytest.mark.parametrize('verb', VERBS)
@pytest.mark.parametrize('name', ['gone.yaml', '.', '/dev/null', 'x' * 300, 'pump.yaml/x'])
def test_a_missing_bundle_is_status_1(here: Here, monkeypatch: pytest.MonkeyPatch, verb: str,
                                      name: str) -> None:
    here.file('pump.yaml', PUMP)
    here.file('trace.csv', HEADING)
    monkeypatch.chdir(here.folder)
    done = here.run(*arguments(verb, Path(name)))
    assert (done.status, done.out) == (1, '')
    assert 'error: ' in done.err.splitlines()[0]
    assert name[:60] in done.err.splitlines()[0]


@pytest.mark.parametrize('words', [
    (), ('chekc',), ('check',), ('simulate', 'b.yaml'), ('simulate', 'b.yaml', '--trace'),
    ('compile', 'b.yaml'), ('bench',), ('bench', 'a', 'b'), ('compile', '--json', 'b.yaml'),
    ('simulate', 'b.yaml', '--trace', 't.csv', 'more'), ('--no-such-option',)])
def test_wrong_usage_is_status_2(here: Here, words: tuple[str, ...]) -> None:
    done = here.run(*words)
    assert (done.status, done.out) == (2, '')
    assert done.err.startswith('usage: fret-monitor')


def test_a_misspelt_verb_is_answered_with_the_one_meant(here: Here) -> None:
    assert here.run('chek', 'pump.yaml').err.endswith(
        "error: there is no verb 'chek', did you mean 'check' or 'schema'?\n")


def test_without_a_verb_the_verbs_are_listed(here: Here) -> None:
    done = here.run()
    told = [line.split()[0] for line in done.err.splitlines() if line.startswith('    ')]
    assert told[:3] == ['check', 'formalize', 'print']  # a long name is on a line of its own
    assert set(VERBS) | {'import', 'explain'} <= set(told)
    assert done.err.endswith('error: a verb is missing\n')


def test_each_module_of_the_folder_is_a_verb(here: Here) -> None:
    folder = Path(fret_monitor.__file__).parent / 'cli'
    verbs = {path.stem.removesuffix('_') for path in folder.glob('[!_]*.py')} - {
        'main', 'columns', 'constants', 'document', 'limits', 'terminal', 'traceability'}
    assert set(VERBS) <= verbs
    for verb in verbs:
        done = here.run(verb, '--help')
        assert (done.status, done.err) == (0, '')
        assert done.out.startswith(f'usage: fret-monitor {verb} ')


@pytest.mark.parametrize('verb', ['analyze', 'compile', 'export', 'import', 'tests'])
def test_each_verb_with_an_output_takes_its_short_option(here: Here, verb: str) -> None:
    assert re.search(r'-o \w+, --output ', here.run(verb, '--help').out)


def test_a_verb_loads_no_other_verb() -> None:
    script = """if True:
        import sys
        from fret_monitor.cli.main import main
        main(['formalize', 'the sw shall always satisfy p'])
        print(*(name for name in sys.modules if 'fret_monitor.cli.' in name), file=sys.stderr)"""
    done = subprocess.run([sys.executable, '-c', script], env=environment(), capture_output=True,
                          text=True, check=True)
    assert sorted(done.stderr.split()) == [
        f'fret_monitor.cli.{name}' for name in ('formalize', 'main', 'terminal')]


def test_the_version_is_that_of_the_package(here: Here) -> None:
    done = here.run('--version')
    assert (done.status, done.out, done.err) == (0, f'fret-monitor {__version__}\n', '')
    for name, pattern in {'setup.py': "version='(.*)',", 'package.xml': '<version>(.*)</'}.items():
        path = Path(fret_monitor.__file__).resolve().parents[1] / name
        if path.is_file():
            assert re.findall(pattern, path.read_text(encoding='utf-8')) == [__version__]


def test_running_the_package_runs_the_command_line() -> None:
    asked = [sys.executable, '-m', 'fret_monitor', 'formalize', 'the sw shall always satisfy p']
    done = subprocess.run(asked, env=environment(), capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, 'H p\n', '')
    done = subprocess.run(asked[:-1], env=environment(), capture_output=True, text=True,
                          check=False)
    assert done.returncode == 2
    assert done.stderr.startswith('usage: fret-monitor formalize')


def test_formalize_says_that_a_duration_counts_steps(here: Here) -> None:
    done = here.run('formalize', 'the sw shall within 2 seconds satisfy p')
    assert (done.status, done.out) == (0, here.run(
        'formalize', 'the sw shall within 2 ticks satisfy p').out)
    assert done.err.splitlines() == [
        "<sentence>:1:21: warning: '2 seconds' counts 2 steps",
        ' 1 | the sw shall within 2 seconds satisfy p',
        '   |                     ^^^^^^^^^ a sentence alone has no period',
        '    = help: write 2 ticks; or, for time, give --policy timed']


def test_formalize_reads_durations_as_times_on_request(here: Here) -> None:
    sentence = 'when persisted(3, q) the sw shall within 2.5 seconds satisfy p'
    refused = here.run('formalize', '--policy', 'timed', sentence)
    assert refused.status == 1
    assert 'evaluation: {policy: timed, unit: 1}' in refused.err
    done = here.run('formalize', '--policy', 'timed', '--unit', '0.5', sentence)
    assert (done.status, done.err) == (0, '')
    assert 'H[0, 1.5 s] q' in done.out
    assert 'O[<2.5 s] ' in done.out
    other = here.run('formalize', '--policy', 'timed', '--unit', '0.5', '--language', 'cocospec',
                     sentence)
    assert 'HT(1.5 s, 0, q)' in other.out
    for wrong in (['--unit', '1'], ['--policy', 'timed', '--unit', '0']):
        assert here.run('formalize', sentence, *wrong).status == 2
    assert here.run('formalize', 'the sw shall within 2 ticks satisfy p').err == ''


@pytest.mark.parametrize('words', [('--help',), *((verb, '--help') for verb in VERBS)])
def test_each_verb_has_help(here: Here, words: tuple[str, ...]) -> None:
    done = here.run(*words)
    assert (done.status, done.err) == (0, '')
    assert done.out.startswith('usage: fret-monitor')


@pytest.mark.parametrize('verb', ['simulate', 'compile', 'bench'])
@pytest.mark.parametrize(('settings', 'expected'), [
    ({'CC': '', 'PATH': '/nowhere'}, 'error: no C compiler found: install gcc'),
    ({'CC': 'no-such-cc'}, "error: CC is set to 'no-such-cc', which cannot be run"),
    ({'CC': 'false'}, 'error: the C compiler failed (exit status 1):'),
])
def test_a_compiler_that_is_missing_or_fails_is_status_1(
        here: Here, monkeypatch: pytest.MonkeyPatch, verb: str, settings: dict[str, str],
        expected: str) -> None:
    monkeypatch.setenv('ROS_HOME', str(here.folder / 'home'))
    for name, value in settings.items():
        monkeypatch.setenv(name, value)
    here.file('trace.csv', HEADING)
    done = here.run(*arguments(verb, here.file('pump.yaml', PUMP)))
    assert (done.status, done.out) == (1, '')
    assert done.err.startswith(expected)
    assert not (here.folder / 'out').exists()


def wait_until(is_true: Callable[[], bool], what: str) -> None:
    end = monotonic() + 30
    while not is_true():
        assert monotonic() < end, f'waited in vain: {what}'
        sleep(0.01)


def is_alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.parametrize('verb', some(['simulate', 'compile', 'bench'], 2))
@pytest.mark.parametrize(('number', 'status'), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_the_compiler_too_and_leaves_no_files(
        here: Here, verb: str, number: signal.Signals, status: int) -> None:
    home, told = here.folder / 'home', here.folder / 'compiler'
    slow = here.file('slow-cc', f"""#!/bin/sh
[ "$1" = --version ] && exit
echo $$ > '{told}.new'
mv '{told}.new' '{told}'
exec sleep 100
""")
    slow.chmod(0o755)
    here.file('trace.csv', HEADING)
    process = subprocess.Popen(
        command(*arguments(verb, here.file('pump.yaml', PUMP))),
        env=environment(ROS_HOME=str(home), CC=str(slow), TMPDIR=str(here.folder)),
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        # If these tests run in the background, SIGINT may be ignored, and children inherit that.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
    wait_until(told.exists, 'the compiler')
    before = list(here.folder.glob('**/fret_monitor.h'))  # the compiler reads these
    process.send_signal(number)
    said, err = process.communicate(timeout=30)
    assert (process.returncode, said, err) == (status, '', '')
    compiler = int(told.read_text())
    wait_until(lambda: not is_alive(compiler), 'the end of the compiler')
    assert before
    left = {path.name for path in here.folder.iterdir()}
    assert left <= {'compiler', 'home', 'pump.yaml', 'slow-cc', 'trace.csv'}
    assert list((home / 'fret_monitor').glob('*')) == []


@pytest.mark.parametrize('module', ['fret_monitor.model', 'fret_monitor.native', 'yaml'])
def test_an_interrupt_during_the_imports_ends_quietly(here: Here, module: str) -> None:
    script = f"""\
import os, signal, sys
class Interrupter:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            os.kill(os.getpid(), signal.SIGINT)
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.meta_path.insert(0, Interrupter())
{START}"""
    done = subprocess.run(
        [sys.executable, '-c', script, 'check', here.file('pump.yaml', PUMP)], env=environment(),
        capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, '', '')


def test_a_signal_handler_of_the_caller_is_restored(here: Here) -> None:
    former = signal.signal(signal.SIGTERM, signal.SIG_IGN)
    try:
        assert here.run('check', here.file('pump.yaml', PUMP)).status == 0
        assert signal.getsignal(signal.SIGTERM) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGTERM, former)
    assert here.run('check', here.file('pump.yaml', PUMP)).status == 0
    assert signal.getsignal(signal.SIGTERM) is former


def test_check_needs_no_compiler(here: Here, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('PATH', '/nowhere')
    monkeypatch.setenv('CC', 'no-such-cc')
    assert here.run('check', here.file('pump.yaml', PUMP)).status == 0


def test_it_runs_from_any_folder(here: Here) -> None:
    here.file('trace.csv', HEADING + '0,0,0,0,moving\n')
    here.file('pump.yaml', PUMP)
    done = run('simulate', 'pump.yaml', '--trace', 'trace.csv', '--verdicts', 'out.csv',
               cwd=here.folder)
    assert (done.status, done.err) == (0, '')
    assert (here.folder / 'out.csv').read_text().startswith('step,R-1,')
    assert run('check', 'gone.yaml', cwd=here.folder).status == 1


def test_names_that_a_terminal_cannot_display_are_no_error(here: Here) -> None:
    bundle = here.folder / os.fsdecode(b'p\xffmp.yaml')
    bundle.write_text(PUMP.replace('R-1', 'Größe'), encoding='utf-8')
    for encoding in ('ascii', 'utf-8'):
        done = subprocess.run(
            command('check', bundle), env=environment(PYTHONIOENCODING=encoding),
            capture_output=True, check=False)
        assert (done.returncode, done.stderr) == (0, b'')
        assert b'p\\udcffmp.yaml: 3 requirements' in done.stdout


def test_a_closed_pipe_is_no_error(here: Here) -> None:
    bundle = here.file('pump.yaml', PUMP)
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(command('check', bundle), env=environment(), stdout=writer,
                          stderr=subprocess.PIPE, text=True, check=False)
    os.close(writer)
    assert (done.returncode, done.stderr) == (1, '')


def test_a_closed_standard_output_is_no_error(here: Here) -> None:
    bundle = here.file('pump.yaml', PUMP)
    done = subprocess.run(
        ['sh', '-c', 'exec "$@" >&-', 'sh', *command('check', bundle)], env=environment(),
        stderr=subprocess.PIPE, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, '')


def test_the_executable_runs_this_command_line() -> None:
    executable = Path(sys.executable).with_name('fret-monitor')
    if not executable.exists():
        pytest.skip('not installed')
    done = subprocess.run([executable, '--help'], capture_output=True, text=True, check=False)
    assert done.stdout.startswith('usage: fret-monitor')
