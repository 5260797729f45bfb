"""A run in SI: raw values stay raw; what is computed is what the sensor felt, by the rig or by a later record."""

import hashlib
import json
import re

import numpy as np
import pytest

from studies import simulated_runs as memory
from testbench import rig as rigs
from testbench.calibration.definition import Calibration
from testbench.errors import AnalysisError, RigError, StoreError
from testbench.export import export
from testbench.ingestion import Ingest
from testbench.ingestion.planned_runs import PlannedRun
from testbench.loads.shaking_wrench import shaking_wrench
from testbench.readers import open_recording
from testbench.runs.joined_channels import joined_table
from testbench.runs.recalibrate import calibrate
from testbench.runs.si_run import SIRun, physical
from testbench.store import append_only_records, open_campaign, open_run

from ..calibration import volts


def column(run, sensor="acc", index=0):
    """A channel of a sensor, as the run's rig has it."""
    return list(SIRun.of(run).rig.sensors[sensor].columns(sensor))[index]


def test_volts_stay_and_accelerations_are_computed(tmp_path):
    """The dataset holds the logger's volts to the bit; in SI it is the acceleration that was put on."""
    run = volts.stored(tmp_path, volts.HEAD + volts.SENSITIVITY)
    assert run.channel("ch0")[0] == 2.5
    values, rate = SIRun.of(run).signal(column(run))
    assert rate == pytest.approx(1000.0)
    np.testing.assert_allclose(values, volts.ACCELERATION, atol=1e-9)


def test_the_unit_that_the_log_does_not_write(tmp_path):
    """The rig's unit, or the calibration's, says it; where nobody does, it is refused at ingest and not guessed."""
    rig = volts.HEAD + volts.SENSITIVITY
    run = volts.stored(tmp_path, rig.replace("[sensors.acc]", '[sensors.acc]\nunit = "V"'), unit=None)
    np.testing.assert_allclose(SIRun.of(run).values(column(run)), volts.ACCELERATION, atol=1e-9)
    assert joined_table(run, "500 Hz")[0].attrs["units"]["ch0"] == "V"
    (outcome,) = Ingest(tmp_path / "c2", rigs.load_rig(rig)).run(PlannedRun("r1", (tmp_path / "r1.csv",)))
    assert [f.code for f in outcome.findings if f.severity == 2] == ["calibration_contradiction"]
    assert "neither in its log nor in the rig" in outcome.message or "no unit" in outcome.findings[-1].message


@pytest.mark.parametrize(
    ("unit", "calibration", "said"),
    [
        ("m/s^2", 'sensitivity = "100 mV/g"', "takes a log in V, this one is in"),
        ("V", 'sensitivity = "4 pC/g"', "takes a log in C"),
        ("V", 'sensitivity = "100 mV/g"\nunit = "mV"', "correct one"),
    ],
)
def test_a_calibration_that_contradicts_the_log(tmp_path, unit, calibration, said):
    """It is found at ingest, with both sides."""
    planned = PlannedRun("r1", (volts.log(tmp_path, unit=unit),))
    rig = rigs.load_rig(f"{volts.HEAD}[sensors.acc.calibration]\n{calibration}\n")
    (outcome,) = Ingest(tmp_path / "c", rig).run(planned)
    (found,) = [f for f in outcome.findings if f.code == "calibration_contradiction"]
    assert outcome.status == "refused"
    assert said in found.message


def test_what_no_sensor_shows_is_named(tmp_path):
    """A reading of 1e295 m/s2 is refused by run, channel and sample, not met as an overflow further on."""
    run = volts.stored(tmp_path, volts.HEAD + '[sensors.acc.calibration]\nsensitivity = "1e-290 mV/g"\n', unit="V")
    with pytest.raises(AnalysisError, match=r"r1: channel .* holds .*e\+2\d\d SI, which nothing measures, at sample"):
        SIRun.of(run).values(column(run))


