"""Uncertainty of correction weights: from the errors of readings to coefficients, to weights, to residual readings.

Influence coefficients are linear in the readings of the runs, so their covariance follows from that of the readings.
Weights of least squares, w = -(A^H A)^-1 A^H v0, are differentiated; of other methods and limits they are drawn.
Errors of readings are taken as independent between runs and between rows, except stated common-mode errors of a run: a
late tachometer pulse turns the phases of all sensors by one angle. Each such error is a mode of its own, which changes
the coefficients of all rows together. Intervals are of 95 %. Units: [r] of readings, [w] of weights, in SI.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

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
from ..results import INLINE, Key, finite
from .influence_coefficients import Coefficients, Solution, design_matrix

DRAWS = 100
"""Draws where weights are not differentiated: their standard deviation is known to 7 %."""
_SIGNIFICANCE = 0.01
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
    """Of each row's (Re v0, Re alpha_1, ..., Im v0, Im alpha_1, ...), (rows, 2 planes + 2, 2 planes + 2) [r, r/w]."""
    degrees_of_freedom: Annotated[float, Key("degrees_of_freedom_a_row", to=finite)]
    """Of each row's covariance; infinite where the errors of readings are stated."""
    source: Annotated[str, Key("from")]
    """Where it comes from: ``stated`` or ``repeats``."""
    widened: Annotated[float, Key("stated_errors_widened_by")] = 1.0
    """Factor on the stated errors, above one where runs scatter more than they allow."""
    modes: Floats | None = None
    """Change of each row's coefficients by each common-mode error, (modes, rows, 2 planes + 2) [r, r/w]."""


@dataclass(frozen=True)
class CorrectionUncertainty:
    """Intervals of correction weights and of the residual readings."""

    coefficients: Annotated[CoefficientCovariance, INLINE]
    total: Complexes
    """The weights, (planes,) [w]."""
    covariance: Floats
    """Of the weight in each plane, components at 0 and 90 degrees, (planes, 2, 2) [w2]."""
    after: Floats
    """Distance from the predicted reading within which the true one is with 95 %, (rows,) [r]."""
    draws: Annotated[int | None, Key()]
    """How many solutions were drawn; None where the weights were differentiated."""
    degrees_of_freedom: tuple[float, ...]
    """Of each plane's covariance."""

    @property
    def weights(self) -> list[PolarInterval]:
        """Of the weight in each plane."""
        return self.about(self.total)

    @property
    def regions(self) -> list[Region]:
        """About the weight in each plane, or about the weight to be added there."""
        return [
            Estimate(np.array([w.real, w.imag]), c, n).region()
            for w, c, n in zip(self.total, self.covariance, self.degrees_of_freedom, strict=True)
        ]

    def about(self, weights: Complexes) -> list[PolarInterval]:
        """Intervals of the weights less known others, such as those already mounted: differences (planes,) [w]."""
        given = zip(weights, self.covariance, self.degrees_of_freedom, strict=True)
        return [polar_interval(complex(w), c, n) for w, c, n in given]


def covariance_of_runs(
    weights: Complexes, readings: Complexes, errors: Floats | None, common_phase: Floats | None = None
) -> CoefficientCovariance | None:
    """Covariance of the coefficients of runs: weights (runs, planes) [w], readings (runs, rows) [r].

    ``errors`` (runs, rows, 2, 2) [r2] are the readings' covariances where they are stated; else they are estimated from
    the residual of the runs, and None is returned where that has no degrees of freedom. ``common_phase`` (modes, runs,
    rows) [rad] are standard deviations of stated common-mode errors of phase.
    """
    design = design_matrix(weights)
    inverse = np.linalg.pinv(design)
    residual = readings - design @ (inverse @ readings)
    freedom = 2 * (design.shape[0] - design.shape[1])
    if errors is not None:
        changed = None if common_phase is None else 1j * common_phase * readings
        widened = _widening(residual, design @ inverse, errors, freedom, changed)
        modes = None
        if changed is not None:
            moved = np.swapaxes(inverse @ changed, 1, 2)
            modes = widened * np.concatenate([moved.real, moved.imag], axis=2)
        return CoefficientCovariance(_propagated(inverse, errors * widened**2), np.inf, "stated", widened, modes)
    if freedom == 0:
        return None
    variance = (np.abs(residual) ** 2).sum(axis=0) / freedom
    each = np.broadcast_to(variance[:, None, None] * np.eye(2), (*readings.shape, 2, 2))
    return CoefficientCovariance(_propagated(inverse, each), freedom, "repeats")


