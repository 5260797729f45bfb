"""Damaged files of every format: a recording or a clear error, and never a crash, a hang, or memory without end.

``COUNTERPOISE_FUZZ`` sets how many damaged copies of each example are read; the long
campaign is ``studies.reader_faults``.
"""

import os
import tracemalloc

import pytest

from balance.errors import CounterpoiseError
from studies.reader_faults import failures, read_or_refused
from testbench.readers import open_recording
from testbench.recording import Severity

from . import examples, reading
from .reading import in_process  # noqa: F401

CASES = int(os.environ.get("COUNTERPOISE_FUZZ", "16"))
MOST_BYTES = 400 << 20
REAL = ["01_loadcell_wagon55.tdms", "02_hammer_short_decimal_comma.lvm", "06_canmod_imu_60FEB5A8.mf4",
        "13_cortex_walk1.forces"]  # fmt: skip


def assert_read_or_refused(path, count, seed):
    """Each damaged copy of a file is read to its end or refused."""
    assert failures(path, path.read_bytes(), count, seed) == []


@pytest.mark.parametrize("name", [*examples.IN_PROCESS, "run.mcap", "run.bag"])
@pytest.mark.usefixtures("in_process")
def test_damaged_files_are_read_or_refused(tmp_path, name):
    """Cut, flipped, spliced, zeroed, repeated, with the largest numbers: only clear errors."""
    assert_read_or_refused(examples.make(tmp_path, name), CASES, seed=1)


@pytest.mark.parametrize("name", ["run.h5", "run.mat", "run.parquet"])
def test_damaged_files_are_read_or_refused_in_a_process_of_their_own(tmp_path, name):
    """The same through libraries in C, which may crash."""
    assert_read_or_refused(examples.make(tmp_path, name), max(3, CASES // 10), seed=2)


@pytest.mark.recordings
@pytest.mark.parametrize("name", REAL)
def test_damaged_public_recordings_are_read_or_refused(tmp_path, name):
    """What real loggers wrote, damaged."""
    path = tmp_path / name
    path.write_bytes(reading.real(name).read_bytes())
    assert_read_or_refused(path, max(4, CASES // 10), seed=3)


_GROWS = {"run.csv", "times.csv", "run.c3d"}
"""Formats that a cut may leave whole: rows without a declared count; bytes behind the last frame that only fill up."""


@pytest.mark.parametrize("name", sorted({*examples.IN_PROCESS, "run.mat", "packed.mat", "old.mat"} - _GROWS))
@pytest.mark.usefixtures("in_process")
def test_no_cut_is_accepted_in_silence(tmp_path, name):
    """Wherever the file ends, but between two of its parts, it is refused or found cut."""
    path = examples.make(tmp_path, name)
    whole = path.read_bytes()
    silent = [end for end in range(1, len(whole), max(1, len(whole) // 40)) if not _is_said(path, whole[:end])]
    assert len(silent) <= 1, f"{path.name} cut at {silent} is read as if it were whole"


def _is_said(path, content):
    path.write_bytes(content)
    try:
        recording = open_recording(path)
        findings = list(recording.findings)
        for _ in recording.blocks(findings.append):
            pass
    except CounterpoiseError:
        return True
    return any(f.severity is Severity.ERROR or f.code == "cut_last_row" for f in findings)


@pytest.mark.parametrize("name", sorted(examples.IN_PROCESS.keys() - {"run.csv", "times.csv", "run.forces", "run.lvm"}))
def test_memory_stays_bounded(tmp_path, name):
    """The largest lengths in the file's head are never allocated."""
    path = examples.make(tmp_path, name)
    whole = path.read_bytes()
    open_recording(path)
    tracemalloc.start()
    try:
        for i in range(0, min(len(whole), 400), 52):
            path.write_bytes(whole[:i] + b"\xff\xff\xff\x7f" + whole[i + 4 :])
            read_or_refused(path)
        assert tracemalloc.get_traced_memory()[1] < MOST_BYTES
    finally:
        tracemalloc.stop()
