"""What a record says of a mechanism: observable combinations with intervals, first moments, counter-masses."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from balance import conditions
from balance.arrays import Floats
from balance.combinations import text_of
from balance.identification import Estimate, Identified, counter_mass_rows
from balance.joint_terms import TERMS
from balance.mechanism import Mechanism
from balance.observability import NotObservable

from ..recording import Origin
from .choice import LONGEST_DELAY_S, Candidate, Choice, unexplained

DOUBTFUL_RATIO = 0.3
"""Part of the torque, low-passed like the model, that may stay unexplained before a result is doubtful."""
DOUBTFUL_WIDTH = 0.5
"""Half of an interval, as a part of the largest first moment, from which a first moment is doubtful."""


_TERM_UNITS = {
    "coulomb": ("N", "N m"), "viscous": ("N s/m", "N m s"), "offset": ("N", "N m"), "armature": ("kg", "kg m^2"),
}  # fmt: skip
"""Of the terms of a joint that slides, and of one that turns."""


@dataclass(frozen=True)
class Value:
    """A combination of parameters with an interval that contains what other choices of method would have given."""

    name: str
    unit: str
    estimate: Estimate
    """At the chosen cut-off and delay; its interval is statistical alone."""
    variants: Mapping[str, float]
    """The same by other choices: half and double the cut-off, no delay."""
    in_file: float
    """What the mechanism's file says."""
    one_sided: Mapping[str, float]
    """With torque and rates smoothed but positions as recorded: often done, biased, for comparison only."""

    @property
    def value(self) -> float:
        """At the chosen cut-off and delay [SI]."""
        return self.estimate.value

    @property
    def interval(self) -> tuple[float, float]:
        """The range of all variants, widened on both sides by half of the statistical 95 % interval."""
        all_values = [self.value, *self.variants.values()]
        return min(all_values) - self.estimate.half_width, max(all_values) + self.estimate.half_width


@dataclass(frozen=True)
class CounterMassValue:
    """A counter-mass that would balance the mechanism as identified."""

    site: str
    position: Floats
    """Of the site in its body's frame, (3,) [m]."""
    mass: Value
    first_moment: Value
    """Mass times the distance of the site from the joint [kg m]."""


