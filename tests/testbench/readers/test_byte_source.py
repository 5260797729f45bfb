"""Items read and prepared ahead, in their order."""

import ctypes
import threading
import time

import pytest

from testbench.readers import byte_source
from testbench.readers.byte_source import DEPTH, in_order


def test_results_come_in_the_order_of_the_items():
    """However long each takes to prepare; items are taken one at a time, and no more than are soon needed."""
    inside, taken = threading.Lock(), []

    def items():
        for i in range(40):
            assert inside.acquire(blocking=False), "an iterator that would not bear two threads at once"
            time.sleep(0.001)
            inside.release()
            taken.append(i)
            yield i

    def slow(i):
        time.sleep(0.01 if i % 3 == 0 else 0.0)
        return i * i

    for i, result in enumerate(in_order(slow, items())):
        assert result == i * i
        assert len(taken) <= i + DEPTH + 1  # what bounds the memory
    assert taken == list(range(40))
    assert list(in_order(slow, [])) == []


@pytest.mark.parametrize("where", ["items", "prepare"])
def test_an_error_comes_at_its_place(where):
    """Results before it are given, then the error."""

    def items():
        for i in range(20):
            if where == "items" and i == 7:
                raise ValueError("7")
            yield i

    def prepare(i):
        if where == "prepare" and i == 7:
            raise ValueError("7")
        return i

    results = in_order(prepare, items())
    assert [next(results) for _ in range(7)] == list(range(7))
    with pytest.raises(ValueError, match="7"):
        next(results)


def test_one_may_stop_early():
    """Nothing is left running, and the items are closed."""
    before = threading.active_count()
    results = in_order(lambda i: i, range(10**6))
    assert [next(results) for _ in range(3)] == [0, 1, 2]
    results.close()
    assert threading.active_count() == before


@pytest.mark.parametrize("library", [object(), OSError("none"), TypeError("Windows")])
def test_other_c_libraries_keep_their_ways(monkeypatch, library):
    """Without mallopt, or without a library that can be asked, items are prepared all the same."""

    def opened(name):
        if isinstance(library, Exception):
            raise library
        return library

    monkeypatch.setattr(ctypes, "CDLL", opened)
    byte_source._keep_freed_memory.cache_clear()
    assert list(in_order(abs, [-1, 2, -3])) == [1, 2, 3]
