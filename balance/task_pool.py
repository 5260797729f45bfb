"""Independent tasks in other processes: copies of this one, or on a Dask cluster (extra ``distributed``).

Copies (fork) begin within some milliseconds, with all that this process holds in memory: tasks need not travel, nor do
results of this process, which takes its share of them. Linux alone has them, where no other thread of Python runs that
might be in the middle of something; elsewhere this process takes the tasks in two threads.

A worker of a cluster that dies loses nothing: its tasks run again elsewhere, up to ATTEMPTS times. Results come as they
are ready, each with the place of its task, so that what is written to disk can be resumed. What works on tasks travels
once, and each thread of a worker keeps its own copy: what that finds for one task it still has for the next. Whoever
reaches a scheduler runs code on its workers: name only one of your own network.
"""

import ctypes
import gc
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

from .errors import CounterpoiseError

if TYPE_CHECKING:
    from distributed import Client

Task = TypeVar("Task")
Result = TypeVar("Result")

ATTEMPTS = 3
"""Workers that may die with a task before it counts as the task's fault."""
LOCAL = "local"
"""As a scheduler's address: processes of this machine."""
THREADS = 2
"""In which this process takes tasks alone: so many at a time are in memory."""
WORTH = 8
"""Tasks from which copies of this process pay: they cost about as much as one run of ten seconds takes."""
MOST = 8
"""Processes, at most: this one takes in what all of them find."""
_MMAP_THRESHOLD, _TRIM_THRESHOLD = -3, -1
"""Numbers of glibc's settings (malloc.h)."""
_LARGEST, _KEPT = 32 << 20, 1 << 28
"""Arrays so large that a copy has them from the system anew, which zeroes them, and free memory that it keeps [bytes]:
with what the C library does otherwise, a quarter of a run's time goes there."""
_CONNECT_S = 10.0
_own = threading.local()
"""What this thread of a worker works with, and the bytes that it came as."""
_PLACE_BYTES = 8
"""Of the place of a task."""


@dataclass(frozen=True)
class TaskPool:
    """Where tasks run."""

    client: "Client | None"
    """None runs them on this machine."""
    processes: int = 1
    """So many take them, this one and copies of it; without ``client``."""

    def results(self, work: Callable[[Task], Result], tasks: Sequence[Task]) -> Iterator[tuple[int, Result]]:
        """``work`` of each task with the task's place, in order of completion; what ``work`` raises is raised here."""
        if self.client is None:
            if self.processes > 1 and len(tasks) > 1 and _can_fork():
                yield from _shared(work, tasks, self.processes)
            else:
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

    def map(self, work: Callable[[Task], Result], tasks: Sequence[Task], imports: bool = False) -> list[Result]:
        """``work`` of each task, in the order of the tasks; in this process alone by THREADS.

        Where it ``imports`` much, copies of this process are made after the first task, and have that too.
        """
        if self is HERE:
            with ThreadPoolExecutor(THREADS) as threads:
                return list(threads.map(work, tasks))
        first = [work(task) for task in tasks[:1]] if imports and self.processes > 1 else []
        found = dict(self.results(work, tasks[len(first) :]))
        return [*first, *(found[place] for place in range(len(found)))]

    @property
    def in_memory(self) -> "TaskPool":
        """This pool where what works, and tasks, are inherited by copies of this process; else this process alone."""
        return self if self.processes > 1 else HERE

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


def cores(tasks: int) -> TaskPool:
    """A process for each core, where there are so many tasks that it pays; else HERE."""
    if tasks < WORTH or not _can_fork():
        return HERE
    number = min(len(os.sched_getaffinity(0)), MOST)
    return TaskPool(None, number) if number > 1 else HERE


def _can_fork() -> bool:
    """Whether a copy of this process has all that it needs: no other thread, which it would lack, holds a lock.

    Daemonic processes, such as those of ``multiprocessing.Pool``, may not have any.
    """
    from multiprocessing import current_process

    return sys.platform == "linux" and threading.active_count() == 1 and not current_process().daemon


