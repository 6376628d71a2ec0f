"""Workers: the processes that run stages, here or on a cluster."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import partial
from multiprocessing import connection
from multiprocessing.context import BaseContext
from types import TracebackType
from typing import Any, TypeVar

from pipeline.findings import InputError

T = TypeVar("T")

#: Linear algebra on one thread a worker: cores go to missions, and sums do not depend on their number.
ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1"
)


#: Memory let go of stays with the process, which needs as much again for the next part or picture: what was given back
#: has to be filled with zeros page by page. For the C library of GNU; others do not look at it.
KEPT_MEMORY = {"MALLOC_MMAP_THRESHOLD_": str(2**32), "MALLOC_TRIM_THRESHOLD_": str(2**32), "MALLOC_ARENA_MAX": "1"}

#: The process that cleans up after a run that was interrupted or killed need not say that it did.
NO_CLOSING_WORDS = {"PYTHONWARNINGS": "ignore::UserWarning:multiprocessing.resource_tracker"}


class Workers:
    """An executor that is started when first needed and replaced when one of its processes is killed.

    Parameters
    ----------
    make
        Starts the executor.
    width
        How many tasks it should be given at a time.
    threads
        How many threads each task may use.
    """

    def __init__(self, make: Callable[[], Executor], width: int, threads: int = 1) -> None:
        self._make = make
        self._executor: Executor | None = None
        self.width = width
        self.threads = threads

    def submit(self, task: Callable[..., T], *arguments: Any) -> Future[T]:
        """Hand over `task`, to a fresh executor if the present one is broken."""
        if self._executor is not None:
            with suppress(BrokenExecutor):
                return self._executor.submit(task, *arguments)
            self._executor.shutdown(wait=False)
        self._executor = self._make()
        return self._executor.submit(task, *arguments)

    def start(self, task: Callable[..., T], *arguments: Any) -> Callable[[], T]:
        """Hand over `task`, and return what waits for its result; it is done here if its process is killed."""
        future = self.submit(task, *arguments)

        def result() -> T:
            with suppress(BrokenExecutor):
                return future.result()
            return task(*arguments)

        return result

    def __enter__(self) -> Workers:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._executor is not None:
            self._executor.shutdown(wait=error is None)


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def local(count: int) -> Workers:
    """Return workers on this machine, `count` processes that end when this one does and share its cores."""

    def make() -> Executor:
        return ProcessPoolExecutor(count, mp_context=_context(), initializer=_settle)

    return Workers(make, count, max(1, cores() // count))


@contextmanager
def beside(threads: int) -> Iterator[Callable[..., Callable[[], Any]]]:
    """Give a function that starts a task, with its arguments, and returns what waits for its result.

    A process beside this one does one task after another. What it has not begun when its result is waited for is done
    here, so that neither of them is idle: wait for what was started last first. All is done here with fewer than two
    threads to use, or if that process is killed.
    """
    if threads < 2:
        yield partial
        return
    with ProcessPoolExecutor(1, mp_context=_context(), initializer=_settle) as executor, ThreadPoolExecutor(1) as queue:

        def start(task: Callable[..., T], *arguments: Any) -> Callable[[], T]:
            future = queue.submit(lambda: executor.submit(task, *arguments).result())

            def result() -> T:
                if not future.cancel():
                    with suppress(BrokenExecutor):
                        return future.result()
                return task(*arguments)

            return result

        try:
            yield start
        finally:
            queue.shutdown(cancel_futures=True)


def _context() -> BaseContext:
    """Return how processes are started; the first start settles what all later ones find in their environment."""
    os.environ.update({**ONE_THREAD, **KEPT_MEMORY, **NO_CLOSING_WORDS})
    methods = multiprocessing.get_all_start_methods()
    return multiprocessing.get_context("forkserver" if "forkserver" in methods else "spawn")


def cluster(address: str) -> Workers:
    """Return the workers of the dask scheduler at `address`; they must see the same folders as this process.

    Raises
    ------
    InputError
        If dask.distributed is not installed or no scheduler answers.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise InputError(
            "--scheduler",
            found="no dask.distributed",
            expected="the extra 'cluster'",
            remedy="pip install 'seatrial[cluster]'",
        ) from error
    try:
        client = Client(address, timeout=10)
    except (OSError, ValueError) as error:
        raise InputError(
            "--scheduler", found=f"no answer from '{address}'", expected="a dask scheduler, as in tcp://host:8786"
        ) from error
    return Workers(lambda: client.get_executor(pure=False), max(1, sum(client.nthreads().values())))


def _settle() -> None:
    """Leave interrupts to the parent, and end with it however it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent.sentinel,), daemon=True).start()


def _end_with(sentinel: int) -> None:
    connection.wait([sentinel])
    os._exit(1)
