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

"""The monitor node: parameters and life cycle; a `BundleSession` runs each bundle."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from os import strerror
import traceback
from typing import Any, TYPE_CHECKING

from fret_monitor.model.names import distinct_names
from fret_monitor.native import load_evaluator, words
from fret_monitor.ros.intake.node_time import ClockNode
from fret_monitor.ros.log_lines import log_lines
from fret_monitor.ros.nodes.bundle_session import BundleSession
from fret_monitor.ros.nodes.duplicate_nodes import DuplicateNodes
from fret_monitor.ros.nodes.sign_of_life import SignOfLife
from fret_monitor.ros.reports.health import PERIOD
from fret_monitor.ros.settings.declared import Parameters
from fret_monitor.ros.settings.names import full_name, refuse_shared_names, valid_names
from fret_monitor.ros.settings.opened import open_monitors, Opened
from fret_monitor.ros.settings.overrides import DeclaredOverrides, overrides_of
from fret_monitor.ros.settings.parameters import (
    Described, MetricsAddress, MONITOR_PARAMETERS, read_settings, Refusal, Settings,
)
from fret_monitor.ros.signals import uninterrupted
from fret_monitor.ros.watch import ErrorKeeper, steady_timer, Watch
from fret_monitor.runtime.start_lines import restarted, watching

from rcl_interfaces.msg import SetParametersResult
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.timer import Timer
from std_srvs.srv import Trigger

if TYPE_CHECKING:
    from fret_monitor.ros.reports.metrics import MetricsServer


class MonitorNode(ClockNode, LifecycleNode):
    """
    A managed node that monitors one bundle or several while it is active.

    `configure` reads the parameters and opens the bundles, `activate` subscribes, `deactivate`
    unsubscribes, `cleanup` and `shutdown` release everything. Unless `autostart` is false, the
    constructor configures and activates the node.

    Any executor can spin it. The executor serves transitions, `~/reset`, parameters and timers;
    messages do not need one.
    """

    PARAMETERS: Mapping[str, Described] = MONITOR_PARAMETERS

    def __init__(self, node_name: str = 'fret_monitor', **options: Any) -> None:
        """
        Create the node; `options` are those of `rclpy.lifecycle.LifecycleNode`.

        Raises `Refusal` if the parameters, bundles or libraries are not usable. Nothing is left.
        """
        self._sessions: list[BundleSession] = []
        self._declared_overrides: DeclaredOverrides | None = None
        self._sign_of_life: SignOfLife | None = None
        self._reports: Timer | None = None
        self._metrics: MetricsServer | None = None
        self._is_active = False
        self._is_starting = False
        self._failure: Exception | None = None
        super().__init__(node_name, **options)
        self._watch = Watch(self)
        with ExitStack() as undo:
            undo.callback(self.destroy_node)
            self._begin()
            undo.pop_all()

    def _begin(self) -> None:
        self._declared = Parameters(self, self.PARAMETERS, lambda: bool(self._sessions))
        self._duplicate_nodes = DuplicateNodes(self, self._watch)
        self.create_service(Trigger, '~/reset', self._reset)
        for service in self.services:
            if service.service_name.endswith('/change_state'):
                service.callback = _refusing(service.callback)
        if self.get_parameter('autostart').value:
            self._start(self.trigger_configure)
            self._start(self.trigger_activate)
        else:
            self.get_logger().info(words.WAITING)

    def _start(self, trigger: Callable[[], TransitionCallbackReturn]) -> None:
        """Trigger a transition, and raise its error if it fails."""
        self._is_starting = True
        trigger()
        self._is_starting = False
        if self._failure is not None:
            raise self._failure

    def set_parameters_atomically(
            self, parameter_list: list[Parameter]) -> SetParametersResult:
        """Set parameters, or say why not in the words of the node in C."""
        checked = self._declared.check(parameter_list)
        return super().set_parameters_atomically(parameter_list) if checked.successful else checked

    # rclpy calls these methods at transitions.

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Open the bundles that the parameters name."""
        return self._take(self._configure) or super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start monitoring."""
        return self._take(self._activate) or super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop monitoring; nothing is stepped or published afterwards."""
        return self._take(self._deactivate) or super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Release the bundles; the next `configure` reads them again."""
        return self._take(self._release) or super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Release the bundles."""
        return self._take(self._release) or super().on_shutdown(state)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Release the bundles after an error, so that the node can be configured again."""
        self._release()
        return super().on_error(state)

    def _take(self, step: Callable[[], None]) -> TransitionCallbackReturn | None:
        """
        Run the work of a transition; return None if it succeeds.

        rclpy drops its error, so it is kept here: `_start` raises it; otherwise it is logged.
        """
        attempt = ErrorKeeper()
        with attempt:
            step()
        self._failure = attempt.error
        if attempt.error is None:
            return None
        reasons, answer = (
            (attempt.error.problems, TransitionCallbackReturn.FAILURE)
            if isinstance(attempt.error, Refusal) else
            ([''.join(traceback.format_exception(attempt.error))], TransitionCallbackReturn.ERROR))
        for line in () if self._is_starting else (*reasons, words.INACTIVE):
            self.get_logger().error(line.rstrip())
        return answer

    def _configure(self) -> None:
        with self._declared.warning_of_ignored():
            settings = read_settings(self._declared.values())
            opened = self._open(settings)
            manifests = [item.monitor.manifest for item in opened]
            library = load_evaluator(opened[0].evaluator)
            with valid_names():
                self._overrides = overrides_of(self, library, manifests)
                refuse_shared_names(self, manifests, self._names(opened), library)
            self._declared.show_constants(manifests)
        with ExitStack() as undo:
            undo.callback(self._release)
            if settings.metrics is not None:
                self._metrics = self._serve_metrics(settings.metrics)
            for item, name in zip(opened, self._names(opened)):
                self._sessions.append(BundleSession(
                    self, item, self._watch, settings, self._overrides, name,
                    reports_failures=not self._sessions))
            undo.pop_all()
        self._warn(_ask_system(settings, library))
        self._warn([warning for item in opened for warning in item.warnings])
        log_lines(self.get_logger(), self._overrides.unused(self._subscribed()))

    def _serve_metrics(self, address: MetricsAddress) -> 'MetricsServer':
        from fret_monitor.ros.reports.metrics import MetricsServer
        server = MetricsServer(address)
        self.get_logger().info(f'figures of /diagnostics for Prometheus: {server.url}')
        return server

    def _open(self, settings: Settings) -> list[Opened]:
        """Compile and load what the node runs; raises `Refusal`."""
        return open_monitors(settings)

    def _names(self, opened: Sequence[Opened]) -> list[str]:
        """Return distinct names for the bundles; an empty name if there is only one bundle."""
        return distinct_names([item.monitor.manifest.name for item in opened])

    def _warn(self, warnings: Iterable[str]) -> None:
        for warning in warnings:
            self.get_logger().warning(warning)

    def _activate(self) -> None:
        with uninterrupted(), ExitStack() as undo:
            undo.callback(self._deactivate)
            self._watch.forget()
            for session in self._sessions:
                session.start()
            self._is_active = True
            self._sign_of_life = SignOfLife(
                self, self._sessions[0].reporter.engine.library,
                [session.turns for session in self._sessions], self._watch)
            self._reports = steady_timer(self, PERIOD, self._report)
            undo.pop_all()
        log_lines(self.get_logger(), watching([session.watched for session in self._sessions]))
        self._declared_overrides = self._declared_overrides or DeclaredOverrides(
            self, self._watch, self._overrides, self._subscribed())

    def _subscribed(self) -> dict[str, dict[str, str | int]]:
        """Return the full names of subscribed topics, each with what its bundle fixes."""
        return {full_name(self, session.manifest, topic): dict(topic.qos)
                for session in self._sessions for topic in session.manifest.subscribed
                if session.manifest.key_of(topic) is None}

    def _report(self) -> None:
        """Report of all bundles, and show that the node lives: in one timer, since each costs."""
        for session in self._sessions:
            session.report()
        if (metrics := self._metrics) is not None:
            self._watch.run('metrics', lambda: metrics.show(
                item for session in self._sessions for item in session.statuses()))
        if (life := self._sign_of_life) is not None:
            self._watch.run('sign of life', life.beat, lambda: self._sign_of_life is not life)

    def _deactivate(self) -> None:
        self._end_reports()
        for session in self._sessions:
            session.stop()

    def _end_reports(self) -> None:
        self._is_active = False
        if self._reports is not None:
            self.destroy_timer(self._reports)
            self._reports = None
        if self._metrics is not None:
            self._metrics.show(())
        life, self._sign_of_life = self._sign_of_life, None
        if life is not None:
            life.close()

    def _release(self) -> None:
        self._end_reports()
        if self._declared_overrides is not None:
            self._declared_overrides.close()
            self._declared_overrides = None
        metrics, self._metrics = self._metrics, None
        if metrics is not None:
            metrics.close()
        while self._sessions:
            self._sessions[-1].close()  # before pop: if interrupted, it can be repeated
            self._sessions.pop()

    def destroy_node(self) -> None:
        self._release()
        super().destroy_node()
        # rclpy does not destroy it, and it would keep the node in the graph.
        self._state_machine.destroy_when_not_in_use()

    def _reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self._is_active
        if not self._is_active:
            response.message = words.NO_RESTART
            return response
        line = restarted(self._sessions[0].library,
                         sum(session.reset() for session in self._sessions))
        response.message = line.text
        log_lines(self.get_logger(), [line])
        return response


def _ask_system(wanted: Settings, library: Any) -> Iterator[str]:
    """Ask the system for what is wanted, and yield a warning for each thing that it refuses."""
    if wanted.priority and (error := library.fm_set_priority(wanted.priority)):
        yield words.NO_PRIORITY % (wanted.priority, strerror(error))
    processors = wanted.processors
    if processors and (error := library.fm_set_processors(processors.encode())):
        yield words.NO_PROCESSORS % (processors, strerror(error))
    if wanted.locks_memory and (error := library.fm_lock_memory()):
        yield words.NO_LOCKED_MEMORY % strerror(error)


def _refusing(change_state: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """
    Return a service callback that refuses transitions that the current state does not allow.

    rclpy's own callback raises an error then, which would end the process. rcl has logged it.
    """
    def answer(request: Any, response: Any) -> Any:
        try:
            return change_state(request, response)
        except _rclpy.RCLError:
            response.success = False
            return response

    return answer
