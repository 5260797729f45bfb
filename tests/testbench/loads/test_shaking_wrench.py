"""Shaking wrench from a mixed set of force sensors: what it determines, and why it does not determine the rest."""

import numpy as np
import pytest

from balance import datasets
from studies import simulated_runs as memory
from testbench import rig as rigs
from testbench.errors import AnalysisError, RigError
from testbench.loads.shaking_wrench import COMPONENTS, shaking_wrench, without_preload
from testbench.runs.si_run import SIRun

TEXT = datasets.find_dataset("parallelogram-6bar", "rigs", ".toml").read_text("utf-8")


@pytest.fixture(scope="module")
def moved():
    """The x move with the counter-masses that were built."""
    return memory.scene("x")


def transmitted_wrench(scene, run, seed, point):
    """What really went through the supports at the forces' instants, about a point, (n, 6)."""
    start = scene.starts(seed)["forces"]
    time = start["start"] + run.time("forces") / (1.0 + 1e-6 * start["drift_ppm"])
    about = scene.bench.transmitted_wrench.copy()
    about[:, 3:] -= np.cross(point, about[:, :3])
    return np.column_stack([np.interp(time, scene.bench.time, v) for v in about.T])


@pytest.mark.parametrize("point", [(0.0, 0.0, 0.0), (0.3, -0.2, 0.1)])
def test_all_six_components_at_any_point(moved, point):
    """A 6-axis, a 3-axis and two 1-axis sensors add up to what the mechanism exerted, within their noise."""
    run = moved.run(0)
    found = shaking_wrench(SIRun.of(run, moved.rig), point)
    assert found.determined(COMPONENTS) == list(COMPONENTS)
    true = transmitted_wrench(moved, run, 0, np.array(point))
    for k, component in enumerate(COMPONENTS):
        error = found.values[component] - true[:, k]
        assert np.std(error) < (0.3 if component[0] == "F" else 0.1)
        assert abs(np.mean(error)) < 0.05
    assert not found.findings


@pytest.mark.parametrize("lost", [1, 3, 4, 40])
def test_samples_that_the_clock_left_out(moved, lost):
    """Few are interpolated, which is said, and what follows stays at its time; more are refused, and the gap named.

    Bridged, for who masks it, the rest is as without a gap.
    """
    run, rate = moved.run(0), moved.run(0).group("forces").rate_hz
    whole = shaking_wrench(SIRun.of(run, moved.rig))
    begin = whole.time[0] + (1000.0 - 0.5) / rate
    cut = SIRun.of(memory.without(run, "forces", begin, begin + lost / rate), moved.rig)
    outside = np.abs(np.arange(len(whole.time)) - 1000.0) > lost
    bridged = shaking_wrench(cut, bridged=True)
    np.testing.assert_allclose(bridged.time, whole.time, atol=1e-6)
    np.testing.assert_allclose(bridged.values["Fx"][outside], whole.values["Fx"][outside], atol=1e-3)
    if lost > 3:
        with pytest.raises(AnalysisError, match=rf"leaves out {lost} samples, .* after {whole.time[999]:.6g} s"):
            shaking_wrench(cut)
        return
    found = shaking_wrench(cut)
    np.testing.assert_array_equal(found.values["Fx"], bridged.values["Fx"])
    assert {f.code for f in found.findings} == {"time_gap"}
    assert found.findings[0].message.endswith("interpolated between the samples beside them")


def test_what_is_not_determined_is_none_with_the_reason(moved):
    """If the rig does not say that the side sensors carry no sideways force, Fx is unknown, and so are the moments."""
    rig = rigs.rig_from_text(TEXT.replace('unloaded = "rest"', 'unloaded = ["Mx", "My", "Mz"]'))
    found = shaking_wrench(SIRun.of(moved.run(0), rig))
    assert found.determined(COMPONENTS) == ["Fz", "Mx", "My"]
    assert found.values["Fx"] is None
    assert "futek_1 does not measure Fx" in found.reasons["Fx"]
    assert "unloaded" in found.reasons["Mz"]


def test_the_point_decides_what_a_lever_needs(moved):
    """An unknown Fy matters to Mx only about a point out of its plane."""
    rig = rigs.rig_from_text(TEXT.replace('unloaded = "rest"', 'unloaded = ["Mx", "My", "Mz"]'))
    run = moved.run(0)
    assert shaking_wrench(SIRun.of(run, rig), (0.1, 0.2, 0.0)).values["Mx"] is not None
    assert "Fy" in shaking_wrench(SIRun.of(run, rig), (0.1, 0.2, 0.1)).reasons["Mx"]


def test_crosstalk_is_taken_out(moved):
    """Readings = C loads: with C in the rig the loads come back as they were."""
    run, matrix = moved.run(0), np.array([[1.0, 0.03, 0.0], [-0.02, 1.0, 0.01], [0.0, 0.04, 1.0]])
    loads = np.column_stack([run.channel(c) for c in ("Fx2", "Fy2", "Fz2")])
    mixed = run
    for k, name in enumerate(("Fx2", "Fy2", "Fz2")):
        mixed = memory.with_values(mixed, name, loads @ matrix[k])
    rows = ", ".join(str([float(x) for x in row]) for row in matrix)
    rig = rigs.rig_from_text(TEXT.replace('model = "Kistler 9016-b"', f'model = "x"\ncrosstalk = [{rows}]'))
    plain, found = shaking_wrench(SIRun.of(run, moved.rig)), shaking_wrench(SIRun.of(mixed, rig))
    assert found.values["Fy"] == pytest.approx(plain.values["Fy"], abs=1e-9)


