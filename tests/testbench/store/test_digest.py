"""SHA-256 of files, however they are read."""

import hashlib

import pytest

from testbench.store import atomic_files


@pytest.mark.parametrize("size", [0, 1, 4096, (1 << 20) - 1, 1 << 20, (1 << 20) + 1, 5_000_000])
def test_the_same_however_it_is_read(tmp_path, size):
    """In small pieces, in large ones, ahead in a thread: what hashlib gives for the whole."""
    content = bytes(range(251)) * (1 + size // 251)
    path = tmp_path / "file"
    path.write_bytes(content[:size])
    expected = hashlib.sha256(content[:size]).hexdigest()
    told = []
    assert atomic_files.sha256_of(path, told.append) == expected
    assert sum(told) == size
    assert atomic_files.sha256_of(path, at_once=64) == expected
    assert atomic_files.sha256_of(path, at_once=16 << 20) == expected
    assert atomic_files.sha256_alone(path) == expected


def test_a_file_that_cannot_be_read_says_so(tmp_path):
    """An error of the thread that reads is raised by who asked."""
    with pytest.raises(OSError, match="No such file"):
        atomic_files.sha256_alone(tmp_path / "none")
