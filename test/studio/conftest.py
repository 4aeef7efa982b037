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
One Chromium and one server for the tests of a module; each test has a page of its own.

They end with it: the keepalive thread of a connection draws random numbers, which hypothesis
takes for those of a test that runs later in the same worker.
"""

from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from shutil import rmtree

import pytest
from studio import browser
from studio.serving import studio


@pytest.fixture(scope='module')
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[browser.Chromium]:
    """Return a running Chromium."""
    if browser.CHROMIUM is None or find_spec('websockets') is None:
        pytest.skip('needs Chromium and websockets')
    with browser.chromium(tmp_path_factory.mktemp('chromium')) as found:
        yield found


@pytest.fixture
def page(chromium: browser.Chromium) -> Iterator[browser.Page]:
    """Return a page in a window with a storage of its own."""
    with chromium.page() as found:
        yield found


@pytest.fixture(scope='module')
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, str]]:
    """Return a folder, and the address under which it is served."""
    folder = tmp_path_factory.mktemp('served')
    with studio(folder) as url:
        yield folder, url


@pytest.fixture
def folder(served: tuple[Path, str]) -> Iterator[Path]:
    """Return the folder that is served, which is empty."""
    yield served[0]
    for path in served[0].iterdir():
        rmtree(path) if path.is_dir() else path.unlink()


@pytest.fixture
def url(served: tuple[Path, str]) -> str:
    """Return the address of the page of the folder."""
    return served[1]
