"""Base parameters and balance conditions from the same records: the same first moments, the same intervals."""

import numpy as np
import pytest

from balance.balancing import conditions
from balance.dynamics.regressor import joint_friction_regressor, torque_regressor
from balance.errors import DataError
from balance.estimation.base_parameters import base_parameters
from balance.estimation.first_moment_imbalance import imbalance_fit
from balance.estimation.identifiability import identifiability
from balance.estimation.regression import RegressionRecord, fit

from .. import models

ARM = models.load("serial-2r")
RNG = np.random.default_rng(11)
COUNT = 500
STATES = [np.cumsum(x, axis=0) * [[0.3, 0.2]] for x in RNG.normal(size=(3, COUNT, 2))]
BLOCKS = np.arange(COUNT) * 18 // COUNT


def record(columns, readings, **more):
    """In 18 blocks."""
    return RegressionRecord.of(columns, readings, BLOCKS, **more)


def torques():
    """Columns of all parameters with joint terms, their names, and noisy torques."""
    terms, names = joint_friction_regressor(ARM.driven, *STATES[1:])
    columns = np.concatenate([torque_regressor(ARM, *STATES), terms], axis=2)
    truth = np.concatenate([ARM.pi, np.tile([0.1, 0.01, 0.02, 0.004], 2)])
    return columns, [*ARM.parameter_names, *names], columns @ truth + RNG.normal(size=(COUNT, 2)) * [0.5, 0.1]


def test_identified_and_trimmed_first_moments_are_equal():
    """From one record of torques: by base parameters, and by conditions with what else is unknown as nuisances."""
    columns, names, torque = torques()
    found = conditions.balance_conditions(ARM)
    seen = identifiability(columns, names)
    identified = base_parameters(record(columns, torque), seen)
    padded = np.pad(found.matrix, ((0, 0), (0, columns.shape[2] - found.matrix.shape[1])))
    others = _complement(np.array([seen.share(row) for row in padded]))
    base = seen.base_columns(columns)
    turned = np.linalg.inv(np.vstack([[seen.share(row) for row in padded], others]))
    trimmed = imbalance_fit([record(base @ turned, torque)], found).imbalance
    for k, row in enumerate(padded):
        one, other = identified.estimate(row), trimmed.estimate(np.eye(found.rank)[k])
        size = abs(one.value)
        assert other.value == pytest.approx(one.value, abs=1e-9 * size)
        assert other.interval() == pytest.approx(one.interval(), abs=1e-9 * size)
        assert other.degrees_of_freedom == pytest.approx(one.degrees_of_freedom, rel=1e-7)


def _complement(rows):
    """Unit rows that complete a basis."""
    kept = list(rows)
    for unit in np.eye(rows.shape[1]):
        if np.linalg.matrix_rank(np.array([*kept, unit])) > len(kept):
            kept.append(unit)
    return np.array(kept[len(rows) :])


def test_nuisances_are_columns_of_their_own():
    """An offset that is a nuisance of the record, or an unknown among the others: the same values and intervals."""
    columns, names, torque = torques()
    offsets = [k for k, name in enumerate(names) if name.startswith("offset[")]
    base = list(identifiability(columns, names).pivots)
    rest = [k for k in base if k not in offsets]
    joint = fit([record(columns[:, :, rest + offsets], torque)])
    apart = fit([record(columns[:, :, rest], torque, nuisance=columns[:, :, offsets])])
    for unit in np.eye(len(rest)):
        one, other = joint.estimate(np.pad(unit, (0, len(offsets)))), apart.estimate(unit)
        assert other.value == pytest.approx(one.value, abs=1e-8 * max(abs(one.value), one.standard_uncertainty))
        assert other.half_width() == pytest.approx(one.half_width(), rel=1e-6)


def test_instruments_that_are_the_columns_change_nothing():
    """Instruments without noise of their own: least squares."""
    columns, names, torque = torques()
    base = identifiability(columns, names).base_columns(columns)
    plain, instrumented = (fit([record(base, torque, instruments=z)]) for z in (None, base))
    assert instrumented.values == pytest.approx(plain.values, rel=1e-9)
    assert instrumented.covariance == pytest.approx(plain.covariance, rel=1e-6, abs=1e-12)


def test_instruments_take_out_the_bias_of_noisy_columns():
    """Noise of the columns pulls least squares towards zero; columns made without it do not."""
    rng = np.random.default_rng(2)
    true = rng.normal(size=(COUNT * 4, 1, 1))
    noisy = true + 0.5 * rng.normal(size=true.shape)
    blocks, readings = np.arange(COUNT * 4) * 20 // (COUNT * 4), 2.0 * true[:, :, 0]
    plain = fit([RegressionRecord.of(noisy, readings, blocks)]).estimate(np.ones(1))
    free = fit([RegressionRecord.of(noisy, readings, blocks, instruments=true)]).estimate(np.ones(1))
    assert plain.value == pytest.approx(2.0 / 1.25, abs=0.1)
    assert free.interval()[0] < 2.0 < free.interval()[1]


def test_rows_of_one_name_share_their_noise():
    """A row that hardly moves in one record counts there by its noise in all."""
    rng = np.random.default_rng(3)
    columns, noise = rng.normal(size=(COUNT, 1, 1)), rng.normal(size=(COUNT, 1))
    loud, still = (
        record(columns, columns[:, :, 0] + noise, rows=("Fx",)),
        record(1e-3 * columns, 0.0 * noise, rows=("Fx",)),
    )
    assert fit([loud, still]).residual_rms["Fx"] == pytest.approx(1.0 / np.sqrt(2.0), rel=0.1)


def test_parts_that_differ_are_refused():
    """Readings of another length than the columns."""
    with pytest.raises(DataError, match="differ"):
        RegressionRecord.of(np.zeros((3, 1, 2)), np.zeros((4, 1)), np.zeros(3, dtype=int))
