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

"""What tests with processes stand on."""

from concurrent.futures import Future
from types import SimpleNamespace
from typing import Any

import pytest
from ros import harness


def test_a_request_without_an_answer_is_repeated(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []

    def call(request: str) -> Future[str]:
        asked.append(request)
        answer: Future[str] = Future()
        if len(asked) == 2:
            answer.set_result('an answer')
        return answer

    monkeypatch.setattr(harness, 'ASK_AGAIN_S', 0.1)
    client: Any = SimpleNamespace(
        srv_name='service', service_is_ready=lambda: True, call_async=call)
    assert harness.answer_of(client, 'a request') == 'an answer'
    assert asked == ['a request'] * 2
