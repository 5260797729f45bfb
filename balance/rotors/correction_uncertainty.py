"""Uncertainty of correction weights: from the errors of readings to coefficients, to weights, to their residual.

Influence coefficients are linear in the readings of the runs, so their covariance follows from that of the readings.
Weights of least squares, w = -(A^H A)^-1 A^H v0, are differentiated; of other methods and limits they are drawn.
Errors of readings are taken as independent between runs and between rows, but for those stated as shared by a run: a
tachometer that comes late turns the phases of all sensors alike. Each such error is a mode of its own; what it does to
the coefficients of different rows belongs together.
Intervals are of 95 %.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..arrays import Complexes, Floats
from ..errors import SizingError
from ..estimation.estimate import (
    Estimate,
    Region,
    chi_square_tail,
    coverage_factor,
    effective_degrees_of_freedom,
    joint_coverage_factor,
    standard_deviation_within,
)
from .influence_coefficients import Coefficients, Solution, known_of

DRAWS = 100
"""Draws where weights are not differentiated: their standard deviation is known to 7 %."""
_DOUBT = 0.01
"""Probability below which runs scatter more than the stated errors allow."""
_SEED = 0


@dataclass(frozen=True)
class PolarInterval:
    """Half widths of the 95 % intervals of a vector's magnitude and angle."""

    magnitude: float
    """In the vector's unit."""
    angle: float
    """At most pi, where the vector is not distinguished from zero [rad]."""


@dataclass(frozen=True)
class CoefficientCovariance:
    """Covariance of the coefficients that runs give."""

    covariance: Floats
    """Of each row's (Re v0, Re alpha_1, ..., Im v0, Im alpha_1, ...), (rows, 2 planes + 2, 2 planes + 2)."""
    degrees_of_freedom: float
    """Of each row's covariance; infinite where the errors of readings are stated."""
    source: str
    """Where it comes from: ``stated`` or ``repeats``."""
    widened: float = 1.0
    """Factor on the stated errors, above one where runs scatter more than they allow."""
    modes: Floats | None = None
    """Change of each row's coefficients by errors that rows share, (modes, rows, 2 planes + 2)."""


@dataclass(frozen=True)
class CorrectionUncertainty:
    """Intervals of correction weights and of the readings that they leave."""

    scatter: CoefficientCovariance
    total: Complexes
    """The weights, (planes,)."""
    covariance: Floats
    """Of the weight in each plane, components at 0 and 90 degrees, (planes, 2, 2)."""
    after: Floats
    """Distance from the predicted reading within which the true one lies with 95 %, (rows,)."""
    draws: int | None
    """How many solutions were drawn; None where the weights were differentiated."""
    degrees_of_freedom: tuple[float, ...]
    """Of each plane's covariance."""

    @property
    def weights(self) -> list[PolarInterval]:
        """Of the weight in each plane."""
        return self.about(self.total)

    @property
    def regions(self) -> list[Region]:
        """About the weight in each plane, or about what is to be added there."""
        return [
            Estimate(np.array([w.real, w.imag]), c, n).region()
            for w, c, n in zip(self.total, self.covariance, self.degrees_of_freedom, strict=True)
        ]

    def about(self, weights: Complexes) -> list[PolarInterval]:
        """Intervals of the weights (planes,) less others that are known, such as those that are on already."""
        given = zip(weights, self.covariance, self.degrees_of_freedom, strict=True)
        return [polar_interval(complex(w), c, n) for w, c, n in given]


def covariance_of_runs(
    weights: Complexes, readings: Complexes, errors: Floats | None, shared: Floats | None = None
) -> CoefficientCovariance | None:
    """Scatter of the coefficients of runs: weights (runs, planes), readings (runs, rows).

    ``errors`` (runs, rows, 2, 2) are the readings' covariances where they are stated; else what repeated runs leave
    over tells them, and without runs to spare nothing does: None. ``shared`` (modes, runs, rows) are deviations of
    phase that rows share, beside stated ones [rad].
    """
    known = known_of(weights)
    inverse = np.linalg.pinv(known)
    left = readings - known @ (inverse @ readings)
    spare = 2 * (known.shape[0] - known.shape[1])
    if errors is not None:
        changed = None if shared is None else 1j * shared * readings
        widened = _widening(left, known @ inverse, errors, spare, changed)
        modes = None if changed is None else widened * _coefficient_modes(inverse, changed)
        return CoefficientCovariance(_propagated(inverse, errors * widened**2), np.inf, "stated", widened, modes)
    if spare == 0:
        return None
    variance = (np.abs(left) ** 2).sum(axis=0) / spare
    each = np.broadcast_to(variance[:, None, None] * np.eye(2), (*readings.shape, 2, 2))
    return CoefficientCovariance(_propagated(inverse, each), spare, "repeats")


