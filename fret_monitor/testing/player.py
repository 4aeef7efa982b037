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
Publishes the rows of a trace as messages, for tests of nodes.

With `/clock` it also decides how much time passes for the monitor (`testgen/played.py`). After
each message it waits until the monitor has answered a request, which the middleware delivers after
that message. With the answer comes the monitor's time, so that no message overtakes its `/clock`.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from threading import Event, Thread
from time import monotonic, sleep
from types import TracebackType
from typing import Any

from builtin_interfaces.msg import Time
from fret_monitor.model.manifest import Manifest, ManifestInput, SECONDS
from fret_monitor.model.playing import repeat_interval, stamp_of
from fret_monitor.model.policies import Policy
from fret_monitor.ros.intake.fields import message_class
from rcl_interfaces.msg import Parameter, ParameterEvent, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import qos_profile_parameter_events, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rosgraph_msgs.msg import Clock

_QOS = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
_END_S = 0.2  # for what is due at the end
_TRIES = 100  # of a message on `/clock`
_MATCH_S = 0.3  # discovery is not symmetric: the other side matches a moment later
_NODE_MATCH_S = 1.0  # the same for a node and the monitor
_START_NS = 10**9  # of the simulated time
_PAST_NS = 1  # what is due at a time of `/clock` is taken when that has moved past it

Make = Callable[[str, Mapping[str, Any]], Any]
"""Returns the message of a topic from the values of its inputs, by name."""


class Player:
    """
    A node that publishes some inputs of a bundle, and simulated time where the policy needs it.

    `played` are the names of the inputs. Inputs that are fields of their messages are set there;
    `make` makes messages of other topics.
    """

    def __init__(self, manifest: Manifest, played: Collection[str],
                 make: Make | None = None, pause: float = 0.0) -> None:
        """Advertise the topics; `pause` is the time in seconds for a node's answers."""
        self._pause = pause
        self._manifest = manifest
        self._make = make
        self._topics: dict[str, list[int]] = {}
        for place, item in enumerate(manifest.inputs):
            if item.topic is not None and item.name in played:
                self._topics.setdefault(item.topic, []).append(place)
        self._context = Context()
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self.node = Node('fret_monitor_player', context=self._context)
        self._publishers = {topic: self.node.create_publisher(
            message_class(self._type_of(topic)), topic, _QOS) for topic in self._topics}
        self._clock = self.node.create_publisher(Clock, '/clock', _QOS) \
            if self.has_clock else None
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._repeated = 0  # ns: on all topics in `repeats` there was a message since then
        self._repeats = [topic for topic, places in self._topics.items() if any(
            manifest.inputs[place].timeout is not None for place in places)]
        self._interval = repeat_interval(item.timeout for item in manifest.inputs)
        self._is_closing = False
        self._thread = Thread(target=self._spin, daemon=True)
        self._thread.start()

    @property
    def has_clock(self) -> bool:
        """Whether the time is simulated: where a trace has times, or an input a timeout."""
        return self._manifest.policy in (Policy.TIMED, Policy.PERIODIC) or any(
            item.timeout is not None for item in self._manifest.inputs)

    def __enter__(self) -> 'Player':
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 traceback: TracebackType | None) -> None:
        self._is_closing = True
        self._thread.join()
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.try_shutdown()

    def _spin(self) -> None:
        while not self._is_closing:
            self._executor.spin_once(timeout_sec=0.1)

    def _type_of(self, topic: str) -> str:
        return next(item.message_type for item in self._manifest.inputs
                    if item.topic == topic and item.message_type is not None)

    def wait(self, monitor: str, listeners: int, seconds: float) -> None:
        """
        Wait until each topic has so many subscriptions, and the others of the bundle a publisher.

        `monitor` is the name of the monitor's node.

        Raises
        ------
        AssertionError
            if that takes more than some seconds.
        """
        others = {item.topic for item in self._manifest.inputs if item.topic is not None} \
            - set(self._topics)
        self._monitor = _MonitorTime(self.node, monitor, seconds)
        end = monotonic() + seconds
        while True:
            listener = 'the monitor' if listeners == 1 else 'the node'
            missing = [f'{listener} does not subscribe to {topic}'
                       for topic, publisher in self._publishers.items()
                       if publisher.get_subscription_count() < listeners]
            if self._clock is not None and not self._clock.get_subscription_count():
                missing.append('the monitor does not subscribe to /clock')
            if not self._monitor.is_reachable():
                missing.append('the monitor has no parameters')
            missing += [f'nobody publishes {topic}' for topic in sorted(others)
                        if not self.node.count_publishers(topic)]
            if not missing:
                sleep(_MATCH_S if not others else _NODE_MATCH_S)
                return
            if monotonic() > end:
                raise AssertionError(f'after {seconds:g} s {", ".join(missing)}')
            sleep(0.02)

    def play(self, times: Sequence[int], rows: Sequence[Sequence[Any]], end: int) -> None:
        """
        Publish rows of all inputs of the bundle.

        `times` are in nanoseconds, and used under `timed` alone, as `end` is.
        """
        is_timed = self._manifest.policy is Policy.TIMED
        period = self._manifest.period
        step = 0 if period is None else int(period * 10**9)
        self._set_clock(0)
        before: Sequence[Any] | None = None
        for number, row in enumerate(rows):
            if is_timed:
                self._pass_time(times[number] - times[0], before)
            self._publish(row, before if is_timed else None)
            before = row
            sleep(self._pause)
            if not is_timed and step:
                self._pass_time((number + 1) * step + _PAST_NS, before)
        if is_timed:
            self._pass_time(end - times[0] + _PAST_NS, before)
        sleep(_END_S)

    def _pass_time(self, until: int, row: Sequence[Any] | None) -> None:
        """Let the time go on; publish inputs with a timeout again before they are silent."""
        while self._interval is not None and row is not None \
                and until - self._repeated > self._interval:
            self._repeated += self._interval
            self._set_clock(self._repeated)
            self._publish_topics(self._repeats, row)
            sleep(self._pause)
        self._set_clock(until)
        sleep(self._pause)

    def _set_clock(self, nanoseconds: int) -> None:
        if self._clock is None:
            return
        seconds, rest = divmod(_START_NS + nanoseconds, 10**9)
        message = Clock()
        message.clock.sec, message.clock.nanosec = seconds, rest
        for _ in range(_TRIES):  # its subscription is best effort
            self._clock.publish(message)
            if self._monitor.receive_all() == message.clock:
                return
        raise AssertionError('the monitor does not follow /clock')

    def _publish(self, row: Sequence[Any], before: Sequence[Any] | None) -> None:
        self._publish_topics([
            topic for topic, places in self._topics.items() if before is None or any(
                repr(row[place]) != repr(before[place]) for place in places)], row)

    def _publish_topics(self, topics: Sequence[str], row: Sequence[Any]) -> None:
        for topic in topics:
            self._publishers[topic].publish(self._message(topic, row))
            self._monitor.receive_all()

    def _message(self, topic: str, row: Sequence[Any]) -> Any:
        inputs = [(self._manifest.inputs[place], row[place]) for place in self._topics[topic]]
        if self._make is not None:
            return self._make(topic, {item.name: _named(item, value) for item, value in inputs})
        message = message_class(self._type_of(topic))()
        for item, value in inputs:
            _set(message, item, _named(item, value))
        return message