def changed(tmp_path, places, how):
    """The stored run of a log in which the lines of some samples are changed, or left out."""
    log = volts.log(tmp_path)
    head, *lines = log.read_text("utf-8").splitlines()
    lines = [how(line) if i in places else line for i, line in enumerate(lines)]
    log.write_text("\n".join([head, *filter(None, lines)]) + "\n", "utf-8")
    rig = rigs.load_rig(volts.HEAD + volts.SENSITIVITY)
    (outcome,) = Ingest(tmp_path / "campaign", rig).run(PlannedRun("r1", (log,)))
    assert outcome.status == "stored"
    return SIRun.of(open_run(tmp_path / "campaign" / "r1.h5"))


@pytest.mark.parametrize(
    ("lost", "refusal"),
    [
        ([69], None),
        ([69, 140, 141], None),
        ([69, 70, 71, 72], "the clock of channel 'ch0' leaves out 4 samples, 0.004 s, after 0.068 s; more than 3"),
        (
            [50, 69, 140, 200],
            "the clock of channel 'ch0' leaves out 1 sample, 0.001 s, after 0.049 s, and 3 more, above 0.1%",
        ),
        ([69, 107], "after 0.106 s, beside its largest readings, where the largest may be missing: export the log"),
    ],
)
def test_lines_that_the_log_lacks_are_interpolated_or_refused(tmp_path, lost, refusal):
    """What follows them stays at its time: a signal has even steps, also where the log has none."""
    run = changed(tmp_path, lost, lambda line: "")
    one = column(run.recorded)
    assert len(run.values(one)) == len(volts.ACCELERATION) - len(lost)
    if refusal:
        with pytest.raises(AnalysisError, match=re.escape(refusal)):
            run.signal(one)
        return
    curvature = 9.81 * (2.0 * np.pi * 7.0) ** 2
    np.testing.assert_allclose(run.signal(one)[0], volts.ACCELERATION, atol=0.003**2 / 8.0 * curvature)
    (said,) = run.doubts([one])
    assert (said.code, said.message.endswith("interpolated between the samples beside them")) == ("time_gap", True)
    np.testing.assert_allclose(run.even_instants(one), np.arange(len(volts.ACCELERATION)) / 1000.0, atol=1e-9)


def test_what_was_accepted_is_said(tmp_path):
    """A run that is stored for somebody's acceptance says so wherever its channels are used."""
    log = volts.log(tmp_path)
    head, *lines = log.read_text("utf-8").splitlines()
    lines[100], lines[101] = lines[101], lines[100]
    log.write_text("\n".join([head, *lines]) + "\n", "utf-8")
    rig = rigs.load_rig(volts.HEAD + volts.SENSITIVITY)
    (stored,) = Ingest(tmp_path / "c", rig, accepted=frozenset({"time_not_increasing"})).run(PlannedRun("r1", (log,)))
    assert stored.status == "stored"
    run = SIRun.of(open_run(tmp_path / "c" / "r1.h5"))
    said = {f.code: f.message for f in run.doubts([column(run.recorded)])}
    assert said["time_not_increasing"].endswith("accepted when it was stored")


@pytest.mark.parametrize(
    ("missing", "refusal"),
    [
        ([69], None),
        ([69, 140, 141], None),
        ([69, 70, 71, 72], "at samples 69 to 72, more than 3 in a row"),
        ([0, 1, 2, 3], "at samples 0 to 3, at the beginning or end .* invented: cut these rows off the log: correct"),
        ([0, 69, 70, 71, 72], "at samples 69 to 72, more than 3 in a row"),
        ([5, 399], "at sample 399, at the beginning or end"),
        ([398, 399], "at samples 398 to 399, at the beginning or end"),
        ([50, 69, 140, 200], "at sample 50, and at 3 more, above 0.1% of them"),
        ([69, 107], "at sample 107, beside its largest readings, where an overload may be hidden"),
    ],
)
def test_what_is_missing_is_interpolated_or_refused(tmp_path, missing, refusal):
    """Few samples away from the peaks: off by what a straight line is (h^2 / 8 times the curvature), and said so."""
    run = changed(tmp_path, missing, lambda line: re.sub(r",[^,]*", ",---", line, count=1))
    if refusal:
        with pytest.raises(AnalysisError, match=f"r1: channel 'ch0' holds no number {refusal}"):
            run.values(column(run.recorded))
        return
    curvature = 9.81 * (2.0 * np.pi * 7.0) ** 2
    np.testing.assert_allclose(run.values(column(run.recorded)), volts.ACCELERATION, atol=0.003**2 / 8.0 * curvature)
    assert np.isnan(run.readings(column(run.recorded))[missing]).all()
    (said,) = run.doubts([column(run.recorded)])
    assert said.message.endswith("interpolated between the samples beside them")


