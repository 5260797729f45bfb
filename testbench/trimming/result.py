"""What is missing at each site and what to add there, with the verdict."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Any

import numpy as np

from balance.arrays import Floats
from balance.balancing.conditions import Conditions, text_of
from balance.balancing.sizing import Sizing, best_sets_from_stock, site_columns, sizing_of_given
from balance.balancing.stock_plates import Plate
from balance.estimation.estimate import LEVEL, Estimate
from balance.estimation.first_moment_imbalance import (
    CombinedImbalance,
    Imbalance,
    MissingMass,
    masses_per_value,
    with_condition_values,
)
from balance.estimation.identifiability import NotIdentifiable
from balance.estimation.uncertainty_budget import Budget, Contribution
from balance.mechanism.mechanism import Mechanism
from balance.results import Key, Shown, finite, plain

from ..kinematics.gaps import GAP_FINDING
from ..recording import Finding, Origin
from .problem import SOURCES, Source

_STEPS_MATTER = 0.5
"""Part of what stays unexplained that the encoders' steps may leave, from which they are named for it."""
_LITTLE, _LIKE_REST, _AS_REST = 0.02, 1.5, 1.1
"""Part of what the mechanism without counter-masses would show, and multiple of what is read at rest, up to which what
stays unexplained is noise; multiple up to which it is noise, whatever part it is."""
_NOISE_MATTERS = 0.3
"""Part of the square of what stays unexplained that is read at rest, too, from which it is named."""
_BALANCED = 0.01
"""First-moment residual at most, as a part of that without counter-masses, of a mechanism that counts as balanced."""


@dataclass(frozen=True)
class Share:
    """What one source determines."""

    source: Annotated[Source, Key("", "source")]
    missing: Annotated[tuple[MissingMass, ...], Key()]
    unexplained: Annotated[float, Key()]
    """Share of what it measured."""
    by_steps: Annotated[float, Key("unexplained_by_encoder_steps")] = 0.0
    """Share that the encoders' steps may leave, which the interval contains; zero where it was not asked."""
    of_unbalanced: Annotated[float, Key("unexplained_of_unbalanced", to=finite)] = np.inf
    """What stays unexplained as a part of what the mechanism without counter-masses would show [-]."""
    over_rest: Annotated[float, Key("residual_over_rest", to=finite)] = np.inf
    """Largest residual of a row over what it shows at rest [-]; infinite where that is not known."""

    @property
    def doubtful(self) -> bool:
        """Whether too much stays unexplained, and more than noise: of a balanced mechanism hardly more is measured."""
        return self._much and not self.is_noise

    @property
    def is_noise(self) -> bool:
        """Whether much stays unexplained, and no more than is read at rest."""
        return self._much and self.over_rest <= (_LIKE_REST if self.of_unbalanced <= _LITTLE else _AS_REST)

    @property
    def _much(self) -> bool:
        return self.unexplained > SOURCES[self.source].doubtful_share

    @property
    def why(self) -> str:
        """What may leave so much, and what to do."""
        if self.by_steps > _STEPS_MATTER * self.unexplained:
            return (
                f"the encoders' steps may leave {self.by_steps:.0%}, which the intervals contain, and hide what is "
                "systematic beside them; finer encoders, or a lower --cutoff, tell"
            )
        systematic = (
            f"what is systematic (sensors, levers, the model{SOURCES[self.source].lacks}) may exceed the intervals"
        )
        if (noise := self.over_rest**-2.0) > _NOISE_MATTERS:
            return (
                f"{noise:.0%} of its square is what the sensors read at rest, the rest more than noise; {systematic}: "
                "a larger motion or quieter sensors tell"
            )
        return f"more than noise leaves; {systematic}"