def covariance_of_stated(errors: Floats) -> CoefficientCovariance:
    """Scatter of stated coefficients: covariances of each row's v0, alpha_1, ..., (planes + 1, rows, 2, 2)."""
    return CoefficientCovariance(_propagated(np.eye(len(errors), dtype=complex), errors), np.inf, "stated")


def propagate(
    solution: Solution, scatter: CoefficientCovariance, again: Callable[[Coefficients], Solution]
) -> CorrectionUncertainty:
    """Intervals of a solution; ``again`` solves for other coefficients, where weights have to be drawn."""
    weights, rows = solution.weights, len(solution.residual)
    mounted = _parts(np.r_[1.0, weights][None, :])
    whole = (
        scatter.covariance
        if scatter.modes is None
        else scatter.covariance + np.einsum("mri,mrj->rij", scatter.modes, scatter.modes)
    )
    left = np.array([mounted @ c @ mounted.T for c in whole])
    after = joint_coverage_factor(2, scatter.degrees_of_freedom) * np.sqrt(
        [float(np.linalg.eigvalsh(c)[-1]) for c in left]
    )
    if solution.is_free:
        by_row = _differentiated(solution, scatter)
        draws = None
    else:
        by_row, draws = _drawn(solution, scatter, again)[None], DRAWS
    spare = [
        _effective(np.trace(by_row[:, p], axis1=1, axis2=2), scatter.degrees_of_freedom) for p in range(len(weights))
    ]
    if draws is not None:
        spare = [min(draws - 1.0, rows * scatter.degrees_of_freedom)] * len(weights)
    return CorrectionUncertainty(scatter, weights, by_row.sum(axis=0), after, draws, tuple(spare))


def polar_interval(value: complex, covariance: Floats, degrees_of_freedom: float = np.inf) -> PolarInterval:
    """Intervals of a vector's magnitude and angle from the covariance of its parts (2, 2)."""
    u = np.array([value.real, value.imag]) / abs(value) if value else np.array([1.0, 0.0])
    reach = coverage_factor(degrees_of_freedom)
    along = reach * float(np.sqrt(u @ covariance @ u))
    across = reach * float(np.sqrt(np.array([-u[1], u[0]]) @ covariance @ np.array([-u[1], u[0]])))
    distinct = max(along, across) < abs(value)
    return PolarInterval(along, float(np.arcsin(across / abs(value))) if distinct else np.pi)


def reading_covariance(value: complex, along: float, across: float) -> Floats:
    """Covariance of a reading's parts from the half widths of its 95 % intervals along and across it, (2, 2)."""
    c, s = (value.real / abs(value), value.imag / abs(value)) if value else (1.0, 0.0)
    turn = np.array([[c, -s], [s, c]])
    spread: Floats = (
        turn @ np.diag(np.square([standard_deviation_within(along), standard_deviation_within(across)])) @ turn.T
    )
    return spread


def _coefficient_modes(inverse: Complexes, changed: Complexes) -> Floats:
    """Change of each row's (Re v0, Re alpha_1, ..., Im v0, Im alpha_1, ...), (modes, rows, 2 planes + 2)."""
    coefficients = np.swapaxes(inverse @ changed, 1, 2)
    return np.concatenate([coefficients.real, coefficients.imag], axis=2)


def _parts(matrix: Complexes) -> Floats:
    """The same map on real parts followed by imaginary parts, (2 m, 2 n)."""
    return np.block([[matrix.real, -matrix.imag], [matrix.imag, matrix.real]])


def _propagated(inverse: Complexes, errors: Floats) -> Floats:
    """Covariance of each row's coefficients, from those of its readings (runs, rows, 2, 2)."""
    taken = _parts(inverse)
    runs = inverse.shape[1]
    found = []
    for row in range(errors.shape[1]):
        blocks = [[np.diag(errors[:, row, i, j]) for j in (0, 1)] for i in (0, 1)]
        found.append(taken @ np.block(blocks).reshape(2 * runs, 2 * runs) @ taken.T)
    return np.array(found)


