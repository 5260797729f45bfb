"""What the encoders leave open in what the base's vibration says: derivatives beside changes of the whole."""

from dataclasses import replace

import numpy as np
import pytest

from balance.balancing import conditions
from balance.closure import Closure
from balance.estimation.first_moment_imbalance import imbalance_fit
from balance.motion import Samples
from testbench.kinematics.smoothing_and_derivatives import smoothed_derivatives
from testbench.trimming.problem import parameter_basis, shared_unknowns, with_shared_unknowns
from testbench.trimming.result import Share
from testbench.trimming.vibration_regression import (
    backwards,
    per_reading,
    shaken_base,
    step_covariance,
    step_readings,
    vibration_regression,
    wrench_slopes,
)

STEP = 4.8e-5
"""Of the encoders [rad]."""


@pytest.fixture(scope="module")
def case(aligned):
    """The runs of three motions, the conditions, the fit, the parameters that it found."""
    runs = aligned
    found = conditions.balance_conditions(runs[0].mechanism)
    moved = [shaken_base(run, 40.0) for run in runs]
    records = [vibration_regression(run, found).record for run in moved]
    turned = shared_unknowns(records, found.rank)
    fit = imbalance_fit(with_shared_unknowns(records, found.rank, turned), found)
    basis = parameter_basis(found)
    pi = basis[:, : found.rank] @ fit.imbalance.values + basis[:, found.rank :] @ (turned @ fit.shared)
    return moved, runs[0].encoders, found, turned, fit, pi


def elsewhere(run, joints, more):
    """The run with encoders that read ``more`` (n, joints) [rad]."""
    smooth = smoothed_derivatives(more, 160.0, run.grid.rate)
    at = [run.model.coordinate_index(joint) for joint in joints]
    driven = [
        x[:, at] + d for x, d in zip((run.path.q, run.path.v, run.path.a), (smooth.q, smooth.v, smooth.a), strict=True)
    ]
    return replace(run, path=Closure(run.model).follow(Samples(run.path.time, *driven, joints)))


def test_values_move_by_the_derivatives(case):
    """Encoders that read elsewhere within their steps move the values as their derivatives say, here to a tenth."""
    moved, columns, found, turned, fit, pi = case
    joints = tuple(column.component for column in columns)
    rng = np.random.default_rng(0)
    more = [STEP * rng.uniform(-0.5, 0.5, (run.grid.count, 2)) for run in moved]
    expected = -sum(
        np.einsum("nj,njk->k", d, per_reading(run, joints, gain, pi))
        for d, run, gain in zip(more, moved, fit.gains(), strict=True)
    )
    changed = []
    for sign in (1.0, -1.0):
        others = [elsewhere(run, joints, sign * d) for run, d in zip(moved, more, strict=True)]
        records = [vibration_regression(run, found).record for run in others]
        changed.append(imbalance_fit(with_shared_unknowns(records, found.rank, turned), found).imbalance.values)
    assert 0.5 * (changed[0] - changed[1]) == pytest.approx(expected, abs=0.1 * np.abs(expected).max())


def test_what_the_steps_leave_is_what_the_readings_change_by(case):
    """Encoders that read elsewhere by their noise change the modelled readings by as much, to a tenth (rms)."""
    moved, columns, _, _, _, pi = case
    run, joints = moved[0], tuple(column.component for column in columns)
    deviations = np.array([column.total_noise for column in columns])
    more = deviations * np.random.default_rng(3).normal(size=(run.grid.count, len(columns)))

    def readings(one):
        return one.smooth(one.answers((one.wrench_regressor(one.path) @ pi)[:, :, None]))[..., 0]

    changed = readings(elsewhere(run, joints, more)) - readings(run)
    found = step_readings(run, columns, pi)
    assert np.sqrt((found**2).mean()) == pytest.approx(np.sqrt((changed**2).mean()), rel=0.1)


