"""What records say of a mechanism, and how well that predicts runs which had no part in it.

Observable combinations of parameters with intervals, first moments, counter-masses; torques and forces of separate runs
against what the parameters predict of them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from operator import attrgetter
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np

from balance.arrays import Floats
from balance.balancing import conditions
from balance.balancing.conditions import text_of
from balance.dynamics.regressor import JOINT_TERMS
from balance.errors import DataError
from balance.estimation.base_parameters import BaseParameters, Consistent, consistent
from balance.estimation.estimate import (
    LEVEL_TEXT,
    Estimate,
    coverage_factor,
    effective_degrees_of_freedom,
    joint_coverage_factor,
)
from balance.estimation.first_moment_imbalance import masses_per_value
from balance.estimation.identifiability import NotIdentifiable
from balance.mechanism.mechanism import Mechanism
from balance.results import IN_BODY, Key, Shown, first_of

from ..errors import AnalysisError
from ..loads.shaking_wrench import COMPONENTS
from ..recording import Finding, Origin
from .cross_validation import (
    FOLDS,
    Candidate,
    Choice,
    MethodErrors,
    SimulationError,
    compare,
    simulation_errors,
    unexplained,
)
from .estimators import Method
from .model_tests import FALSE_ALARM, Doubt, FreeTest, ModelTests
from .records import LONGEST_DELAY_S, JointRecord
from .regression_equations import RegressionEquations, parameters_in_file, regression_equations

if TYPE_CHECKING:
    from balance.estimation.uncertainty_budget import Budget

_TERM_UNITS = {
    "coulomb": ("N", "N m"), "viscous": ("N s/m", "N m s"), "offset": ("N", "N m"), "armature": ("kg", "kg m^2"),
    "low_speed": ("N", "N m"), "hysteresis": ("N", "N m"), "quadratic": ("N s^2/m^2", "N m s^2"),
    "low_speed_slope": ("N", "N m"), "hysteresis_slope": ("N", "N m"), "directional": ("N s/m", "N m s"),
}  # fmt: skip
"""Of the terms of a joint that slides, and of one that turns."""
_FRICTION = {
    "low_speed": ("at low speed (Stribeck)", ", below {}/s"),
    "hysteresis": ("after the joint turned (hysteresis; at the turn twice that)", ", for {}"),
    "quadratic": ("with the square of the speed", ""),
    "directional": ("with the speed, in its positive direction, and as much the other way in the negative one", ""),
}
"""Where the laws of friction add to it, and their size."""
FRICTION_FINDING = "other_friction"
SCALE = "torque scale"
"""How the variants begin that the interval of the torques' scale makes."""
_INTERVAL = (f"{LEVEL_TEXT} interval", lambda ends: "{:z.4f} .. {:z.4f}".format(*ends))


