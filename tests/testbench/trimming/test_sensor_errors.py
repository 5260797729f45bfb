"""What the sensors' stated errors leave open: in the interval where the rig states them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from balance.estimation import regression
from studies import simulated_runs as memory
from studies.trim import BENCHES, campaign
from testbench import rig as rigs
from testbench.rig.sensor_channels import sensitivity_scatter
from testbench.runs.aligned_run import AlignedRun
from testbench.runs.si_run import SIRun
from testbench.trimming import sensor_errors, trim_runs
from testbench.trimming.problem import RunEquations
from testbench.trimming.result import trim_document

MISSING = 0.0308090


@pytest.fixture(scope="module")
def deep():
    """Runs of three motions on the bench whose sensors have faults."""
    return [scene.run(k) for k, scene in enumerate(campaign("wrench", BENCHES["deep"]))]


@pytest.fixture(scope="module")
def aligned(manipulator, deep):
    """The same on one clock."""
    return memory.aligned(deep, manipulator)


@pytest.fixture(scope="module")
def found(aligned):
    """What their forces say."""
    return trim_runs(aligned, source="wrench")


def test_the_deep_bench(found):
    """Force sensors that are off by a per cent, as the rig says they may be: the interval holds, and says of what."""
    assert all(m.interval[0] < MISSING < m.interval[1] for m in found.missing)
    assert all(np.ptp(m.interval) < MISSING for m in found.missing)
    assert any(
        "calibration and cross-talk that rig and calibration state of base_acc, k6d40, kistler" in a
        for a in found.about
    )


def test_the_budget_is_the_interval(aligned):
    """Contributions of each source, noise and stated errors apart, add up to the interval of each site."""
    found = trim_runs(aligned, source=("wrench", "torque"))
    for one, budget in zip(found.missing, found.budgets, strict=True):
        assert budget.half_width == pytest.approx(one.first_moment.half_width(), rel=1e-6)
        assert sum(budget.shares) == pytest.approx(1.0)
        assert {part.source.partition(":")[0] for part in budget.contributions} >= {"force sensors"}
        assert [part.evaluation for part in budget.contributions].count("B") >= 1


def test_what_is_not_stated_is_not_in_the_interval(aligned, found):
    """By a rig that states no errors of its sensors the same runs give narrower intervals, which are not of 95 %."""
    rig = aligned[0].rig
    silent = rig.model_copy(update={"bench": rig.bench.model_copy(update={"errors": {}})})
    clocks = [{group: run.clock(group) for group in ("daq", "forces")} for run in aligned]
    runs = [AlignedRun(SIRun(r.run.recorded, silent), r.unloaded, c) for r, c in zip(aligned, clocks, strict=True)]
    unstated = trim_runs(runs, source="wrench")
    for wide, narrow in zip(found.missing, unstated.missing, strict=True):
        assert np.ptp(narrow.interval) < np.ptp(wide.interval)
    assert unstated.unexplained > found.unexplained
    assert unstated.verdict == "doubtful"
    assert trim_document(unstated)["interval_level"] is None


def test_a_stated_error_of_one_channel(deep):
    """Only what is stated counts; the uncertainty of a calibration takes the place of what the rig's bench states."""
    run = SIRun.of(deep[0])
    assert sensor_errors.stated_deviations(SIRun(deep[0], rigs.load_rig(memory.MANIPULATOR))) == {}
    text = run.rig.text.replace("[sensors.kistler]", '[sensors.kistler.calibration.uncertainty]\nexpanded = "6 %"\n'
                                "coverage_factor = 2\n[sensors.kistler]")  # fmt: skip
    certified = sensor_errors.stated_deviations(SIRun(deep[0], rigs.rig_from_text(text)))
    assert certified["kistler", 0, 0] == pytest.approx(0.03)
    assert certified["kistler", 0, 2] == pytest.approx(0.01)
    entries = sensor_errors.stated_deviations(run)
    assert entries["kistler", 0, 0] == pytest.approx(0.005)
    assert entries["kistler", 0, 2] == pytest.approx(0.01)
    assert ("futek_1", 0, 0) in entries
    assert ("encoder_A0", 0, 0) not in entries


