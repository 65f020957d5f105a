# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Work for the machines of a Dask cluster."""

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager

PATIENCE = '15s'


@contextmanager
def cluster(scheduler: str) -> Iterator[Executor]:
    """
    Connect to a cluster.

    :param scheduler: address of its scheduler, such as tcp://host:8786.
    :return: what runs functions on its workers.
    :raises ImportError: where Dask is not installed.
    :raises OSError: where the scheduler does not answer.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise ImportError('--scheduler needs Dask: pip install "dask[distributed]"') from error
    with Client(scheduler, timeout=PATIENCE) as client:  # type: ignore[no-untyped-call]
        yield client.get_executor(pure=False)
