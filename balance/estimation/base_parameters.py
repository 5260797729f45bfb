"""Base parameters of a mechanism: the combinations that a record determines, and bodies that may have them.

tau = W pi, W = W[pivots] @ combinations: the base parameters b = combinations @ pi are solved for, nothing else.

A body can exist if its pseudo-inertia, the 4 x 4 matrix [[S, h], [h', m]] of its density's second moments S, first
moments h and mass m, is positive definite; S = tr(I)/2 1 - I (Wensing, Kim, Slotine, IEEE Robot. Autom. Lett. 3, 2018).
Frictions and drive inertias are not negative. What a record determines, a set of parameters has: the one that is
given is nearest to those of the mechanism's file in the metric tr((P0^-1 dP)^2), which no choice of frame or unit
changes (Lee, Park, IEEE Robot. Autom. Lett. 3, 2018). Both are convex programmes, solved to a proven optimum.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Cones, Floats, conic_optimum, packed_triangle
from ..errors import DataError
from ..mechanism.mechanism import PARAMETERS, Mechanism, pseudo_inertia
from .estimate import Estimate
from .identifiability import Identifiability
from .regression import RegressionFit, RegressionRecord, fit

LEAST_SHARE = 1e-3
"""Pseudo-inertias are kept above this share of those of the file: definite, not merely semidefinite."""
FEASIBLE_SIGMA = 1e-3
"""Distance of the nearest feasible set, in standard errors, up to which the free estimate counts as feasible."""
_SIZE = 4
_NOT_NEGATIVE = ("coulomb[", "viscous[", "armature[")


@dataclass(frozen=True)
class BaseParameters:
    """Base parameters as identified."""

    identifiability: Identifiability
    fit: RegressionFit

    @property
    def values(self) -> Floats:
        """(r,) [SI]"""
        return self.fit.values

    @property
    def covariance(self) -> Floats:
        """(r, r) [SI]"""
        return self.fit.covariance

    @property
    def determines_all(self) -> bool:
        """Whether the solve determined every base parameter."""
        return len(self.fit.excited) == self.identifiability.rank

    def estimate(self, combination: Mapping[str, float] | Floats) -> Estimate:
        """Any identifiable combination, by names or as a vector over all parameters (p,) [-].

        Raises NotIdentifiable, naming it, if the record does not determine it.
        """
        known = self.identifiability
        vector = known.vector(combination) if isinstance(combination, Mapping) else combination
        return self.fit.estimate(known.share(vector))

    def predict(self, regressor: Floats) -> Floats:
        """Torques [N m, N] of a regressor (n, rows, p), (n, rows)."""
        return np.asarray(self.identifiability.base_columns(regressor) @ self.values)


def base_parameters(record: RegressionRecord, identifiability: Identifiability) -> BaseParameters:
    """From a record whose columns are those of the base parameters, or of all parameters, which are reduced to them.

    Raises DataError where there are too few blocks.
    """
    if record.columns.shape[2] != identifiability.rank:
        record = replace(record, columns=identifiability.base_columns(record.columns))
    return BaseParameters(identifiability, fit([record], conditions=identifiability.first_moments))


@dataclass(frozen=True)
class Consistent:
    """The nearest parameters that bodies can have."""

    parameters: Floats
    """All parameters, (p,): what the record does not determine is as near as may be to the file's."""
    base: Floats
    """Base parameters of these, (r,)."""
    distance: float
    """From the free estimate, in standard errors (Mahalanobis): zero where that is feasible."""

    @property
    def free_is_feasible(self) -> bool:
        """Whether bodies exist that have the free estimate's base parameters."""
        return self.distance <= FEASIBLE_SIGMA

    def least_eigenvalue(self) -> float:
        """Smallest eigenvalue over all bodies' pseudo-inertias, of the part that the parameters name [SI]."""
        bodies = self.parameters[: len(self.parameters) // len(PARAMETERS) * len(PARAMETERS)]
        return min(float(np.linalg.eigvalsh(pseudo_inertia(row))[0]) for row in bodies.reshape(-1, len(PARAMETERS)))


def consistent(identified: BaseParameters, mechanism: Mechanism, file: Floats) -> Consistent:
    """The nearest feasible base parameters, then the member of their set that is nearest to ``file`` (p,) [SI].

    Raises DataError where the solver proves no optimum.
    """
    combinations = identified.identifiability.combinations
    problem = _Problem(mechanism, identified.identifiability.names, file)
    errors = np.sqrt(np.diag(identified.covariance))
    floor = 1e-9 * max(float(np.abs(identified.values).max()), 1e-12)
    whiten = _inverse_root(identified.covariance, np.maximum(errors, floor))
    nearest = problem.solve(whiten @ combinations, whiten @ identified.values, 1e-8)
    distance = float(np.linalg.norm(whiten @ (combinations @ nearest - identified.values)))
    base = identified.values if distance <= FEASIBLE_SIGMA else combinations @ nearest
    member = problem.solve(whiten @ combinations / _TIGHT, whiten @ base / _TIGHT, 1.0)
    return Consistent(member, combinations @ member, distance)


_TIGHT = 1e-3
"""Standard errors by which the member may miss the base parameters."""


def _inverse_root(covariance: Floats, errors: Floats) -> Floats:
    """A matrix T with T' T = covariance^-1; directions that so few blocks do not tell apart count with 1e-4."""
    values, vectors = np.linalg.eigh(covariance / np.outer(errors, errors))
    return np.asarray((vectors / np.sqrt(np.maximum(values, 1e-4))).T / errors)


class _Problem:
    """min |A pi - b|^2 + w d(pi, file)^2 over parameters of bodies that exist."""

    def __init__(self, mechanism: Mechanism, names: Sequence[str], file: Floats) -> None:
        self.names, self.file = names, file
        self.bodies = len(mechanism.bodies)
        self.reference = [_definite(row) for row in mechanism.parameters]
        # Sizes by which the unknowns are counted, so that the solver sees numbers near one, (p,).
        roots = [np.sqrt(np.diag(reference)) for reference in self.reference]
        units = [pseudo_inertia(unit) for unit in np.eye(len(PARAMETERS))]
        sizes = [np.abs(unit / np.outer(root, root)).max() for root in roots for unit in units]
        rest = np.maximum(np.abs(self.file[len(sizes) :]), 0.1)
        self.scale = np.concatenate([1.0 / np.array(sizes), rest])

    def solve(self, rows: Floats, wanted: Floats, weight: float) -> Floats:
        """The optimum, (p,)."""
        distance, from_file = self._distance()
        matrix = np.concatenate([rows * self.scale, np.sqrt(weight) * distance])
        target = np.concatenate([wanted, np.sqrt(weight) * from_file])
        try:
            return self._optimum(matrix, target)
        except DataError:
            size = np.abs(matrix).max()  # very sure records: the solver's tolerances are of numbers near one
            return self._optimum(matrix / size, target / size)

    def _optimum(self, matrix: Floats, target: Floats) -> Floats:
        """Parameters (p,) of the least |matrix x - target|. Raises DataError where that is not proven."""
        cone_rows, cone_right, cones = self._cones()
        count, slack = matrix.shape[1], matrix.shape[0]
        # min |s|^2 with s = matrix x - target as unknowns of their own: far better conditioned than matrix' matrix
        square = np.diag(np.concatenate([np.zeros(count), np.ones(slack)]))
        equal = np.hstack([matrix, -np.eye(slack)])
        constraints = np.hstack([cone_rows, np.zeros((len(cone_rows), slack))])
        rows, right = np.vstack([equal, constraints]), np.concatenate([target, cone_right])
        solution = conic_optimum(np.zeros(count + slack), rows, right, [("Zero", slack), *cones], 1e-10, square)
        if str(solution.status) not in {"Solved", "AlmostSolved"}:
            raise DataError(f"no proven set of bodies for these parameters: the conic solver says {solution.status}")
        return np.asarray(solution.x[:count]) * self.scale

    def _relative(self) -> list[list[Floats]]:
        """Of each body P0^-1/2 dP P0^-1/2 per unit of each of its ten parameters, (4, 4) each."""
        found = []
        for reference in self.reference:
            root = np.linalg.inv(np.linalg.cholesky(reference))
            found.append([root @ pseudo_inertia(unit) @ root.T for unit in np.eye(len(PARAMETERS))])
        return found

    def _distance(self) -> tuple[Floats, Floats]:
        """Rows D and D x_file with |D x - D x_file|^2 = sum of tr((P0^-1 dP)^2) and of relative terms, squared."""
        count, wide = len(self.names), len(PARAMETERS)
        rows = np.zeros((self.bodies, _SIZE * _SIZE, count))
        for body, units in enumerate(self._relative()):
            rows[body, :, body * wide : (body + 1) * wide] = np.transpose([unit.ravel() for unit in units])
        rows *= self.scale
        whole = np.concatenate([*rows, np.eye(count)[self.bodies * wide :]])
        return whole, whole @ (self.file / self.scale)

    def _cones(self) -> tuple[Floats, Floats, Cones]:
        """A, b and cones of b - A x in cones: pseudo-inertias above their least share, terms not negative."""
        count, wide = len(self.names), len(PARAMETERS)
        blocks = np.zeros((self.bodies, _SIZE * (_SIZE + 1) // 2, count))
        for body, units in enumerate(self._relative()):
            blocks[body, :, body * wide : (body + 1) * wide] = -np.transpose([packed_triangle(unit) for unit in units])
        blocks *= self.scale
        terms = [k for k, name in enumerate(self.names) if name.startswith(_NOT_NEGATIVE)]
        cones = [("PSDTriangle", _SIZE)] * self.bodies + ([("Nonnegative", len(terms))] if terms else [])
        least = np.tile(-LEAST_SHARE * packed_triangle(np.eye(_SIZE)), self.bodies)
        return np.concatenate([*blocks, -np.eye(count)[terms]]), np.pad(least, (0, len(terms))), cones


def _definite(row: Floats) -> Floats:
    """A body's pseudo-inertia in its file, made definite where a point mass or a plate has none across it."""
    matrix = pseudo_inertia(row)
    mass = max(float(row[0]), 1e-6)
    size = max(float(np.trace(matrix[:3, :3])) / mass, 1e-6)
    scale = np.sqrt([mass * size] * 3 + [mass])
    values, vectors = np.linalg.eigh(matrix / np.outer(scale, scale))
    whole = (vectors * np.maximum(values, 1e-4)) @ vectors.T
    return np.asarray(whole * np.outer(scale, scale))
