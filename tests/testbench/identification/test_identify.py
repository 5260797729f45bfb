"""Identification of simulated arms with known parameters: what it finds, how sure it is, what it may not look at."""

from dataclasses import replace

import numpy as np
import pytest

from balance.balancing.conditions import balance_conditions
from balance.balancing.sizing import exact_sizing
from balance.estimation.identifiability import NotIdentifiable
from balance.mechanism.mjcf_parser import load_mechanism
from testbench.errors import AnalysisError
from testbench.identification import STEPS, identify
from testbench.identification.result import validate

from . import arms

ARM = load_mechanism("two-joint-arm-a0")
MOMENTS = ({"mcx[link_1]": 1.0, "m[link_2]": 0.3}, {"mcx[link_2]": 1.0})


@pytest.fixture(scope="module")
def result():
    """An arm whose torques are logged 10 ms before the motion, as in one of the real recordings."""
    return identify([arms.record(ARM, seed=3, delay=-0.01)], ARM)


def test_first_moments_of_a_known_arm(result):
    """Both first moments within 2 % of the truth and inside their intervals, those inside 15 %."""
    for moment, value in zip(MOMENTS, (0.34912, 0.11106), strict=True):
        found = result.value(moment)
        assert found.value == pytest.approx(value, rel=0.02)
        assert found.interval[0] < value < found.interval[1]
        assert found.interval[1] - found.interval[0] < 0.3 * value


def test_delay_is_found(result):
    """Torques logged 10 ms before the motion are found to be, and not to be where they are not."""
    assert result.chosen.delay == pytest.approx(-0.01, abs=1e-9)
    assert identify([arms.record(ARM, seed=3)], ARM).chosen.delay == 0.0


def test_intervals_contain_the_other_choices(result):
    """Half and double the cut-off, no delay, and the other methods lie inside every interval."""
    labels = [label.partition(" (")[0] for label in result.variants]
    assert labels == ["half cut-off", "double cut-off", "no delay", "ls", "oe"]
    assert result.method == "iv"
    for value in [*result.base_values(), *result.joint_values()]:
        assert len(value.variants) == 5
        assert all(value.interval[0] <= other <= value.interval[1] for other in value.variants.values())


def test_friction_and_drive(result):
    """Dry friction, drive inertia and offset come out with the torques' own accuracy."""
    found = {value.name: value for value in result.joint_values()}
    assert set(found) == {"coulomb[J1]", "viscous[J1]", "offset[J1]", "coulomb[J2]", "viscous[J2]", "offset[J2]",
                          "armature[J2]"}  # fmt: skip
    assert found["coulomb[J1]"].value == pytest.approx(0.12, abs=0.02)
    assert found["armature[J2]"].value == pytest.approx(0.004, abs=0.002)
    assert found["coulomb[J1]"].unit == "N m"


def test_little_is_left_unexplained(result):
    """What stays unexplained of held-out torque is the noise: little below the cut-off, 0.05 N m of all."""
    assert (result.rms_ratio_in_band < 0.05).all()
    evidence = result.choice.equations
    rms = np.sqrt(np.mean(evidence.torque(result.chosen.delay) ** 2, axis=0))
    np.testing.assert_allclose(result.rms_ratio * rms, 0.05, rtol=0.5)
    assert result.verdict == "usable up to a torque scale"


def test_the_file_s_values_have_no_part_in_it(result):
    """With other masses in the mechanism's file every choice and every result is the same, bit for bit."""
    other = ARM.with_payload({"link_1": 3.0, "link_2": 0.1})
    again = identify([arms.record(ARM, seed=3, delay=-0.01)], other)
    assert again.chosen == result.chosen
    assert [v.value for v in again.base_values()] == [v.value for v in result.base_values()]
    assert [v.interval for v in again.base_values()] == [v.interval for v in result.base_values()]
    assert again.base_values()[0].in_file != result.base_values()[0].in_file


def test_counter_masses_balance_the_arm(result):
    """Counter-masses behind the joints are those that sizing gives for the true arm, within their intervals."""
    exact = {c.site: c.mass for c in exact_sizing(balance_conditions(ARM), ARM).counter_masses}
    found = {c.site: c for c in result.counter_masses()}
    assert set(found) == set(exact) == {"counter_link_1", "counter_link_2"}
    for site, mass in exact.items():
        low, high = found[site].mass.interval
        assert low < mass < high
        assert found[site].first_moment.value == pytest.approx(0.1 * found[site].mass.value)
    first, second = (found[site].first_moment.value for site in exact)
    # masses on the links' lines also lessen, a little, what the record tells of centres beside those lines
    assert second == pytest.approx(result.value(MOMENTS[1]).value, rel=1e-3)
    assert first == pytest.approx(result.value(MOMENTS[0]).value + 0.3 * second / 0.1, rel=1e-3)


