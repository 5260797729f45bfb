"""What first moment is missing where, from measured shaking forces: least squares on the balance conditions.

The shaking force is linear in pi and vanishes where the conditions C pi = c are zero: F = W_F pi = W_F C^+ c. So c is
what is measured, one number a condition, and counter-masses m that would balance are those of C pi + B m = 0 with the
measured c in place of C pi.

Several sources are weighted by their covariances: c = (sum L_i)^-1 sum L_i c_i with L_i the inverse covariance of
source i, zero where it determines nothing: what it takes from a file is no measurement. What the file may be wrong by
is the same in all of them, c_i = c + P_i e + noise, and no mean narrows it: with G_i the weight of source i it adds
P P', P = sum G_i P_i. Where they agree, the squares of what they differ by, weighted by the inverse of the joint
covariance, are distributed as chi-square; covariances are estimates, so that they are compared with Fisher's F (per
degree of freedom), which leaves more room.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Annotated

import numpy as np

from ..arrays import Floats
from ..balancing.conditions import Conditions
from ..mechanism.mechanism import Mechanism
from ..results import IN_BODY, Key, first_of
from .estimate import Estimate, effective_degrees_of_freedom, f_tail
from .identifiability import NotIdentifiable
from .regression import LEAST_BLOCKS, RegressionFit, RegressionRecord, fit

_FIXED = 1e-9
"""Part of a combination in what was estimated, relative to it, that is rounding."""
_OUTSIDE = 1e-6
_VALUE = attrgetter("value")


@dataclass(frozen=True)
class Subspace:
    """Values that conditions can have: c = start + directions.T @ (something)."""

    directions: Floats
    """Orthonormal, (k, rank)."""
    start: Floats
    """(rank,) [kg m]"""

    @classmethod
    def all_values(cls, conditions: Conditions) -> "Subspace":
        """Any values."""
        return cls(np.eye(conditions.rank), np.zeros(conditions.rank))

    @classmethod
    def at_sites(cls, conditions: Conditions, mechanism: Mechanism, sites: Sequence[str]) -> "Subspace":
        """What masses at ``sites`` can change; the rest as the mechanism's file has it."""
        from ..balancing.sizing import site_columns

        columns = site_columns(conditions, mechanism, sites)
        basis, sizes, _ = np.linalg.svd(columns, full_matrices=False)
        return cls(basis[:, sizes > 1e-12 * sizes[0]].T, conditions.values(mechanism))

    def joined(self, rows: Sequence[Floats]) -> "Subspace":
        """The same with further directions, ``rows`` (rank,) [-] each."""
        basis, sizes, _ = np.linalg.svd(np.array([*self.directions, *rows]).T, full_matrices=False)
        return replace(self, directions=basis[:, sizes > 1e-9 * sizes[0]].T)

    @property
    def is_whole(self) -> bool:
        """Whether conditions can have any values."""
        return len(self.directions) == len(self.start)

    def reduced(self, record: RegressionRecord) -> RegressionRecord:
        """A record of all conditions' values in the coordinates of this space."""
        rank = len(self.start)
        own, turned = record.columns[:, :, :rank], record.instruments

        def along(every: Floats) -> Floats:
            return np.concatenate([every[:, :, :rank] @ self.directions.T, every[:, :, rank:]], axis=2)

        instruments = None if turned is None else along(turned)
        readings = record.readings - own @ self.start
        return replace(record, columns=along(record.columns), instruments=instruments, readings=readings)


@dataclass(frozen=True)
class MissingMass:
    """What a site lacks for balance; negative where it has too much."""

    site: Annotated[str, Key("", "site")]
    position: Annotated[Floats, IN_BODY]
    """In the frame of its body as in the file, (3,) [m]."""
    lever_arm: float
    """Distance from the axis of its body's joint [m]."""
    mass: Annotated[Estimate, Key("mass_kg", "that is [kg]", ".3f", to=_VALUE)]
    """[kg]"""
    first_moment: Annotated[Estimate, Key("first_moment_kgm", "missing [kg m]", ".4f", to=_VALUE)]
    """About the axis of its body's joint, mass times lever arm [kg m]."""

    @property
    def interval(
        self,
    ) -> Annotated[tuple[float, float], Key("", "interval", lambda ends: "{:z.4f} .. {:z.4f}".format(*ends))]:
        """Of the first moment [kg m]."""
        return self.first_moment.interval()

    @property
    def is_significant(self) -> bool:
        """Whether the interval leaves out zero."""
        low, high = self.mass.interval()
        return not low <= 0.0 <= high

    def with_added(self, mass: float) -> "MissingMass":
        """What the site lacks once a mass [kg] is mounted there."""
        first_moment = self.first_moment.shifted(-mass * self.lever_arm)
        return replace(self, mass=self.mass.shifted(-mass), first_moment=first_moment)


