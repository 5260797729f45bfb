"""Public recordings against what other people's libraries give of them, malformed ones against their answers."""

import csv
import json

import numpy as np
import pytest

from testbench.recording import Refusal, TimeColumn, UniformClock

from . import reading

SENSORS = {"8": "Main Acceleration", "32": "16g DC Acceleration", "36": "Pressure/Temperature"}
WHEEL = {"col3 angle deg (wraps at 360)": "col3", "col18 Fx N": "col18", "col19 Fy N": "col19", "col23 Mz Nm": "col23",
         "col6 raw ch1": "col6", "col1 index": "col1"}  # fmt: skip


def plain(what):
    """A check that is called by its channel."""
    return what, None


def with_unit(what):
    """The same, its unit in square brackets."""
    return what.removesuffix("]").partition(" [")[0], None


def of_block(what):
    """The second block of a trigger is a group of its own."""
    channel, _, rows = what.partition(" rows ")
    return channel, "03_hammer_two_blocks" + (" part 2" if rows.startswith("8192") else "")


def of_sensor(what):
    """Group and channel by their numbers: 8.0 is X of the main accelerometer."""
    number, _, rest = what.partition(".")
    return rest[2:].removesuffix("]").rpartition(" [")[0], SENSORS[number]


CHECKED = {
    "01_loadcell_wagon55.tdms": lambda what: (what.partition("/")[2], None),
    "02_hammer_short_decimal_comma.lvm": plain,
    "03_hammer_two_blocks.lvm": of_block,
    "04_mpstd_4acc.uff": lambda what: (what.split(":")[1].split(" (")[0], None),
    "05_slamstick_SSX66115.IDE": of_sensor,
    "06_canmod_imu_60FEB5A8.mf4": with_unit,
    "07_ema_case1.mat": plain,
    "08_phyphox_linear_acc.csv": plain,
    "09_double_pendulum_A0_061705.csv": plain,
    "10_double_pendulum_C1_154548.csv": plain,
    "11_smartwheel_offsets_baseline.csv": lambda what: (WHEEL.get(what, what), None),
    "12_kistler_fp_volts.txt": plain,
    "13_cortex_walk1.forces": plain,
    "14_walk_4_forceplates.c3d": with_unit,
}
"""Channel and group of what is checked in each recording, by how the check is called."""


@pytest.mark.recordings
@pytest.mark.parametrize("name", CHECKED)
def test_public_recordings_have_their_known_values(name):
    """Counts, extremes and ends exactly, means and clocks to 1e-9; units where the check names one."""
    found = reading.read_real(name)
    for what, values in reading.known(name).items():
        channel, group = CHECKED[name](what)
        if "t_first" in values:
            reading.assert_clock(found.time(), values)
        elif what == "points":
            points = np.array(found.data["14_walk_4_forceplates points"])
            assert points.shape == (3 * values["n_points"], values["n_frames"])
            assert (int(np.isnan(points).sum()), points.size) == (values["nan_values"], values["total_values"])
            assert found.groups["14_walk_4_forceplates points"].clock.rate_hz == values["rate_hz"]
        elif "mean_re" in values:
            parts = [found.column(channel.replace("complex", part)) for part in ("real", "imag")]
            assert [[p[0] for p in parts], [p[-1] for p in parts]] == [values["first"], values["last"]]
            assert parts[0].mean() == pytest.approx(values["mean_re"], rel=1e-9)
            assert np.hypot(*parts).max() == pytest.approx(values["abs_max"], rel=1e-9)
        else:
            reading.assert_values(found.column(channel, group), values)
            assert not what.endswith("]") or found.unit(channel) == what.removesuffix("]").rpartition(" [")[2]
            holder = next(g for g in found.groups.values() if group in (None, g.name) and _holds(g, channel))
            for time in values.keys() & {"time_s", "time_us"}:
                reading.assert_clock(found.time(holder.name), values[time])
    assert not [f for f in found.findings if f.severity == 2]


def _holds(group, channel):
    return channel in [c.name for c in group.channels]


@pytest.mark.recordings
@pytest.mark.parametrize(
    ("name", "groups", "clock", "codes"),
    [
        ("03_hammer_two_blocks.lvm", 1, None, {"unit_doubtful", "appended_blocks", "rate_rounded"}),
        ("04_mpstd_4acc.uff", 1, UniformClock(3200.0, 0.0), {"duplicate_dof"}),
        ("05_slamstick_SSX66115.IDE", 5, TimeColumn(0, 1e-6), {"calibration_applied"}),
        ("06_canmod_imu_60FEB5A8.mf4", 9, None, set()),
        ("07_ema_case1.mat", None, None, {"rate_rounded"}),
        ("11_smartwheel_offsets_baseline.csv", 1, None, {"no_header", "no_clock"}),
        ("13_cortex_walk1.forces", 1, UniformClock(450.0), set()),
    ],
)
def test_what_is_known_of_recordings_as_a_whole(name, groups, clock, codes):
    """The number of groups, the clock of the first, and what is said."""
    found = reading.read_real(name)
    assert groups in (None, len(found.recording.groups))
    assert clock in (None, found.group().clock)
    assert codes <= found.codes