@dataclass(frozen=True)
class Trim(Shown, rows="missing", figure="testbench.figures.estimates:draw_trim"):
    """What runs say of a mechanism as it was mounted.

    >>> import testbench
    >>> found = testbench.trim("parallelogram-6bar", "campaign/r002.h5", by=["wrench"])
    >>> [one.site for one in found.missing if one.is_significant]
    ['counter_A0A', 'counter_B0B']
    """

    conditions: Conditions
    mechanism: Mechanism
    """As mounted, by its file and the run table."""
    runs: tuple[str, ...]
    origin: Origin
    shares: tuple[Share, ...]
    """By source."""
    missing: tuple[MissingMass, ...]
    """By all sources, weighted."""
    imbalance: Imbalance
    """The conditions' values, by all sources."""
    about: tuple[str, ...]
    """How it was found, for people."""
    doubts_before: tuple[str, ...]
    consensus: CombinedImbalance | None = None
    """Whether several sources agree."""
    plates: tuple[Plate, ...] = ()
    findings: tuple[Finding, ...] = ()
    estimates: tuple[Imbalance, ...] = ()
    """The conditions' values by each source, in the order of ``shares``."""
    accepted: tuple[Finding, ...] = ()
    """Contradictions that a person accepted."""
    unbalanced: float = 0.0
    """First-moment residual without counter-masses, by the model [kg m]."""
    removable: Mapping[str, float] = field(default_factory=dict)
    """By site, first moment of what is mounted there, and of what it has too much of, by run table and file [kg m]."""

    @property
    def budgets(self) -> list[Budget]:
        """Of what each site lacks [kg m]: by source, noise and what its sensors' stated errors leave open; the file.

        Several sources are weighted by their inverse covariances, so that each has a part in both; what the file may be
        wrong by is the same in all.
        """
        combined = self.imbalance
        rows = masses_per_value(self.conditions, self.mechanism, [one.site for one in self.missing], combined.values)
        gains = self.consensus.gains if self.consensus else (np.eye(len(combined.values)),)
        found = []
        for one, row in zip(self.missing, rows, strict=True):
            parts = []
            for share, estimate, gain in zip(self.shares, self.estimates, gains, strict=True):
                parts += _contributions(share.source, estimate, one.lever_arm * row @ gain)
            if combined.by_file is not None:
                by_file = float(np.linalg.norm(one.lever_arm * row @ combined.by_file))
                name = "what is taken from the mechanism's file"
                parts.append(Contribution(name, "B", by_file, "kg m", 1.0, "normal"))
            moment, name = one.first_moment, f"first moment missing at {one.site}"
            found.append(Budget(name, moment.value, "kg m", tuple(parts), moment.degrees_of_freedom))
        return found

    @property
    def source(self) -> str:
        """What it is found from: ``wrench``, ``torque``, ``vibration``, ``trials``, several joined by ``+``."""
        return "+".join(share.source for share in self.shares)

    @property
    def unexplained(self) -> float:
        """The largest share of what a source measured that stays unexplained."""
        return max(share.unexplained for share in self.shares)

    @cached_property
    def values(self) -> tuple[tuple[str, Estimate | None], ...]:
        """The balance conditions, left-hand sides as measured; None where the runs do not determine one."""
        found = []
        for k, (row, unit) in enumerate(zip(np.eye(self.conditions.rank), self.conditions.units, strict=True)):
            estimate = None if self.imbalance.is_fixed(row) else self._estimate(row, unit)
            found.append((text_of(self.conditions.coefficients(k)), estimate))
        return tuple(found)

    @cached_property
    def addition(self) -> Sizing:
        """What to add to the sites that significantly lack something: from the plates, else of any mass.

        On the mechanism less the removal; nothing to one that counts as balanced.
        """
        return self._addition(self._best_changes(may_remove=True))

    @cached_property
    def removal(self) -> tuple[MissingMass, ...]:
        """What to take off where there is significantly too much, in the mounting whose residual is predicted.

        None of a mechanism that counts as balanced.
        """
        changes = self._best_changes(may_remove=True)
        less = [m for m in self.missing if changes.get(m.site, 0.0) < 0.0]
        return tuple(m.with_added(m.mass.value - changes[m.site]) for m in less)

    @cached_property
    def only_adding(self) -> Sizing | None:
        """What to add where nothing can be taken off; None where nothing is to be taken off, or to be added."""
        found = self._addition(self._best_changes(may_remove=False)) if self.removal else None
        return found if found and any(c.mass > 0.0 for c in found.counter_masses) else None

    def _best_changes(self, may_remove: bool) -> dict[str, float]:
        """By site, masses to add, or to take off (negative), that are best with nothing changed where an interval holds
        zero, nor, where none ``may_remove``, where there is too much [kg].
        """
        changed = [m for m in self.missing if m.is_significant and (may_remove or m.first_moment.value > 0.0)]
        values, masses = self.conditions.values(self._measured), np.zeros(0)
        while changed and self.verdict != "balanced":  # until each has the sign of what is missing there
            sites = [m.site for m in changed]
            masses = masses_per_value(self.conditions, self.mechanism, sites, values) @ values
            kept = [m for m, mass in zip(changed, masses, strict=True) if m.first_moment.value * mass > 0.0]
            if len(kept) == len(changed):
                break
            changed = kept
        return {m.site: float(mass) for m, mass in zip(changed, masses, strict=False)}

    def _addition(self, changes: Mapping[str, float]) -> Sizing:
        """What is added of changes [kg], on the mechanism less what they take off; plates as near as they come."""
        more, rest = {site: mass for site, mass in changes.items() if mass > 0.0}, self._measured
        if len(more) < len(changes):
            columns = site_columns(self.conditions, rest, list(changes))
            taken_off = columns @ np.minimum(list(changes.values()), 0.0)
            rest = with_condition_values(self.conditions, rest, self.conditions.values(rest) + taken_off)
        if more and self.plates:
            return best_sets_from_stock(self.conditions, rest, self.plates, list(more))[0]
        return sizing_of_given(self.conditions, rest, more)

    def residual_with(self, mounting: Sizing) -> tuple[float, tuple[float, float]]:
        """First-moment residual of a mounting, and from the least to the most that the intervals leave of it [kg m];
        what the runs do not tell by the file.
        """
        sizes, half = self._lacking(self.conditions.values(mounting.after))
        half = np.where(np.isfinite(half), half, 0.0)
        told = any(m.is_significant for m in self.missing)  # else the sites' intervals leave zero of every condition
        low = told * np.maximum(sizes - half, 0.0).max(initial=0.0)
        return float(sizes.max(initial=0.0)), (float(low), float((sizes + half).max(initial=0.0)))

    @property
    def residual(self) -> float:
        """First-moment residual as the runs found it; what they do not tell by the file [kg m]."""
        return float(self._lacking(self.conditions.values(self._measured))[0].max(initial=0.0))

    @property
    def predicted_residual(self) -> float:
        """First-moment residual with the addition and the removal [kg m]."""
        return self.residual_with(self.addition)[0]

    @property
    def predicted_residual_interval(self) -> tuple[float, float]:
        """From the least to the most that the intervals leave of it [kg m]."""
        return self.residual_with(self.addition)[1]

    @property
    def residual_share(self) -> float:
        """First-moment residual as measured, with half its interval and what a doubtful source leaves unexplained, as a
        part of that without counter-masses; infinite where the runs do not tell it.

        What no mass at the sites can change: by the file, with what that may be wrong by.
        """
        if not self.unbalanced > 0.0:
            return np.inf
        hidden = max((share.of_unbalanced for share in self.shares if share.doubtful), default=0.0)
        most = np.sum(self._lacking(self.imbalance.values), axis=0).max(initial=0.0)
        return float(most / self.unbalanced) + hidden

    def _lacking(self, values: Floats) -> tuple[Floats, Floats]:
        """Size of the first moment that each body lacks by ``values`` (rank,), and half of its interval in the
        direction in which that is widest, infinite where the runs do not tell it, (nb,) [kg m] each.
        """
        half = [
            max(e.half_width() if (e := self._estimate(row)) else np.inf for row in own)
            for own in self.imbalance.lacking
        ]
        return np.linalg.norm(self.conditions.lacking @ values, axis=1), np.array(half)

    def _estimate(self, combination: Floats, unit: str = "kg m") -> Estimate | None:
        """A combination (rank,) of the conditions' values [kg m, or ``unit``]; None where the runs do not tell it."""
        with suppress(NotIdentifiable):
            return self.imbalance.estimate(combination, unit)
        return None

    def remaining(self) -> list[MissingMass]:
        """What each site lacks still, with the addition and the removal."""
        return [m.with_added(self.changes.get(m.site, 0.0)) for m in self.missing]

    @property
    def changes(self) -> dict[str, float]:
        """By site, what the addition adds and the removal takes off (negative), sites that stay left out [kg]."""
        added = {c.site: c.mass for c in self.addition.counter_masses if c.mass > 0.0}
        return {**added, **{m.site: m.mass.value for m in self.removal}}

    @property
    def _measured(self) -> Mechanism:
        by_file = self.conditions.values(self.mechanism)
        values = [file if e is None else e.value for (_, e), file in zip(self.values, by_file, strict=True)]
        return with_condition_values(self.conditions, self.mechanism, np.array(values))

    @property
    def interval_level(self) -> float | None:
        """Of the intervals; None where they do not contain what a source does not explain, or no source is trusted."""
        doubted = any(share.doubtful for share in self.shares) or bool(self.doubts_before)
        return None if doubted else LEVEL

    def doubts(self) -> list[str]:
        """Why the result is doubtful; empty if it is not."""
        unexplained = [
            f"{share.unexplained:.0%} of the measured {SOURCES[share.source].measured} stays unexplained: {share.why}"
            for share in self.shares
            if share.doubtful and self.residual_share > _BALANCED  # else balanced, whatever it is that it leaves
        ]
        beyond = [
            f"{m.site}: at least {-m.interval[1]:.2g} kg m too much, where run table and file have {most:.2g} kg m to "
            "take off: what was mounted is not what the run table says, or a body is not what its file says"
            for m in self.missing
            if -m.interval[1] > _BALANCED * self.unbalanced + (most := self.removable.get(m.site, np.inf))
        ]
        others = [finding.message for finding in self.findings if finding.code != GAP_FINDING]
        return [*self.doubts_before, *unexplained, *beyond, *others]

    @property
    def gaps(self) -> tuple[str, ...]:
        """What was left out for gaps in records: a finding, and no doubt by itself."""
        return tuple(dict.fromkeys(finding.message for finding in self.findings if finding.code == GAP_FINDING))

    @property
    def verdict(self) -> str:
        """``add``, ``remove`` (sites have too much), ``change`` (one has too little, one too much), ``balanced`` (to a
        hundredth of what is missing without counter-masses), ``nothing told`` (every interval holds zero), or
        ``doubtful``.
        """
        if self.doubts():
            return "doubtful"
        if self.residual_share <= _BALANCED:
            return "balanced"
        significant = [m.first_moment.value for m in self.missing if m.is_significant]
        if not significant:
            return "nothing told"
        if min(significant) < 0.0:
            return "change" if max(significant) > 0.0 else "remove"
        return "add"