@pytest.mark.parametrize("matrix", ["[[1.0, 0.0], [0.0, 1.0]]", "[[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]]"])
def test_a_crosstalk_that_does_not_fit_is_refused(matrix):
    """A matrix of another size, or one that loses a load, is named by its key."""
    with pytest.raises(RigError, match="crosstalk"):
        rigs.rig_from_text(TEXT.replace('model = "Kistler 9016-b"', f'model = "x"\ncrosstalk = {matrix}'))


def test_a_measured_component_is_not_unloaded():
    """A rig that says both is refused."""
    with pytest.raises(RigError, match="unloaded names Fz"):
        rigs.rig_from_text(TEXT.replace('unloaded = "rest"', 'unloaded = ["Fz"]'))


def test_preload_and_drift_of_a_sensor_are_taken_off(moved):
    """A preload of 1800 N with a drift of 3 N/s leaves the shaking force as it was."""
    run = moved.run(0)
    drifting = memory.with_values(run, "Fz2", run.channel("Fz2") + 1800.0 + 3.0 * run.time("forces"))
    one, other = (shaking_wrench(SIRun.of(r, moved.rig)).values["Fz"] for r in (run, drifting))
    assert other == pytest.approx(one, abs=0.05)
    kept = shaking_wrench(SIRun.of(drifting, moved.rig), preload=True).values["Fz"]
    assert np.mean(kept) > 1790.0


def test_without_preload_uses_both_rests():
    """A straight line through both rests is removed exactly; with one rest, its mean."""
    line = np.column_stack([5.0 + 0.01 * np.arange(100), np.full(100, -2.0)])
    rest = (slice(0, 20), slice(80, 100))
    assert np.abs(without_preload(line, rest)).max() < 1e-12
    assert without_preload(line, (slice(0, 20), slice(100, 100)))[:20].mean(axis=0) == pytest.approx([0.0, 0.0])


def test_saturation_is_flagged(moved):
    """A sensor at the end of its range is a finding that names it."""
    run = moved.run(0)
    clipped = memory.with_values(run, "Fx1", np.clip(40.0 * run.channel("Fx1"), -500.0, 500.0))
    found = shaking_wrench(SIRun.of(clipped, moved.rig))
    assert [(f.code, f.channel) for f in found.findings] == [("clipping", "Fx1")]


def test_what_rests_on_a_clipped_sensor_is_no_number_there(moved):
    """Clipped stretches are no numbers in the components that rest on the sensor, and named in time."""
    run = moved.run(0)
    true = run.channel("Fz3")
    limit = 0.6 * float(np.abs(true).max())
    rig = rigs.rig_from_text(TEXT.replace('range = "1112 N"', f'range = "{limit} N"', 1))
    whole, found = (
        shaking_wrench(SIRun.of(memory.with_values(run, "Fz3", values), rig))
        for values in (0.5 * true, np.clip(true, -limit, limit))
    )
    over = np.abs(true) >= (1 - 1e-4) * limit
    assert not whole.clipped
    assert set(found.clipped) == {"Fz", "Mx", "My"}
    for component in ("Fz", "Mx", "My"):
        assert np.array_equal(np.isnan(found.values[component]), over)
    assert np.array_equal(found.values["Fx"], whole.values["Fx"])
    inside = np.zeros(len(true), dtype=bool)
    for first, last in found.clipped["Fz"]:
        inside |= (found.time >= first) & (found.time <= last)
    assert np.array_equal(inside, over)


def test_how_preload_is_taken_off_is_said(moved):
    """Rest on both sides: a line through both means; kept: nothing."""
    assert "before and" in shaking_wrench(SIRun.of(moved.run(0), moved.rig)).tare
    assert shaking_wrench(SIRun.of(moved.run(0), moved.rig), preload=True).tare.startswith("nothing")


def test_no_force_sensor_is_refused(moved):
    """A rig without supports measures no shaking force."""
    rig = moved.rig.model_copy(update={"sensors": dict(moved.rig.base_accelerometers)})
    with pytest.raises(AnalysisError, match="no force sensors"):
        shaking_wrench(SIRun.of(moved.run(0), rig))


def test_a_dead_force_sensor_leaves_no_number(moved):
    """One of two sensors that share Fx unplugged: half of Fx is not Fx. What rests on others alone stays as it was."""
    run = moved.run(0)
    dead = memory.with_values(run, "Fx1", np.zeros(len(run.channel("Fx1"))))
    whole, found = shaking_wrench(SIRun.of(run, moved.rig)), shaking_wrench(SIRun.of(dead, moved.rig))
    assert found.values["Fx"] is None
    assert "Fx1 shows one value only" in found.reasons["Fx"]
    assert "Mz" in found.reasons
    assert [f.code for f in found.findings] == ["constant_channel"]
    np.testing.assert_allclose(found.values["Fy"], whole.values["Fy"], atol=1e-9)


def test_flat_tops_below_the_stated_range_are_no_numbers():
    """An amplifier that ends at half of what passed, far below the sensor's range: what rests on it is no number."""
    scene = memory.scene("x", masses={})
    run = scene.run(0)
    assert not shaking_wrench(SIRun.of(run, scene.rig)).findings
    values = run.channel("Fx1")
    top = 0.5 * np.abs(values).max()
    found = shaking_wrench(SIRun.of(memory.with_values(run, "Fx1", np.clip(values, -top, top)), scene.rig))
    assert [f.code for f in found.findings] == ["clipping_suspected"]
    assert found.clipped["Fx"]