@dataclass(frozen=True)
class Imbalance:
    """Values of the balance conditions as measured."""

    conditions: Conditions
    values: Floats
    """(rank,) [kg m]"""
    covariance: Floats
    """(rank, rank) [kg2 m2]"""
    subspace: Subspace
    """What of the values was estimated; the rest was fixed."""
    excited: Floats
    """Orthonormal combinations of the subspace's coordinates, and others after them, that were determined."""
    unexplained: float
    """Share of the rms of what was measured that is not explained."""
    constant_degrees_of_freedom: float = np.inf
    """Of every combination, where no regression is behind the values."""
    regression: RegressionFit | None = None
    """Behind the values; its first unknowns are the subspace's coordinates."""
    by_file: Floats | None = None
    """How the values change by one standard deviation of each independent error of the mechanism's file, from which the
    rest was fixed, (rank, rank) [kg m]: the same errors in all sources, contained in the covariance; None for none."""
    parts: tuple[tuple[Floats, "Imbalance"], ...] = ()
    """Sources that these values are the weighted mean of, each behind how the values follow its own, (rank, rank)."""

    def unexplained_of(self, values: Floats) -> float:
        """What is not explained as a part of what values (rank,) [kg m] of the conditions make [-]; infinite where no
        regression tells.
        """
        found = self.regression
        return np.inf if found is None else found.unexplained_of(self.coordinates(values, len(found.values)))

    def estimate(self, combination: Floats, unit: str = "kg m") -> Estimate:
        """A combination (rank,) of the conditions' values [kg m, or ``unit``].

        Raises NotIdentifiable if it is not determined.
        """
        if not self._determines(combination):
            rows = [k for k, row in enumerate(np.eye(len(self.values))) if not self._determines(row)]
            raise NotIdentifiable(
                f"this record does not determine {first_of([self.conditions.left(k) for k in rows], 2)}: its motion "
                "does not excite it; record another motion, all drives at once"
            )
        deviation = float(np.sqrt(max(float(combination @ self.covariance @ combination), 0.0)))
        return Estimate.single(
            float(combination @ self.values), deviation, self.degrees_of_freedom_of(combination), unit=unit
        )

    def _determines(self, combination: Floats) -> bool:
        own = self.coordinates(combination, self.excited.shape[1])
        outside = np.abs(own - self.excited.T @ (self.excited @ own)).max()
        return bool(outside <= _OUTSIDE * np.abs(combination).max(initial=0.0))

    @property
    def degrees_of_freedom(self) -> float:
        """The fewest of any condition's value that was estimated."""
        rows = [row for row in np.eye(len(self.values)) if not self.is_fixed(row)]
        return min((self.degrees_of_freedom_of(row) for row in rows), default=np.inf)

    def degrees_of_freedom_of(self, combination: Floats) -> float:
        """Of the deviation of a combination (rank,) [-].

        Those of the jackknife, times the square of the variance over the part that the jackknife estimates (Welch,
        Satterthwaite): what stated errors of sensors add is known.
        """
        whole = float(combination @ self.covariance @ combination)
        estimated, freedom = self._by_noise(combination)
        return freedom * min(max(whole / max(estimated, 1e-9 * whole, 1e-300), 1.0) ** 2, max(1e6 / freedom, 1.0))

    def _by_noise(self, combination: Floats) -> tuple[float, float]:
        """The part of a combination's variance that is estimated, and its degrees of freedom."""
        if self.parts:
            each = np.array([one._by_noise(combination @ gain) for gain, one in self.parts])
            return float(each[:, 0].sum()), effective_degrees_of_freedom(*each.T)
        if self.regression is None:
            return float(combination @ self.covariance @ combination), self.constant_degrees_of_freedom
        own = self.coordinates(combination, len(self.regression.values))
        return float(own @ self.regression.covariance @ own), self.regression.degrees_of_freedom(own)

    @property
    def weight(self) -> Floats:
        """Inverse covariance of what was estimated, zero of what was fixed, (rank, rank) [1/(kg2 m2)].

        What the fixed part may be wrong by is in the covariance of the estimated one, and no measurement of its own.
        """
        own = self.subspace.directions.T @ self.subspace.directions
        return _inverse(own @ self.covariance @ own)

    @property
    def lacking(self) -> list[Floats]:
        """What each body lacks along the principal axes of its covariance, (3, rank) [-, m] for each body."""
        every = self.conditions.lacking
        return [np.linalg.svd(rows @ self.covariance @ rows.T)[0].T @ rows for rows in every]

    @property
    def covariance_by_file(self) -> Floats:
        """Part of the covariance that the mechanism's file makes, (rank, rank) [kg2 m2]."""
        return np.zeros_like(self.covariance) if self.by_file is None else self.by_file @ self.by_file.T

    def is_fixed(self, combination: Floats) -> bool:
        """Whether a combination (rank,) [-] of the conditions' values was not estimated but fixed."""
        own = np.abs(self.subspace.directions @ combination).max(initial=0.0)
        return bool(own <= _FIXED * np.abs(combination).max(initial=0.0))

    def missing(self, mechanism: Mechanism, sites: Sequence[str]) -> list[MissingMass]:
        """What each site lacks (see ``distribute_masses``). Raises NotIdentifiable as ``estimate`` does."""
        rows = masses_per_value(self.conditions, mechanism, sites, self.values)
        levers = [mechanism.lever_arm(site) for site in sites]
        return [
            MissingMass(site, mechanism.place(site), lever, self.estimate(row, "kg"), self.estimate(lever * row))
            for site, lever, row in zip(sites, levers, rows, strict=True)
        ]

    def coordinates(self, combination: Floats, count: int) -> Floats:
        """A combination (rank,) of the conditions' values in the regression's unknowns, (count,) [-]."""
        own = self.subspace.directions @ combination
        return np.pad(own, (0, count - len(own)))


