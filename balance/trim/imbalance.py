"""Values of the balance conditions as measured, and what sites lack by them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Floats
from ..conditions import Conditions
from ..identification import Estimate, student_t
from ..mechanism import Mechanism
from ..observability import NotObservable
from .record import Record
from .sites import shares_of, site_columns


@dataclass(frozen=True)
class Free:
    """Values that conditions can have: c = start + directions.T @ (something)."""

    directions: Floats
    """Orthonormal, (k, rank)."""
    start: Floats
    """(rank,) [kg m]"""

    @classmethod
    def all(cls, conditions: Conditions) -> "Free":
        """Any values."""
        return cls(np.eye(conditions.rank), np.zeros(conditions.rank))

    @classmethod
    def at_sites(cls, conditions: Conditions, mechanism: Mechanism, sites: Sequence[str]) -> "Free":
        """What masses at ``sites`` can change; the rest as the mechanism's file has it."""
        columns = site_columns(conditions, mechanism, sites)
        basis, sizes, _ = np.linalg.svd(columns, full_matrices=False)
        return cls(basis[:, sizes > 1e-12 * sizes[0]].T, conditions.values(mechanism))

    def of(self, record: Record) -> Record:
        """The record's equations in what is free, in place of all conditions."""
        rank = len(self.start)
        own, others = record.columns[:, :, :rank], record.columns[:, :, rank:]
        columns = np.concatenate([own @ self.directions.T, others], axis=2)
        return replace(record, columns=columns, force=record.force - own @ self.start)


@dataclass(frozen=True)
class Missing:
    """What a site lacks for balance; negative where it has too much."""

    site: str
    position: Floats
    """In its body's frame, (3,) [m]."""
    mass: Estimate
    """[kg]"""
    first_moment: Estimate
    """About the body's joint, mass times distance [kg m]."""


@dataclass(frozen=True)
class Imbalance:
    """Values of the balance conditions as measured."""

    conditions: Conditions
    values: Floats
    """(rank,) [kg m]"""
    covariance: Floats
    """(rank, rank)"""
    freedom: int
    free: Free
    """What of the values was found; the rest was held."""
    excited: Floats
    """Orthonormal combinations of all unknowns, those of ``free`` first, that the records determine, (excited, ...)."""
    unexplained: float
    """Share of the rms of what was measured that is not explained."""
    noise: Floats | None = None
    """The part of the covariance that stretches tell by what they differ, (rank, rank); None: all of it."""
    stretches: Floats | None = None
    """What each stretch adds to the covariance where noise is alike in all, up to a factor, (stretches, rank, rank)."""

    def estimate(self, share: Floats) -> Estimate:
        """A combination (rank,) of the conditions' values. Raises NotObservable if the records do not determine it."""
        own = self.free.directions @ share
        padded = np.pad(own, (0, self.excited.shape[1] - len(own)))
        outside = padded - self.excited.T @ (self.excited @ padded)
        if np.abs(outside).max() > 1e-6 * np.abs(share).max(initial=0.0):
            raise NotObservable("what balances is not determined by this record: the motion does not excite it")
        error = float(np.sqrt(max(float(share @ self.covariance @ share), 0.0)))
        return Estimate(float(share @ self.values), error, student_t(self.freedom_of(share)) * error)

    def freedom_of(self, share: Floats) -> int:
        """Degrees of freedom of the deviation of a combination (rank,): few where few stretches tell it.

        (sum p)^2 / sum p^2 with p what each stretch adds, no more than there are; times the square of the variance over
        the part that stretches tell (Welch, Satterthwaite), for the rest is known.
        """
        if self.stretches is None:
            return self.freedom
        added = np.einsum("i,kij,j->k", share, self.stretches, share)
        if not added.sum() > 0.0:
            return self.freedom
        told = min(float(added.sum() ** 2 / np.sum(added**2)) - 1.0, float(self.freedom))
        own = self.covariance if self.noise is None else self.noise
        known = (share @ self.covariance @ share) / max(float(share @ own @ share), 1e-300)
        return max(1, int(min(told * float(known) ** 2, 1e6) + 0.5))

    def holds(self, share: Floats) -> bool:
        """Whether a combination (rank,) of the conditions' values was not found but held."""
        return bool(np.abs(self.free.directions @ share).max(initial=0.0) <= 1e-9 * np.abs(share).max(initial=0.0))

    def missing(self, mechanism: Mechanism, sites: Sequence[str]) -> list[Missing]:
        """What each site lacks, in least squares over the conditions. Raises NotObservable as ``estimate`` does."""
        shares = shares_of(self.conditions, mechanism, sites)
        return [self._missing(mechanism, site, share) for site, share in zip(sites, shares, strict=True)]

    def _missing(self, mechanism: Mechanism, site: str, share: Floats) -> Missing:
        position = mechanism.site(site).position
        distance = float(np.linalg.norm(position))
        return Missing(site, position, self.estimate(share), self.estimate(distance * share))
