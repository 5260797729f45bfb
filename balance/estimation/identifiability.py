"""Which combinations of parameters a record determines, found from the regressor before any solving.

Parameters are determined up to W's null space: exactly the combinations in the row space of W are observable. They
are given in reduced row echelon form, masses last, so that they read as balance conditions do:
``mcx[link_1] + 0.3 m[link_2]``.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any

import numpy as np

from ..arrays import Floats
from ..balancing.conditions import reduced_row_echelon, text_of
from ..errors import DataError
from ..results import Key

RANK_LIMIT = 1e-6
"""Singular value, relative to the largest, of columns of unit length, below which a direction is not excited.

Normal equations square it: 1e-12 is what double precision (2e-16) resolves after offsets and the like have been taken
out. Identities of the mechanics hold for measured states to rounding, far below.
"""
_ROUNDING = 1e-9
"""Length of a column, relative to the longest in whatever unit, that is rounding."""
_LARGE = 0.3
"""Share in the weakest direction, of the largest one, from which a base parameter is named."""
_OUTSIDE = 1e-7
"""Part of a combination outside the row space, relative to it, that is rounding."""


class NotIdentifiable(DataError):
    """A combination of parameters that the record does not determine."""


@dataclass(frozen=True)
class Identifiability:
    """What a regressor determines of its parameters."""

    names: tuple[str, ...]
    """Names of all parameters, (p)."""
    combinations: Floats
    """The base parameters, an observable combination a row, in reduced row echelon form, (r, p)."""
    pivots: tuple[int, ...]
    """The column of each row's leading 1: these columns of the regressor are its base, W = W[pivots] @ combinations."""
    singular_values: Annotated[tuple[float, float], Key("singular_value_gap")]
    """Smallest kept and largest dropped singular value, relative to the largest, of columns of unit length."""
    condition: Annotated[float, Key()]
    """Condition number of the base columns, each of unit length: how well the motion tells them apart."""
    weak: Floats
    """Share of each base parameter in the direction that the motion excites least, (r,), of unit length."""
    per_unit: Floats
    """Standard error of each base parameter where every row had white noise of 1 N m, 1 N, (r,) [SI]."""

    @property
    def rank(self) -> Annotated[int, Key()]:
        """Number of base parameters."""
        return len(self.pivots)

    @property
    def first_moments(self) -> int:
        """Number of base parameters that a first moment leads, as it does a balance condition."""
        return sum(self.names[k].startswith("mc") for k in self.pivots)

    @property
    def weakest(self) -> Annotated[str, Key()]:
        """The base parameters that the motion hardly distinguishes, offsets of further runs left out."""
        size = np.abs(self.weak)
        names = [self.text(int(k)) for k in np.argsort(-size) if size[k] > _LARGE * size.max()]
        return ", ".join(name for name in names if not name.startswith("offset[") or ", " not in name)

    @property
    def errors_per_unit(self) -> Annotated[list[dict[str, Any]], Key("base_parameters")]:
        """The base parameters, with their standard errors where every row had white noise of 1 N m, 1 N."""
        each = enumerate(self.per_unit.tolist())
        return [{"name": self.text(k), "standard_error_per_unit_noise": error} for k, error in each]

    @cached_property
    def undetermined(self) -> Annotated[tuple[str, ...], Key("not_observable")]:
        """Parameters that the record does not determine by themselves."""
        rows = np.eye(len(self.names))
        return tuple(name for name, row in zip(self.names, rows, strict=True) if not self.is_identifiable(row))

    def coefficients(self, row: int) -> dict[str, float]:
        """Coefficients of one base parameter by name, zeros left out."""
        return {self.names[k]: float(self.combinations[row, k]) for k in np.flatnonzero(self.combinations[row])}

    def text(self, row: int) -> str:
        """One base parameter, such as ``mcx[link_1] + 0.3 m[link_2]``."""
        return text_of(self.coefficients(row))

    def base_columns(self, regressor: Floats) -> Floats:
        """Columns of a regressor (n, rows, p) that the base parameters multiply, (n, rows, r) [reading / parameter]."""
        return regressor[:, :, list(self.pivots)]

    def over_all(self, values: Floats) -> Floats:
        """Parameters (..., p) [SI] that make the same rows as base parameters (..., r) [SI]: all others are zero."""
        full = np.zeros((*values.shape[:-1], len(self.names)))
        full[..., list(self.pivots)] = values
        return full

    def vector(self, coefficients: Mapping[str, float]) -> Floats:
        """A combination given by names, over all parameters, (p,) [-]. Raises DataError for an unknown name."""
        vector = np.zeros(len(self.names))
        for name, value in coefficients.items():
            if name not in self.names:
                raise DataError(f"no parameter {name!r}: there are {', '.join(self.names)}")
            vector[self.names.index(name)] = value
        return vector

    def share(self, vector: Floats) -> Floats:
        """Coefficients (r,) [-] over the base parameters that make up a combination of all parameters (p,).

        Raises NotIdentifiable, naming the combination and what is observable instead.
        """
        share = vector[list(self.pivots)]
        outside = np.abs(vector - share @ self.combinations).max()
        if not outside <= _OUTSIDE * np.abs(vector).max(initial=0.0):
            wanted = {self.names[k]: float(vector[k]) for k in np.flatnonzero(vector)}
            base = ", ".join(self.text(row) for row in range(self.rank) if self.coefficients(row).keys() & wanted)
            raise NotIdentifiable(
                f"{text_of(wanted)} is not observable from this record: of these parameters it determines "
                f"{base or 'none'}"
            )
        return share

    def is_identifiable(self, vector: Floats) -> bool:
        """Whether a combination of all parameters (p,) [-] is determined."""
        try:
            self.share(vector)
        except NotIdentifiable:
            return False
        return True