@dataclass(frozen=True)
class ImbalanceFit:
    """What records tell of the conditions, and of what else is unknown."""

    imbalance: Imbalance
    shared: Floats
    """What else is unknown and the same in all records, (shared,)."""
    regression: RegressionFit

    def gains(self) -> list[Floats]:
        """By record: how much each condition's value rises by what a reading is more, (n, rows, rank)."""
        directions = self.imbalance.subspace.directions
        return self.regression.gains(np.pad(directions.T, ((0, 0), (0, len(self.shared)))))


def imbalance_fit(
    records: Sequence[RegressionRecord],
    conditions: Conditions,
    subspace: Subspace | None = None,
    prior: Floats | None = None,
) -> ImbalanceFit:
    """Values of the conditions from records whose first columns are theirs, others those of shared unknowns.

    ``prior`` (shared,) as in ``regression.fit``. Raises DataError with too few blocks, NotIdentifiable with no motion.
    """
    space = subspace or Subspace.all_values(conditions)
    size = len(space.directions)
    reduced = [space.reduced(record) for record in records]
    known = None if prior is None else np.r_[np.zeros(size), prior]
    found = fit(reduced, known, one_scale=size, least_blocks=size + LEAST_BLOCKS)
    own = found.covariance[:size, :size]
    values = space.start + found.values[:size] @ space.directions
    covariance = space.directions.T @ own @ space.directions
    measured = Imbalance(conditions, values, covariance, space, found.excited, found.unexplained, regression=found)
    return ImbalanceFit(measured, found.values[size:], found)


def masses_per_value(conditions: Conditions, mechanism: Mechanism, sites: Sequence[str], values: Floats) -> Floats:
    """The mass that each site lacks per unit of each condition's value, about ``values`` (rank,), (sites, rank) [1/m].

    Masses are m = rows @ values, linear in what is estimated, so that its intervals carry over. What no first moment
    meets is left out (``Conditions.on_first_moments``). What no mass can meet is weighed, of an open chain, by first
    moments about its joints, whatever is mounted: of sites on a line what is missing along it. Of loops, whose
    conditions join bodies, by the momentum over the workspace (``exact_sizing``).
    """
    from ..balancing.least_masses import distribute_masses
    from ..balancing.sizing import site_columns

    weights = conditions.on_first_moments
    if mechanism.loops:
        weights = conditions.weights @ weights
    columns = weights @ site_columns(conditions, mechanism, sites)
    return -distribute_masses(columns, -weights @ values, removable=True).per_target @ weights


def can_be_met(
    conditions: Conditions, mechanism: Mechanism, sites: Sequence[str], combinations: Floats | None = None
) -> bool:
    """Whether masses at the sites, added or removed, meet all conditions, to 1e-6 of what the mechanism lacks.

    Or ``combinations`` (k, rank) of their values [-, m].
    """
    from ..balancing.sizing import site_columns

    of = np.eye(conditions.rank) if combinations is None else combinations
    columns, values = of @ site_columns(conditions, mechanism, sites), of @ conditions.values(mechanism)
    remaining = columns @ np.linalg.lstsq(columns, values, rcond=None)[0] - values
    scale = float(np.linalg.norm(np.abs(conditions.matrix) @ np.abs(mechanism.pi)))
    return bool(np.linalg.norm(remaining) <= 1e-6 * scale)


def with_condition_values(conditions: Conditions, mechanism: Mechanism, values: Floats) -> Mechanism:
    """The mechanism with the least change of its parameters that gives the conditions these values (rank,) [kg m]."""
    change = np.linalg.pinv(conditions.matrix) @ (values - conditions.values(mechanism))
    parameters = mechanism.parameters + change.reshape(mechanism.parameters.shape)
    parameters.setflags(write=False)
    return replace(mechanism, parameters=parameters)