@dataclass(frozen=True)
class Identification:
    """The result of an identification."""

    mechanism: Mechanism
    runs: tuple[str, ...]
    origin: Origin
    choice: Choice
    identified: Identified
    """At the chosen cut-off and delay."""
    variants: Mapping[str, Identified]
    """By other choices that count for the intervals."""
    one_sided: Mapping[str, Identified]
    """With torque and rates smoothed but positions as recorded: often done, biased, shown for comparison only."""

    @property
    def chosen(self) -> Candidate:
        """Cut-off, delay, and torque error on held-out stretches."""
        return self.choice.chosen

    @property
    def joints(self) -> tuple[str, ...]:
        """The driven joints, in the order of every array of torques."""
        return self.mechanism.driven

    @cached_property
    def rms_ratio(self) -> Floats:
        """Part of the torque as recorded that stays unexplained on held-out stretches, (joints,)."""
        evidence = self.choice.evidence
        return unexplained(evidence.torque(self.chosen.delay), self.choice.predicted, evidence.moving)

    @cached_property
    def rms_ratio_in_band(self) -> Floats:
        """The same below the cut-off, torque and model low-passed alike, (joints,)."""
        evidence = self.choice.evidence
        torque = evidence.low_passed_torque(self.chosen.delay)
        return unexplained(torque, self.choice.predicted_smooth, evidence.moving)

    def value(self, combination: Mapping[str, float] | Floats, name: str = "", unit: str = "") -> Value:
        """Any observable combination. Raises NotObservable, naming it, if the record does not determine it."""
        observability = self.identified.observability
        vector = observability.vector(combination) if isinstance(combination, Mapping) else combination
        coefficients = {observability.names[k]: float(vector[k]) for k in np.flatnonzero(vector)}
        return Value(
            name or text_of(coefficients),
            unit or self.unit_of(next(iter(coefficients), "")),
            self.identified.estimate(vector),
            {label: other.estimate(vector).value for label, other in self.variants.items()},
            float(vector @ self._in_file),
            {label: other.estimate(vector).value for label, other in self.one_sided.items()},
        )

    def base_values(self) -> list[Value]:
        """The base parameters: all that the record determines, without friction and other terms of joints."""
        rows = self.identified.observability.combinations
        return [self.value(row) for row in rows if np.any(row[: len(self.mechanism.pi)])]

    def joint_values(self) -> list[Value]:
        """Friction, offset and drive inertia of each joint that the record determines by itself."""
        rows = self.identified.observability.combinations
        return [self.value(row) for row in rows if not np.any(row[: len(self.mechanism.pi)])]

    def parameters(self) -> list[tuple[str, Value | None]]:
        """Every single parameter by name; None where the record does not determine it."""
        observability = self.identified.observability
        eye = np.eye(len(observability.names))
        return [
            (name, self.value(row) if observability.is_observable(row) else None)
            for name, row in zip(observability.names, eye, strict=True)
        ]

    def first_moments(self) -> list[Value]:
        """The left-hand sides of the balance conditions that the record determines [kg m]."""
        return [self.value(row, text) for text, row in self._conditions if self._observable(row)]

    def undetermined_moments(self) -> list[str]:
        """The balance conditions whose left-hand sides the record does not determine."""
        return [text for text, row in self._conditions if not self._observable(row)]

    def counter_masses(self, sites: Sequence[str] = ()) -> list[CounterMassValue]:
        """Counter-masses at ``sites`` (default: those named counter...) that would balance the mechanism.

        Raises NotObservable if the record does not determine what they depend on.
        """
        names = list(sites) or self.mechanism.counter_sites
        rows = counter_mass_rows(self._found, self.mechanism, names)
        return [self._counter_mass(site, self._padded(row)) for site, row in rows.items()]

    def doubts(self) -> list[str]:
        """Why the result is doubtful; empty if it is not."""
        doubts = [
            f"{ratio:.0%} of the torque of {joint} below {self.chosen.cutoff:.3g} Hz stays unexplained"
            for joint, ratio in zip(self.joints, self.rms_ratio_in_band, strict=True)
            if ratio > DOUBTFUL_RATIO
        ]
        if abs(self.chosen.delay) > LONGEST_DELAY_S - 0.5 * self.choice.evidence.parts[0].record.grid.step:
            doubts.append(f"the delay of the torques, {self.chosen.delay * 1e3:.3g} ms, is at the end of what is tried")
        doubts += [f"{text} is not determined by this record" for text in self.undetermined_moments()]
        largest = max((abs(value.value) for value in self.first_moments()), default=0.0)
        for value in self.first_moments():
            low, high = value.interval
            if (high - low) / 2 > DOUBTFUL_WIDTH * largest:
                doubts.append(f"{value.name} is known to {(high - low) / 2:.2g} kg m only")
        return doubts

    @property
    def verdict(self) -> str:
        """``usable`` or ``doubtful``."""
        return "doubtful" if self.doubts() else "usable"

    def unit_of(self, parameter: str) -> str:
        """Unit of a parameter by name."""
        kind, _, of = parameter.rstrip("]").partition("[")
        if kind in TERMS:
            place = self.mechanism.coordinate_index(of)
            turning = self.mechanism.tree.joints[place].revolute
            return _TERM_UNITS[kind][turning]
        return "kg" if kind == "m" else "kg m" if kind.startswith("mc") else "kg m^2"

    @cached_property
    def _found(self) -> conditions.Conditions:
        return conditions.find(self.mechanism)

    @cached_property
    def _conditions(self) -> list[tuple[str, Floats]]:
        found = self._found
        return [(text_of(found.coefficients(i)), self._padded(row)) for i, row in enumerate(found.matrix)]

    @cached_property
    def _in_file(self) -> Floats:
        """Parameters as the mechanism's file has them, (p,)."""
        m = self.mechanism
        places = [m.coordinate_index(joint) for joint in self.joints]
        none = np.zeros_like(m.viscous)
        by_term = {"coulomb": m.coulomb, "viscous": m.viscous, "offset": none, "armature": m.armature}
        return np.concatenate([m.pi, [by_term[term][place] for place in places for term in TERMS]])

    def _padded(self, row: Floats) -> Floats:
        return np.concatenate([row, np.zeros(len(self._in_file) - len(row))])

    def _observable(self, row: Floats) -> bool:
        return self.identified.observability.is_observable(row)

    def _counter_mass(self, site: str, row: Floats) -> CounterMassValue:
        position = self.mechanism.site(site).position
        distance = float(np.linalg.norm(position))
        try:
            mass = self.value(row, f"mass[{site}]", "kg")
        except NotObservable as error:
            raise NotObservable(f"no counter-mass for {site}: {error}") from error
        return CounterMassValue(site, position, mass, self.value(distance * row, f"first_moment[{site}]", "kg m"))
