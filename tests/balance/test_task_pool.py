"""Tasks in other processes: the same results in any pool, none lost with a worker, errors as they were raised."""

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import suppress
from functools import partial
from inspect import getsource
from types import FunctionType, ModuleType

import pytest

from balance.errors import CounterpoiseError, DataError
from balance.task_pool import HERE, LOCAL, MOST, WORTH, TaskPool, cores, task_pool

forks = pytest.mark.skipif(sys.platform != "linux", reason="copies of this process: Linux alone")
COPIES = TaskPool(None, 2)


def squaring():
    """The square, slowly, and the process that computed it; a function that travels by value."""

    def square(number: int) -> tuple[int, int]:
        if number < 0:
            raise DataError(f"{number}: expected zero or more")
        time.sleep(0.05)
        return number**2, os.getpid()

    return square


@pytest.fixture(scope="module")
def cluster():
    """A scheduler on this machine with two worker processes: Dask warns where its usual port is taken, and errors are
    made of warnings here; of ports nothing is said.
    """
    with socket.socket() as taken:
        with suppress(OSError):  # taken by another program already
            taken.bind(("127.0.0.1", 8787))
            taken.listen()
        with task_pool(LOCAL, processes=2) as pool:
            yield pool.client.cluster


@pytest.fixture
def scheduler(cluster):
    """The address of that scheduler, once both workers are there: one that was killed takes a while to come back."""
    cluster.wait_for_workers(2, timeout=120)
    return cluster.scheduler_address


def test_one_process_and_two_give_the_same(scheduler):
    """Squares of twelve numbers; the tasks go to both workers."""
    with task_pool(None) as here, task_pool(scheduler) as there:
        assert there.workers == 2
        alone, shared = dict(here.results(squaring(), range(12))), dict(there.results(squaring(), range(12)))
    assert [value for value, _ in alone.values()] == [shared[place][0] for place in range(12)]
    assert len({process for _, process in shared.values()}) == 2


def same() -> None:
    """What works, and tasks, need not be such as travel; what imports is done here first, the others by both."""
    here = os.getpid()
    tasks = [lambda number=number: (number, os.getpid(), time.sleep(0.05)) for number in range(12)]
    for imports in (True, False):
        found = COPIES.map(lambda task: task(), tasks, imports)
        assert [number for number, *_ in found] == list(range(12))
        assert len({process for _, process, _ in found}) == 2
        assert here == found[0][1] or not imports


def first_error() -> None:
    """The first error is raised, though a later task fails sooner."""

    def work(number: int) -> int:
        time.sleep(0.2 / (number + 1))
        if number in {3, 7}:
            raise DataError(f"{number} is odd")
        return number

    raised = ""
    try:
        COPIES.map(work, range(12))
    except DataError as error:
        raised = str(error)
    assert raised == "3 is odd"


def death() -> None:
    """What a copy had that dies, or what cannot travel, and what nobody had begun, is done here."""
    here = os.getpid()

    def work(number: int) -> object:
        time.sleep(0.05)
        if os.getpid() != here:
            return threading.Lock() if number < 4 else os.kill(os.getpid(), signal.SIGKILL)
        return number

    assert COPIES.map(work, range(12)) == list(range(12))


class Worded(DataError):
    """An error that makes its text itself."""

    def __init__(self, name: str, number: int) -> None:
        super().__init__(f"{name}: {number}")
        self.number = number


def error_of_other_words() -> None:
    """An error that cannot be made again of its text is raised as it was."""

    def work(number: int) -> int:
        time.sleep(0.05)
        if number >= 3:
            raise Worded("log", number)
        return number

    raised = None
    try:
        COPIES.map(work, range(12))
    except Worded as error:
        raised = error.number
    assert raised == 3


def where_they_pay() -> None:
    """Not for a few tasks, nor where another thread runs, which a copy would lack."""
    assert cores(WORTH - 1) is HERE
    idle = threading.Event()
    thread = threading.Thread(target=idle.wait)
    thread.start()
    assert cores(1000) is HERE
    assert COPIES.map(lambda _: os.getpid(), range(4)) == 4 * [os.getpid()]
    idle.set()
    thread.join()
    assert cores(1000).processes == min(len(os.sched_getaffinity(0)), MOST)


