"""Independent tasks in other processes: on this machine or on a Dask cluster (extra ``distributed``).

A worker that dies loses nothing: its tasks run again elsewhere, up to ATTEMPTS times. Results come as they are ready,
each with the place of its task, so that what is written to disk can be resumed. What works on tasks travels once, and
each thread of a worker keeps its own copy: what that finds for one task it still has for the next. Whoever reaches a
scheduler runs code on its workers: name only one of your own network.
"""

import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

from .errors import CounterpoiseError

if TYPE_CHECKING:
    from distributed import Client

Task = TypeVar("Task")
Result = TypeVar("Result")

ATTEMPTS = 3
"""Workers that may die with a task before it counts as the task's fault."""
LOCAL = "local"
"""As a scheduler's address: processes of this machine."""
_CONNECT_S = 10.0
_own = threading.local()
"""What this thread of a worker works with, and the bytes that it came as."""


@dataclass(frozen=True)
class TaskPool:
    """Where tasks run."""

    client: "Client | None"
    """None runs them one after the other in this process."""

    def results(self, work: Callable[[Task], Result], tasks: Sequence[Task]) -> Iterator[tuple[int, Result]]:
        """``work`` of each task with the task's place, in order of completion; what ``work`` raises is raised here."""
        if self.client is None:
            yield from ((place, work(task)) for place, task in enumerate(tasks))
            return
        from distributed import as_completed
        from distributed.protocol.pickle import dumps

        function = getattr(work, "func", work)  # of a partial
        self._refuse_workers_without(getattr(function, "__self__", function))
        packed = self.client.submit(bytes, dumps(work), pure=False)  # as a task's result: had anew if its worker dies
        futures = self.client.map(_worked, tasks, packed=packed, pure=False)
        places = {future.key: place for place, future in enumerate(futures)}
        for future in as_completed(futures):
            yield places[future.key], future.result()
            future.release()

    def _refuse_workers_without(self, work: object) -> None:
        """Raise CounterpoiseError where a worker cannot import what runs: Dask would lose the worker without a word."""
        if "<locals>" in getattr(work, "__qualname__", ""):
            return  # travels by value
        name = getattr(work, "__module__", None) or type(work).__module__

        def is_missing() -> bool:  # defined here, so that it travels by value
            from importlib.util import find_spec

            try:
                return find_spec(name) is None
            except ModuleNotFoundError:
                return True

        assert self.client is not None
        if without := [worker for worker, missing in self.client.run(is_missing).items() if missing]:
            raise CounterpoiseError(
                f"worker {without[0]} has no module {name}: install there what this process runs, in the same versions"
            )

    @property
    def workers(self) -> int:
        """Processes that work on tasks at this moment, at least 1."""
        return 1 if self.client is None else max(1, len(self.client.scheduler_info()["workers"]))


def _worked(task: Task, packed: bytes) -> object:
    """In a worker: what ``packed`` makes of a task."""
    from distributed.protocol.pickle import loads

    if getattr(_own, "packed", None) is not packed:
        _own.packed, _own.work = packed, loads(packed)
    return _own.work(task)


HERE = TaskPool(None)
"""One task after the other in this process."""


@contextmanager
def task_pool(scheduler: str | None, processes: int | None = None) -> Iterator[TaskPool]:
    """Tasks in this process (None), in ``processes`` of this machine (LOCAL), or at a scheduler such as tcp://host:8786.

    Raises CounterpoiseError where Dask is not installed or the scheduler does not answer.
    """
    if scheduler is None:
        yield HERE
        return
    try:
        import dask
        from distributed import Client, LocalCluster
    except ImportError:
        raise CounterpoiseError(
            "tasks in other processes need Dask: pip install 'counterpoise[distributed]', or leave out --scheduler"
        ) from None
    settings: dict[str, object] = {
        "distributed.scheduler.allowed-failures": ATTEMPTS,
        "distributed.worker.daemon": True,
    }
    # without Dask's own MALLOC_TRIM_THRESHOLD_, by which each large array is had from the system anew, and zeroed
    settings["distributed.nanny.pre-spawn-environ"] = {"OMP_NUM_THREADS": 1, "OPENBLAS_NUM_THREADS": 1}
    settings["distributed.admin.large-graph-warning-threshold"] = "1 GB"  # a long motion is sent once
    with dask.config.set(settings):
        if scheduler == LOCAL:
            quiet = {"dashboard": False, "dashboard_address": "127.0.0.1:0"}  # else a second cluster warns of a port
            local = {"processes": True, "threads_per_worker": 1, "host": "127.0.0.1", "scheduler_kwargs": quiet}
            with LocalCluster(n_workers=processes, **local) as cluster, Client(cluster) as client:
                yield TaskPool(client)
            return
        try:
            client = Client(scheduler, timeout=_CONNECT_S)
        except (OSError, ValueError, TimeoutError) as error:
            raise CounterpoiseError(
                f"no Dask scheduler answers at {scheduler}: {type(error).__name__}; expected an address such as "
                "tcp://127.0.0.1:8786, where `dask scheduler` runs"
            ) from None
        with client:
            if not client.scheduler_info()["workers"]:
                sys.stderr.write(f"{scheduler} has no worker yet: waiting; start one with `dask worker {scheduler}`\n")
            yield TaskPool(client)