def _contributions(source: Source, estimate: Imbalance, gain: Floats) -> list[Contribution]:
    """Of one source to a combination of the conditions' values in which it has a gain (rank,) [-]."""
    whole = max(float(gain @ (estimate.covariance - estimate.covariance_by_file) @ gain), 0.0)
    noise, freedom = whole, estimate.constant_degrees_of_freedom
    if estimate.regression is not None:
        own = estimate.coordinates(gain, len(estimate.regression.values))
        noise = min(float(own @ estimate.regression.covariance @ own), whole)
        freedom = estimate.regression.degrees_of_freedom(own)
    name = SOURCES[source].name.partition(",")[0]
    of = "noise, the base's accelerometers' too" if source == "wrench" else "noise"
    parts = [Contribution(f"{name}: {of}, and what the model lacks", "A", noise**0.5, "kg m", 1.0, "t", freedom)]
    if whole > noise * (1.0 + 1e-9):
        stated = f"{name}: stated errors of calibration, cross-talk, resolution; the file's mass, on a base that moves"
        parts.append(Contribution(stated, "B", (whole - noise) ** 0.5, "kg m", 1.0, "normal"))
    return parts


def _additions(sizing: Sizing) -> list[dict[str, Any]]:
    return [
        {"site": c.site, "mass_kg": c.mass, "plates": c.plates, "position_m": c.position} for c in sizing.counter_masses
    ]