@pytest.mark.recordings
def test_details_of_recordings():
    """A force in g is kept as written; all columns of a file without header; a rate that is a little off."""
    assert reading.read_real("03_hammer_two_blocks.lvm").unit("F") == "g"
    columns = reading.read_real("11_smartwheel_offsets_baseline.csv").group().channels
    assert [c.name for c in columns] == [f"col{i}" for i in range(25)]
    assert "1280 Hz, the times give 1279.95" in reading.read_real("07_ema_case1.mat").message("rate_rounded")
    forces = reading.read_real("14_walk_4_forceplates.c3d").groups["14_walk_4_forceplates analog"]
    assert {c.unit for c in forces.channels} == {None, "N", "Nmm", "V", "mm/s²"}


@pytest.mark.recordings
@pytest.mark.parametrize("share", [0.1, 0.5, 0.999])
def test_a_cut_endaq_recording_says_so(tmp_path, share):
    """What is whole can be had by one who accepts the loss."""
    whole = reading.real("05_slamstick_SSX66115.IDE").read_bytes()
    path = tmp_path / "cut.IDE"
    path.write_bytes(whole[: int(share * len(whole))])
    assert "whole blocks of samples come before it" in reading.read(path).message("cut_file")


def _facts(name):
    """A malformed recording, and what is true of it."""
    with reading.malformed("manifest.csv").open(encoding="utf-8", newline="") as stream:
        facts = json.loads(next(row["facts"] for row in csv.DictReader(stream) if row["file"] == name))
    return reading.read(reading.malformed(name)), facts


@pytest.mark.recordings("malformed")
def test_what_is_whole_of_malformed_recordings():
    """Rows before a cut and behind a second header; names and numbers in Windows-1254; samples at the range."""
    found, facts = _facts("b03_cut_mid_row.csv")
    assert (len(found.time()), found.time()[-1]) == (facts["good_rows"], facts["last_good_time"])
    found = reading.read(reading.malformed("b05_header_repeated.csv"))
    assert [len(found.time(name)) for name in found.groups] == [300, 200]
    assert [f.where for f in found.findings if f.code == "repeated_header"] == ["line 302"]
    found = reading.read(reading.malformed("b06_time_not_monotonic.csv"))
    (finding,) = [f for f in found.findings if f.code == "time_not_increasing"]
    assert (finding.where, finding.severity) == ("line 202, line 401, line 601", 2)
    found, facts = _facts("b08_cp1254_turkish.csv")
    assert [c.name for c in found.group().channels] == facts["names"]
    (columns,) = found.data.values()
    assert [[c[0] for c in columns], [c[-1] for c in columns]] == [facts["first_row"], facts["last_row"]]
    with pytest.raises(Refusal, match="the file is empty"):
        reading.read(reading.malformed("b11_empty.csv"))
    found = reading.read(reading.malformed("b15_mixed_decimal.csv"))
    where = {f.code: f.where for f in found.findings if f.severity == 2}
    assert where["decimal_mark_changes"].startswith("lines 62, ")
    assert where["ambiguous_number"] == "lines 22, 82"
    assert np.isnan(found.column("Fy (N)")[[20, 80]]).all()
    found, facts = _facts("b16_saturated_16g.csv")
    (finding,) = [f for f in found.findings if f.code == "clipping"]
    assert finding.channel == "Acc X (g)"
    for number in (*facts["clipped"]["Acc X"].values(), facts["range_g"]):
        assert str(number) in finding.message
    assert len(found.column("Acc X (g)")) == facts["rows"]


@pytest.mark.recordings("malformed")
def test_tokens_that_are_no_numbers():
    """Ten cells, each named with line and token; no column becomes text; means are of finite values."""
    found, facts = _facts("b04_nan_inf_tokens.csv")
    messages = {f.channel: f.message for f in found.findings if f.code == "not_a_number"}
    for line, (channel, token) in facts["line_to_token"].items():
        shown = f"'{token}'" if token else "an empty cell"
        assert f"{shown} in line {line}" in messages[channel]
    assert [int(messages[name].split()[4]) for name in sorted(messages)] == list(facts["per_channel"].values())
    (check,) = found.checks.values()
    assert all(np.isfinite(stats.mean) for stats in check.stats)
    assert sum(stats.not_finite for stats in check.stats) == facts["unreadable_or_nonfinite"]


@pytest.mark.recordings("malformed")
def test_what_lies_outside_of_a_malformed_recording():
    """Three objects of another file, a link to nowhere, a circle; the two channels that are safe are kept."""
    found = reading.read(reading.malformed("b13_links_outside.h5"))
    by_code = {code: {f.channel for f in found.findings if f.code == code} for code in found.codes}
    assert by_code["outside_reference"] == {"/run1/acc_y_external", "/run1/acc_z_rawfile", "/run1/force_virtual"}
    assert (by_code["broken_link"], by_code["cyclic_link"]) == ({"/run1/torque_dangling"}, {"/run1/loop"})
    assert {c.name for c in found.group().channels} == {"acc_x", "time"}
    assert not np.isin(found.data[found.group().name], [424242.0, 31337.0]).any()
