"""Parameters of bodies that can exist: recognised, and the nearest found, where identified ones are not."""

import numpy as np
import pytest

from balance.dynamics.regressor import joint_friction_regressor, torque_regressor
from balance.estimation.base_parameters import (
    LEAST_SHARE,
    BaseParameters,
    Consistent,
    base_parameters,
    consistent,
)
from balance.estimation.identifiability import identifiability
from balance.estimation.regression import RegressionRecord
from balance.mechanism.mechanism import pseudo_inertia
from balance.mechanism.mjcf_parser import load_mechanism

from .. import models

ARM = models.load("two-joint-arm-a0")
TERMS = [0.1, 0.01, 0.02, 0.004]
FILE = np.concatenate([ARM.pi, np.tile(TERMS, 2)])
COUNT = 400


def identified(truth: np.ndarray, noise: float = 0.01) -> BaseParameters:
    """From torques of a random motion with known parameters."""
    rng = np.random.default_rng(0)
    q, v, a = rng.normal(size=(3, COUNT, 2)) * [[[1.0]], [[3.0]], [[20.0]]]
    terms, names = joint_friction_regressor(ARM.driven, v, a)
    regressor = np.concatenate([torque_regressor(ARM, q, v, a), terms], axis=2)
    seen = identifiability(regressor, [*ARM.parameter_names, *names])
    torque = regressor @ truth + noise * rng.normal(size=(COUNT, 2))
    return base_parameters(RegressionRecord.of(regressor, torque, np.arange(COUNT) * 20 // COUNT), seen)


def test_pseudo_inertia_is_the_sum_over_points():
    """The pseudo-inertia of point masses is the sum of m [r; 1] [r; 1]'."""
    rng = np.random.default_rng(1)
    points, masses = rng.normal(size=(5, 3)), rng.uniform(0.5, 2.0, 5)
    row = np.zeros(10)
    expected = np.zeros((4, 4))
    for r, m in zip(points, masses, strict=True):
        about = m * (r @ r * np.eye(3) - np.outer(r, r))
        row += np.array([m, *(m * r), about[0, 0], about[0, 1], about[1, 1], about[0, 2], about[1, 2], about[2, 2]])
        expected += m * np.outer([*r, 1.0], [*r, 1.0])
    np.testing.assert_allclose(pseudo_inertia(row), expected, atol=1e-12)


def test_a_feasible_estimate_is_kept():
    """An estimate that bodies can have is left as it is, and the member given has the same base parameters."""
    found = identified(FILE)
    made = consistent(found, ARM, FILE)
    assert made.free_is_feasible
    assert made.distance < 1e-3
    np.testing.assert_allclose(made.base, found.values, atol=1e-4 * np.abs(found.values).max())
    assert made.least_eigenvalue() > 0.0


def test_what_is_not_determined_is_as_in_the_file():
    """With the file's own base parameters the member is the file's."""
    made = consistent(identified(FILE, 0.0), ARM, FILE)
    np.testing.assert_allclose(made.parameters[: len(ARM.pi)], ARM.pi, atol=1e-4)


def infeasible() -> tuple[BaseParameters, Consistent]:
    """An arm whose second link has a negative inertia about its joint."""
    truth = FILE.copy()
    truth[ARM.parameter_names.index("Izz[link_2]")] = -0.005
    found = identified(truth)
    return found, consistent(found, ARM, FILE)


def test_an_impossible_estimate_is_recognised():
    """A negative inertia is no body's; the nearest set has positive definite bodies, and terms not negative."""
    _, made = infeasible()
    assert not made.free_is_feasible
    assert made.distance > 3.0
    for row, file in zip(made.parameters[:20].reshape(2, 10), ARM.parameters, strict=True):
        root = np.linalg.inv(np.linalg.cholesky(pseudo_inertia(file)))
        assert np.linalg.eigvalsh(root @ pseudo_inertia(row) @ root.T)[0] > 0.99 * LEAST_SHARE
    assert (made.parameters[[20, 21, 23, 24, 25, 27]] >= -1e-9).all()


def test_no_random_feasible_set_is_nearer():
    """Of a hundred feasible sets about the nearest, none is nearer to the free estimate."""
    found, made = infeasible()
    inverse = np.linalg.pinv(found.covariance, rcond=1e-8)
    rng = np.random.default_rng(2)

    def distance(parameters: np.ndarray) -> float:
        left = found.identifiability.combinations @ parameters - found.values
        return float(left @ inverse @ left)

    best = distance(made.parameters)
    tried = 0
    for _ in range(5000):  # some 7 of 100 are feasible
        anywhere = FILE * (1.0 + 0.2 * rng.normal(size=28))
        other = made.parameters + 10.0 ** rng.uniform(-5, 0) * (anywhere - made.parameters)
        bodies = [pseudo_inertia(row) for row in other[:20].reshape(2, 10)]
        share = [np.linalg.inv(np.linalg.cholesky(pseudo_inertia(row))) for row in ARM.parameters]
        least = min(np.linalg.eigvalsh(r @ b @ r.T)[0] for r, b in zip(share, bodies, strict=True))
        if least > LEAST_SHARE and (other[[20, 21, 23, 24, 25, 27]] >= 0.0).all():
            tried += 1
            assert distance(other) > best * (1.0 - 1e-3)
    assert tried >= 100


@pytest.mark.parametrize("name", ["serial-2r", "parallelogram-6bar"])
def test_bodies_of_the_files_exist(name):
    """Every shipped body has a pseudo-inertia that is not negative."""
    mechanism = load_mechanism(name)
    for row in mechanism.parameters:
        assert np.linalg.eigvalsh(pseudo_inertia(row))[0] > -1e-12
