"""How many times what they are torques read, where runs differ by masses that are known.

tau_k = s_k (W_k pi + W_k dpi + rho^2 W_k J): each torque sensor has a scale s of its own, forces have one. What is
mounted on a body has an inertia about its own centre that is stated roughly or not at all (a point; a disc); so rho^2,
the square of its radius of gyration beyond what is stated, is unknown too, one for each body, J the inertia of its mass
at one metre about every axis. The weight of the masses then tells the scales. Where gravity does not (joints that turn
about the vertical), what is stated holds, and their inertia tells them. No radius of gyration is below zero: where
noise says so, it is zero.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from balance.arrays import Floats, Indices
from balance.estimation.estimate import Estimate, f_tail
from balance.estimation.regression import RegressionFit

from .records import JointRecord
from .regression_equations import RecordEquations, RegressionEquations

CLOSED = 0.05
"""Half width of the interval of a scale, as a part of it, up to which known masses close it."""
AGREE = 1e-3
"""Probability with which equal scales are told apart (noise white)."""
_ROUNDS, _SETTLED = 20, 1e-7
"""Of Gauss-Newton, and the step of a scale at which it ends."""
_NOTHING = 1e-9
"""Part of what known masses make that is rounding, for a radius of gyration of 1 m."""
_DIAGONAL = (4, 6, 9)
"""Ixx, Iyy and Izz among the parameters of a body."""


@dataclass(frozen=True)
class _Fit:
    """Scales of some groups of rows, and squares of radii of gyration, as fitted together."""

    scales: Floats
    """(groups,)"""
    radii: Floats
    """Squares of the radii of gyration beyond what is stated, (bodies,) [m2]."""
    regression: RegressionFit
    """Of bodies, radii that are free, and changes of the scales, in this order."""

    def combination(self, weights: Floats) -> Floats:
        """Of all unknowns (p,) for weights (groups,) of the scales [-]."""
        return np.pad(weights, (len(self.regression.values) - len(weights), 0))

    def estimates(self) -> list[Estimate | None]:
        """Of the scales, None where the runs do not determine one."""
        rows = map(self.combination, np.eye(len(self.scales)))
        return [
            replace(self.regression.estimate(row), values=np.array([scale]))
            if self.regression.determines(row)
            else None
            for row, scale in zip(rows, self.scales, strict=True)
        ]


@dataclass(frozen=True)
class TorqueScales:
    """Scales of the rows of equations, torques ``delay`` [s] late, whose bodies make them by ``base`` columns."""

    equations: RegressionEquations
    names: tuple[str, ...]
    """Of the groups of rows that have a scale each: driven joints, then all forces together."""
    base: Floats
    """Low-passed base columns, (n, rows, r)."""
    rows: Floats
    """Low-passed readings less known masses, (n, rows) [N m, N]."""
    known: Floats
    """What known masses make of them, as stated, (n, rows) [N m, N]."""

    @cached_property
    def each(self) -> dict[str, Estimate]:
        """Scale of each group that the runs determine, by name; equal where they agree."""
        if not np.any(self.known):
            return {}
        if self.common is not None:
            return dict.fromkeys(self.names, self.common)
        found = zip(self.names, self._apart.estimates(), strict=True)
        return {name: one for name, one in found if one is not None}

    @cached_property
    def common(self) -> Estimate | None:
        """Scale of all; None where they differ, or not each is determined."""
        if not np.any(self.known) or self._together is None:
            return None
        return self._together.estimates()[0]

    @property
    def closed(self) -> bool:
        """Whether each is known to CLOSED."""
        return len(self.each) == len(self.names) and all(map(_is_narrow, self.each.values()))

    @property
    def by_statement(self) -> bool:
        """Whether they rest on the radii of gyration that are stated."""
        return bool(self._own.shape[2]) and not self._own_is_free

    @cached_property
    def radii_of_gyration(self) -> dict[str, tuple[float, float]]:
        """Intervals of their squares of what is mounted, about its own centre and beyond what is stated, by body [m2].

        Of bodies where the weight of what is mounted tells its mass apart from its inertia.
        """
        if not self._own_is_free:
            return {}
        one = self._chosen
        places = np.flatnonzero(one.radii > self._least_radii)
        rows = np.eye(len(one.regression.values))[self.base.shape[2] :]
        names = [self.equations.names[10 * self._turning[k]][2:-1] for k in places]
        return {name: one.regression.estimate(row).interval() for name, row in zip(names, rows, strict=False)}

    @cached_property
    def columns(self) -> Floats:
        """What a change of each scale makes of the rows, and own inertias, (n, rows, k) [N m, N, and per m2]."""
        if not np.any(self.known):
            return self.base[:, :, :0]
        one = self._apart
        made = self._made(one.regression.values[: self.base.shape[2]], one.radii)
        return np.concatenate([self._by_group(made, self._groups), self._own], axis=2)

    @cached_property
    def changes(self) -> dict[str, Floats]:
        """By how much base parameters (r,) [SI] change at either end of each scale's interval, by that scale."""
        if not self.closed:
            return {}
        as_read = self.equations.fitted(self.base, self.rows).values
        found: dict[str, Floats] = {}
        values = np.array([self.each[name].value for name in self.names])
        radii = self._chosen.radii
        for label, scales in self._ends(values):
            true = (self.rows + self.known) / scales[self._groups] - self.known - self._own @ radii
            found[label] = self.equations.fitted(self.base, true).values - as_read
        return found

    def _ends(self, values: Floats) -> Iterator[tuple[str, Floats]]:
        if self.common is not None:
            yield from ((f"{end:.6g}", np.full_like(values, end)) for end in self.common.interval())
            return
        for place, name in enumerate(self.names):
            for end in self.each[name].interval():
                yield f"{name} {end:.6g}", np.where(np.arange(len(values)) == place, end, values)

    @property
    def _groups(self) -> Indices:
        """Of each row, its place among the names, (rows,)."""
        return np.minimum(np.arange(self.rows.shape[1]), len(self.names) - 1)

    @cached_property
    def _own(self) -> Floats:
        """What known masses would make more at a radius of gyration of 1 m, by body, (n, rows, bodies) [per m2]."""
        return self._of_own_inertia(self._turning)

    @cached_property
    def _turning(self) -> list[int]:
        """Bodies with masses that are known, and of which the rows show that they turn."""
        bodies = sorted({int(body) for r in self._loaded for body in np.flatnonzero(r.mounted[::10])})
        made = np.abs(self._of_own_inertia(bodies)).max(axis=(0, 1), initial=0.0)
        return [body for body, most in zip(bodies, made, strict=True) if most > _NOTHING * np.abs(self.known).max()]

    @property
    def _loaded(self) -> list[JointRecord]:
        """Those with masses that are known."""
        return [record for record in self.equations.records if len(record.mounted)]

    def _of_own_inertia(self, bodies: Sequence[int]) -> Floats:
        """Of some bodies, (n, rows, bodies) [per m2]."""

        def of(part: RecordEquations) -> Floats:
            columns = np.zeros((*part.whole.shape[:2], len(bodies)))
            for k, body in enumerate(bodies if len(part.record.mounted) else ()):
                turned = part.whole[:, :, [10 * body + at for at in _DIAGONAL]].sum(axis=2)
                columns[:, :, k] = part.record.mounted[10 * body] * turned
            return part.low_passed(columns)

        return self.equations.joined(of)

    @cached_property
    def _least_radii(self) -> Floats:
        """Where the squares of radii of gyration are zero, beyond what is stated, (bodies,) [m2]."""
        return np.array([min(-_stated(r.mounted, body) for r in self._loaded) for body in self._turning])

    @cached_property
    def _own_is_free(self) -> bool:
        return bool(self._own.shape[2]) and all(map(_is_narrow, self._free.estimates()))

    @cached_property
    def _free(self) -> _Fit:
        return self._bounded(self._groups)

    @cached_property
    def _apart(self) -> _Fit:
        """Each group with its own scale."""
        return self._free if self._own_is_free else self._fit(self._groups, self._least_radii, free=())

    @cached_property
    def _together(self) -> _Fit | None:
        """One scale, where all are determined and agree."""
        apart, count = self._apart, len(self.names)
        if count == 1:
            return apart
        found = apart.estimates()
        if any(one is None for one in found):
            return None
        contrasts = np.eye(count)[1:] - np.eye(count)[0]
        weights = np.array([apart.combination(row) for row in contrasts])
        away, covariance = contrasts @ apart.scales, weights @ apart.regression.covariance @ weights.T
        freedom = min(apart.regression.degrees_of_freedom(row) for row in weights)
        ratio = float(away @ np.linalg.pinv(covariance, hermitian=True) @ away) / (count - 1)
        if f_tail(ratio, count - 1, freedom) < AGREE:
            return None
        one = np.zeros_like(self._groups)
        return self._bounded(one) if self._own_is_free else self._fit(one, self._least_radii, free=())

    @property
    def _chosen(self) -> _Fit:
        return self._together or self._apart

    def _bounded(self, groups: Indices) -> _Fit:
        """With radii of gyration free, and at zero where they would be below."""
        free = list(range(self._own.shape[2]))
        while True:
            found = self._fit(groups, self._least_radii, free)
            below = [k for k in free if found.radii[k] < self._least_radii[k]]
            if not below:
                return found
            free = [k for k in free if k not in below]

    def _fit(self, groups: Indices, radii: Floats, free: Sequence[int]) -> _Fit:
        """Gauss-Newton on tau = s (W pi + known + own rho^2): columns s W, s own, and what a scale of one makes."""
        count, own = int(groups.max()) + 1, self._own[:, :, list(free)]
        columns, scales, radii = np.concatenate([self.base, own], axis=2), np.ones(count), radii.copy()
        fixed = self.known + np.delete(self._own, list(free), axis=2) @ np.delete(radii, list(free))
        whole = self.rows + self.known
        values = self.equations.fitted(columns, whole - fixed).values
        for _ in range(_ROUNDS):
            row_scales = scales[groups]
            made = self._by_group(fixed + columns @ values, groups)
            both = np.concatenate([columns * row_scales[:, None], made], axis=2)
            found = self.equations.fitted(both, whole - row_scales * fixed)
            values, step = found.values[:-count], found.values[-count:]
            scales = scales + step
            if np.abs(step).max() < _SETTLED:
                break
        radii[list(free)] = values[self.base.shape[2] :]
        return _Fit(scales, radii, found)

    def _made(self, values: Floats, radii: Floats) -> Floats:
        """Rows as bodies (r,) and all that is mounted make them, (n, rows) [N m, N]."""
        return np.asarray(self.base @ values + self.known + self._own @ radii)

    def _by_group(self, made: Floats, groups: Indices) -> Floats:
        """Rows (n, rows) in a column for each group, zero elsewhere, (n, rows, groups)."""
        return made[:, :, None] * (groups[:, None] == np.arange(groups.max() + 1))


def _stated(mounted: Floats, body: int) -> float:
    """Square of the largest radius of gyration of known masses (10 nb,) on a body about their own centre [m2]."""
    mass, *moments = mounted[10 * body : 10 * body + 4]
    if not mass:
        return 0.0
    xx, xy, yy, xz, yz, zz = mounted[10 * body + 4 : 10 * body + 10] / mass
    centre = np.array(moments) / mass
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    own = inertia - (centre @ centre) * np.eye(3) + np.outer(centre, centre)
    return max(float(np.linalg.eigvalsh(own)[-1]), 0.0)


def _is_narrow(found: Estimate | None) -> bool:
    return found is not None and found.half_width() <= CLOSED * found.value
