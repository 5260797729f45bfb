"""What is missing by motor torque, by the base's vibration, by trial masses; from simulated runs with known truth."""

import json
from dataclasses import replace

import numpy as np
import pytest

from balance.arrays import frozen
from studies import simulated_runs as memory
from studies.laboratories import FAMILIES
from studies.trim import BENCHES
from testbench import rig as rigs
from testbench.errors import AnalysisError
from testbench.figures.estimates import draw_trim
from testbench.rig.sensors import Accelerometer
from testbench.runs.aligned_run import AlignedRun
from testbench.runs.si_run import SIRun
from testbench.trimming import trim_runs
from testbench.trimming.result import trim_document

from ..coverage import assert_holds
from .conftest import MOTIONS

MISSING = 0.0308090


@pytest.fixture(scope="module")
def both(aligned):
    """What forces and torques together say of the three runs."""
    return trim_runs(aligned)


def with_kinds(*kinds):
    """The bench's rig with sensors of some kinds alone."""
    rig = rigs.load_rig(memory.MANIPULATOR)
    return rig.model_copy(update={"sensors": {k: v for k, v in rig.sensors.items() if v.kind in kinds}})


def holds(found, widest):
    """Whether every interval holds the truth and is no wider than this [kg m]."""
    return all(m.interval[0] < MISSING < m.interval[1] < m.interval[0] + widest for m in found.missing)


def test_motor_torques(manipulator, runs):
    """Gravity turns what is missing: three motions tell it to a fiftieth of what the bare mechanism lacks."""
    found = trim_runs(memory.aligned(runs, manipulator, with_kinds("encoder", "torque")))
    assert found.source == "torque"
    assert holds(found, 0.05)
    assert any("taken from the mechanism's file" in line for line in found.about)


def test_a_torque_that_drifts_tells_the_same(manipulator, runs):
    """An offset of 3 N m and 2 N m/s in one drive's log are nuisances: equal to rounding, 1e-10 kg m."""
    rig, found = with_kinds("encoder", "torque"), []
    for drift in (0.0, 2.0):
        seen = []
        for run in runs:
            values = run.channel("tau1")
            slow = drift * (1.5 + np.arange(len(values)) / run.find("tau1")[0].rate_hz)
            seen.append(memory.with_values(run, "tau1", values + slow))
        found.append([m.first_moment.value for m in trim_runs(memory.aligned(seen, manipulator, rig)).missing])
    assert found[0] == pytest.approx(found[1], abs=1e-8)


def test_torque_scales_with_what_is_missing(manipulator):
    """Two kilograms less on one arm are found by torque, and only there."""
    less = {**memory.BUILT, "counter_A0A": memory.BUILT["counter_A0A"] - 2.0}
    found = trim_runs(
        memory.aligned([memory.scene(m, masses=less).run(k) for k, m in enumerate(MOTIONS)], manipulator),
        source="torque",
    )
    first, second = found.missing
    assert first.interval[0] < MISSING + 2.0 * 0.03755 < first.interval[1]
    assert second.interval[0] < MISSING < second.interval[1]


def test_a_joint_without_torque_is_refused(manipulator, runs):
    """Torques of one of two motors do not tell."""
    rig = rigs.load_rig(memory.MANIPULATOR)
    rig = rig.model_copy(update={"sensors": {k: v for k, v in rig.sensors.items() if k != "motor_B0"}})
    with pytest.raises(AnalysisError, match="no motor torque of joint B0"):
        trim_runs(memory.aligned(runs, manipulator, rig), source="torque")


def test_vibration_through_the_stated_base(manipulator, runs):
    """With the base that the rig states, its vibration tells best; that the base is assumed is said."""
    found = trim_runs(memory.aligned(runs, manipulator, with_kinds("encoder", "accelerometer")))
    assert found.source == "vibration"
    assert holds(found, 0.01)
    assert any("assumed" in line for line in found.about)
    assert found.verdict == "add"