def test_cross_talk_between_unlike_units_is_a_share_of_the_ranges():
    """Half a per cent of 20 N m shows as half a per cent of 500 N."""
    rig = rigs.load_rig("parallelogram-6bar-deep")
    sizes = sensitivity_scatter("k6d40", list(rig.sensors["k6d40"].columns("k6d40")), rig.bench.errors["k6d40"])
    assert sizes[0, 5] == pytest.approx(0.005 * 500.0 / 20.0)
    assert sizes[0, 1] == pytest.approx(0.005)
    assert np.diag(sizes) == pytest.approx(0.005)


def test_effects_are_of_what_the_channels_are_exposed_to():
    """An entry of a sensitivity matrix shows in one channel what another is exposed to."""
    columns = list(rigs.load_rig(memory.MANIPULATOR).sensors["base_acc"].columns("base_acc"))
    exposed = np.arange(12.0).reshape(4, 3)
    effect = sensor_errors.reading_effects(exposed, columns, {("base_acc", 1, 2): 0.02, ("other", 0, 0): 0.1})
    assert list(effect) == [("base_acc", 1, 2)]
    assert effect["base_acc", 1, 2][:, 1] == pytest.approx(exposed[:, 2])
    assert not effect["base_acc", 1, 2][:, [0, 2]].any()


def test_noise_is_not_explained_by_a_common_error_of_sensitivity():
    """Two sensors, 10 % of noise: a scale that both may share does not shrink what is found to shrink the residual."""
    rng, count, period = np.random.default_rng(1), 4000, 25.0
    column = rng.standard_normal((count, 1))
    shown = {name: 0.5 * column + 0.07 * rng.standard_normal((count, 1)) for name in ("front", "rear")}
    blocks = regression.equal_blocks(column[:, 0] ** 2, period, 20)
    record = regression.RegressionRecord.of(column[:, :, None], sum(shown.values()), blocks, rows=["Fx"])
    run = RunEquations(record, period, (), {(name, 0, 0): one for name, one in shown.items()})
    deviations, found = {entry: 0.02 for entry in run.effects}, []
    for _ in range(2):
        records, entries = sensor_errors.with_error_columns([record], [run.effects], [deviations])
        fit = regression.fit(records, np.r_[0.0, np.full(len(entries), 0.5 * period)], one_scale=1)
        found.append(fit.values[0])
        supports = dict.fromkeys(shown, SimpleNamespace(measured=("Fx",)))
        run = replace(run, effects=sensor_errors.without_residual(run, fit.residual()[0], supports))
    assert found[0] < 0.97
    assert found[1] == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)], ids=["rough first", "fine first"])
def test_the_better_calibration_counts_whatever_the_order(order):
    """A sensor 5 % wrong in the run whose calibration states 5 %, right in that of 0.1 %: the truth is the latter's."""
    rng, count, period, entry = np.random.default_rng(2), 2000, 25.0, ("scale", 0, 0)
    column = rng.standard_normal((count, 1))
    blocks = regression.equal_blocks(column[:, 0] ** 2, period, 20)
    scales, stated = (1.05, 1.0), ({entry: 0.05}, {entry: 0.001})
    records = [
        regression.RegressionRecord.of(
            column[:, :, None], scales[i] * column + 0.01 * rng.standard_normal((count, 1)), blocks, rows=["Fx"]
        )
        for i in order
    ]
    joined, _ = sensor_errors.with_error_columns(records, [{entry: column}] * 2, [stated[i] for i in order])
    found = regression.fit(joined, np.r_[0.0, 0.5 * period], one_scale=1)
    assert found.values[0] == pytest.approx(1.0, abs=0.002)