@pytest.mark.parametrize(
    ("by_steps", "said"), [(0.0, "levers, the model"), (0.1, "levers"), (0.55, "steps may leave 55%")]
)
def test_much_that_is_unexplained_is_said_with_what_may_leave_it(by_steps, said):
    """The encoders' steps where they may leave half of it, else what is systematic; doubtful in any case."""
    share = Share("vibration", (), 0.57, by_steps)
    assert share.doubtful
    assert said in share.why


@pytest.mark.parametrize("gravity", [0.0, -9.81])
def test_backwards_is_the_transpose(case, gravity):
    """Any sum of what pushes show is that of the pushes times what it asks of them, weight and tilt included."""
    run, rng = replace(case[0][0], gravity=np.array([0.3, gravity, 0.2])), np.random.default_rng(1)
    gain = rng.normal(size=(run.used.stop - run.used.start, len(run.sensors.rows), 1))
    push = np.zeros((run.grid.count, 6, 1))
    push[run.used.start + 200 : run.used.stop - 400] = run.valid.low_pass(rng.normal(size=push.shape), 40.0)[
        run.used.start + 200 : run.used.stop - 400
    ]
    shown = np.sum(gain * run.smooth(run.answers(push)))
    assert np.sum(backwards(run, gain) * push) == pytest.approx(shown, rel=1e-6)


def test_a_finer_encoder_leaves_less_open(case):
    """The covariance goes with the square of the step; none without steps."""
    moved, columns, _, _, fit, pi = case
    coarse, fine, none = (
        step_covariance(moved[0], [replace(c, resolution=step) for c in columns], fit.gains()[0], pi)
        for step in (STEP, 0.1 * STEP, 0.0)
    )
    assert coarse == pytest.approx(100.0 * fine)
    assert not none.any()
    assert np.linalg.eigvalsh(coarse).min() > -1e-6 * np.trace(coarse)


def test_the_wrench_changes_with_acceleration_by_the_inertia(case):
    """The shaking wrench is linear in the accelerations: twice the change for twice the acceleration."""
    moved, columns, _, _, _, pi = case
    run = moved[0]
    joints = tuple(column.component for column in columns)
    _, by_speed, by_rate = wrench_slopes(run, joints, pi)
    at = [run.model.coordinate_index(joint) for joint in joints]
    samples = [x[:, at] for x in (run.path.q, run.path.v, run.path.a)]
    more = Closure(run.model).follow(Samples(run.path.time, samples[0], samples[1], samples[2] + 3.0, joints))
    from balance.dynamics.regressor import wrench_regressor

    wrench = [wrench_regressor(run.model, p.q, p.v, p.a) @ pi for p in (run.path, more)]
    assert wrench[1] - wrench[0] == pytest.approx(3.0 * by_rate.sum(axis=2), abs=1e-4 * np.abs(by_rate).max())
    assert np.abs(by_speed).max() > 0.0


def test_the_base_answers_a_sampled_wave_in_full(case):
    """Samples at 1 kHz of a wave of 40 Hz move the base as those at 16 kHz do; straight lines lose 20 times more."""
    run = case[0][0]
    fine = replace(run, grid=replace(run.grid, step=run.grid.step / 16.0, count=run.grid.count * 16))
    time = [np.arange(one.grid.count) * one.grid.step for one in (run, fine)]
    waves = [np.sin(2 * np.pi * 40.0 * t) * np.sin(np.pi * np.minimum(t, 1.0)) ** 4 for t in time]
    push = [np.ascontiguousarray(w[:, None, None] * np.ones((1, 1, 6))) for w in waves]
    truth = fine.base.respond(push[1], fine.grid.step).acceleration[::16]
    size = np.abs(truth).max()
    assert np.abs(run.moved(push[0]).acceleration - truth).max() < 5e-5 * size
    assert (
        np.abs(run.base.respond(push[0], run.grid.step).acceleration - truth).max()
        > 20.0 * np.abs(run.moved(push[0]).acceleration - truth).max()
    )