def daemonic() -> None:
    """A process that may have no copies, such as one of multiprocessing.Pool, does the tasks itself."""
    from multiprocessing import get_context

    with get_context("fork").Pool(1) as pool:
        assert pool.apply(COPIES.map, (abs, [-1, -2, -3])) == [1, 2, 3]


def as_frozen_before() -> None:
    """Objects that the caller has frozen stay so, and others do not become so."""
    import gc

    COPIES.map(abs, [-1, -2, -3])
    assert gc.get_freeze_count() == 0
    gc.freeze()
    COPIES.map(abs, [-1, -2, -3])
    assert gc.get_freeze_count() > 0


@forks
@pytest.mark.parametrize(
    "checked", [same, first_error, death, error_of_other_words, where_they_pay, daemonic, as_frozen_before]
)
def test_copies_of_a_process(checked):
    """In a process of its own: this one may have threads of other tests."""
    head = "import os, signal, threading, time\nfrom balance.errors import DataError\nfrom balance.task_pool import *\n"
    head += getsource(Worded)
    code = f"{head}COPIES = TaskPool(None, 2)\n{getsource(checked)}\n{checked.__name__}()"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@forks
@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGKILL])
def test_copies_end_with_their_process(end):
    """Interrupted at the terminal, which all of them hear, or killed: none is left, and only one says so."""
    code = (
        "import os, time\nfrom balance.task_pool import TaskPool\n"
        "TaskPool(None, 2).map(lambda n: (os.write(1, b'%d\\n' % os.getpid()), time.sleep(0.5)), range(40))"
    )
    command = [sys.executable, "-c", code]
    with subprocess.Popen(command, stdout=-1, stderr=-1, text=True, start_new_session=True) as process:
        copies = {int(process.stdout.readline()) for _ in range(2)}
        os.killpg(process.pid, end) if end is signal.SIGINT else process.kill()
        error = process.communicate(timeout=20)[1]
    assert error.count("KeyboardInterrupt") == (end is signal.SIGINT)
    for _ in range(100):
        left = [copy for copy in copies if os.path.exists(f"/proc/{copy}")]
        if not left:
            break
        time.sleep(0.1)
    assert not left


def test_what_works_on_tasks_travels_once(scheduler):
    """Each of both workers counts its own calls: what works there for one task is there for the next."""
    seen = []

    def count(_: int) -> int:
        seen.append(None)
        return len(seen)

    with task_pool(scheduler) as pool:
        for _ in range(2):  # and a second round starts anew
            counts = sorted(count for _, count in pool.results(count, range(12)))
            assert counts.count(1) <= 2
            assert sum(counts.count(first + 1) <= counts.count(first) for first in range(1, 12)) == 11
    assert not seen


def test_a_worker_that_dies_loses_no_task(scheduler):
    """One of both workers is killed after the first result: all forty results come, each once."""
    with task_pool(scheduler) as pool:
        found, killed = {}, None
        for place, (value, process) in pool.results(squaring(), range(40)):
            if killed is None:
                killed = process
                os.kill(killed, signal.SIGKILL)
            assert place not in found
            found[place] = value
    assert found == {number: number**2 for number in range(40)}


def test_an_error_of_a_task_is_raised(scheduler):
    """The error that the task raised, not one of the pool."""
    for address in (None, scheduler):
        with pytest.raises(DataError, match="-1: expected zero"), task_pool(address) as pool:
            list(pool.results(squaring(), [-1]))


def test_a_worker_without_a_module_is_named(scheduler, monkeypatch):
    """What only this process can import: the module is named, and the workers live on."""
    module = ModuleType("only_here")
    module.work = FunctionType((lambda number: number).__code__, {}, "work")
    module.work.__module__, module.work.__qualname__ = "only_here", "work"
    monkeypatch.setitem(sys.modules, "only_here", module)
    with task_pool(scheduler) as pool:
        before = pool.client.run(os.getpid)
        for work in (module.work, partial(module.work)):
            with pytest.raises(CounterpoiseError, match="has no module only_here"):
                list(pool.results(work, [1]))
        assert pool.client.run(os.getpid) == before
        assert len(before) == 2


def test_an_address_without_a_scheduler_is_refused(monkeypatch):
    """With the address, and what to start there."""
    monkeypatch.setattr("balance.task_pool._CONNECT_S", 0.5)
    refusal = pytest.raises(CounterpoiseError, match=r"no Dask scheduler answers at tcp://127.0.0.1:9")
    with refusal, task_pool("tcp://127.0.0.1:9"):
        pass
