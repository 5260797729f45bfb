"""A log's digest, computed beside everything else: right whoever computes it, and of a file that stays as it is."""

import hashlib
import threading

import pytest

from testbench import source
from testbench.errors import RecordingError
from testbench.source import FileDigest

CONTENT = bytes(range(256)) * 4096


@pytest.fixture
def log(tmp_path):
    """A file of 1 MiB."""
    path = tmp_path / "log.csv"
    path.write_bytes(CONTENT)
    return path


@pytest.mark.parametrize("size", [0, 1, 4096, len(CONTENT)])
def test_the_digest_is_that_of_the_file(log, size):
    """Of nothing, of little, of all; asked for twice."""
    log.write_bytes(CONTENT[:size])
    digest = FileDigest(log)
    assert digest.size == size
    assert digest.result() == digest.result() == digest.sha256 == hashlib.sha256(CONTENT[:size]).hexdigest()


@pytest.mark.parametrize("blocks", [0, 1, 7, 255])
def test_who_asks_goes_on_where_the_thread_stands(log, monkeypatch, blocks):
    """The thread stops after so many blocks, and whoever asks for the result takes in the others, once each."""
    monkeypatch.setattr(source, "_AT_ONCE", 4096)
    go_on, asked = FileDigest._go_on, threading.Event()

    def slow(self, stopped):
        left = iter(range(blocks))
        if threading.current_thread() is threading.main_thread():
            return go_on(self, stopped)
        go_on(self, lambda: next(left, None) is None)
        asked.set()

    monkeypatch.setattr(FileDigest, "_go_on", slow)
    digest = FileDigest(log)
    assert asked.wait(10)
    assert (digest._read, digest.sha256) == (blocks * 4096, "")
    assert digest.result() == hashlib.sha256(CONTENT).hexdigest()


def test_a_file_that_changes_is_refused(log):
    """Its size or its time of change."""
    digest = FileDigest(log)
    log.write_bytes(CONTENT + b"x")
    with pytest.raises(RecordingError, match="changed while it was read"):
        digest.result()


def test_a_file_that_cannot_be_read_says_so_where_it_is_asked(log):
    """The error of the thread is raised by who asks."""
    digest = FileDigest(log)
    digest._thread.join()
    digest._failed = PermissionError("denied")
    with pytest.raises(PermissionError, match="denied"):
        digest.result()
