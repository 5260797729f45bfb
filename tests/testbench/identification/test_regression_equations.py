"""Both sides low-passed alike leave the parameters alone; one side low-passed does not."""

from dataclasses import replace

import numpy as np
import pytest

from balance.estimation.base_parameters import base_parameters
from balance.estimation.identifiability import identifiability
from balance.estimation.regression import RegressionRecord
from balance.mechanism.mjcf_parser import load_mechanism
from testbench.identification.regression_equations import one_sided, regression_equations
from testbench.kinematics.smoothing_and_derivatives import rest_speeds, smoothed_derivatives

from . import arms

ARM = load_mechanism("two-joint-arm-a0")
MOMENTS = ({"mcx[link_1]": 1.0, "m[link_2]": 0.3}, {"mcx[link_2]": 1.0})
TRUTH = np.array([0.34912, 0.11106])


def biases(cutoff: float, smoothed: str) -> np.ndarray:
    """Mean relative errors of the first moments over ten records with noise."""
    found = []
    for seed in range(10):
        record = arms.record(ARM, seed=seed, noise=0.1)
        evidence = (regression_equations if smoothed == "both" else one_sided)([record], ARM, cutoff)
        columns = evidence.low_passed_columns(range(len(evidence.names))) if smoothed == "both" else evidence.columns
        seen = identifiability(evidence.columns, evidence.names)
        blocks = evidence.blocks(0.3)
        record = RegressionRecord.of(columns, evidence.low_passed_torque(0.0), blocks, used=evidence.moving)
        result = base_parameters(record, seen)
        found.append([result.estimate(moment).value for moment in MOMENTS])
    return np.mean(found, axis=0) / TRUTH - 1.0


@pytest.mark.parametrize("cutoff", [2.5, 7.07])
def test_both_sides_alike_leave_no_bias(cutoff):
    """From 2.5 to 7 Hz the answer is right to 1 % on average, whatever the cut-off."""
    assert (np.abs(biases(cutoff, "both")) < 0.01).all()


def test_torque_alone_smoothed_is_biased():
    """At the lowest of these cut-offs, smoothing torque and rates but not positions costs more than 10 %."""
    assert np.abs(biases(2.5, "torque")).max() > 0.1


def test_regressor_reproduces_the_torque():
    """W of noiseless smoothed positions times the true parameters is the torque, far below the cut-off."""
    record = arms.record(ARM, seed=4, noise=0.0)
    evidence = regression_equations([record], ARM, 14.0)
    left = evidence.columns @ arms.truth(ARM) - evidence.torque(0.0)
    assert np.sqrt(np.mean(left**2)) < 0.05 * np.sqrt(np.mean(evidence.torque(0.0) ** 2))


def test_delay_moves_torque_against_motion():
    """A torque ``delay`` later than its motion is found ``delay`` later in the log."""
    early, late = arms.record(ARM, noise=0.0), arms.record(ARM, noise=0.0, delay=0.015)
    np.testing.assert_allclose(
        regression_equations([late], ARM, 5.0).torque(0.015),
        regression_equations([early], ARM, 5.0).torque(0.0),
        atol=1e-9,
    )


def test_rest_is_left_out():
    """Where a joint rests longer than the low-pass looks around, its torque is not used."""
    record = arms.record(ARM)
    q = record.q.copy()
    q[600:] = q[600]
    evidence = regression_equations([replace(record, q=q)], ARM, 5.0)
    at_rest = evidence.time > 3.0 + 0.5
    assert not evidence.moving[at_rest].any()
    assert evidence.moving[evidence.time < 2.5].mean() > 0.9


@pytest.mark.parametrize(
    ("scale", "slower", "turning", "rest"),
    [
        (1.0, 1.0, True, 0.1),
        (1.0, 1.0, False, 0.2),
        (0.01, 1.0, False, 0.002),
        (10.0, 7.0, False, 2.0 / 7.0),
        (0.0, 1.0, False, 0.0),
    ],
)
def test_rest_scales(scale, slower, turning, rest):
    """With lengths and time, up to 0.1 rad/s; a joint that toggles between two readings rests, whatever its size."""
    time = np.arange(0.0, 10.0, 0.005) * slower
    speed = 4.0 * scale / slower * np.cos(2.0 * time / slower)
    readings = np.rint(2.0 * scale * np.sin(2.0 * time / slower) / (1e-4 * scale or 1.0)) * (1e-4 * scale)
    still = 1e-4 * (time // (0.5 * slower) % 2)
    sway = smoothed_derivatives(still[:, None], 10.0 / slower, 200.0 / slower).v
    found = rest_speeds(
        [(np.column_stack([readings, still]), np.column_stack([speed, sway]))], 10.0 / slower, [turning, False]
    )
    assert found[0] == pytest.approx(rest, rel=1e-6, abs=1e-9)
    assert np.abs(sway).max() < found[1]


def test_what_any_motion_determines():
    """Of an arm as much as a rich record; more than one whose joints make up for each other's turn."""
    record = arms.record(ARM)
    q = record.q[:, :1] * [1.0, -1.0]
    ranks = []
    for one in (record, replace(record, q=q)):
        (part,) = regression_equations([one], ARM, 5.0).parts
        ranks += [identifiability(part.whole, part.names).rank, part.by_any_motion.rank]
    assert ranks[0] == ranks[1] == ranks[3] > ranks[2]


def test_stretches_are_long_enough_and_within_a_record():
    """Stretches last at least as asked, and none holds samples of two records."""
    evidence = regression_equations([arms.record(ARM, seed=s) for s in (0, 1)], ARM, 5.0)
    blocks = evidence.blocks(0.4)
    assert np.bincount(blocks).min() >= 0.4 * arms.RATE
    half = len(blocks) // 2
    assert set(blocks[:half]).isdisjoint(blocks[half:])


def test_every_run_has_two_parts_at_least():
    """Seven runs in ten parts: what is held out leaves of each run another part, which knows the run's offsets."""
    evidence = regression_equations([arms.record(ARM, seed=s) for s in range(7)], ARM, 5.0)
    parts = [set(evidence.equal_parts(10)[place]) for place in evidence.places]
    assert [len(part) for part in parts] == [2] * 7
    assert len(set().union(*parts)) == 14
