"""Parameters of a mechanism from measured torques or wrenches: weighted least squares on what is observable.

tau = W pi, W = W[pivots] @ combinations: the base parameters b = combinations @ pi are solved for, nothing else.
Rows of a joint are weighted by its residual noise. Residuals are correlated in time, so intervals do not come from
their number: whole stretches of the record are left out in turn (delete-block jackknife), which also counts what the
model lacks, as long as a stretch outlasts the correlation.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from .arrays import Floats, Indices
from .conditions import Conditions
from .errors import DataError
from .mechanism import Mechanism
from .observability import Observability

CONFIDENCE = 0.95
"""Of intervals."""
_EXACT = 1e-4
"""Residual of a joint, as a part of its torque's rms, below which it earns no more weight."""
_REWEIGHTINGS = 20
_SETTLED = 1e-6
"""Relative change of the weights at which they count as found."""


@dataclass(frozen=True)
class Estimate:
    """A value with its standard error and 95 % interval."""

    value: float
    standard_error: float
    half_width: float
    """Half of the 95 % interval: standard error times Student's t for the number of stretches."""

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval."""
        return self.value - self.half_width, self.value + self.half_width


@dataclass(frozen=True)
class Identified:
    """Base parameters with their covariance."""

    observability: Observability
    base: Floats
    """Values of the base parameters, (r,) [SI]."""
    covariance: Floats
    """Of the base parameters, (r, r), from the delete-block jackknife."""
    residual_rms: Floats
    """Torque that the model leaves, rms, a joint, (joints,) [N m, N]."""
    blocks: int
    """Number of stretches that were left out in turn."""

    def estimate(self, combination: Mapping[str, float] | Floats) -> Estimate:
        """Any observable combination, by names or as a vector over all parameters (p,).

        Raises NotObservable, naming it, if the record does not determine it.
        """
        vector = self.observability.vector(combination) if isinstance(combination, Mapping) else combination
        share = self.observability.share(vector)
        error = float(np.sqrt(max(float(share @ self.covariance @ share), 0.0)))
        return Estimate(float(share @ self.base), error, student_t(self.blocks - 1) * error)

    def predict(self, regressor: Floats) -> Floats:
        """Torques [N m, N] of a regressor (n, joints, p) for the identified parameters, (n, joints)."""
        return np.asarray(regressor[:, :, list(self.observability.pivots)] @ self.base)


def solve(
    regressor: Floats, torque: Floats, observability: Observability, blocks: Indices, used: Floats | None = None
) -> Identified:
    """Identify from W (n, joints, p) and tau (n, joints) [N m, N].

    ``blocks`` (n,) numbers the stretch that each sample is in, at least as long as residuals are correlated; ``used``
    (n, joints), zero or one, leaves out single torques. Raises DataError where there are too few stretches.
    """
    columns = base_columns(regressor, observability)
    length = np.sqrt(np.mean(columns**2, axis=(0, 1)))
    sums = BlockSums.of(columns / length, torque, blocks, np.ones_like(torque) if used is None else used)
    if sums.count < 3:
        raise DataError(f"an interval needs three stretches of the record to leave out in turn: there are {sums.count}")
    weights, scaled = sums.solve(np.ones(sums.count))
    left_out = np.array([sums.solve(1.0 - one, weights)[1] for one in np.eye(sums.count)])
    spread = (left_out - left_out.mean(axis=0)) / length
    covariance = (sums.count - 1) / sums.count * spread.T @ spread
    return Identified(observability, scaled / length, covariance, 1.0 / np.sqrt(weights), sums.count)


def base_columns(regressor: Floats, observability: Observability) -> Floats:
    """The columns of a regressor (n, joints, p) that its base parameters multiply, (n, joints, r)."""
    return regressor[:, :, list(observability.pivots)]


@dataclass(frozen=True)
class BlockSums:
    """Normal equations of each stretch and joint, from which any choice of stretches is solved without the samples."""

    matrix: Floats
    """Sums of w' w, (blocks, joints, r, r)."""
    vector: Floats
    """Sums of w' tau, (blocks, joints, r)."""
    square: Floats
    """Sums of tau^2, (blocks, joints)."""
    samples: Floats
    """Number of torques, (blocks, joints)."""

    @classmethod
    def of(cls, columns: Floats, torque: Floats, blocks: Indices, used: Floats) -> "BlockSums":
        """Sum over samples: ``columns`` (n, joints, r), ``torque`` and ``used`` (n, joints), ``blocks`` (n,)."""
        labels, place = np.unique(blocks, return_inverse=True)
        parts = [np.flatnonzero(place == k) for k in range(len(labels))]
        joints = np.moveaxis(columns * used[:, :, None], 1, 0)
        matrix = np.array([[w[part].T @ w[part] for w in joints] for part in parts])
        vector = np.array([[w[part].T @ tau[part] for w, tau in zip(joints, torque.T, strict=True)] for part in parts])
        square = np.array([np.sum(used[part] * torque[part] ** 2, axis=0) for part in parts])
        return cls(matrix, vector, square, np.array([used[part].sum(axis=0) for part in parts]))

    @property
    def count(self) -> int:
        """Number of stretches."""
        return len(self.matrix)

    def solve(self, chosen: Floats, weights: Floats | None = None) -> tuple[Floats, Floats]:
        """Weights (joints,) and parameters (r,) from the ``chosen`` stretches (blocks,), zero or one.

        Weights not given are those of the residuals: 1 / their mean square, found by repetition.
        """
        matrix, vector = np.tensordot(chosen, self.matrix, 1), np.tensordot(chosen, self.vector, 1)
        if weights is not None:
            return weights, _solved(matrix, vector, weights)
        square, samples = chosen @ self.square, chosen @ self.samples
        weights = samples / square
        for _ in range(_REWEIGHTINGS):
            parameters = _solved(matrix, vector, weights)
            left = square - 2 * vector @ parameters + np.einsum("i,jik,k->j", parameters, matrix, parameters)
            before, weights = weights, samples / np.maximum(left, _EXACT**2 * square)
            if np.abs(weights / before - 1.0).max() < _SETTLED:
                break
        return weights, _solved(matrix, vector, weights)


def _solved(matrix: Floats, vector: Floats, weights: Floats) -> Floats:
    """Minimum-norm solution: a choice of stretches without some excitation yields a poor value, not an error."""
    return np.linalg.lstsq(np.tensordot(weights, matrix, 1), weights @ vector, rcond=1e-14)[0]


def student_t(freedom: int) -> float:
    """Factor from a standard error to half of a 95 % interval for so many degrees of freedom."""
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.5 + CONFIDENCE / 2))


def counter_mass_rows(conditions: Conditions, mechanism: Mechanism, sites: Sequence[str]) -> dict[str, Floats]:
    """The counter-mass at each site as a combination of the inertial parameters, mass = row @ pi, (10 nb,).

    From ``A pi + B m = 0`` in least squares: the masses are linear in pi, so that intervals of pi carry over.
    """
    columns = [conditions.matrix @ (mechanism.with_counter_mass({site: 1.0}).pi - mechanism.pi) for site in sites]
    rows = -np.linalg.pinv(np.array(columns).T, rcond=1e-12) @ conditions.matrix
    return dict(zip(sites, rows, strict=True))