class _MonitorTime:
    """
    Asks the monitor for its time, by setting a parameter to the value that it has.

    The monitor publishes an event with its time, and then answers.
    """

    def __init__(self, node: Node, monitor: str, seconds: float) -> None:
        """Prepare to ask a node in the same namespace; it has some seconds for each answer."""
        self._name = node.resolve_service_name(monitor)
        self._seconds = seconds
        self._time: Time | None = None
        self._client = node.create_client(SetParameters, f'{monitor}/set_parameters')
        node.create_subscription(
            ParameterEvent, '/parameter_events', self._take, qos_profile_parameter_events)

    def _take(self, event: ParameterEvent) -> None:
        if event.node == self._name:
            self._time = event.stamp

    def is_reachable(self) -> bool:
        """Whether it can be asked."""
        return self._client.service_is_ready()

    def receive_all(self) -> Time | None:
        """
        Wait until the monitor has received what was published before; return its time then.

        None if an event was lost, since its publisher was not known yet.

        Raises
        ------
        AssertionError
            if it does not answer.
        """
        is_done = Event()
        self._client.call_async(SetParameters.Request(parameters=[Parameter(
            name='log_level', value=ParameterValue(
                type=ParameterType.PARAMETER_STRING))])).add_done_callback(
                    lambda _: is_done.set())
        if not is_done.wait(self._seconds):
            raise AssertionError(f'the monitor has not answered for {self._seconds:g} s')
        return self._time


def _named(item: ManifestInput, value: Any) -> Any:
    """Return the value that a field has; of a string input, its string."""
    if item.is_string:
        return item.values[int(value)][1]
    return bool(value) if item.value_type.value == 'bool' else value


def _set(message: Any, item: ManifestInput, value: Any) -> None:
    """Set the field of an input."""
    *way, last = map(str, item.path)
    holder = message
    for step in way:
        holder = getattr(holder, step)
    old = getattr(holder, last)
    if item.reduction == SECONDS:
        stamp = stamp_of(float(value))
        if stamp is None:
            raise ValueError(f"no stamp is {value} seconds, for '{item.name}'")
        old.sec, old.nanosec = stamp
    elif item.reduction == 'norm' and hasattr(old, 'get_fields_and_field_types'):
        first, *others = old.get_fields_and_field_types()
        setattr(old, first, value)
        for name in others:
            setattr(old, name, 0.0)
    elif item.reduction:
        rest = 0.0 if item.reduction == 'norm' else value
        setattr(holder, last, [value, *[rest] * (len(old) - 1)])
    else:
        setattr(holder, last, value)