def trim_document(result: Trim) -> dict[str, Any]:
    """What is missing, what to add and take off in one mounting, and what is best by adding only; units in the keys."""
    adding = None
    if (only := result.only_adding) is not None:
        residual, interval = result.residual_with(only)
        adding = {
            "add": _additions(only),
            "predicted_residual_kgm": residual,
            "predicted_residual_interval_kgm": interval,
        }
    found = {
        "mechanism": result.mechanism.name,
        "runs": result.runs,
        "origin": result.origin,
        "source": result.source,
        "sources": result.shares,
        "agreement": result.consensus,
        "missing": result.missing,
        "interval_level": result.interval_level,
        "add": _additions(result.addition),
        "remove": [
            {"site": m.site, "mass_kg": -m.mass.value, "first_moment_kgm": -m.first_moment.value}
            for m in result.removal
        ],
        "residual_without_counter_masses_kgm": result.unbalanced,
        "residual_kgm": result.residual,
        "residual_share": finite(result.residual_share),
        "predicted_residual_kgm": result.predicted_residual,
        "predicted_residual_interval_kgm": result.predicted_residual_interval,
        "only_adding": adding,
        "verdict": result.verdict,
        "doubts": result.doubts(),
        "findings": [finding.as_dict() for finding in result.findings],
        "accepted": [finding.as_dict() for finding in result.accepted],
        "conditions": [
            {"condition": text, f"value_{unit.replace(' ', '')}": e and e.value, "interval": e and e.interval()}
            for (text, e), unit in zip(result.values, result.conditions.units, strict=True)
        ],
        "unexplained": result.unexplained,
        "about": result.about,
    }
    return dict(plain(found))
