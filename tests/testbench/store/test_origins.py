"""Digests of the logs, filled in after HDF5 has closed the run: whole, checked, covered by the run's own digest."""

import h5py
import numpy as np
import pytest

from testbench.errors import RecordingError, StoreError
from testbench.recording import Channel, Group
from testbench.store import digest, layout, open_campaign, open_run
from testbench.store.writer import RunWriter

GROUP = Group("log", (Channel("AccX (g)", "g"),))
KNOWN = ["0123456789abcdef" * 4, "f" * 64, "0" * 64]


def written(folder, sources, digests=None):
    """A run of these sources, whose digests come with the seal."""
    with RunWriter(folder, "r001") as writer:
        writer.group(GROUP).append([np.random.default_rng(1).normal(size=100_000)])
        writer.group(GROUP).finish(None, None)
        writer.describe("unstated", {}, [], {"sources": sources}, "a = 1\n")
        writer.seal(digests)
        return writer.commit()


@pytest.mark.parametrize("count", [0, 1, 2, 3])
@pytest.mark.parametrize("late", [True, False])
def test_digests_come_back(tmp_path, count, late):
    """Known before or with the seal: in the run's provenance and for HDF5, which checks them; the run is intact."""
    known = KNOWN[:count]
    sources = [{"name": f"{n}.csv", "sha256": "" if late else sha256} for n, sha256 in enumerate(known)]
    run = written(tmp_path, sources, (lambda: known) if late else None)
    assert [source["sha256"] for source in open_run(run).provenance["sources"]] == known
    assert digest.recorded(run) == digest.sha256_of(run)
    with h5py.File(run) as file:
        assert (layout.SOURCE_SHA256 in file) == bool(count)
        if count:
            assert file[layout.SOURCE_SHA256].fletcher32
            assert file[layout.SOURCE_SHA256].asstr()[()].tolist() == known


def test_a_log_that_is_not_wholly_here_has_no_digest(tmp_path):
    """As of a recovered run: an empty text, which is not that of a run that was not finished."""
    run = open_run(written(tmp_path, [{"name": "log.csv", "sha256": ""}]))
    assert [source["sha256"] for source in run.provenance["sources"]] == [""]


def test_zeros_are_no_run(tmp_path):
    """A file whose digests were never filled in is refused, and says why."""
    with RunWriter(tmp_path, "r001") as writer:
        writer.group(GROUP).append([np.ones(3)])
        writer.group(GROUP).finish(None, None)
        writer.describe("unstated", {}, [], {"sources": [{"name": "log.csv"}]}, None)
        writer._close()
        with pytest.raises(StoreError, match=r"source_sha256 holds \[''\].*not finished"):
            open_run(writer.part)


@pytest.mark.parametrize("wrong", [[], KNOWN[:2], ["short"], ["ş" * 64], ["F" * 64]])
def test_what_is_no_digest_of_each_source_is_never_stored(tmp_path, wrong):
    """Too few, too many, too short, other letters: refused, and nothing is left of the run."""
    with pytest.raises(StoreError, match="are not the SHA-256 of 1 sources"):
        written(tmp_path / "c", [{"name": "log.csv"}], lambda: wrong)
    assert not (tmp_path / "c").exists()


def test_a_log_that_changed_leaves_nothing(tmp_path):
    """What the digests raise is raised as it is, after the file was closed: nothing of the run stays."""

    def changed():
        raise RecordingError("log.csv: changed while it was read")

    with pytest.raises(RecordingError, match="changed"):
        written(tmp_path / "c", [{"name": "log.csv"}], changed)
    assert not (tmp_path / "c").exists()


def test_each_flipped_bit_of_the_digests_is_found(tmp_path):
    """By verify, and by HDF5's checksum where a digest is read."""
    run = written(tmp_path, [{"name": "log.csv", "sha256": KNOWN[0]}])
    whole = run.read_bytes()
    at = whole.index(KNOWN[0].encode())
    for place in range(at, at + 64 + 4, 3):
        run.write_bytes(whole[:place] + bytes([whole[place] ^ 1 << place % 8]) + whole[place + 1 :])
        assert [state.status for state in open_campaign(tmp_path).verify()] == ["damaged"]
        with pytest.raises(StoreError):
            open_run(run)
