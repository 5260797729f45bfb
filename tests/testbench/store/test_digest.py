"""SHA-256 of files, however they are read."""

import hashlib

import pytest

from testbench.store import digest


def grown(path, *ends):
    """The digest of a file that is taken in up to each of ``ends``, then whole."""
    growing = digest.Growing(path)
    for end in (*ends, None):
        growing.grow(end)
    return growing.hexdigest()


@pytest.mark.parametrize("size", [0, 1, 4096, (1 << 20) - 1, 1 << 20, (1 << 20) + 1, 5_000_000])
def test_the_same_however_it_is_read(tmp_path, size):
    """In small pieces, in large ones, ahead in a thread: what hashlib gives for the whole."""
    content = bytes(range(251)) * (1 + size // 251)
    path = tmp_path / "file"
    path.write_bytes(content[:size])
    expected = hashlib.sha256(content[:size]).hexdigest()
    told = []
    assert digest.sha256_of(path, told.append) == expected
    assert sum(told) == size
    assert digest.sha256_of(path, at_once=64) == expected
    assert digest.sha256_of(path, at_once=16 << 20) == expected
    assert grown(path) == grown(path, 0, size // 3, size // 3, size // 2, size) == expected


def test_what_lies_behind_may_still_change(tmp_path):
    """Nothing is read beyond where the digest stands, so what is patched there counts as patched."""
    path = tmp_path / "file"
    path.write_bytes(bytes(3_000_000))
    growing = digest.Growing(path)
    growing.grow(1_500_000)
    path.write_bytes(bytes(1_500_000) + b"1" * 1_500_000)
    growing.grow()
    assert growing.hexdigest() == digest.sha256_of(path)


def test_a_file_that_cannot_be_read_says_so(tmp_path):
    """An error of the thread that reads is raised by who asked."""
    with pytest.raises(OSError, match="No such file"):
        grown(tmp_path / "none")