def covariance_of_stated(errors: Floats) -> CoefficientCovariance:
    """From stated covariances of the components of v0, alpha_1, ..., (planes + 1, rows, 2, 2) [r2, r2/w2]."""
    return CoefficientCovariance(_propagated(np.eye(len(errors), dtype=complex), errors), np.inf, "stated")


def propagate(
    solution: Solution, covariance: CoefficientCovariance, solve: Callable[[Coefficients], Solution]
) -> CorrectionUncertainty:
    """Intervals of a solution; ``solve`` gives the weights of other coefficients, where they have to be drawn."""
    weights, rows = solution.weights, len(solution.residual)
    mounted = _parts(np.r_[1.0, weights][None, :])
    whole = covariance.covariance
    if covariance.modes is not None:
        whole = whole + np.einsum("mri,mrj->rij", covariance.modes, covariance.modes)
    largest = [float(np.linalg.eigvalsh(mounted @ c @ mounted.T)[-1]) for c in whole]
    after = joint_coverage_factor(2, covariance.degrees_of_freedom) * np.sqrt(largest)
    if solution.is_free:
        shares, draws = _differentiated(solution, covariance), None
        variances = np.trace(shares, axis1=2, axis2=3)
        if not np.isfinite(variances.sum()):
            raise SizingError("the scatter of the runs is not finite: check the readings and their intervals")
        freedom = [effective_degrees_of_freedom(of_plane, covariance.degrees_of_freedom) for of_plane in variances.T]
    else:
        shares, draws = _drawn(solution, covariance, solve)[None], DRAWS
        freedom = [min(draws - 1.0, rows * covariance.degrees_of_freedom)] * len(weights)
    return CorrectionUncertainty(covariance, weights, shares.sum(axis=0), after, draws, tuple(freedom))


def polar_interval(value: complex, covariance: Floats, degrees_of_freedom: float = np.inf) -> PolarInterval:
    """Intervals of a vector's magnitude and angle from the covariance of its components, (2, 2) [its unit squared]."""
    u = np.array([value.real, value.imag]) / abs(value) if value else np.array([1.0, 0.0])
    reach = coverage_factor(degrees_of_freedom)
    along = reach * float(np.sqrt(u @ covariance @ u))
    across = reach * float(np.sqrt(np.array([-u[1], u[0]]) @ covariance @ np.array([-u[1], u[0]])))
    distinct = max(along, across) < abs(value)
    return PolarInterval(along, float(np.arcsin(across / abs(value))) if distinct else np.pi)


def reading_covariance(value: complex, along: float, across: float) -> Floats:
    """Covariance of a reading's components, (2, 2) [r2], by half widths of its 95 % intervals along and across [r]."""
    c, s = (value.real / abs(value), value.imag / abs(value)) if value else (1.0, 0.0)
    turn = np.array([[c, -s], [s, c]])
    sigma = np.square([standard_deviation_within(along), standard_deviation_within(across)])
    spread: Floats = turn @ np.diag(sigma) @ turn.T
    return spread


def _parts(matrix: Complexes) -> Floats:
    """The same map on real parts followed by imaginary parts, (2 m, 2 n)."""
    return np.block([[matrix.real, -matrix.imag], [matrix.imag, matrix.real]])