def condition_columns(conditions: Conditions, regressor: Floats) -> Floats:
    """Columns of a force regressor (n, 3, 10 nb) [N / parameter] that the conditions' values multiply, (n, 3, rank)."""
    return np.asarray(regressor @ np.linalg.pinv(conditions.matrix))


CONTRADICT = 1e-3
"""Probability of such a disagreement by chance, below which sources contradict each other."""
_NO_VARIANCE = 1e-12
"""Variance, relative to the largest of a source, below which a direction was not estimated but fixed."""


@dataclass(frozen=True)
class CombinedImbalance:
    """The weighted values, and the agreement."""

    imbalance: Imbalance
    chi_square: Annotated[float, Key()]
    degrees_of_freedom: Annotated[int, Key("freedom")]
    """Of chi-square: what more than one source determines."""
    probability: Annotated[float, Key()]
    """Of a disagreement at least as large by chance; 1 where nothing is determined twice."""
    gains: tuple[Floats, ...]
    """By source: how the combined values follow its own, (rank, rank) [-]."""

    @property
    def agrees(self) -> Annotated[bool, Key()]:
        """Whether the sources do not contradict each other."""
        return self.probability >= CONTRADICT


def combine(sources: Sequence[Imbalance]) -> CombinedImbalance:
    """The sources together; each as excited as it must be for what is asked of it."""
    weights = [one.weight for one in sources]
    whole = np.sum(weights, axis=0)
    covariance = _inverse(whole)
    gains = tuple(covariance @ w for w in weights)
    rank = int(np.linalg.matrix_rank(whole, hermitian=True))
    fixed = sources[0].values if sources[0].subspace.is_whole else sources[0].subspace.start
    away = np.sum([w @ (one.values - fixed) for w, one in zip(weights, sources, strict=True)], axis=0)
    values = fixed + covariance @ away
    chi = _disagreement(sources, weights, fixed)
    freedom = sum(int(np.linalg.matrix_rank(w, hermitian=True)) for w in weights) - rank
    sizes, directions = np.linalg.eigh(covariance)
    subspace = Subspace(directions[:, sizes > _NO_VARIANCE * sizes[-1]].T, fixed)
    by_file = _by_file(sources, gains, subspace)
    if by_file is not None:
        parts = [g @ (one.covariance - one.covariance_by_file) @ g.T for g, one in zip(gains, sources, strict=True)]
        covariance = np.sum(parts, axis=0) + by_file @ by_file.T
    combined = Imbalance(
        sources[0].conditions,
        values,
        covariance,
        subspace,
        np.eye(len(subspace.directions)),
        max(one.unexplained for one in sources),
        by_file=by_file,
        parts=tuple(zip(gains, sources, strict=True)),
    )
    fewest = min(one.degrees_of_freedom for one in sources)
    probability = f_tail(chi / freedom, freedom, fewest) if freedom > 0 else 1.0
    return CombinedImbalance(combined, chi, freedom, probability, gains)


def _by_file(sources: Sequence[Imbalance], gains: Sequence[Floats], subspace: Subspace) -> Floats | None:
    """Of the combined values, of which those outside ``subspace`` stay as in the file, (rank, rank) [kg m]."""
    told = [(gain, one.by_file) for gain, one in zip(gains, sources, strict=True) if one.by_file is not None]
    if not told:
        return None
    outside = np.eye(len(subspace.start)) - subspace.directions.T @ subspace.directions
    return np.asarray(np.sum([gain @ per for gain, per in told], axis=0) + outside @ told[0][1])


def _disagreement(sources: Sequence[Imbalance], weights: Sequence[Floats], fixed: Floats) -> float:
    """Squares of what sources differ by from the values (rank,) nearest to all, over their joint covariance [-]."""
    from scipy.linalg import block_diag

    rows, away, own, common = [], [], [], []
    for one, weight in zip(sources, weights, strict=True):
        sizes, axes = np.linalg.eigh(weight)
        rows.append(axes[:, sizes > _NO_VARIANCE * sizes[-1]].T)
        away.append(rows[-1] @ (one.values - fixed))
        own.append(rows[-1] @ (one.covariance - one.covariance_by_file) @ rows[-1].T)
        common.append(rows[-1] @ (np.zeros_like(weight) if one.by_file is None else one.by_file))
    columns, read, by_file = np.concatenate(rows), np.concatenate(away), np.concatenate(common)
    weight = _inverse(block_diag(*own) + by_file @ by_file.T)
    left = read - columns @ (_inverse(columns.T @ weight @ columns) @ (columns.T @ weight @ read))
    return float(left @ weight @ left)


def _inverse(covariance: Floats) -> Floats:
    return np.asarray(np.linalg.pinv(0.5 * (covariance + covariance.T), rcond=_NO_VARIANCE, hermitian=True))