@dataclass(frozen=True)
class Value:
    """A combination of parameters with an interval that contains what other choices of method would have given."""

    name: Annotated[str, Key("", "parameter")]
    unit: Annotated[str, Key("", "unit")]
    estimate: Annotated[Estimate, Key("statistical_interval", to=Estimate.interval)]
    """At the chosen cut-off and delay; its interval is statistical alone."""
    variants: Annotated[Mapping[str, float], Key()]
    """The same by other choices: half and double the cut-off, no delay, the other methods."""
    in_file: Annotated[float, Key("", "in MECH's file", ".4f")]
    """What the mechanism's file says."""
    one_sided: Annotated[Mapping[str, float], Key("torque_alone_smoothed")]
    """With torque and rates smoothed but positions as recorded: often done, biased, for comparison only."""

    @property
    def value(self) -> Annotated[float, Key("", "value", ".4f")]:
        """At the chosen cut-off and delay [SI]."""
        return self.estimate.value

    @cached_property
    def interval(self) -> Annotated[tuple[float, float], Key("", *_INTERVAL)]:
        """The range of all variants, widened on both sides by half of the statistical interval."""
        return self.estimate.containing([*self.variants.values()]).interval()

    @property
    def is_of_scale(self) -> bool:
        """Whether the torques' scale makes most of the interval."""
        others = [value for name, value in self.variants.items() if not name.startswith(SCALE)]
        return bool(np.ptp(self.interval) > 2.0 * np.ptp(self.estimate.containing(others).interval()))

    @property
    def budget(self) -> "Budget":
        """In quadrature; ``interval``, which holds every other choice whole, is up to twice as wide."""
        from balance.estimation.uncertainty_budget import Budget, Contribution

        freedom = self.estimate.degrees_of_freedom
        noise = self.estimate.standard_uncertainty
        parts = [Contribution("noise, and what the simulated motion demands", "A", noise, self.unit, 1.0, "t", freedom)]
        for source, scaled in (("cut-off, delay and method", False), (SCALE, True)):
            others = [value for name, value in self.variants.items() if name.startswith(SCALE) == scaled]
            half = 0.5 * float(np.ptp([self.value, *others]))
            known = half / (coverage_factor() if scaled else np.sqrt(3.0))
            if half > 0.0:
                parts.append(Contribution(source, "B", known, self.unit, 1.0, "normal" if scaled else "rectangular"))
        whole = np.array([part.size**2 for part in parts])
        freedom = effective_degrees_of_freedom(whole, np.array([part.degrees_of_freedom for part in parts]))
        return Budget(self.name, self.value, self.unit, tuple(parts), freedom)


@dataclass(frozen=True)
class Ratio:
    """A first moment as a part of another, with an interval that contains other choices of method."""

    name: Annotated[str, Key()]
    value: Annotated[float, Key()]
    interval: Annotated[tuple[float, float], Key()]


@dataclass(frozen=True)
class CounterMassValue:
    """A counter-mass that would balance the mechanism as identified."""

    site: Annotated[str, Key("", "site")]
    position: Annotated[Floats, IN_BODY]
    """Of the site, in the frame of its body as in the file, (3,) [m]."""
    mass: Annotated[Value, Key("mass_kg", "mass [kg]", ".3f", to=attrgetter("value"))]
    first_moment: Annotated[Value, Key("first_moment_kgm", "first moment [kg m]", ".4f", to=attrgetter("value"))]
    """Mass times the distance of the site from the joint's axis [kg m]."""

    @property
    def mass_interval(self) -> Annotated[tuple[float, float], Key("mass_interval_kg", *_INTERVAL)]:
        """[kg]"""
        return self.mass.interval

    @property
    def first_moment_interval(self) -> Annotated[tuple[float, float], Key("first_moment_interval_kgm", *_INTERVAL)]:
        """[kg m]"""
        return self.first_moment.interval


def _inseparable(text: str, beside: Sequence[str]) -> str:
    told = f"separates {text} from {first_of(dict.fromkeys(beside), 4)}" if beside else f"shows {text}"
    return f"No motion with these drives and sensors {told}: use the combinations that are listed."


def unit_of(mechanism: Mechanism, parameter: str) -> str:
    """Unit of a parameter by name."""
    kind, _, of = parameter.rstrip("]").partition(",")[0].partition("[")
    if kind in JOINT_TERMS and of in COMPONENTS:
        return "N" if of.startswith("F") else "N m"
    if kind in _TERM_UNITS:
        place = mechanism.coordinate_index(of)
        return _TERM_UNITS[kind][mechanism.tree.joints[place].revolute]
    return "kg" if kind == "m" else "kg m" if kind.startswith("mc") else "kg m^2"


