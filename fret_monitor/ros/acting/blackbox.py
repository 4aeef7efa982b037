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
The black box: writes the last messages to a file at each violation (docs/recordings.md).

C keeps the messages, and a thread of C writes them (`csrc/engine/blackbox_writer.h`). This module
hands over what C must know of the node.
"""

from typing import Any

from fret_monitor.model.manifest import Manifest, ManifestRequirement
from fret_monitor.native import words
from fret_monitor.native.binding import ffi
from fret_monitor.ros.intake import native_lifetimes
from fret_monitor.ros.intake.symbols import Unavailable
from fret_monitor.ros.settings.names import full_name
from fret_monitor.ros.settings.parameters import BlackBoxSettings, Refusal
from fret_monitor.runtime import Engine
from fret_monitor.runtime.reporting import lines_of, LogLine

from rclpy.node import Node

_AFTER_NS: int = ffi.integer_const('FM_BLACKBOX_AFTER_NS')
_POLL_NS: int = ffi.integer_const('FM_BLACKBOX_POLL_NS')
_END_TOPIC, _END_TYPE = '~/blackbox_end', 'std_msgs/msg/Header'


class BlackBox:
    """Writes a file at each violation, while it runs; from each `start` to the next `end`."""

    def __init__(self, node: Node, manifest: Manifest, settings: BlackBoxSettings,
                 library: Any) -> None:
        """
        Prepare to write messages of the topics in a manifest; `library` is csrc's.

        Raises `Refusal` if the folder cannot be written to, or there is not so much memory.
        """
        self._library = library
        self._kept: list[Any] = []  # memory of C that the options point to
        options = self._options(node, manifest, settings)
        place = ffi.new('struct fm_blackbox_writer **')
        error = library.fm_blackbox_writer_create(place, options)
        if error != 0:
            raise Refusal(*(line.text for line in lines_of(
                library, library.fm_add_blackbox_refusal, options, error)))
        self._pointer: Any = ffi.gc(place[0], library.fm_blackbox_writer_destroy)

    def _options(self, node: Node, manifest: Manifest, settings: BlackBoxSettings) -> Any:
        topics = [*((full_name(node, manifest, item), item.message_type)
                    for item in manifest.topics),
                  (node.resolve_topic_name(_END_TOPIC), _END_TYPE)]
        return self._keep('struct fm_blackbox_options *', {
            'folder': self._text(str(settings.folder)), 'lasts': int(settings.seconds * 1e9),
            'memory': settings.memory_bytes, 'disk': settings.disk_bytes,
            'files': settings.files, 'after': _AFTER_NS, 'poll': _POLL_NS,
            'node': self._text(node.get_fully_qualified_name()),
            'bundle': self._text(manifest.name), 'n_topics': len(manifest.topics),
            'topics': self._keep('struct fm_blackbox_topic[]', [
                (self._text(name), self._text(kind), self._definition(kind))
                for name, kind in topics]),
            'requirements': self._keep('struct fm_blackbox_requirement[]', [
                self._requirement(item) for item in manifest.numbered])})

    def _requirement(self, item: ManifestRequirement) -> tuple[Any, Any]:
        return self._text(item.id), self._text(item.handler.removeprefix('handlerprop'))

    def _definition(self, message_type: str) -> Any:
        # Imported here: a node loads the parsers only when it needs them.
        from fret_monitor.messages.installed import definition_or_none
        text = definition_or_none(message_type)
        return self._keep('char *[]', [*([self._text(text)] if text else []), ffi.NULL])

    def _text(self, text: str) -> Any:
        return self._keep('char[]', text.encode(errors='surrogateescape'))

    def _keep(self, kind: str, value: Any) -> Any:
        self._kept.append(ffi.new(kind, value))
        return self._kept[-1]

    def start(self, engine: Engine) -> None:
        """Keep the messages of an engine, before any is delivered; raises `Unavailable`."""
        self._engine = engine
        native_lifetimes.keep(self)
        if not self._library.fm_blackbox_writer_start(self._pointer, engine.pointer):
            raise Unavailable(words.NO_THREAD)

    def end(self) -> None:
        """Write what is pending, and end the thread; a second call does nothing."""
        self._library.fm_blackbox_writer_end(self._pointer)
        native_lifetimes.release(self)

    def lines(self) -> list[LogLine]:
        """Return the lines about what was written since the last call."""
        return lines_of(self._library, self._library.fm_add_blackbox_lines, self._pointer)

    def counts(self) -> Any:
        """Return what was written so far: a `struct fm_blackbox_facts *`."""
        return ffi.new('struct fm_blackbox_facts *',
                       self._library.fm_blackbox_writer_facts(self._pointer))