@pytest.mark.parametrize("at_rest", [True, False])
def test_noise_that_the_rest_shows_is_no_doubt(manipulator, runs, aligned, at_rest):
    """Loud accelerometers, by clocks that are known: what they read at rest is in the intervals. As much in the motion
    alone is a doubt.
    """
    rng, rig, shaken = np.random.default_rng(1), rigs.load_rig(memory.MANIPULATOR), []
    for run, clocks in zip(runs, ({g: one.clock(g) for g in ("daq", "forces")} for one in aligned), strict=True):
        for column in rig.columns_of(Accelerometer):
            values = run.channel(column.channel)
            noise = 4.0 * np.std(values) * rng.normal(size=len(values))
            moving = np.flatnonzero(np.abs(values) > 0.2 * np.abs(values).max())
            noise[: 0 if at_rest else moving[0]] = 0.0
            run = memory.with_values(run, column.channel, values + noise)
        shaken.append(AlignedRun(SIRun.of(run), manipulator, clocks))
    found = trim_runs(shaken, source="vibration")
    assert found.unexplained > 0.3
    assert (found.verdict == "doubtful") is not at_rest
    assert [share.is_noise for share in found.shares] == [at_rest]
    assert holds(found, 0.1)


def test_what_was_measured_was_measured_in_gravity(manipulator, runs):
    """A rig without ``weight`` is doubtful for runs that are not simulated."""
    measured = [replace(run, origin="measured") for run in runs[:1]]
    found = trim_runs(memory.aligned(measured, manipulator, with_kinds("encoder", "accelerometer")))
    assert found.verdict == "doubtful"
    assert "weight = true" in found.doubts()[0]


@pytest.mark.parametrize("in_file", [1.0, 1.05], ids=["true file", "heavy file"])
@pytest.mark.parametrize("mounted", [{"masses": {}}, {}], ids=["bare", "as built"])
def test_inertia_that_moves_is_counted(manipulator, mounted, in_file):
    """On a base of 30 kg, of whose inertia much moves: with nothing mounted as with all, what is missing is right.

    So it is where the file's bodies are 5 % too heavy.
    """
    light = {
        "[bench]": '[bench]\ncoupling = "moving"',
        '"90 kg"': '"30 kg"',
        '["13 ': '["4 ',
        '"11 ': '"3 ',
        '"9 kg': '"3 kg',
    }
    text = BENCHES["other"].text
    for old, new in light.items():
        text = text.replace(old, new)
    rig = rigs.rig_from_text(text)
    seen = [memory.scene(motion, rig=rig, **mounted).run(k) for k, motion in enumerate(MOTIONS)]
    file = replace(manipulator, parameters=frozen(in_file * manipulator.parameters))
    found = trim_runs(memory.aligned(seen, file), source="vibration")
    assert not found.doubts()
    for one, kilograms in zip(found.missing, memory.BUILT.values(), strict=True):
        true = MISSING + 0.03755 * kilograms * bool(mounted)
        assert one.interval[0] < true < one.interval[1] < one.interval[0] + 0.01


def test_intervals_of_vibration_hold(manipulator):
    """Over seeds of noise and clocks, on another bench, which its bodies' weight tilts: as often as 95 % promises."""
    weighed = rigs.rig_from_text(BENCHES["other"].text.replace("[bench]", "[bench]\nweight = true"))
    scenes = [memory.scene(motion, rig=weighed) for motion in MOTIONS]
    runs = [[scene.run(1000 * seed + k) for k, scene in enumerate(scenes)] for seed in range(2)]
    found = [trim_runs(memory.aligned(one, manipulator), source="vibration").missing for one in runs]
    for arm in range(2):
        hits = [one[arm].interval[0] <= MISSING <= one[arm].interval[1] for one in found]
        assert_holds(sum(hits), len(hits))
        assert max(np.ptp(one[arm].interval) for one in found) < 0.25 * MISSING


def test_vibration_without_a_stated_base_is_refused(manipulator, runs):
    """A rig that states no base: refused, and trial masses are proposed."""
    rig = rigs.load_rig(memory.MANIPULATOR)
    silent = rigs.rig_from_text(rig.text[: rig.text.index("[bench]")])
    with pytest.raises(AnalysisError, match=r"does not state the base.*trial masses"):
        trim_runs(memory.aligned(runs[:1], manipulator, silent), source="vibration")


