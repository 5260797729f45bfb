"""Every row of the manifests beside the public recordings, real and malformed, against what ``testbench info`` says."""

import csv
import json

import pytest

from testbench import public_recordings

from ..readers import reading

NUMBERS = ("n", "nan", "min", "max", "mean", "first", "last")
CLOCK = ("t_first", "t_last", "dt_min", "dt_median", "dt_max")
ANSWERS = {
    "b01_truncated_data.tdms": (1, "cut_file", ["Time 12940", "Load Cell 4040. 1 12930"]),
    "b03_cut_mid_row.csv": (3, "cut_last_row", ["line 1502 has 9 of 21 fields and no line end"]),
    "b04_nan_inf_tokens.csv": (3, "not_a_number", ["in line 11"]),
    "b05_header_repeated.csv": (3, "repeated_header", ["0.00735983"]),
    "b06_time_not_monotonic.csv": (1, "time_not_increasing", ["line 202", "line 401", "-0.9949996471 s at line 601"]),
    "b08_cp1254_turkish.csv": (3, "encoding_inferred", ["cp1254"]),
    "b11_empty.csv": (1, "empty_file", ["empty"]),
    "b13_links_outside.h5": (3, "outside_reference", ["b13_outside"]),
    "b15_mixed_decimal.csv": (1, "decimal_mark_changes", ["the first is '"]),
    "b16_saturated_16g.csv": (3, "clipping", ["1715", "1245", "12", "16 g"]),
    "b18_truncated.mat": (1, "cut_file", ["inside", "last whole variable"]),
    "b19_fewer_rows_than_declared.lvm": (1, "count_contradiction", ["10", "7"]),
}
"""Exit code, a finding, and what its message must hold, by the manifest's ``must_report``."""


def info(command, path):
    """Exit code and document of ``testbench info PATH --stats --json``."""
    code, out, _ = command("info", path, "--stats", "--json")
    return code, json.loads(out)


def close(one, other):
    """Equal to 1e-9, or to 1e-12 where it is nearly zero."""
    return one is not None and one == pytest.approx(other, rel=1e-9, abs=1e-12)


def assert_row(what, expected, groups):
    """One known channel or clock is among the groups with all its numbers."""
    channels = [channel for group in groups for channel in group["channels"]]
    if "t_first" in expected:
        found = [g for g in groups if g["clock"] and g["clock"]["non_increasing"] == expected["non_increasing"]]
        assert any(all(close(g["clock"][f"{key}_s"], expected[key]) for key in CLOCK) for g in found), what
    elif "mean_re" in expected:
        for part, mean in enumerate(("mean_re", "mean_im")):
            ends = expected["first"][part], expected["last"][part]
            assert any(close(c["mean"], expected[mean]) and (c["first"], c["last"]) == ends for c in channels), what
    elif "n_frames" in expected:
        points = [c for g in groups if g["rate_hz"] == expected["rate_hz"] for c in g["channels"]]
        places = [c for c in points if "residual" not in c["name"]]
        assert expected["unit"] in {c["unit"] for c in places}, what
        assert (len(places), {c["n"] for c in places}) == (3 * expected["n_points"], {expected["n_frames"]}), what
        assert sum(c["nan"] for c in places) == expected["nan_values"], what
    else:
        alike = [c for c in channels if all(close(c[key], expected[key]) for key in NUMBERS)]
        assert alike, what
        _assert_time_of(what, expected, [g for g in groups if any(c in alike for c in g["channels"])])


def _assert_time_of(what, expected, groups):
    for unit, seconds in (("time_us", 1e-6), ("time_s", 1.0)):
        if unit in expected:
            clock = {key: value * seconds for key, value in expected[unit].items() if key in CLOCK}
            assert_row(what, {**clock, "non_increasing": expected[unit]["non_increasing"]}, groups)


@pytest.mark.recordings
@pytest.mark.parametrize("name", public_recordings.recordings_by_file())
def test_every_public_recording_has_its_known_values(command, name):
    """All channels and clocks: counts, extremes, means, ends, steps."""
    code, document = info(command, reading.real(name))
    assert code in (0, 3)
    assert reading.known(name)
    for what, expected in reading.known(name).items():
        assert_row(what, expected, document["groups"])


@pytest.mark.recordings("malformed")
def test_every_malformed_recording_gets_its_answer(command, tmp_path):
    """All rows: the exit code, and a finding that says what the manifest wants reported; what is refused is not stored.

    ``ingest`` answers as ``info`` does.
    """
    with reading.malformed("manifest.csv").open(encoding="utf-8", newline="") as stream:
        assert {row["file"] for row in csv.DictReader(stream)} == set(ANSWERS)
    for name, (expected, finding, said) in ANSWERS.items():
        code, document = info(command, reading.malformed(name))
        messages = [f["message"] for f in document["findings"] if f["code"] == finding]
        assert (code, bool(messages)) == (expected, True), name
        for text in said:
            assert any(text in message for message in messages), f"{name}: {text!r} in {messages}"
        ingested, _, err = command("ingest", reading.malformed(name), "-o", tmp_path / name)
        assert (ingested, "Traceback" in err, (tmp_path / name).exists()) == (expected, False, expected != 1), name
