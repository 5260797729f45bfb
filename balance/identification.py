"""Parameters of a mechanism from measured torques or wrenches: weighted least squares on what is observable.

tau = W pi, W = W[pivots] @ combinations: the base parameters b = combinations @ pi are solved for, nothing else.
Rows of a joint are weighted by its residual noise. Residuals are correlated in time, so intervals do not come from
their number: whole stretches of the record are left out in turn (delete-block jackknife), which also counts what the
model lacks, as long as a stretch outlasts the correlation.

Where W itself carries noise, least squares is biased towards zero: Z' W b = Z' tau with instruments Z, a W made
without that noise, is not (instrumental variables; Janot, Vandanjon, Gautier, IEEE Trans. Control Syst. Technol. 22,
2014).
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
    regressor: Floats,
    torque: Floats,
    observability: Observability,
    blocks: Indices,
    used: Floats | None = None,
    instruments: Floats | None = None,
) -> Identified:
    """Identify from W (n, rows, p) and tau (n, rows) [N m, N].

    ``blocks`` (n,) numbers the stretch that each sample is in, at least as long as residuals are correlated; ``used``
    (n, rows), zero or one, leaves out single torques; ``instruments`` (n, rows, r) stand for the base columns of W
    where these carry noise. Raises DataError where there are too few stretches.
    """
    columns = base_columns(regressor, observability)
    return solve_base(columns, torque, observability, blocks, used, instruments)


def solve_base(
    columns: Floats,
    torque: Floats,
    observability: Observability,
    blocks: Indices,
    used: Floats | None = None,
    instruments: Floats | None = None,
) -> Identified:
    """The same from the base columns of W alone, (n, rows, r)."""
    length = np.sqrt(np.mean(columns**2, axis=(0, 1)))
    everything = np.ones_like(torque) if used is None else used
    scaled = None if instruments is None else instruments / length
    sums = BlockSums.of(columns / length, torque, blocks, everything, scaled).informed()
    if sums.count < 3:
        raise DataError(f"an interval needs three stretches of the record to leave out in turn: there are {sums.count}")
    weights, found = sums.solve(np.ones(sums.count))
    left_out = np.array([sums.solve(1.0 - one, weights)[1] for one in np.eye(sums.count)])
    spread = (left_out - left_out.mean(axis=0)) / length
    covariance = (sums.count - 1) / sums.count * spread.T @ spread
    return Identified(observability, found / length, covariance, 1.0 / np.sqrt(weights), sums.count)


def base_columns(regressor: Floats, observability: Observability) -> Floats:
    """The columns of a regressor (n, joints, p) that its base parameters multiply, (n, joints, r)."""
    return regressor[:, :, list(observability.pivots)]


@dataclass(frozen=True)
class BlockSums:
    """Normal equations of each stretch and row, from which any choice of stretches is solved without the samples."""

    matrix: Floats
    """Sums of w' w, (blocks, rows, r, r)."""
    vector: Floats
    """Sums of w' tau, (blocks, rows, r)."""
    square: Floats
    """Sums of tau^2, (blocks, rows)."""
    samples: Floats
    """Number of torques, (blocks, rows)."""
    instrumented: tuple[Floats, Floats] | None = None
    """Sums of z' w and z' tau where there are instruments z."""

    @classmethod
    def of(
        cls, columns: Floats, torque: Floats, blocks: Indices, used: Floats, instruments: Floats | None = None
    ) -> "BlockSums":
        """Sum over samples: ``columns`` (n, rows, r), ``torque`` and ``used`` (n, rows), ``blocks`` (n,)."""
        labels, place = np.unique(blocks, return_inverse=True)
        parts = [np.flatnonzero(place == k) for k in range(len(labels))]
        own = _sums(columns, columns, torque, parts, used)
        other = None if instruments is None else _sums(instruments, columns, torque, parts, used)
        square = np.array([np.sum(used[part] * torque[part] ** 2, axis=0) for part in parts])
        return cls(*own, square, np.array([used[part].sum(axis=0) for part in parts]), other)

    @property
    def count(self) -> int:
        """Number of stretches."""
        return len(self.matrix)

    def informed(self) -> "BlockSums":
        """Only the stretches in which anything is used."""
        some = self.samples.any(axis=1)
        other = None if self.instrumented is None else (self.instrumented[0][some], self.instrumented[1][some])
        return BlockSums(self.matrix[some], self.vector[some], self.square[some], self.samples[some], other)

    def solve(self, chosen: Floats, weights: Floats | None = None) -> tuple[Floats, Floats]:
        """Weights (rows,) and parameters (r,) from the ``chosen`` stretches (blocks,), zero or one.

        Weights not given are those of the residuals: 1 / their mean square, found by repetition.
        """
        matrix, vector = np.tensordot(chosen, self.matrix, 1), np.tensordot(chosen, self.vector, 1)
        solved = matrix, vector
        if self.instrumented is not None:
            solved = np.tensordot(chosen, self.instrumented[0], 1), np.tensordot(chosen, self.instrumented[1], 1)
        if weights is not None:
            return weights, _solved(*solved, weights)
        square, samples = chosen @ self.square, chosen @ self.samples
        weights = samples / square
        for _ in range(_REWEIGHTINGS):
            parameters = _solved(*solved, weights)
            left = square - 2 * vector @ parameters + np.einsum("i,jik,k->j", parameters, matrix, parameters)
            before, weights = weights, samples / np.maximum(left, _EXACT**2 * square)
            if np.abs(weights / before - 1.0).max() < _SETTLED:
                break
        return weights, _solved(*solved, weights)


def _sums(
    left: Floats, columns: Floats, torque: Floats, parts: Sequence[Indices], used: Floats
) -> tuple[Floats, Floats]:
    """Sums of l' w (blocks, rows, r, r) and l' tau (blocks, rows, r) over what is used."""
    rows = np.moveaxis(left * used[:, :, None], 1, 0)
    matrix = np.array([[z[p].T @ w[p] for z, w in zip(rows, np.moveaxis(columns, 1, 0), strict=True)] for p in parts])
    vector = np.array([[z[p].T @ tau[p] for z, tau in zip(rows, torque.T, strict=True)] for p in parts])
    return matrix, vector


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