def identifiability(regressor: Floats, names: Sequence[str]) -> Identifiability:
    """Find what a regressor (n, rows, p) [reading / parameter] determines of the parameters ``names`` (p).

    Raises NotIdentifiable if nothing moves it at all.
    """
    stacked = regressor.reshape(-1, regressor.shape[-1])
    length = np.linalg.norm(stacked, axis=0)
    present = np.flatnonzero(length > _ROUNDING * length.max(initial=0.0))
    if not len(present):
        raise NotIdentifiable("this record determines no parameter: every column of its regressor is zero")
    values, rows = np.linalg.svd(np.linalg.qr(stacked[:, present] / length[present], mode="r"))[1:]
    relative = values / values[0]
    rank = int(np.count_nonzero(relative > RANK_LIMIT))
    basis = np.zeros((rank, len(names)))
    basis[:, present] = np.linalg.qr((rows[:rank] * length[present]).T)[0].T
    order = pivot_order(names)
    combinations = reduced_row_echelon(basis, order)
    pivots = tuple(next(k for k in order if row[k] != 0.0) for row in combinations)
    dropped = float(relative[rank]) if rank < len(relative) else 0.0
    own = length[list(pivots)]
    sizes, directions = np.linalg.svd(np.linalg.qr(stacked[:, list(pivots)] / own, mode="r"))[1:]
    errors = np.sqrt(np.sum((directions / sizes[:, None]) ** 2, axis=0)) / own
    return Identifiability(
        tuple(names),
        combinations,
        pivots,
        (float(relative[rank - 1]), dropped),
        float(sizes[0] / sizes[-1]),
        directions[-1],
        errors,
    )


def pivot_order(names: Sequence[str]) -> list[int]:
    """Columns in the order in which they lead a combination: first moments, inertias, terms of joints, masses."""
    return sorted(range(len(names)), key=lambda k: (_place(names[k].partition("[")[0]), k))


def _place(parameter: str) -> int:
    if parameter == "m":
        return 3
    return 0 if parameter.startswith("mc") else 1 if parameter.startswith("I") else 2