def _widening(left: Complexes, hat: Complexes, errors: Floats, spare: int, changed: Complexes | None) -> float:
    """Factor on stated errors: one, unless what the runs leave over is beyond them with less than one per cent."""
    if spare == 0:
        return 1.0
    rest = _propagated(np.eye(len(hat)) - hat, errors)
    expected = np.trace(rest, axis1=1, axis2=2)
    if changed is not None:
        expected = expected + (np.abs((np.eye(len(hat)) - hat) @ changed) ** 2).sum(axis=(0, 1))
    ratio = float(np.mean((np.abs(left) ** 2).sum(axis=0) / expected))
    freedom = spare * left.shape[1]
    return float(np.sqrt(ratio)) if chi_square_tail(ratio * freedom, freedom) < _DOUBT else 1.0


def _differentiated(solution: Solution, scatter: CoefficientCovariance) -> Floats:
    """Share of each row, then of shared errors, in the covariance of each plane's weight, (shares, planes, 2, 2).

    dw = -(A^H A)^-1 sum_i [conj(a_i) (dv0_i + da_i w) + conj(da_i) r_i], rows times their factors.
    """
    factors, weights = solution.factors, solution.weights
    matrix, left = solution.coefficients.matrix * factors[:, None], solution.residual * factors
    normal = np.linalg.inv(matrix.conj().T @ matrix)
    planes, slopes = len(weights), []
    mirror = np.kron(np.diag([1.0, -1.0]), np.eye(planes + 1))
    none = np.zeros((planes, 1))
    for row, factor, rest in zip(matrix, factors, left, strict=True):
        straight = -factor * (normal @ np.outer(row.conj(), np.r_[1.0, weights]))
        mirrored = -factor * rest * normal @ np.hstack([none, np.eye(planes)])
        slopes.append(_parts(straight) + _parts(mirrored) @ mirror)
    shares = [_by_plane(s @ c @ s.T, planes) for s, c in zip(slopes, scatter.covariance, strict=True)]
    if scatter.modes is not None:
        moved = np.einsum("rpi,mri->mp", np.array(slopes), scatter.modes)
        shares.append(_by_plane(moved.T @ moved, planes))
    return np.array(shares)


def _drawn(solution: Solution, scatter: CoefficientCovariance, again: Callable[[Coefficients], Solution]) -> Floats:
    """Covariance of each plane's weight, from coefficients drawn about those found, (planes, 2, 2)."""
    rng = np.random.default_rng(_SEED)
    about, planes = solution.coefficients, len(solution.weights)
    roots = np.array([_root(c) for c in scatter.covariance])
    found = []
    for _ in range(DRAWS):
        parts = (roots @ rng.normal(size=(*roots.shape[:2], 1)))[..., 0]
        if scatter.modes is not None:
            parts = parts + np.tensordot(rng.normal(size=len(scatter.modes)), scatter.modes, 1)
        off = parts[:, : planes + 1] + 1j * parts[:, planes + 1 :]
        found.append(again(Coefficients(about.initial + off[:, 0], about.matrix + off[:, 1:], 0.0)).weights)
    drawn = np.array(found)
    return _by_plane(np.cov(np.hstack([drawn.real, drawn.imag]).T), planes)


def _root(covariance: Floats) -> Floats:
    """A matrix whose product with its transpose is the covariance."""
    values, vectors = np.linalg.eigh(covariance)
    root: Floats = vectors * np.sqrt(np.maximum(values, 0.0))
    return root


def _by_plane(covariance: Floats, planes: int) -> Floats:
    """Blocks of the real and imaginary part of each plane, (planes, 2, 2)."""
    return np.array([covariance[np.ix_([p, planes + p], [p, planes + p])] for p in range(planes)])


def _effective(shares: Floats, degrees_of_freedom: float) -> float:
    """Degrees of freedom of a sum of variances, each with as many."""
    if not np.isfinite(shares.sum()):
        raise SizingError("the scatter of the runs is not finite")
    return effective_degrees_of_freedom(shares, degrees_of_freedom)