UNEXPLAINED = 0.3
"""Part of a force, or of the torque of a separate run, low-passed like the model, that may stay unexplained."""
Verdict = Literal["usable", "usable up to a torque scale", "doubtful"]
FAIR_CONDITION = 30.0
POOR_CONDITION = 100.0
"""Of the base columns, scaled to unit length, from which an excitation is no longer good, and poor (Gautier, Khalil,
Int. J. Robot. Res. 11, 1992)."""
DOUBTFUL_WIDTH = 0.25
"""Half of an interval, as a part of the largest first moment, from which a first moment is doubtful."""
OWN_FACTOR = 2.0
NEGLIGIBLE = 0.05
"""What stays unexplained may be so many times what did on held-out blocks of the identifying runs, or so little."""


@dataclass(frozen=True)
class Identification(Shown, rows="values", figure="testbench.figures.estimates:draw_identification"):
    """The result of an identification.

    >>> import testbench
    >>> testbench.identify("parallelogram-6bar", "campaign/r002.h5", by="wrench").origin
    'simulated'
    """

    mechanism: Mechanism
    runs: tuple[str, ...]
    origin: Origin
    choice: Choice
    identified: BaseParameters
    """At the chosen cut-off and delay."""
    variants: Mapping[str, BaseParameters]
    """By other choices that count for the intervals."""
    failed: tuple[str, ...]
    """Choices by which no motion can be simulated or not all is determined."""
    one_sided: Mapping[str, BaseParameters]
    """With torque and rates smoothed but positions as recorded: often done, biased, shown for comparison only."""
    contradictions: tuple[Finding, ...] = ()
    """What the runs' sensors contradict in the run table or in each other, and what of the base they do not show."""
    by: str = ""
    """What it is found from: ``torque``, ``wrench`` or ``both``."""
    notes: tuple[str, ...] = ()
    """What was left out of the runs, and why."""
    validation: "Validation | None" = None
    """How well it predicts separate runs."""
    friction: tuple[FreeTest, ...] = ()
    """The tests by which friction is more than Coulomb + viscous; their laws are parameters unless all is doubtful."""

    @property
    def values(self) -> "list[Value]":
        """The base parameters, then friction, drives and offsets."""
        return [*self.base_values(), *self.joint_values()]

    @property
    def chosen(self) -> Candidate:
        """Cut-off, delay, and torque error on held-out blocks."""
        return self.choice.chosen

    @property
    def method(self) -> Method:
        """By which the values are found; the others are among the variants."""
        return self.choice.method

    @property
    def rows(self) -> tuple[str, ...]:
        """What was measured, in the order of every array: driven joints' torques, then components of force."""
        return self.choice.equations.records[0].rows(self.mechanism)

    @property
    def joints(self) -> tuple[str, ...]:
        """The driven joints whose torques count."""
        return tuple(row for row in self.rows if row in self.mechanism.driven)

    @cached_property
    def comparison(self) -> list[MethodErrors]:
        """All methods on held-out blocks."""
        return compare(self.choice, self.mechanism, self.identified.identifiability)

    @cached_property
    def consistent(self) -> Consistent:
        """The nearest bodies that can exist. Raises DataError where none is proven to be the nearest."""
        return consistent(self.identified, self.mechanism, self.in_file)

    @cached_property
    def rms_ratio(self) -> Floats:
        """Part of each row as recorded that stays unexplained on held-out blocks, (rows,) [-]."""
        equations = self.choice.equations
        return unexplained(equations.torque(self.chosen.delay), self.choice.predicted, equations.moving)

    @cached_property
    def rms_ratio_in_band(self) -> Floats:
        """The same below the cut-off, torque and model low-passed, (rows,) [-]."""
        equations = self.choice.equations
        torque = equations.low_passed_torque(self.chosen.delay)
        return unexplained(torque, self.choice.predicted_smooth, equations.moving)

    def value(self, combination: Mapping[str, float] | Floats, name: str = "", unit: str = "") -> Value:
        """Any observable combination, by names or as a vector over all parameters (p,) [-].

        Raises NotIdentifiable, naming it, if the record does not determine it.
        """
        identifiable = self.identified.identifiability
        vector = identifiable.vector(combination) if isinstance(combination, Mapping) else combination
        coefficients = {identifiable.names[k]: float(vector[k]) for k in np.flatnonzero(vector)}
        found = self.identified.estimate(vector)
        variants = {label: other.estimate(vector).value for label, other in self.variants.items()}
        for label, change in self.tests.scales.changes.items():
            variants[f"{SCALE} {label}"] = found.value + float(identifiable.share(vector) @ change)
        return Value(
            name or text_of(coefficients),
            unit or unit_of(self.mechanism, next(iter(coefficients), "")),
            replace(found, covariance=found.covariance * self._covariance_factor),
            variants,
            float(vector @ self.in_file),
            {label: other.estimate(vector).value for label, other in self.one_sided.items()},
        )

    def base_values(self) -> list[Value]:
        """The base parameters: all that the record determines, without friction and other terms of joints."""
        rows = self.identified.identifiability.combinations
        return [self.value(row) for row in rows if np.any(row[: len(self.mechanism.pi)])]

    def joint_values(self) -> list[Value]:
        """Friction, offset and drive inertia of each joint that the record determines by itself."""
        rows = self.identified.identifiability.combinations
        return [self.value(row) for row in rows if not np.any(row[: len(self.mechanism.pi)])]

    @cached_property
    def other_friction(self) -> list[str]:
        """What friction is beyond Coulomb + viscous, and what of it is determined."""
        texts = []
        for test in self.friction:
            if (law := test.law) is None:
                continue
            joint, (where, fades) = law.joint, _FRICTION[law.kind]
            lacking = f"coulomb[{joint}] and viscous[{joint}] are not determined"
            try:
                one, *slope = (self.value({term.name: 1.0}) for term in law.terms)
            except DataError:  # no parameter, or not told from others
                text = (
                    f"it may be other {where}, which explains {test.share:.1%} of the torque (by chance "
                    f"{test.probability:.1g}); left out, as the record is doubtful with it too, so {lacking}; what is "
                    f"found about {joint} may be this friction, or the other way round"
                )
            else:
                apart, (low, high) = "first moments and inertias are not affected", sorted(map(abs, one.interval))
                way = "rad" if self.mechanism.tree.joints[self.mechanism.coordinate_index(joint)].revolute else "m"
                ends = [law.size * np.exp(end / one.value) for change in slope for end in change.interval]
                size = fades.format(" to ".join(f"{end:.2g}" for end in sorted(ends)) + f" {way}")
                text = (
                    f"{abs(one.value):.3g} [{low:.3g}, {high:.3g}] {one.unit} {'more' if one.value > 0.0 else 'less'} "
                    f"{where}{size}; it is found together with the bodies, as "
                    f"{', '.join(term.name for term in law.terms)}: {apart}, coulomb and viscous are the rest of the "
                    "friction"
                )
                if test.at_end:
                    text = f"it is other {where}, its size is at the end of what is tried: {lacking}, {apart}"
                elif one.interval[0] * one.interval[1] <= 0.0:
                    text = f"it may be other {where}, its size is not determined by this record: {apart}"
            texts.append(f"friction of {joint} is not Coulomb + viscous: {text}")
        return texts

    def parameters(self) -> list[tuple[str, Value | None]]:
        """Every single parameter by name; None where the record does not determine it."""
        names = self.identified.identifiability.names
        rows = zip(names, np.eye(len(names)), strict=True)
        return [(name, self.value(row) if self._observable(row) else None) for name, row in rows]

    def first_moments(self) -> list[Value]:
        """The left-hand sides of the balance conditions that the record determines [kg m]."""
        return [self.value(row, text) for text, row in self._conditions if self._observable(row)]

    def moment_rows(self) -> list[tuple[str, dict[str, float]]]:
        """The balance conditions by name, with the coefficients of their parameters."""
        names = self.identified.identifiability.names
        return [(text, {names[k]: float(row[k]) for k in np.flatnonzero(row)}) for text, row in self._conditions]

    def undetermined_moments(self) -> list[str]:
        """The balance conditions whose left-hand sides the record does not determine."""
        return [text for text, row in self._conditions if not self._observable(row)]

    @cached_property
    def inseparable(self) -> dict[str, str]:
        """Those of them that no motion with these drives and sensors determines, and what is to say of each.

        And of bodies' parameters that none separates from a term of a joint, such as an inertia from ``armature``.
        """
        found: dict[str, list[str]] = {}
        seen = self.choice.equations.parts[0].by_any_motion
        for text, row in self._conditions:
            if not self._observable(row) and not seen.is_identifiable(row):
                with_it = [k for k in range(seen.rank) if np.any(seen.combinations[k] * row)]
                found[text] = [n for k in with_it for n in seen.coefficients(k) if not row[seen.names.index(n)]]
        for k in range(seen.rank):
            parts = seen.coefficients(k)
            terms = [name for name in parts if name.partition("[")[0] in JOINT_TERMS]
            bodies = {name: value for name, value in parts.items() if name not in terms}
            if bodies and terms:
                found.setdefault(text_of(bodies), terms)
        return {text: _inseparable(text, beside) for text, beside in found.items()}

    def counter_masses(self) -> list[CounterMassValue]:
        """Counter-masses at the sites named counter... that would balance the mechanism.

        Raises NotIdentifiable if the record does not determine what they depend on.
        """
        found, sites = self._balance, self.mechanism.counter_sites
        moments = [
            self.identified.estimate(row).value if self._observable(row) else float(row @ self.in_file)
            for _, row in self._conditions
        ]
        rows = masses_per_value(found, self.mechanism, sites, np.array(moments)) @ found.matrix
        masses = []
        for site, row in zip(sites, rows, strict=True):
            whole, lever = self._padded(row), self.mechanism.lever_arm(site)
            try:
                mass = self.value(whole, f"mass[{site}]", "kg")
            except NotIdentifiable as error:
                raise NotIdentifiable(f"no counter-mass for {site}: {error}") from error
            moment = self.value(lever * whole, f"first_moment[{site}]", "kg m")
            masses.append(CounterMassValue(site, self.mechanism.place(site), mass, moment))
        return masses

    def moment_ratios(self) -> list[Ratio]:
        """First moments as parts of the largest, which no scale common to all torques changes."""
        moments = [(row, self.value(row, text)) for text, row in self._conditions if self._observable(row)]
        if not moments:
            return []
        found = []
        whole_row, whole = max(moments, key=lambda pair: abs(pair[1].value))
        for row, one in moments:
            if one.name != whole.name and all(whole.variants.values()):
                ratio = one.value / whole.value
                away = self.value((row - ratio * whole_row) / whole.value).estimate.shifted(ratio)
                others = [value / whole.variants[label] for label, value in one.variants.items()]
                found.append(Ratio(f"{one.name} / {whole.name}", ratio, away.containing(others).interval()))
        return found

    @cached_property
    def tests(self) -> ModelTests:
        """Whether the torques are those of bodies."""
        return ModelTests(self.mechanism, self.choice.equations, self.chosen.delay, self.identified)

    @property
    def closed(self) -> bool:
        """Whether masses that are known to differ between the runs determine the scale of each torque."""
        return self.tests.scales.closed

    @cached_property
    def doubts(self) -> list[Doubt]:
        """Why the result is doubtful; empty if it is not."""
        contradicted = [Doubt(finding.code, finding.message) for finding in self.contradictions]
        return [*contradicted, *self.tests.doubts, *self._doubts_of_bodies(), *self._doubts_of_answer()]

    def _doubts_of_bodies(self) -> list[Doubt]:
        """Parameters that no bodies have, or by which some method has no answer."""
        found = []
        if self.failed:
            text = f"no motion can be simulated, or not all is determined, by {', '.join(self.failed)}"
            found.append(Doubt("no_motion", text))
        freedom = max(self.identified.fit.blocks - 1.0, 1.0)
        by_chance = joint_coverage_factor(2 * max(len(self.joints), 1), freedom, 1.0 - FALSE_ALARM)
        try:
            distance = self.consistent.distance / np.sqrt(self._covariance_factor)
        except DataError as error:
            return [*found, Doubt("bodies_unproven", str(error))]
        if distance > by_chance:
            text = f"no bodies have such parameters: the nearest are {distance:.2g} standard errors away"
            found.append(Doubt("no_such_bodies", f"{text}, {by_chance:.2g} by chance"))
        return found

    def _doubts_of_answer(self) -> list[Doubt]:
        """What is poorly excited, at the end of what is tried, not determined or hardly known."""
        seen, chosen = self.identified.identifiability, self.chosen
        found = [
            Doubt("unexplained", f"{ratio:.0%} of {row} below {chosen.cutoff:.3g} Hz stays unexplained")
            for row, ratio in zip(self.rows, self.rms_ratio_in_band, strict=True)
            if row not in self.joints and ratio > UNEXPLAINED
        ]
        if seen.condition > POOR_CONDITION:
            text = f"the motion tells the parameters poorly apart: condition {seen.condition:.3g}, expected below"
            cure = "record a motion of all drives at once, each over more of its range and of frequencies of its own"
            found.append(Doubt("poor_excitation", f"{text} {POOR_CONDITION:g}: {cure}; weakest: {seen.weakest}"))
        if abs(chosen.delay) > LONGEST_DELAY_S - 0.5 * self.choice.equations.records[0].grid.step:
            text = f"the delay of the torques, {chosen.delay * 1e3:.3g} ms, is at the end of what is tried"
            found.append(Doubt("delay", text))
        lacking = [text for text in self.undetermined_moments() if text not in self.inseparable]
        found += [Doubt("not_determined", f"{text} is not determined by this record") for text in lacking]
        moments = self.first_moments()
        largest = max((abs(value.value) for value in moments), default=0.0)
        widths = [(value.name, float(np.ptp(value.interval)) / 2.0) for value in moments]
        wide = [(name, half) for name, half in widths if half > DOUBTFUL_WIDTH * largest]
        return [*found, *(Doubt("wide", f"{name} is known to {half:.2g} kg m only") for name, half in wide)]

    @property
    def excitation(self) -> str:
        """``good``, ``fair`` or ``poor``: how well the motion tells the base parameters apart, before solving."""
        condition = self.identified.identifiability.condition
        return "poor" if condition > POOR_CONDITION else "fair" if condition > FAIR_CONDITION else "good"

    @property
    def verdict(self) -> Verdict:
        """Whether it may be relied on."""
        if self.all_doubts:
            return "doubtful"
        torques_alone = self.joints and len(self.joints) == len(self.rows)
        return "usable up to a torque scale" if torques_alone and not self.closed else "usable"

    @property
    def all_doubts(self) -> list[Doubt]:
        """Those about the runs, and those about the prediction of separate ones."""
        return [*self.doubts, *(self.validation.doubts if self.validation else [])]

    @property
    def lost(self) -> tuple[str, ...]:
        """What gaps in the records took, those of separate runs too."""
        return (*self.choice.equations.left_out, *(self.validation.equations.left_out if self.validation else ()))

    def named(self, row: str) -> str:
        """What a row is called: the torque of a joint, or a component of force or moment."""
        return f"the torque of {row}" if row in self.mechanism.driven else row

    @cached_property
    def in_file(self) -> Floats:
        """Parameters as the mechanism's file has them, (p,) [SI]."""
        return self._padded(parameters_in_file(self.mechanism, self.joints))

    @property
    def _covariance_factor(self) -> float:
        return 1.0 if self.tests.motion is None else self.tests.motion.factor

    @cached_property
    def _balance(self) -> conditions.Conditions:
        return conditions.balance_conditions(self.mechanism)

    @cached_property
    def _conditions(self) -> list[tuple[str, Floats]]:
        found = self._balance
        return [(text_of(found.coefficients(i)), self._padded(row)) for i, row in enumerate(found.matrix)]

    def _padded(self, row: Floats) -> Floats:
        return np.pad(row, (0, len(self.identified.identifiability.names) - len(row)))

    def _observable(self, row: Floats) -> bool:
        return self.identified.identifiability.is_identifiable(row)