@pytest.mark.parametrize("count", [1, 2, 3])
def test_what_is_missing_at_an_end_is_left_out(tmp_path, count):
    """As if the log had no such rows: nothing is invented, and it is said; what is stored stays as long as it is."""
    places, runs = range(count), list[SIRun]()
    for name, how in (("empty", lambda line: re.sub(r",[^,]*", ",", line, count=1)), ("without", lambda line: "")):
        (tmp_path / name).mkdir()
        runs.append(changed(tmp_path / name, places, how))
    empty, without = runs
    one = column(empty.recorded)
    np.testing.assert_array_equal(empty.values(one), without.values(one))
    np.testing.assert_array_equal(empty.instants(one), without.instants(one))
    np.testing.assert_allclose(empty.values(one), volts.ACCELERATION[count:], atol=1e-9)
    (said,) = empty.doubts([one])
    assert said.message.endswith("; left out at the ends of the record, as are the logger's other channels there")
    (tmp_path / "both").mkdir()
    both = changed(tmp_path / "both", [*places, 50], lambda line: re.sub(r",[^,]*", ",", line, count=1))
    (said,) = both.doubts([column(both.recorded)])
    assert "; left out at the ends" in said.message
    assert said.message.endswith("; interpolated between the samples beside them")
    kept = physical(empty.recorded).channel("ch0")
    assert np.isnan(kept[:count]).all()
    np.testing.assert_array_equal(kept[count:], empty.values(one))
    window = empty.preloaded([one], 0, 10).readings(one)
    np.testing.assert_array_equal(window, kept[:10])


def test_six_axes(tmp_path):
    """The matrix gives back the six loads, in N and N m, also to the analysis of the shaking wrench."""
    run = volts.stored(tmp_path, volts.HEAD + volts.SENSITIVITY + volts.SIX + volts.MATRIX)
    for i in range(6):
        np.testing.assert_allclose(SIRun.of(run).values(column(run, "six", i)), volts.LOADS[i], atol=1e-7)
    wrench = shaking_wrench(SIRun.of(run), preload=True)
    for i, name in enumerate(volts.NAMES):
        np.testing.assert_allclose(wrench.values[name], volts.LOADS[i], atol=1e-7)


def test_a_matrix_goes_before_the_crosstalk_of_the_rig(tmp_path):
    """The rig's crosstalk is not taken out a second time: a recorded matrix takes its place."""
    rows = str((np.eye(6) + 0.1).tolist())
    rig = volts.HEAD + volts.SENSITIVITY + volts.SIX + f'unit = "V"\ncrosstalk = {rows}\n'
    run = volts.stored(tmp_path, rig)
    matrix = {"raw": "V", "physical": {"F": "N", "M": "N m"}, "rows": volts.PER_VOLT.tolist()}
    calibrate([run], "six", Calibration.model_validate({"matrix": matrix}), "delivered with the sensor")
    wrench = shaking_wrench(SIRun.of(run), preload=True)
    np.testing.assert_allclose(wrench.values["Mz"], volts.LOADS[5], atol=1e-7)
    np.testing.assert_allclose(SIRun.of(run).loads(column(run, "six", 5)), volts.LOADS[5], atol=1e-7)


def test_a_correction_is_a_later_record(tmp_path):
    """From 100 to 50 mV/g: accelerations double, raw values, the run's bytes and the older record stay."""
    run = volts.stored(tmp_path, volts.HEAD + volts.SENSITIVITY)
    before = hashlib.sha256(run.path.read_bytes()).hexdigest()
    first = calibrate([run], "acc", Calibration(sensitivity="200 mV/g", offset="2.5 V"), "typing error")
    old = first.record.read_bytes()
    np.testing.assert_allclose(SIRun.of(run).values(column(run)), volts.ACCELERATION / 2.0, atol=1e-9)
    calibrate([run], "acc", Calibration(sensitivity="50 mV/g", offset="2.5 V", date="2026-03-31"), "certificate 12")
    np.testing.assert_allclose(SIRun.of(run).values(column(run)), 2.0 * volts.ACCELERATION, atol=1e-9)
    assert run.channel("ch0")[0] == 2.5
    assert hashlib.sha256(run.path.read_bytes()).hexdigest() == before
    assert first.record.read_bytes() == old
    assert {state.status for state in open_campaign(run.path.parent).verify()} == {"intact"}


