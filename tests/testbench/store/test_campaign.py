"""A campaign: a digest that was hit, what is missing and what does not belong are named for what they are."""

import hashlib
import os

import numpy as np
import pytest

from testbench.errors import StoreError
from testbench.store import atomic_files, open_campaign, open_run

from .stored import ACC, store


@pytest.fixture
def campaign(tmp_path):
    """A campaign of two runs."""
    for name in ("r001", "r002"):
        store(tmp_path, ACC, [np.arange(300.0)], name=name)
    return open_campaign(tmp_path)


def states(campaign):
    """What verify says of each file."""
    return {file.name: file.status for file in campaign.verify()}


def test_flipped_bits_of_the_digest_are_found(campaign):
    """A digest that was hit does not pass for that of its run."""
    path = atomic_files.digest_file(campaign.run_paths[0])
    whole = path.read_bytes()
    for at in range(len(whole) - 1):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
        assert states(campaign)["r001.h5"] == "damaged"


def test_what_is_missing_or_does_not_belong(campaign):
    """A run without digest, a digest without run, a part, another file: each is named for what it is."""
    atomic_files.digest_file(campaign.run_paths[0]).unlink()
    campaign.run_paths[1].unlink()
    (campaign.path / ".r003.0123456789ab.part").write_text("")
    (campaign.path / "notes.txt").write_text("")
    (campaign.path / "r004.h5").write_bytes(b"no run")
    assert states(campaign) == {
        "r001.h5": "damaged", "r002.h5": "missing", "r004.h5": "damaged", ".r003.0123456789ab.part": "unfinished",
        "notes.txt": "extra",
    }  # fmt: skip


def test_a_digest_is_that_of_sha256sum(campaign):
    """The digest beside a run is in the form that sha256sum -c reads."""
    path = campaign.run_paths[0]
    assert atomic_files.digest_file(path).read_text() == f"{atomic_files.sha256_of(path)}  r001.h5\n"


def test_other_folders_are_no_campaigns(tmp_path):
    """A missing folder and one without runs: clear messages."""
    with pytest.raises(StoreError, match="no such folder"):
        open_campaign(tmp_path / "nowhere")
    with pytest.raises(StoreError, match="holds no run"):
        open_campaign(tmp_path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names")
@pytest.mark.parametrize("make", [lambda path: os.mkfifo(path), os.mkdir, lambda path: os.symlink("nowhere", path)])
@pytest.mark.parametrize("of_digest", [False, True])
def test_what_is_no_file_is_damage(campaign, make, of_digest):
    """A pipe, a folder, a broken link in place of a run or its digest: said at once, and the others are verified."""
    from testbench.cli.campaign import verify

    run = campaign.run_paths[0]
    place = atomic_files.digest_file(run) if of_digest else run
    place.unlink()
    make(place)
    assert verify.main([str(campaign.path)], standalone_mode=False) == 1
    assert states(campaign) == {path.name: "damaged" if path == run else "intact" for path in campaign.run_paths}
    if not of_digest:
        with pytest.raises(StoreError, match=r"is a folder|is no file but"):
            open_run(run)


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