@dataclass(frozen=True)
class Validation:
    """How well an identification predicts separate runs."""

    result: Identification
    runs: tuple[str, ...]
    equations: RegressionEquations
    """Of the separate runs, at the cut-off of the identification."""

    @cached_property
    def parameters(self) -> Floats:
        """What was identified, with the offsets that these runs themselves have, (p,) [SI] of their equations."""
        equations, found = self.equations, self.result.identified
        full, first = np.zeros(len(equations.names)), equations.parts[0]
        shared = len(full) - (len(self.runs) - 1) * len(first.offsets)
        full[:shared] = found.identifiability.over_all(found.values)[:shared]
        left = equations.low_passed_torque(self.result.chosen.delay) - self._smooth_columns @ full
        for part, own in zip(equations.parts, equations.places, strict=True):
            used = equations.moving[own]
            full[[*part.offsets]] += np.sum(used * left[own], axis=0) / np.maximum(used.sum(axis=0), 1.0)
        return full

    @cached_property
    def _smooth_columns(self) -> Floats:
        return self.equations.low_passed_columns(range(len(self.equations.names)))

    @cached_property
    def rms_ratio(self) -> Floats:
        """Part of each row as recorded that stays unexplained, (rows,) [-]."""
        predicted = self.equations.columns @ self.parameters
        return unexplained(self.equations.torque(self.result.chosen.delay), predicted, self.equations.moving)

    @cached_property
    def rms_ratio_in_band(self) -> Floats:
        """The same below the cut-off, (rows,) [-]."""
        predicted = self._smooth_columns @ self.parameters
        return unexplained(self.equations.low_passed_torque(self.result.chosen.delay), predicted, self.equations.moving)

    @cached_property
    def angles(self) -> SimulationError | None:
        """How far simulated angles stray; None for loops, and where there are no torques."""
        same, result = [np.tile(self.parameters, (FOLDS, 1))], self.result
        strayed = simulation_errors(self.equations, result.mechanism, same, result.chosen.delay)
        return None if strayed is None else strayed[0]

    @cached_property
    def doubts(self) -> list[Doubt]:
        """Rows that the parameters do not predict."""
        result = self.result
        return [
            Doubt(
                "not_predicted",
                f"{', '.join(self.runs)}: {ratio:.0%} of {result.named(row)} below the cut-off stays unexplained, "
                f"{own:.0%} did in the runs identified from",
            )
            for row, ratio, own in zip(result.rows, self.rms_ratio_in_band, result.rms_ratio_in_band, strict=True)
            if ratio > min(UNEXPLAINED, max(NEGLIGIBLE, OWN_FACTOR * own))
        ]


def validate(result: Identification, records: Sequence[JointRecord]) -> Validation:
    """Compare an identification with records of the same sensors.

    Raises AnalysisError if a record is among those identified from, or measured something else.
    """
    names = tuple(record.name for record in records)
    if twice := set(names) & set(result.runs):
        raise AnalysisError(f"{', '.join(sorted(twice))}: identified from, so it proves nothing: expected other runs")
    for record in records:
        if record.rows(result.mechanism) != result.rows:
            raise AnalysisError(
                f"{record.name}: measured {', '.join(record.rows(result.mechanism))}, expected {', '.join(result.rows)}"
            )
    first = result.choice.equations.records[0]
    records = [replace(record, laws=first.laws, of_root=first.of_root) for record in records]
    return Validation(result, names, regression_equations(records, result.mechanism, result.chosen.cutoff))
