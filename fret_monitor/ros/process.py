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

"""Run a node as a process: from the command line to the exit status."""

from collections.abc import Callable, Iterator
import gc
import inspect
from itertools import pairwise
import logging
from pathlib import Path
import re
import shlex
import sys
from threading import Event
import traceback
from types import ModuleType
from typing import cast

from fret_monitor.model.output import drop_output
from fret_monitor.native import words
from fret_monitor.ros.settings.arguments import refuse_several_types, SeveralTypes
from fret_monitor.ros.settings.parameters import (
    GATE_PARAMETERS, LOGGER_PARAMETERS, MONITOR_PARAMETERS, Refusal,
)
from fret_monitor.ros.signals import StopRequest

import rclpy
from rclpy.exceptions import InvalidParameterTypeException
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

_WIDTH = 80
_FAILED = 2

_USAGE = """\
usage: {command} --ros-args -p spec:=BUNDLE.yaml
       {command} --ros-args -p library:=FOLDER   (what `compile` wrote)
"""
_PARAMETERS = {'monitor': MONITOR_PARAMETERS, 'gate': GATE_PARAMETERS,
               'logger': LOGGER_PARAMETERS}


def run(name: str, make_node: Callable[[], Node], stop: StopRequest,
        not_native: str = '') -> int:
    """
    Create a node and spin it until a signal is received; return the exit status.

    `not_native`: why it is not the node in C, which the log says; an empty text: none is wanted.
    It is 0 after SIGINT or SIGTERM, 1 if the node cannot start, and 2 if it fails later; the
    reason is printed on standard error.
    """
    try:
        logging.basicConfig(format='warning: %(message)s')  # this package logs only warnings
        own = remove_ros_args(sys.argv)[1:]
        if own:
            return _print_usage(name, own[0])
        refuse_several_types(sys.argv[1:], f'fret_{name}')
        rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
        return _run(make_node, stop, not_native)
    except (_rclpy.RCLError, _rclpy.UnknownROSArgsError, InvalidParameterTypeException,
            Refusal, SeveralTypes) as error:
        if not (problem := _problem(error, name)):
            raise
        print(problem, file=sys.stderr)
        return 1
    finally:
        rclpy.try_shutdown()
        stop.end()


def _problem(error: Exception, name: str) -> str:
    """Return what to print about an error of the user; an empty text for any other."""
    text = str(error)
    reason = text.partition(', at ')[0]
    match error:
        case Refusal():
            return text
        case SeveralTypes():
            return f"error: parameter '{text}' is given values of several types, and ROS does " \
                'not keep which is the last: give it once, or all as one type, such as 2.0'
        case InvalidParameterTypeException():
            return f'error: {_wrong_type(text)}'
        case _rclpy.UnknownROSArgsError():
            return f'error: unknown ROS arguments {text}{_no_flag(text)}'
        case _rclpy.RCLInvalidROSArgsError():
            return f'error: {reason}{_no_colon()}\n{_usage(name)}'.rstrip('\n')
    if match := re.search(r'existing \w+ topic name r[qr](/\S+?)(Request|Reply) ', text):
        return (f'error: two services of this node have the name {match[1]} after remapping: '
                'give one of them another name')
    return ('error: ROS cannot make its folder of logs: set HOME, or ROS_LOG_DIR to a folder that '
            f'can be written ({reason})' if 'initialize logging' in text else '')


def _usage(name: str) -> str:
    """Return the usage text, with the command by which this process was started."""
    script = Path(sys.argv[0])
    is_by_path = script.name == name and script.parent.parts[-2:] != ('lib', 'fret_monitor')
    return _USAGE.format(command=script if is_by_path else f'ros2 run fret_monitor {name}')


def _described(name: str) -> Iterator[str]:
    """Yield the lines that describe the parameters of a node."""
    from textwrap import fill  # only for --help
    parameters = _PARAMETERS[name]
    width = max(map(len, parameters)) + 4
    for key, item in parameters.items():
        yield fill(item.description, _WIDTH, initial_indent=f'  {key}:='.ljust(width + 2),
                   subsequent_indent=' ' * (width + 2))


def _no_flag(unknown: str) -> str:
    """Return the advice for an assignment that was given without `-p`."""
    found = next((item for item in sys.argv if ':=' in item and repr(item) in unknown), None)
    return f': a parameter has -p before it: -p {shlex.quote(found)}' if found else ''


def _no_colon() -> str:
    """Return the advice for a parameter that was given as NAME=VALUE."""
    found = next((value for flag, value in pairwise(sys.argv)
                  if flag in ('-p', '--param') and '=' in value and ':=' not in value), None)
    return f"; write -p {shlex.quote(found.replace('=', ':=', 1))}" if found else ''


def _wrong_type(reason: str) -> str:
    """Return what is wrong with a parameter that rclpy itself declares, such as use_sim_time."""
    match = re.match(r"Trying to set parameter '(.*?)' to '(.*)' of type '(\w+)'.*'BOOL'", reason,
                     re.DOTALL)
    if match is None:
        return reason
    value = f"'{match[2]}'" if match[3] == 'STRING' else match[2]
    return f"parameter '{match[1]}' is {'a list' if 'ARRAY' in match[3] else value}, and has to " \
           'be true or false'


def _print_usage(name: str, argument: str) -> int:
    usage = _usage(name)
    if argument in ('-h', '--help'):
        try:
            print(usage, 'parameters, each behind a -p of its own:', *_described(name), sep='\n',
                  flush=True)
        except BrokenPipeError:
            drop_output()  # the reader, such as `head`, has read enough
        return 0
    print(f"error: unexpected argument '{argument}'\n{usage}", end='', file=sys.stderr)
    return 1


def index_modules() -> None:
    """
    Enter the loaded modules into the index of `inspect`, in which rclpy looks up who logs.

    At the first log line inspect would make that index itself, from paths without links, which
    takes a tenth of a node's start.
    """
    for module in list(sys.modules.values()):
        if file := getattr(module, '__file__', None):
            inspect.modulesbyfile.setdefault(file, module.__name__)


def skip_generator() -> None:
    """
    Keep the generator of message classes, and its parser, from being loaded with the first class.

    `rosidl_generator_py` does without it if it cannot be imported. That takes a tenth of the start
    of a node of rclpy.
    """
    sys.modules.setdefault('rosidl_generator_py.generate_py_impl', cast(ModuleType, None))


def _spin(executor: SingleThreadedExecutor, node: Node, is_over: Event) -> None:
    """
    Spin until the event is set; a response that the middleware does not send is logged.

    Not `spin_until_future_complete`, which gives the future another callback at each message.
    """
    while not is_over.is_set():
        try:
            executor.spin_once()
        except _rclpy.RCLError as error:
            if 'send response' not in str(error):
                raise
            node.get_logger().warning(words.RESPONSE_NOT_SENT % ('a service', error))


def _run(make_node: Callable[[], Node], stop: StopRequest, not_native: str) -> int:
    skip_generator()
    index_modules()
    with stop.interruptible():
        node = make_node()
        if not_native:
            node.get_logger().warning(
                f'native is not possible, the node runs in Python: {not_native}')
    gc.freeze()  # what is made by now lives as long as the process: no collection visits it
    gc.enable()
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        is_over = Event()
        wake = node.create_guard_condition(is_over.set)
        with stop.waking(wake.trigger):
            _spin(executor, node, is_over)
    except Exception:  # noqa: B902  whatever it is, launch must not take it for a refusal
        traceback.print_exc()
        return _FAILED
    finally:
        executor.shutdown()
        node.destroy_node()
    return 0