def _propagated(inverse: Complexes, errors: Floats) -> Floats:
    """Covariance of each row's coefficients, from those of its readings (runs, rows, 2, 2)."""
    parts, runs = _parts(inverse), inverse.shape[1]
    rows = []
    for row in range(errors.shape[1]):
        blocks = [[np.diag(errors[:, row, i, j]) for j in (0, 1)] for i in (0, 1)]
        rows.append(parts @ np.block(blocks).reshape(2 * runs, 2 * runs) @ parts.T)
    return np.array(rows)


def _widening(residual: Complexes, hat: Complexes, errors: Floats, freedom: int, changed: Complexes | None) -> float:
    """Factor on stated errors: one, unless the residual is beyond them with a probability below one per cent."""
    if freedom == 0:
        return 1.0
    off = np.eye(len(hat)) - hat
    expected = np.trace(_propagated(off, errors), axis1=1, axis2=2)
    if changed is not None:
        expected = expected + (np.abs(off @ changed) ** 2).sum(axis=(0, 1))
    ratio = float(np.mean((np.abs(residual) ** 2).sum(axis=0) / expected))
    whole = freedom * residual.shape[1]
    return float(np.sqrt(ratio)) if chi_square_tail(ratio * whole, whole) < _SIGNIFICANCE else 1.0


def _differentiated(solution: Solution, covariance: CoefficientCovariance) -> Floats:
    """Share of each row, then of common-mode errors, in the covariance of each plane's weight, (shares, planes, 2, 2).

    dw = -(A^H A)^-1 sum_i [conj(a_i) (dv0_i + da_i w) + conj(da_i) r_i], rows times their factors.
    """
    factors, weights = solution.factors, solution.weights
    matrix, residual = solution.coefficients.matrix * factors[:, None], solution.residual * factors
    normal = np.linalg.inv(matrix.conj().T @ matrix)
    planes, slopes = len(weights), []
    mirror = np.kron(np.diag([1.0, -1.0]), np.eye(planes + 1))
    for row, factor, rest in zip(matrix, factors, residual, strict=True):
        straight = -factor * (normal @ np.outer(row.conj(), np.r_[1.0, weights]))
        mirrored = -factor * rest * normal @ np.eye(planes, planes + 1, 1)
        slopes.append(_parts(straight) + _parts(mirrored) @ mirror)
    shares = [_by_plane(s @ c @ s.T, planes) for s, c in zip(slopes, covariance.covariance, strict=True)]
    if covariance.modes is not None:
        moved = np.einsum("rpi,mri->mp", np.array(slopes), covariance.modes)
        shares.append(_by_plane(moved.T @ moved, planes))
    return np.array(shares)


def _drawn(solution: Solution, covariance: CoefficientCovariance, solve: Callable[[Coefficients], Solution]) -> Floats:
    """Covariance of each plane's weight, from coefficients drawn about the estimates, (planes, 2, 2)."""
    rng = np.random.default_rng(_SEED)
    about, planes = solution.coefficients, len(solution.weights)
    values, vectors = np.linalg.eigh(covariance.covariance)
    roots = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    solved = []
    for _ in range(DRAWS):
        parts = (roots @ rng.normal(size=(*roots.shape[:2], 1)))[..., 0]
        if covariance.modes is not None:
            parts = parts + np.tensordot(rng.normal(size=len(covariance.modes)), covariance.modes, 1)
        off = parts[:, : planes + 1] + 1j * parts[:, planes + 1 :]
        solved.append(solve(Coefficients(about.initial + off[:, 0], about.matrix + off[:, 1:], 0.0)).weights)
    drawn = np.array(solved)
    return _by_plane(np.cov(np.hstack([drawn.real, drawn.imag]).T), planes)


def _by_plane(covariance: Floats, planes: int) -> Floats:
    """Blocks of the real and imaginary part of each plane, (planes, 2, 2)."""
    return np.array([covariance[np.ix_([p, planes + p], [p, planes + p])] for p in range(planes)])