def test_sources_together(both):
    """Forces and torques agree; together they are no less sure than the surer."""
    assert both.source == "wrench+torque"
    assert both.consensus.agrees
    assert holds(both, 0.01)
    for k, one in enumerate(both.missing):
        alone = [np.ptp(share.missing[k].interval) for share in both.shares]
        assert np.ptp(one.interval) < 1.2 * min(alone)


def test_sources_that_contradict(manipulator, runs):
    """Torques of a bench with 6 kg less on an arm beside forces of the one that was built: said, and doubtful."""
    less = {**memory.BUILT, "counter_A0A": memory.BUILT["counter_A0A"] - 6.0}
    mixed = []
    for k, (motion, run) in enumerate(zip(MOTIONS, runs, strict=True)):
        other = memory.scene(motion, masses=less).run(k)
        for name in ("tau1", "tau2"):
            run = memory.with_values(run, name, other.channel(name))
        mixed.append(run)
    found = trim_runs(memory.aligned(mixed, manipulator))
    assert found.verdict == "doubtful"
    assert "contradict" in found.doubts()[0]


@pytest.fixture(scope="module")
def trials():
    """Each motion with what was built, a kilogram more on the first arm, and on the second."""
    more = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]
    sets = [{s: m + d for (s, m), d in zip(memory.BUILT.items(), one, strict=True)} for one in more]
    scenes = [memory.scene(motion, masses=masses) for masses in sets for motion in MOTIONS]
    return [scene.run(k) for k, scene in enumerate(scenes)]


@pytest.fixture(scope="module")
def balanced(manipulator, aligned):
    """Three runs of the balanced mechanism, by clocks that are known: its forces show nothing to align them by."""
    masses = {site: mass + MISSING / 0.03755 for site, mass in memory.BUILT.items()}
    clocks = [{group: run.clock(group) for group in ("daq", "forces")} for run in aligned]
    runs = [SIRun.of(memory.scene(motion, masses=masses).run(k)) for k, motion in enumerate(MOTIONS)]
    return [AlignedRun(*one) for one in zip(runs, [manipulator] * 3, clocks, strict=True)]


def test_a_balanced_mechanism_is_called_so(balanced):
    """Noise is all that its forces show: most of them stays unexplained, which is no doubt; nothing is to be added."""
    found = trim_runs(balanced, source="wrench")
    assert found.doubts() == []
    assert found.unexplained > 0.5
    assert found.verdict == trim_document(found)["verdict"] == "balanced"
    assert found.residual_share < 0.01
    untold = replace(found.imbalance, excited=found.imbalance.excited[:0])
    assert replace(found, imbalance=untold).verdict != "balanced"  # though by its file it is


def test_a_balanced_mechanism_of_which_no_rest_tells(balanced):
    """What stays unexplained would leave it balanced were all of it imbalance: no doubt, and part of what is left."""
    whole = trim_runs(balanced, source="wrench")
    (share,) = whole.shares
    short = replace(whole, shares=(replace(share, over_rest=np.inf),))
    assert short.verdict == "balanced"
    assert short.residual_share == pytest.approx(whole.residual_share + share.of_unbalanced)
    much = replace(whole, shares=(replace(share, over_rest=np.inf, of_unbalanced=0.01),))
    assert much.verdict == "doubtful"
    as_rest = replace(whole, shares=(replace(share, unexplained=0.4, over_rest=1.0, of_unbalanced=0.5),))
    assert as_rest.doubts() == []  # noise, and all of it in the intervals


