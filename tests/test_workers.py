"""Workers: processes that leave interrupts to their parent, and a cluster in place of them."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import types
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

import pytest

from pipeline.findings import InputError
from pipeline.workers import ONE_THREAD, beside, cluster, local


def test_a_worker_leaves_interrupts_to_its_parent_and_computes_on_one_thread() -> None:
    with local(1) as workers:
        assert workers.submit(signal.getsignal, signal.SIGINT).result() == signal.SIG_IGN
        assert {workers.submit(os.getenv, name).result() for name in ONE_THREAD} == {"1"}


def test_a_worker_that_is_killed_leaves_its_task_to_be_done_here() -> None:
    caught: list[int] = []
    before = signal.signal(signal.SIGTERM, lambda number, frame: caught.append(number))
    try:
        with local(1) as workers:
            assert workers.start(os.getpid)() != os.getpid()
            workers.start(signal.raise_signal, signal.SIGTERM)()
    finally:
        signal.signal(signal.SIGTERM, before)
    assert caught == [signal.SIGTERM]


def test_workers_compute_on_one_thread_whatever_was_started_before_them() -> None:
    program = (
        "import os; from pipeline.workers import ONE_THREAD, beside, local\n"
        "with beside(2) as start: start(os.getpid)()\n"
        "with local(1) as workers: print({workers.submit(os.getenv, name).result() for name in ONE_THREAD})\n"
    )
    bare = {name: value for name, value in os.environ.items() if name not in ONE_THREAD}
    told = subprocess.run([sys.executable, "-c", program], env=bare, capture_output=True, text=True, check=True)
    assert told.stdout.strip() == "{'1'}"


def test_without_a_core_to_spare_a_task_is_done_here() -> None:
    with beside(1) as start:
        assert start(os.getpid)() == os.getpid()


def test_a_task_is_done_beside_and_here_what_has_not_been_begun_there(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with beside(2) as start:
        begun, ahead = start(pipe.read_text), start(os.getpid)
        with pipe.open("w") as file:  # opens when the other end is opened, beside
            assert ahead() == os.getpid()
            file.write("told")
        assert begun() == "told"


def test_a_task_whose_process_is_killed_is_done_here(tmp_path: Path) -> None:
    pipe, caught = tmp_path / "pipe", list[int]()
    os.mkfifo(pipe)
    before = signal.signal(signal.SIGTERM, lambda number, frame: caught.append(number))
    others = set(multiprocessing.active_children())
    try:
        with beside(2) as start:
            begun = start(pipe.read_text)
            with pipe.open("w"):
                killed = start(signal.raise_signal, signal.SIGTERM)  # ends the process beside, here it is caught
                (process,) = set(multiprocessing.active_children()) - others
            begun()
            process.join()
            killed()
    finally:
        signal.signal(signal.SIGTERM, before)
    assert caught == [signal.SIGTERM]


def test_without_dask_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError) as caught:
        cluster("tcp://127.0.0.1:8786")
    assert str(caught.value) == (
        "--scheduler: found no dask.distributed; expected the extra 'cluster'; pip install 'seatrial[cluster]'"
    )


class ClientExecutor(Executor):
    """As narrow as that of dask.distributed: its shutdown takes nothing but wait."""

    def submit(self, task: Any, /, *arguments: Any, **options: Any) -> Future[Any]:
        future: Future[Any] = Future()
        future.set_result(task(*arguments))
        return future

    def shutdown(self, wait: bool = True) -> None:  # type: ignore[override]
        pass


class Client:
    def __init__(self, address: str, timeout: float) -> None:
        if address != "tcp://127.0.0.1:8786":
            raise OSError("Timed out trying to connect")

    def get_executor(self, *, pure: bool) -> ClientExecutor:
        assert not pure
        return ClientExecutor()

    def nthreads(self) -> dict[str, int]:
        return {"tcp://127.0.0.1:1": 2, "tcp://127.0.0.1:2": 3}


def test_a_cluster_is_given_as_many_tasks_as_it_has_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", types.SimpleNamespace(Client=Client))
    with cluster("tcp://127.0.0.1:8786") as workers:
        assert workers.width == 5
        assert workers.submit(abs, -1).result() == 1


def test_a_scheduler_that_does_not_answer_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", types.SimpleNamespace(Client=Client))
    with pytest.raises(InputError) as caught:
        cluster("tcp://127.0.0.1:1")
    assert str(caught.value) == (
        "--scheduler: found no answer from 'tcp://127.0.0.1:1'; expected a dask scheduler, as in tcp://host:8786"
    )
