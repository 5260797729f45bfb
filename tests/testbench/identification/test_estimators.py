"""The linear equation of the deviation: what a nonlinear simulation with the same pull does, for small ones."""

import numpy as np

from balance.dynamics.forward_dynamics import acceleration
from balance.dynamics.regressor import joint_friction_regressor, torque_regressor
from balance.mechanism.mjcf_parser import load_mechanism
from testbench.identification.estimators import DAMPING, Deviation, _integrated
from testbench.identification.regression_equations import regression_equations

from . import arms

ARM = load_mechanism("two-joint-arm-a0")
PULL = 2.0


def made() -> tuple:
    """A record's equations, and the true parameters without dry friction."""
    part = regression_equations([arms.record(ARM, noise=0.0, rate=500.0)], ARM, 10.0).parts[0]
    truth = arms.truth(ARM)
    truth[[20, 24]] = 0.0
    return part, truth


def nonlinear(part, truth: np.ndarray, pushed: np.ndarray) -> np.ndarray:
    """q'' = M^-1 (tau - h) + pull, by the midpoint rule, with tau = W pi + pushed; the deviation, (n, joints)."""
    w = 2 * np.pi * PULL
    motion, step = part.motion, part.record.grid.step
    torque = part.whole[: len(pushed)] @ truth + pushed

    def inverse(q, v, a):
        return (
            np.concatenate([torque_regressor(ARM, q, v, a), joint_friction_regressor(ARM.driven, v, a)[0]], axis=2)
            @ truth
        )

    def rate(q, v, at):
        i, j = int(at), int(np.ceil(at))
        mean = [(x[i] + x[j])[None] / 2 for x in (torque, motion.q, motion.v)]
        return acceleration(inverse, q, v, mean[0]) + w * w * (mean[1] - q) + 2 * DAMPING * w * (mean[2] - v)

    q, v = motion.q[:1].copy(), motion.v[:1].copy()
    away = [q[0] - motion.q[0]]
    for i in range(len(pushed) - 1):
        half_q, half_v = q + step / 2 * v, v + step / 2 * rate(q, v, i)
        q, v = q + step * half_v, v + step * rate(half_q, half_v, i + 0.5)
        away.append(q[0] - motion.q[i + 1])
    return np.array(away)


def test_small_deviations_are_those_of_the_nonlinear_simulation():
    """A small torque that the model lacks makes the same deviation, to 3 %, as simulating the first second with it."""
    part, truth = made()
    time = part.record.grid.time
    pushed = 0.02 * np.column_stack([np.sin(5 * time), np.cos(7 * time)])
    linear = Deviation.of(part, ARM, truth).simulate(pushed[:, :, None], PULL).q[:, :, 0]
    expected = nonlinear(part, truth, pushed[:500])
    assert np.abs(linear[:500] - expected).max() < 0.03 * np.abs(expected).max()


def test_noise_of_the_motion_is_taken_back():
    """Above the pull, the acceleration of the simulated motion has less than a third of the recorded one's noise."""
    clean, _ = made()
    record = arms.record(ARM, noise=0.0, rate=500.0)
    rng = np.random.default_rng(3)
    noisy = type(record)(
        "noisy", "simulated", record.grid, record.q + 2e-3 * rng.normal(size=record.q.shape), record.torque
    )
    part = regression_equations([noisy], ARM, 10.0).parts[0]
    full = arms.truth(ARM)
    left = noisy.torque - part.whole @ full
    away = Deviation.of(part, ARM, full).simulate(left[:, :, None], PULL)
    recorded = part.inside(part.motion.a - clean.motion.a)
    simulated = part.inside(part.motion.a + away.a[:, :, 0] - clean.motion.a)
    assert simulated.std() < 0.33 * recorded.std()


def test_the_pull_holds_what_stands_upright():
    """An arm that stands upright needs a pull above the frequency at which its weight topples it."""
    record = arms.record(ARM, noise=0.0, swing=(0.3, 1.0))
    upright = type(record)("up", "simulated", record.grid, record.q + [np.pi - 0.5, -0.8], record.torque)
    model = Deviation.of(regression_equations([upright], ARM, 5.0).parts[0], ARM, arms.truth(ARM))
    assert 0.5 < model.least_pull_hz < 3.0
    away = model.simulate(np.ones((len(model.inertia), 2, 1)) * 0.01, model.least_pull_hz * 1.2)
    assert np.abs(away.q).max() < 1.0


def test_a_linear_system_from_where_it_starts():
    """x' = -x from 2: 2 exp(-t), to the square of the step."""
    system, pushed = -np.ones((501, 1, 1)), np.zeros((501, 1, 1))
    state = _integrated(system, pushed, 0.01, np.array([[2.0]]))
    np.testing.assert_allclose(state[:, 0, 0], 2.0 * np.exp(-0.01 * np.arange(501)), atol=2e-5)