def test_masses_are_not_filled_in(result):
    """A single mass is not determined by torque: no value for it, and a refusal that names it."""
    assert dict(result.parameters())["m[link_2]"] is None
    assert dict(result.parameters())["mcx[link_2]"].value == result.value(MOMENTS[1]).value
    with pytest.raises(NotIdentifiable, match=r"m\[link_2\]"):
        result.value({"m[link_2]": 1.0})


def test_intervals_hold_over_records():
    """Of three records the intervals of both first moments contain the truth, but for one of the six at most."""
    inside = np.zeros(2)
    for seed in range(3):
        found = identify([arms.record(ARM, seed=20 + seed, noise=0.1)], ARM, others=False)
        for k, (moment, value) in enumerate(zip(MOMENTS, (0.34912, 0.11106), strict=True)):
            low, high = found.value(moment).interval
            inside[k] += low <= value <= high
    assert inside.sum() >= 5


def test_two_records_together():
    """Two records tell more than one: the statistical interval shrinks, no stretch runs over from one to the other."""
    one = identify([arms.record(ARM, seed=1, noise=0.2)], ARM, others=False)
    both = identify([arms.record(ARM, seed=s, noise=0.2) for s in (1, 2)], ARM, others=False)
    assert both.identified.fit.blocks > 1.5 * one.identified.fit.blocks
    assert both.value(MOMENTS[0]).estimate.half_width() < one.value(MOMENTS[0]).estimate.half_width()
    assert both.runs == ("arm 1", "arm 2")


def test_a_zero_that_moves_between_runs_moves_its_offset_alone():
    """The second of two runs, with a known payload, has other zeros of its torques: all else is as with equal zeros.

    Bodies, friction, scale by the known mass, tests of the model, all methods, and what is predicted of a third run.
    """
    heavier = ARM.with_payload({"link_2": 0.3})
    light, third = (arms.record(ARM, seed=seed) for seed in (3, 5))
    loaded, zeros = replace(arms.record(heavier, seed=4), mounted=heavier.pi - ARM.pi), np.array([0.2, -0.12])
    equal, moved = (identify([light, replace(loaded, torque=loaded.torque + zero)], ARM) for zero in (0.0, zeros))
    assert moved.doubts == []
    assert moved.verdict == "usable"
    assert moved.tests.scale.value == pytest.approx(equal.tests.scale.value, rel=1e-6)
    assert set(moved.variants) == set(equal.variants)
    for one, other in zip(equal.values, moved.values, strict=True):
        zero = dict(zip(("offset[J1, arm 4]", "offset[J2, arm 4]"), zeros, strict=True)).get(one.name, 0.0)
        for label, value in one.variants.items():
            if not label.startswith("torque scale"):
                assert other.variants[label] == pytest.approx(value + zero, rel=1e-5, abs=1e-6), (one.name, label)
        assert other.value == pytest.approx(one.value + zero, rel=1e-6, abs=1e-7)
        assert other.unit == one.unit
    strayed = [[one.angles.all_rms for one in result.comparison] for result in (equal, moved)]
    assert strayed[1] == pytest.approx(strayed[0], rel=1e-4)
    known, unknown = (validate(moved, [replace(third, torque=third.torque + zero)]) for zero in (0.0, 3.0 * zeros))
    assert known.doubts == unknown.doubts == []
    assert unknown.angles.all_rms == pytest.approx(known.angles.all_rms, rel=1e-6)


def test_a_mechanism_with_a_loop():
    """A four-bar driven by one motor: what its torque determines is found, through the closed loop."""
    mechanism = load_mechanism("four-bar")
    found = identify([arms.record(mechanism, seed=2, noise=0.01, swing=(0.9, 2.5))], mechanism)
    for row, value in zip(found.identified.identifiability.combinations, found.identified.values, strict=True):
        low, high = found.value(row).interval
        assert low <= row @ arms.truth(mechanism) <= high, value
    assert (found.rms_ratio_in_band < 0.1).all()


def test_a_resting_joint_is_refused():
    """A record in which a joint stays at rest says nothing of it."""
    still = arms.record(ARM, swing=(1e-4, 1.0))
    with pytest.raises(AnalysisError, match="'J1' never moves"):
        identify([still], ARM)


def test_a_short_record_is_refused():
    """A record too short for any cut-off is refused, with its length."""
    whole = arms.record(ARM)
    short = type(whole)("short", "simulated", type(whole.grid)(0.0, 1 / 200.0, 40), whole.q[:40], whole.torque[:40])
    with pytest.raises(AnalysisError, match=r"short: 0.2 s at 200"):
        identify([short], ARM)


def test_progress_counts_every_step():
    """Whatever cut-offs and variants there are, the steps that are told add up to those that were promised."""
    told = []
    identify([arms.record(ARM, rate=50.0)], ARM, "ls", others=False, done=told.append)
    assert sum(told) == STEPS
    assert min(told) >= 0