def test_nothing_is_added_to_a_balanced_mechanism(balanced):
    """Sites that lack, or have too much of, a thousandth for certain: the residual that is predicted is that of nothing
    added."""
    found = trim_runs(balanced, source="wrench")
    for sign in (-1.0, 1.0):
        sizes = np.linalg.norm(found.conditions.lacking @ found.imbalance.values, axis=1)
        moved = sign * 0.003 * found.unbalanced * found.imbalance.values / sizes.max()
        sure = replace(found.imbalance, values=moved, covariance=1e-12 * found.imbalance.covariance)
        certain = replace(found, imbalance=sure, missing=tuple(sure.missing(found.mechanism, ("counter_A0A",))))
        shown = trim_document(certain)
        assert certain.missing[0].is_significant
        assert (shown["verdict"], shown["add"], shown["remove"]) == ("balanced", [], [])
        assert shown["predicted_residual_kgm"] == pytest.approx(0.003 * found.unbalanced)
        assert certain.remaining()[0].first_moment.value == certain.missing[0].first_moment.value


def test_trial_masses(manipulator, trials):
    """Nothing is known of the base: trial masses of a kilogram tell what is missing on the first run's mounting."""
    silent = rigs.rig_from_text(rigs.load_rig(memory.MANIPULATOR).text.split("[bench]")[0])
    found = trim_runs(memory.aligned(trials, manipulator, silent))
    assert found.source == "trials"
    assert all(m.interval[0] < MISSING < m.interval[1] for m in found.missing)
    assert all(np.ptp(m.interval) < 0.5 * MISSING for m in found.missing)
    json.dumps(trim_document(found))


def test_clocks_of_trials_may_start_anywhere(manipulator, trials):
    """Loggers that count from other instants, each run from its own: nothing changes but rounding of seconds."""
    shown = []
    for apart in (0.0, 37.25):
        moved = [memory.started_at(run, apart * k) for k, run in enumerate(trials)]
        shown.append([m.first_moment.value for m in trim_runs(memory.aligned(moved, manipulator)).missing])
    assert shown[0] == pytest.approx(shown[1], abs=1e-6)


def test_trial_masses_in_loud_noise_are_doubtful(manipulator, trials):
    """A floor half as loud as the vibration: what is missing may be found too small, which is said."""
    noisy = [memory.disturbed(run, FAMILIES["floor"], 0.5, k) for k, run in enumerate(trials)]
    found = trim_runs(memory.aligned(noisy, manipulator), source="trials")
    assert found.verdict == "doubtful"
    assert found.interval_level is None
    assert "stays unexplained" in found.doubts()[0]


def test_an_arm_without_trial_mass_is_named(manipulator, trials):
    """Trial masses on one arm alone do not determine the other: the one without is named, and no other."""
    for runs, without in ((trials[:6], "counter_B0B"), (trials[:3] + trials[6:], "counter_A0A")):
        with pytest.raises(AnalysisError, match=f"the mass at {without} does not differ independently"):
            trim_runs(memory.aligned(runs, manipulator))


def test_a_trial_mass_that_was_not_recorded_is_refused(manipulator, trials):
    """A run whose conditions do not say what was mounted cannot be a trial."""
    forgotten = replace(trials[3], conditions={k: v for k, v in trials[3].conditions.items() if k != "counter_masses"})
    with pytest.raises(AnalysisError, match="do not say which masses were mounted"):
        trim_runs(memory.aligned([*trials[:3], forgotten, *trials[6:]], manipulator), source="trials")


def test_the_figure(both):
    """A panel an arm; the points are the sources', both together, and what the plates leave."""
    figure = draw_trim(both)
    assert len(figure.axes) == 2
    assert [t.get_text() for t in figure.axes[0].get_xticklabels()] == ["wrench", "torque", "all", "with what is added"]


def test_the_predicted_residual_has_an_interval(both):
    """What is added leaves nothing of what is told, up to what the intervals leave open."""
    low, high = both.predicted_residual_interval
    assert low == 0.0
    assert both.predicted_residual < high < 0.2 * MISSING
    untold = replace(both, missing=())  # no site lacks anything for certain: none is left that is above zero
    assert untold.predicted_residual_interval[0] == 0.0 < 0.5 * MISSING < untold.predicted_residual
    left = both.remaining()
    assert all(m.interval[0] < 0.0 < m.interval[1] for m in left)
