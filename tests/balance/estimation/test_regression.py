"""Identification recovers known parameters, with intervals that hold though residuals are correlated in time."""

import numpy as np
import pytest

from balance.balancing import conditions
from balance.balancing.sizing import exact_sizing
from balance.dynamics.regressor import torque_regressor
from balance.errors import DataError
from balance.estimation.base_parameters import base_parameters
from balance.estimation.first_moment_imbalance import masses_per_value
from balance.estimation.identifiability import NotIdentifiable, identifiability
from balance.estimation.regression import RegressionRecord, equal_blocks, fit

from ...testbench.coverage import assert_holds
from .. import models

MECHANISM = models.load("serial-2r")
MOMENT = {"mcx[link_1]": 1.0, "m[link_2]": 0.3}
COUNT = 600


def states(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A slow random motion of both joints: sums of sines, q, v, a of (COUNT, 2)."""
    rng = np.random.default_rng(seed)
    time = np.linspace(0.0, 12.0, COUNT)[:, None, None]
    omega = rng.uniform(0.5, 6.0, (1, 2, 4))
    phase, size = rng.uniform(0, 2 * np.pi, (1, 2, 4)), rng.uniform(0.3, 1.0, (1, 2, 4))
    angle = omega * time + phase
    q, v, a = size * np.sin(angle), size * omega * np.cos(angle), -size * omega**2 * np.sin(angle)
    return q.sum(axis=2), v.sum(axis=2), a.sum(axis=2)


def correlated(rng: np.random.Generator, rms: float, memory: float = 0.9) -> np.ndarray:
    """First-order noise of a given rms, remembered over about ten samples, (COUNT, 2)."""
    noise = rng.normal(size=(COUNT, 2))
    for i in range(1, COUNT):
        noise[i] = memory * noise[i - 1] + np.sqrt(1 - memory**2) * noise[i]
    return rms * noise


def solve(regressor, torque, seen, blocks, used=None):
    """Base parameters from a record of all parameters' columns."""
    return base_parameters(RegressionRecord.of(regressor, torque, blocks, used=used), seen)


BLOCKS = np.arange(COUNT) * 15 // COUNT


def test_exact_torques_give_exact_parameters():
    """Without noise every base parameter is found to rounding, and the intervals shrink with it."""
    regressor = torque_regressor(MECHANISM, *states(0))
    seen = identifiability(regressor, MECHANISM.parameter_names)
    found = solve(regressor, regressor @ MECHANISM.pi, seen, BLOCKS)
    np.testing.assert_allclose(found.values, seen.combinations @ MECHANISM.pi, atol=1e-10)
    assert found.estimate(MOMENT).value == pytest.approx(MECHANISM.pi[1] + 0.3 * MECHANISM.pi[10], abs=1e-10)
    assert found.estimate(MOMENT).half_width() < 1e-6
    np.testing.assert_allclose(found.predict(regressor), regressor @ MECHANISM.pi, atol=1e-9)


def test_intervals_hold_under_correlated_noise():
    """Of 60 records with correlated noise the interval of a first moment contains the truth as 95 % promises."""
    truth = MECHANISM.pi[1] + 0.3 * MECHANISM.pi[10]
    inside = 0
    for seed in range(60):
        regressor = torque_regressor(MECHANISM, *states(seed))
        torque = regressor @ MECHANISM.pi + correlated(np.random.default_rng(seed), 0.3)
        low, high = (
            solve(regressor, torque, identifiability(regressor, MECHANISM.parameter_names), BLOCKS)
            .estimate(MOMENT)
            .interval()
        )
        inside += low <= truth <= high
    assert_holds(inside, 60)


def test_counting_samples_would_be_dishonest():
    """The textbook interval, which takes residuals as independent, is at least twice too narrow here."""
    regressor = torque_regressor(MECHANISM, *states(1))
    seen = identifiability(regressor, MECHANISM.parameter_names)
    columns = regressor[:, :, list(seen.pivots)].reshape(-1, seen.rank)
    textbook = 0.3 * np.sqrt(np.linalg.inv(columns.T @ columns)[0, 0])
    noise = [correlated(np.random.default_rng(seed), 0.3) for seed in range(40)]
    found = [solve(regressor, regressor @ MECHANISM.pi + n, seen, BLOCKS).estimate(MOMENT) for n in noise]
    scatter = np.std([one.value for one in found])
    assert scatter > 2 * textbook
    assert 0.6 < np.median([one.standard_uncertainty for one in found]) / scatter < 1.6


def test_a_noisy_joint_counts_less():
    """With a joint ten times noisier, weighting halves the scatter at least against weighting both equally."""
    regressor = torque_regressor(MECHANISM, *states(2))
    seen = identifiability(regressor, MECHANISM.parameter_names)
    columns = regressor[:, :, list(seen.pivots)].reshape(-1, seen.rank)
    row = seen.share(seen.vector({"mcx[link_2]": 1.0}))
    weighted, plain = [], []
    for seed in range(40):
        noise = np.random.default_rng(seed).normal(size=(COUNT, 2)) * [1.0, 0.1]
        torque = regressor @ MECHANISM.pi + noise
        found = solve(regressor, torque, seen, BLOCKS)
        weighted.append(found.estimate({"mcx[link_2]": 1.0}).value)
        plain.append(row @ np.linalg.lstsq(columns, torque.ravel(), rcond=None)[0])
    assert np.std(weighted) < 0.5 * np.std(plain)
    np.testing.assert_allclose(list(found.fit.residual_rms.values()), [1.0, 0.1], rtol=0.1)


def test_torques_not_used_have_no_effect():
    """A torque that is left out may hold anything."""
    regressor = torque_regressor(MECHANISM, *states(3))
    seen = identifiability(regressor, MECHANISM.parameter_names)
    torque = regressor @ MECHANISM.pi
    torque[100:150, 0] = 1e3
    used = np.ones_like(torque)
    used[100:150, 0] = 0.0
    np.testing.assert_allclose(
        solve(regressor, torque, seen, BLOCKS, used).values, seen.combinations @ MECHANISM.pi, atol=1e-9
    )


def test_a_fit_proves_itself_by_its_residual():
    """Nothing of the columns is left in the residual; its rms is the noise, zero where readings do not count."""
    regressor = torque_regressor(MECHANISM, *states(5))
    seen = identifiability(regressor, MECHANISM.parameter_names)
    columns = seen.base_columns(regressor)
    used = np.ones((COUNT, 2))
    used[:50, 0] = 0.0
    noise = np.random.default_rng(5).normal(size=(COUNT, 2)) * [0.3, 0.1]
    found = fit([RegressionRecord.of(columns, regressor @ MECHANISM.pi + noise, BLOCKS, used=used)])
    (residual,) = found.residual()
    weights = np.array([1.0 / found.residual_rms[row] ** 2 for row in ("0", "1")])
    projected = np.einsum("njp,nj,j->p", columns, residual, weights)
    assert (
        np.abs(projected).max()
        < 1e-6 * np.abs(np.einsum("njp,nj,j->p", np.abs(columns), np.abs(residual), weights)).max()
    )
    assert np.sqrt(np.sum(residual**2, axis=0) / used.sum(axis=0)) == pytest.approx([*found.residual_rms.values()])
    assert not residual[:50, 0].any()
    assert np.std(residual[50:] - noise[50:]) < 0.05


@pytest.mark.parametrize("count", [None, 7])
def test_blocks_share_the_information(count):
    """Equal information in each, none shorter than asked, though half of the record tells nothing."""
    information = np.where(np.arange(3000) % 1000 < 500, 1.0, 0.0)
    blocks = equal_blocks(information, 100.0, count)
    shares = np.bincount(blocks, information)
    assert len(shares) == (15 if count is None else 7)
    assert shares == pytest.approx(shares.mean(), abs=1.0)
    assert np.bincount(blocks).min() >= 100
    assert len(np.unique(equal_blocks(np.r_[np.full(50, 20.0), np.full(950, 1.0)], 100.0, 10))) == 5


def test_too_few_stretches_and_unobservable_are_refused():
    """No interval from two stretches; no value for what the record does not determine."""
    regressor = torque_regressor(MECHANISM, *states(4))
    seen = identifiability(regressor, MECHANISM.parameter_names)
    with pytest.raises(DataError, match="there are 2"):
        solve(regressor, regressor @ MECHANISM.pi, seen, BLOCKS // 8)
    with pytest.raises(NotIdentifiable, match=r"m\[link_2\]"):
        solve(regressor, regressor @ MECHANISM.pi, seen, BLOCKS).estimate({"m[link_2]": 1.0})


@pytest.mark.parametrize("name", ["serial-2r", "serial-3r", "parallelogram-6bar"])
def test_counter_masses_are_linear_in_the_parameters(name):
    """The rows give the counter-masses that sizing finds, for the mechanism as it is and with a payload."""
    plain = models.load(name)
    found = conditions.balance_conditions(plain)
    rows = masses_per_value(found, plain, plain.counter_sites, found.values(plain))
    for mechanism in (plain, plain.with_payload(models.LOADS[name][0])):
        exact = exact_sizing(found, mechanism)
        for counter, row in zip(exact.counter_masses, rows, strict=True):
            assert row @ found.values(mechanism) == pytest.approx(counter.mass, abs=1e-9)