def test_a_sensor_without_calibration_gets_one_later(tmp_path):
    """Volts without a calibration are stored, flagged and refused by analyses, until a record says what they are."""
    run = volts.stored(tmp_path, volts.HEAD)
    assert [f.code for f in run.findings if f.severity == 1] == ["uncalibrated"]
    with pytest.raises(AnalysisError, match="testbench calibrate"):
        SIRun.of(run).signal(column(run))
    calibrate([run], "acc", Calibration(sensitivity="100 mV/g", offset="2.5 V"), "sheet found")
    np.testing.assert_allclose(SIRun.of(run).values(column(run)), volts.ACCELERATION, atol=1e-9)
    assert SIRun.of(run).doubts([column(run)]) == []


def test_tables_in_si(tmp_path):
    """``physical`` gives SI with its unit and says by which calibration; without it all is as recorded."""
    run = volts.stored(tmp_path, volts.HEAD + volts.SENSITIVITY)
    calibrate([run], "acc", Calibration(sensitivity="100 mV/g", offset="2.5 V"), "yearly")
    raw, table = run.to_pandas(), physical(run).to_pandas()
    assert (raw["ch0 (V)"].iloc[0], "calibrations" in raw.attrs) == (2.5, False)
    np.testing.assert_allclose(table["ch0 (m/s^2)"], volts.ACCELERATION, atol=1e-9)
    assert table.attrs["units"] == {"ch0 (m/s^2)": "m/s^2"} | {f"ch{i} (V)": "V" for i in range(1, 7)}
    (held,) = json.loads(table.attrs["calibrations"])
    assert (held["sensor"], held["calibration"], held["reason"]) == ("acc", "100 mV/g, offset 2.5 V", "yearly")
    data = physical(run).to_xarray()
    joined = physical(run).to_pandas(resample="10 Hz")
    assert [one.attrs.get("g0_m_per_s2") for one in (raw, table, joined, data)] == [None, 9.81, 9.81, 9.81]
    assert data["ch0"].attrs["units"] == "m/s^2"
    np.testing.assert_array_equal(data["ch0"], table["ch0 (m/s^2)"])
    np.testing.assert_array_equal(data["ch1"], run.channel("ch1"))


@pytest.mark.parametrize("form", ["csv", "parquet", "mat", "uff"])
def test_exports_in_si(tmp_path, form):
    """Each form takes the view in SI as it takes a run."""
    run = volts.stored(tmp_path, volts.HEAD + volts.SENSITIVITY)
    (written,) = export(physical(run), form, tmp_path / "out")
    recording = open_recording(written.file)
    names = [channel.name for group in recording.groups for channel in group.channels]
    units = [channel.unit for group in recording.groups for channel in group.channels]
    columns = next(iter(recording.blocks(lambda finding: None))).columns
    place = next(i for i, name in enumerate(names) if "ch0" in name)
    assert units[place] in {"m/s^2", None} if form == "mat" else units[place] == "m/s^2"
    np.testing.assert_allclose(columns[place], volts.ACCELERATION, atol=1e-9)


@pytest.mark.parametrize(
    ("sensor", "calibration", "said"),
    [
        ("acx", {"sensitivity": "1 mV/g"}, "did you mean 'acc'"),
        ("acc", {"sensitivity": "1 mV/N"}, "no acceleration"),
        ("acc", {"sensitivity": {"z": "1 mV/g"}}, "no component 'z'"),
        ("acc", {"sensitivity": "1 mV/g", "unit": "mV"}, "correct one"),
    ],
)
def test_a_correction_that_does_not_fit_is_not_recorded(tmp_path, sensor, calibration, said):
    """It is refused before anything is written."""
    run = volts.stored(tmp_path, volts.HEAD)
    with pytest.raises(RigError, match=said):
        calibrate([run], sensor, Calibration.model_validate(calibration), "why")
    with pytest.raises(RigError, match="reason"):
        calibrate([run], "acc", Calibration(sensitivity="1 mV/g"), " ")
    assert not (run.path.parent / append_only_records.FOLDER).exists()


