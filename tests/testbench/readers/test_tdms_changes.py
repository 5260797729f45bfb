"""TDMS whose properties change in the midst of the samples, or whose samples do not fill their chunks."""

import struct

import numpy as np
import pytest
from nptdms import ChannelObject, TdmsWriter

from . import reading

VALUES = np.arange(50) / 8


def written(tmp_path, *segments):
    """A file of one channel, a pair of samples and properties for each segment."""
    with TdmsWriter(tmp_path / "run.tdms") as writer:
        for values, properties in segments:
            writer.write_segment([ChannelObject("DAQ", "x", values, properties)])
    return reading.read(tmp_path / "run.tdms")


def test_another_step_in_the_midst_of_samples_leaves_no_rate(tmp_path):
    """Half the samples at 1 kHz and half at 500 Hz have no one rate: said with both and where, and none is taken."""
    found = written(tmp_path, (VALUES, {"wf_increment": 0.001}), (VALUES, {"wf_increment": 0.002}))
    assert found.group().clock is None
    assert "0.001 up to sample 50 and 0.002" in found.message("header_contradiction")
    assert found.column("x").tolist() == [*VALUES, *VALUES]


@pytest.mark.parametrize(
    ("name", "before", "after"),
    [
        ("unit_string", "N", "kN"),
        ("wf_start_time", np.datetime64("2024-01-01T00:00:00"), np.datetime64("2024-01-01T00:01:00")),
    ],
)
def test_another_unit_or_start_is_said(tmp_path, name, before, after):
    """By the format the last one holds for all samples; that another one stood before is a warning."""
    rate = {"wf_increment": 0.001}
    found = written(tmp_path, (VALUES, {name: before, **rate}), (VALUES, {name: after, **rate}))
    (finding,) = [f for f in found.findings if f.code == "header_contradiction"]
    assert (finding.channel, finding.where) == ("x", "sample 50")
    assert str(finding.message).startswith(f"{name} is ")
    assert found.group().clock.rate_hz == 1000.0


@pytest.mark.parametrize(
    ("axis", "rate_hz"),
    [
        ({}, 8.0), ({"wf_xname": "Time"}, 8.0), ({"wf_xname": "Zeit", "wf_xunit_string": "s"}, 8.0),
        ({"wf_xname": "Time", "wf_xunit_string": "ms"}, 8000.0), ({"wf_xname": "Frequency"}, None),
        ({"wf_xname": "Frequency", "wf_xunit_string": "Hz"}, None), ({"wf_xunit_string": "blorp"}, None),
    ],
)  # fmt: skip
def test_a_step_is_one_of_time_in_its_unit(tmp_path, axis, rate_hz):
    """1/8 of an abscissa is 8 Hz of seconds, 8 kHz of milliseconds, and no rate of anything else."""
    found = written(tmp_path, (VALUES, {"wf_increment": 0.125, **axis}))
    clock = found.group().clock
    assert (None if clock is None else clock.rate_hz) == rate_hz


def test_a_correction_behind_the_samples_is_no_contradiction(tmp_path):
    """A property that is written anew once all samples are there is that of all of them; so is one said twice alike."""
    first = {"unit_string": "N", "wf_increment": 0.001}
    found = written(tmp_path, (VALUES, first), (VALUES, first), (VALUES[:0], {"unit_string": "kN"}))
    assert found.unit("x") == "kN"
    assert "header_contradiction" not in found.codes


@pytest.mark.parametrize(("is_interleaved", "unit"), [(True, "rows of 12 bytes"), (False, "chunks of 60 bytes")])
def test_bytes_behind_whole_chunks_are_an_error(tmp_path, is_interleaved, unit):
    """Three bytes more than whole rows or chunks are a part of samples that is not read, and said to be."""
    metadata = struct.pack("<I", 2)
    for path, kind in (("/'g'/'a'", 3), ("/'g'/'b'", 10)):
        metadata += struct.pack("<I", len(path)) + path.encode() + struct.pack("<IIIQI", 20, kind, 1, 5, 0)
    flags, raw = 0b1110 | (is_interleaved << 5), bytes(60)
    for behind in (b"", b"abc"):
        sizes = struct.pack("<I2Q", 4713, len(metadata) + len(raw + behind), len(metadata))
        path = tmp_path / "run.tdms"
        path.write_bytes(b"TDSm" + struct.pack("<I", flags) + sizes + metadata + raw + behind)
        found = reading.read(path)
        assert len(found.column("a")) == len(found.column("b")) == 5
        assert ("count_contradiction" in found.codes) == bool(behind)
    assert f"3 bytes behind its whole {unit}" in found.message("count_contradiction")