def _shared(work: Callable[[Task], Result], tasks: Sequence[Task], processes: int) -> Iterator[tuple[int, Result]]:
    """By this process and copies of it; by itself what copies that died had not done.

    Each takes the next task when it is done with one: the file of places is read through one offset.
    """
    from multiprocessing import connection, get_context
    from tempfile import TemporaryFile

    context, ends, copies = get_context("fork"), list[Any](), list[Any]()
    left, failed = dict.fromkeys(range(len(tasks))), dict[int, Exception]()
    frozen = gc.get_freeze_count() > 0  # by who called: it stays so
    with TemporaryFile(buffering=0) as places:
        places.write(b"".join(place.to_bytes(_PLACE_BYTES, "little") for place in left))
        places.seek(0)
        gc.freeze()  # what copies inherit is never garbage to them: looking for any would copy its pages, here too
        try:
            for _ in range(min(processes, len(tasks)) - 1):
                receiver, sent = context.Pipe(duplex=False)
                copies.append(context.Process(target=_copy, args=(work, tasks, places.fileno(), sent), daemon=True))
                copies[-1].start()
                sent.close()
                ends.append(receiver)
            _keep_memory()
            while left:
                place, found = _next(places.fileno()), list[tuple[int, Any, Exception | None]]()
                if place is None and not ends:  # copies died
                    place = next(iter(left))
                if place is not None:
                    found.append(_tried(work, tasks, place))
                heard: list[Any] = connection.wait(ends, None if place is None else 0.0)
                for end in heard:
                    try:
                        found.append(end.recv())
                    except (EOFError, OSError):
                        ends.remove(end)
                    except Exception:  # an error whose words do not travel: its task is done here
                        continue
                for at, result, error in found:
                    left.pop(at, None)
                    if error is None:
                        yield at, result
                    else:
                        failed[at] = error
                        places.seek(0, os.SEEK_END)  # nobody takes another
                        left = {other: None for other in left if other < at}
            if failed:  # of several the first, as it would without copies
                raise failed[min(failed)]
        finally:
            places.seek(0, os.SEEK_END)
            for end in ends:
                end.close()
            for copy in copies:
                copy.join()
            if not frozen:
                gc.unfreeze()


def _next(places: int) -> int | None:
    """The place of the task that nobody has taken yet; None if all are taken."""
    found = os.read(places, _PLACE_BYTES)
    return int.from_bytes(found, "little") if found else None


def _tried(work: Callable[[Task], Result], tasks: Sequence[Task], place: int) -> tuple[int, Any, Exception | None]:
    """Place, result and error of a task."""
    try:
        return place, work(tasks[place]), None
    except Exception as error:
        return place, None, error


def _copy(work: Callable[[Task], Result], tasks: Sequence[Task], places: int, sent: Any) -> None:  # noqa: ANN401
    """In a copy of this process: the terminal's interrupt is for this process, with which the copy ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _keep_memory()
    with ThreadPoolExecutor(1) as sender:  # who works need not wait until this process takes in what was found
        while (place := _next(places)) is not None:
            sender.submit(sent.send, _tried(work, tasks, place))


def _keep_memory() -> None:
    """Large arrays from memory that is kept."""
    with suppress(AttributeError, OSError):  # another C library
        for setting, limit in ((_MMAP_THRESHOLD, _LARGEST), (_TRIM_THRESHOLD, _KEPT)):
            ctypes.CDLL(None).mallopt(setting, limit)


def _end_with_parent() -> None:
    from multiprocessing import parent_process

    parent = parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


@contextmanager
def task_pool(scheduler: str | None, processes: int | None = None, tasks: int = 0) -> Iterator[TaskPool]:
    """Without a scheduler on the :func:`cores` that so many ``tasks`` are worth, in ``processes`` that Dask starts on
    this machine (LOCAL), or at a scheduler such as tcp://host:8786.

    Raises CounterpoiseError where Dask is not installed or the scheduler does not answer.
    """
    if scheduler is None:
        yield cores(tasks)
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