@pytest.mark.parametrize(("old", "new"), [("100 mV", "900 mV"), ('"acc"', '"bcc"'), ("yearly", "daily"), ("}", "")])
def test_a_damaged_record_is_refused(tmp_path, old, new):
    """A digit that changed in a record is noticed, and the file named: no analysis goes on with it."""
    run = volts.stored(tmp_path, volts.HEAD + volts.SENSITIVITY)
    done = calibrate([run], "acc", Calibration(sensitivity="100 mV/g"), "yearly")
    done.record.write_text(done.record.read_text("utf-8").replace(old, new), encoding="utf-8")
    with pytest.raises(StoreError, match=done.record.name):
        SIRun.of(run).signal(column(run))


def test_a_record_about_other_bytes_is_refused(tmp_path):
    """A run that was replaced under its name is not calibrated by what was recorded of the old one."""
    run = volts.stored(tmp_path, volts.HEAD + volts.SENSITIVITY)
    calibrate([run], "acc", Calibration(sensitivity="200 mV/g", offset="2.5 V"), "yearly")
    for name in ("r1.h5", "r1.h5.sha256"):
        (run.path.parent / name).unlink()
    again = volts.stored(tmp_path, volts.HEAD + volts.SENSITIVITY + volts.SIX)
    with pytest.raises(StoreError, match=r"other bytes of r1\.h5"):
        SIRun.of(again).signal(column(again))
    calibrate([again], "acc", Calibration(sensitivity="100 mV/g", offset="2.5 V"), "of the new run")
    np.testing.assert_allclose(SIRun.of(open_run(again.path)).values(column(again)), volts.ACCELERATION, atol=1e-9)


@pytest.fixture(scope="module")
def recorded():
    """The manipulator's run along x, in memory."""
    return memory.scene("x").run(0)


def test_a_channel_is_computed_once(recorded):
    """The same array each time, and nobody can change it for the others."""
    run = SIRun.of(recorded)
    (first, *_) = run.rig.base_columns
    assert run.values(first) is run.values(first)
    with pytest.raises(ValueError, match="read-only"):
        run.values(first)[0] = 0.0


def test_channels_in_memory_are_the_same(tmp_path):
    """Read in one opening of the file, or one by one: the same values to the bit."""
    run = SIRun.of(volts.stored(tmp_path, volts.HEAD + volts.SENSITIVITY + volts.SIX + volts.MATRIX))
    columns = list(run.rig.columns())
    for one in columns:
        np.testing.assert_array_equal(run.preloaded(columns).values(one), run.values(one))


def test_the_rig_that_is_given_goes_before_the_one_stored(recorded):
    """What is of which sensor is said by it; the run stays as it is."""
    deep = rigs.load_rig("parallelogram-6bar-deep")
    run = SIRun.of(recorded, deep)
    assert (run.rig, run.recorded) == (deep, recorded)


@pytest.mark.parametrize(("factor", "clips"), [(1.0, False), (40.0, True)])
def test_samples_at_the_end_of_the_range_are_masked(recorded, factor, clips):
    """Those and no others, and a finding says how many."""
    values = np.clip(factor * recorded.channel("Fx1"), -500.0, 500.0)
    run = SIRun.of(memory.with_values(recorded, "Fx1", values))
    (column,) = [c for c in run.rig.columns() if c.channel == "Fx1"]
    np.testing.assert_array_equal(run.clipped(column), np.abs(values) >= (1.0 - 1e-4) * 500.0)
    assert (run.saturation(column) is not None) is clips


def test_a_dead_channel_is_told(recorded):
    """One value throughout."""
    run = SIRun.of(memory.with_values(recorded, "Fz3", np.full(recorded.group("forces").samples, 3.0)))
    dead = [column.channel for column in run.rig.columns() if run.is_dead(column)]
    assert "Fz3" in dead
    assert "Fz4" not in dead
