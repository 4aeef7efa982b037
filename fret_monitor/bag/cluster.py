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

"""Where recordings are read: in processes on this machine, or on a cluster of Dask."""

from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager, ExitStack
from importlib import import_module
import logging
from typing import Any

from fret_monitor.bag.workers import workers
from fret_monitor.model.diagnostics import refuse

_TIMEOUT_S = 10


@contextmanager
def executor(jobs: int, address: str | None) -> Iterator[Executor | None]:
    """
    Yield what runs functions on a cluster or in `jobs` processes; None: the caller does.

    `address` is as of `cluster_client`; None: no cluster.
    """
    if address is not None:
        with cluster_client(address, jobs) as client:
            yield client.get_executor(pure=False)
    elif jobs > 1:
        with ProcessPoolExecutor(jobs, mp_context=workers()) as pool:
            yield pool
    else:
        yield None


@contextmanager
def cluster_client(address: str, jobs: int) -> Iterator[Any]:
    """
    Yield a client of a cluster of Dask.

    `address` is that of its scheduler, or `local`: one is started here, with `jobs` workers.

    Raises
    ------
    CompileError
        if there is no scheduler, or it has no worker.
    """
    dask: Any = import_module('distributed')
    logging.getLogger('distributed').setLevel(logging.ERROR)  # it logs how a cluster starts
    with ExitStack() as stack:
        if address == 'local':
            # Without an address its server would take port 8787, on all networks.
            cluster = stack.enter_context(dask.LocalCluster(
                n_workers=jobs, threads_per_worker=1, dashboard_address='127.0.0.1:0',
                scheduler_kwargs={'dashboard': False}))
            yield stack.enter_context(dask.Client(cluster))
            return
        try:
            client = stack.enter_context(dask.Client(address, timeout=_TIMEOUT_S))
        except (OSError, ValueError) as error:
            refuse(f"no scheduler of Dask at '{address}': {error}",
                   help='start one: dask scheduler; dask worker ADDRESS; or --dask local')
        _expect_worker(client, address)
        yield client


def _expect_worker(client: Any, address: str) -> None:
    try:
        client.wait_for_workers(1, timeout=_TIMEOUT_S)
    except TimeoutError:
        refuse(f"the scheduler of Dask at '{address}' has no worker",
               help=f'start one, or several: dask worker {address}')
