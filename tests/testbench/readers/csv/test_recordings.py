"""Public recordings against their known values, malformed ones against their answers."""

import csv
import json

import numpy as np
import pytest

from testbench.recording import Refusal, UniformClock

from .. import reading

TEXTS = {
    "08_phyphox_linear_acc.csv": {},
    "09_double_pendulum_A0_061705.csv": {},
    "10_double_pendulum_C1_154548.csv": {},
    "11_smartwheel_offsets_baseline.csv": {
        "col3 angle deg (wraps at 360)": "col3", "col18 Fx N": "col18", "col19 Fy N": "col19",
        "col23 Mz Nm": "col23", "col6 raw ch1": "col6", "col1 index": "col1",
    },
    "12_kistler_fp_volts.txt": {},
    "13_cortex_walk1.forces": {},
}  # fmt: skip
"""Texts among the public recordings; names of their checks that are not names of channels."""


@pytest.mark.recordings
@pytest.mark.parametrize("name", TEXTS)
def test_public_recordings_have_their_known_values(name):
    """Counts, extremes and ends exactly, means to 1e-9, clocks to 1e-9."""
    found = reading.read(reading.real(name))
    for check, expected in reading.known(name).items():
        column = found.column(TEXTS[name].get(check, check))
        if "t_first" in expected:
            reading.assert_clock(column, expected)
        else:
            reading.assert_values(column, expected)
    assert not [f for f in found.findings if f.severity == 2]


@pytest.mark.recordings
def test_a_headerless_recording_keeps_its_first_row():
    """25 columns col0 ... col24, the first row among the samples, and a finding that there were no names."""
    found = reading.read(reading.real("11_smartwheel_offsets_baseline.csv"))
    assert [c.name for c in found.group().channels] == [f"col{i}" for i in range(25)]
    assert found.codes >= {"no_header", "no_clock"}


@pytest.mark.recordings
def test_a_declared_rate_is_the_clock():
    """Cortex declares 450 Hz and 1092 samples; both hold."""
    found = reading.read(reading.real("13_cortex_walk1.forces"))
    assert found.group().clock == UniformClock(450.0)
    assert "count_contradiction" not in found.codes


def malformed_facts(name):
    """What is true of a malformed recording."""
    with reading.malformed("manifest.csv").open(encoding="utf-8", newline="") as stream:
        return json.loads(next(row["facts"] for row in csv.DictReader(stream) if row["file"] == name))


@pytest.mark.recordings("malformed")
def test_cut_inside_a_row():
    """The last row has 9 of 21 fields: it is left out and said."""
    found = reading.read(reading.malformed("b03_cut_mid_row.csv"))
    facts = malformed_facts("b03_cut_mid_row.csv")
    assert (len(found.time()), found.time()[-1]) == (facts["good_rows"], facts["last_good_time"])
    assert "line 1502 has 9 of 21 fields and no line end" in found.message("cut_last_row")


@pytest.mark.recordings("malformed")
def test_tokens_that_are_no_numbers():
    """Ten cells, each named with line and token; no column becomes text; means are of finite values."""
    found = reading.read(reading.malformed("b04_nan_inf_tokens.csv"))
    facts = malformed_facts("b04_nan_inf_tokens.csv")
    messages = {f.channel: f.message for f in found.findings if f.code == "not_a_number"}
    for line, (channel, token) in facts["line_to_token"].items():
        shown = f"'{token}'" if token else "an empty cell"
        assert f"{shown} in line {line}" in messages[channel]
    counts = [int(messages[name].split()[4]) for name in sorted(messages)]
    assert counts == list(facts["per_channel"].values())
    check = next(iter(found.checks.values()))
    assert all(np.isfinite(stats.mean) for stats in check.stats)
    assert sum(stats.not_finite for stats in check.stats) == facts["unreadable_or_nonfinite"]


@pytest.mark.recordings("malformed")
def test_a_repeated_header():
    """300 and 200 rows as two recordings, with the line of the second header and the time that starts again."""
    found = reading.read(reading.malformed("b05_header_repeated.csv"))
    assert [len(found.time(name)) for name in found.groups] == [300, 200]
    (finding,) = [f for f in found.findings if f.code == "repeated_header"]
    assert finding.where == "line 302"
    assert "0.00735983" in finding.message


@pytest.mark.recordings("malformed")
def test_time_that_falls():
    """Refused, with the lines and the size of each step."""
    found = reading.read(reading.malformed("b06_time_not_monotonic.csv"))
    (finding,) = [f for f in found.findings if f.code == "time_not_increasing"]
    assert finding.where == "line 202, line 401, line 601"
    assert "-0.9949996471 s at line 601" in finding.message
    assert finding.severity == 2


@pytest.mark.recordings("malformed")
def test_turkish_names_in_windows_1254():
    """The names exactly, the numbers of first and last row exactly, and the encoding that was taken."""
    facts = malformed_facts("b08_cp1254_turkish.csv")
    found = reading.read(reading.malformed("b08_cp1254_turkish.csv"))
    assert [c.name for c in found.group().channels] == facts["names"]
    columns = next(iter(found.data.values()))
    assert [c[0] for c in columns] == facts["first_row"]
    assert [c[-1] for c in columns] == facts["last_row"]
    assert "cp1254" in found.message("encoding_inferred")


@pytest.mark.recordings("malformed")
def test_an_empty_file():
    """Refused, saying that it is empty."""
    with pytest.raises(Refusal, match="the file is empty"):
        reading.read(reading.malformed("b11_empty.csv"))


@pytest.mark.recordings("malformed")
def test_a_decimal_mark_that_changes():
    """Refused: the first line with the other mark, and the numbers that may mean two things."""
    found = reading.read(reading.malformed("b15_mixed_decimal.csv"))
    where = {f.code: f.where for f in found.findings if f.severity == 2}
    assert where["decimal_mark_changes"].startswith("lines 62, ")
    assert where["ambiguous_number"] == "lines 22, 82"
    fy = found.column("Fy (N)")
    assert np.isnan(fy[[20, 80]]).all()


@pytest.mark.recordings("malformed")
def test_a_sensor_at_its_range():
    """Counts at both limits, the longest run, the limit; the samples stay."""
    found = reading.read(reading.malformed("b16_saturated_16g.csv"))
    facts = malformed_facts("b16_saturated_16g.csv")
    (finding,) = [f for f in found.findings if f.code == "clipping"]
    clipped = facts["clipped"]["Acc X"]
    assert finding.channel == "Acc X (g)"
    for number in (*clipped.values(), facts["range_g"]):
        assert str(number) in finding.message
    assert len(found.column("Acc X (g)")) == facts["rows"]
