"""What may explain a difference to values that others give, each by a fit of its own; and the document of all findings.

* A joint alone: the first moments from each joint's torque by itself. Where they differ, a torque is scaled, or a joint
  has friction that the model lacks.
* Scale between joints: tau_k = s W_k pi with tau_1 = W_1 pi. Bodies that both torques move tie them together. A scale
  common to all of them cannot be distinguished from heavier bodies: every parameter scales in the same way.
* Scale of all torques: determined where runs differ by masses that are known: tau = s (W pi + W dpi).
* Friction: none, dry alone, dry and viscous, dry that differs by direction, and that of the mechanism's file.
* Delay and cut-off: no delay between torque and motion, from low to high cut-offs. Noise of the motion that a high
  cut-off lets in pulls least squares towards zero.
* The file's own parameters: what they leave of the same torques.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any

import numpy as np

from balance.arrays import Floats
from balance.errors import DataError
from balance.estimation.base_parameters import BaseParameters
from balance.estimation.estimate import LEVEL, Estimate
from balance.estimation.identifiability import Identifiability, identifiability
from balance.estimation.regression import RegressionFit, RegressionRecord, fit
from balance.results import Key, document, plain

from ..kinematics.gaps import GAP_FINDING
from ..recording import Finding
from .cross_validation import RULE, CrossValidation, unexplained
from .estimators import NAMES
from .model_tests import FALSE_ALARM, FREE_ALARM
from .regression_equations import RegressionEquations, regression_equations
from .result import Identification, Validation

SCALE_UNKNOWN = (
    "a scale common to all torques and heavier bodies look alike: it takes runs that differ by a mass that is known "
    "(conditions payload_kg or counter_masses)"
)
SCALE_KNOWN = "from masses that are known to differ between the runs"
_ROUNDS = 20
_SETTLED = 1e-9
_FRICTION = {
    "no friction": ("coulomb[", "viscous["),
    "dry friction": ("viscous[",),
    "viscous friction": ("coulomb[",),
    "dry and viscous friction": ("none",),
}
"""Models of friction, with the terms that each lacks."""


def _shown(found: Estimate) -> dict[str, Any]:
    return {"value": found.value, "interval": found.interval()}


@dataclass(frozen=True)
class Fit:
    """First moments by one way of fitting, None where it does not determine them."""

    name: Annotated[str, Key("fit")]
    first_moments: Annotated[Mapping[str, Estimate | None], Key("first_moments_kgm", to=_shown)]
    unexplained: Annotated[Mapping[str, float], Key("rms_ratio_below_cutoff")]
    """Part of each row below the cut-off that the fit does not explain."""


def scale_document(scale: Estimate | None) -> dict[str, Any]:
    """The scale of all torques, or why it is not identifiable."""
    if scale is None:
        return {"identifiable": False, "reason": SCALE_UNKNOWN}
    return {"identifiable": True, "reason": SCALE_KNOWN, **_shown(scale)}


@dataclass(frozen=True)
class Explanation:
    """The fits, all of least squares at the cut-off and delay of an identification."""

    result: Identification

    @property
    def fits_by(self) -> Annotated[str, Key()]:
        """How they are made."""
        return "least squares at the chosen cut-off and delay"

    @cached_property
    def rows_alone(self) -> Annotated[list[Fit], Key()]:
        """First moments from each row by itself."""
        names = self.equations.names
        rows = enumerate(self.result.rows)
        return [self._fit(f"{self.result.named(row)} alone", self._columns[:, [k]], names, [k]) for k, row in rows]

    @cached_property
    def friction(self) -> Annotated[list[Fit], Key()]:
        """First moments with other models of friction."""
        if not self.result.joints:
            return []
        fits = []
        for name, lacking in _FRICTION.items():
            kept, names = self._without(lacking)
            fits.append(self._fit(name, self._columns[:, :, kept], names))
        return [*fits, self._fit("dry and viscous friction, dry by direction", *self._by_direction())]

    @cached_property
    def file_friction(self) -> Annotated[Fit | None, Key("friction_of_file")]:
        """First moments with dry and viscous friction taken from the mechanism's file."""
        if not self.result.joints:
            return None
        kept, names = self._without(("coulomb[", "viscous["))
        fixed = np.setdiff1d(np.arange(len(self.equations.names)), kept)
        known = self._columns[:, :, fixed] @ self.result.in_file[fixed]
        return self._fit("friction of MECH's file", self._columns[:, :, kept], names, known=known)

    @cached_property
    def without_delay(self) -> Annotated[list[Fit], Key()]:
        """First moments without delay, at every cut-off that the records allow."""
        if not self.result.joints:
            return []
        result, fits = self.result, []
        for one in result.choice.best_of_each:
            equations = regression_equations(self.equations.records, result.mechanism, one.cutoff)
            held_out = CrossValidation(equations, result.mechanism, self._seen)
            chosen = replace(result.chosen, cutoff=one.cutoff, delay=0.0)
            at = Explanation(replace(result, choice=replace(result.choice, chosen=chosen, held_out=held_out)))
            fits.append(at._fit(f"no delay, {one.cutoff:.3g} Hz", at._columns, equations.names))
        return fits

    @property
    def file_unexplained(self) -> Annotated[dict[str, float], Key("file_rms_ratio_below_cutoff")]:
        """Part of each row below the cut-off that the parameters of the mechanism's file do not explain."""
        shares = unexplained(self._rows, self._columns @ self.result.in_file, self.equations.moving)
        return dict(zip(self.result.rows, shares.tolist(), strict=True))

    @cached_property
    def scale_between(self) -> Annotated[dict[str, Estimate], Key("torque_scale_between_joints", to=_shown)]:
        """Scale of each joint's torque against the first joint's, for those that share a body."""
        joints = self.result.joints
        return {f"{joint} / {joints[0]}": self._scale(k) for k, joint in enumerate(joints) if k}

    @property
    def equations(self) -> RegressionEquations:
        """At the chosen cut-off."""
        return self.result.choice.equations

    @cached_property
    def _columns(self) -> Floats:
        return self.equations.low_passed_columns(range(len(self.equations.names)))

    @property
    def _base(self) -> Floats:
        return self._columns[:, :, list(self._seen.pivots)]

    @cached_property
    def _rows(self) -> Floats:
        return self.equations.low_passed_torque(self.result.chosen.delay)

    @property
    def _seen(self) -> Identifiability:
        return self.result.identified.identifiability

    def _without(self, lacking: tuple[str, ...]) -> tuple[list[int], list[str]]:
        """Places and names of the parameters whose names begin otherwise."""
        names = self.equations.names
        kept = [k for k, name in enumerate(names) if not name.startswith(lacking)]
        return kept, [names[k] for k in kept]

    def _fitted(self, columns: Floats, rows: Floats, used: Floats | None = None) -> RegressionFit:
        blocks = self.equations.blocks(1.0 / self.equations.cutoff)
        everything = self.equations.moving if used is None else used
        return fit([RegressionRecord.of(columns, rows, blocks, used=everything)])

    def _fit(
        self,
        name: str,
        columns: Floats,
        names: Sequence[str],
        rows: Sequence[int] | None = None,
        known: Floats | float = 0.0,
    ) -> Fit:
        chosen = list(range(len(self.result.rows)) if rows is None else rows)
        moving, measured = self.equations.moving[:, chosen], (self._rows - known)[:, chosen]
        seen = identifiability(columns * moving[:, :, None], names)
        base = columns[:, :, list(seen.pivots)]
        found = BaseParameters(seen, self._fitted(base, measured, moving))
        ratio = unexplained(self._rows[:, chosen], self._rows[:, chosen] - measured + base @ found.values, moving)
        return Fit(
            name,
            {text: _estimate(found, row) for text, row in self.result.moment_rows()},
            {self.result.rows[k]: float(r) for k, r in zip(chosen, ratio, strict=True)},
        )

    def _by_direction(self) -> tuple[Floats, list[str]]:
        """Columns and names with one more a joint, the square of its direction: dry friction that differs by it."""
        places = [self.equations.names.index(f"coulomb[{joint}]") for joint in self.result.joints]
        added = self.equations.joined(lambda part: part.low_passed(part.whole[:, :, places] ** 2))
        names = [*self.equations.names, *(f"uneven[{joint}]" for joint in self.result.joints)]
        return np.concatenate([self._columns, added], axis=2), names

    def _scale(self, joint: int) -> Estimate:
        """Gauss-Newton on tau_k = s W_k pi: columns s W_k, and W_k pi for the change of s."""
        base = self._base
        scale, pi = 1.0, self._fitted(base, self._rows).values
        for _ in range(_ROUNDS):
            columns = base.copy()
            columns[:, joint] *= scale
            made = np.zeros((*base.shape[:2], 1))
            made[:, joint, 0] = base[:, joint] @ pi
            found = self._fitted(np.concatenate([columns, made], axis=2), self._rows)
            pi, step = found.values[:-1], float(found.values[-1])
            scale += step
            if abs(step) < _SETTLED:
                break
        return replace(found.estimate(np.eye(len(found.values))[-1]), values=np.array([scale]))


def _estimate(found: BaseParameters, row: Mapping[str, float]) -> Estimate | None:
    if not set(row) <= set(found.identifiability.names):
        return None
    vector = found.identifiability.vector(row)
    return found.estimate(vector) if found.identifiability.is_identifiable(vector) else None


def identification_document(result: Identification) -> dict[str, Any]:
    """All that was found."""
    determined = bool(result.mechanism.counter_sites) and not result.undetermined_moments()
    explained = Explanation(result)
    found = {
        "mechanism": result.mechanism.name,
        "runs": list(result.runs),
        "origin": result.origin,
        "rows": list(result.rows),
        "method": {"name": result.method, "what": NAMES[result.method], "compared": result.comparison},
        "parameters": [
            {"name": name, "value": one and one.value, "interval": one and one.interval, "observable": one is not None}
            for name, one in result.parameters()
        ],
        "base_parameters": [*result.base_values(), *result.joint_values()],
        "first_moments": result.first_moments(),
        "first_moment_ratios": result.moment_ratios(),
        "counter_masses": result.counter_masses() if determined else None,
        "consistent": _consistent(result),
        "identifiability": {**document(result.identified.identifiability), "excitation": result.excitation},
        "cutoff": {"chosen_Hz": result.chosen.cutoff, "rule": RULE, "held_out_error": result.choice.best_of_each},
        "torque_delay_s": result.chosen.delay,
        "interval": {
            "confidence": LEVEL,
            "statistical": f"delete-block jackknife over {result.identified.fit.blocks} blocks",
            "method": f"widened to contain: {', '.join(result.variants)}",
        },
        "evidence": {**document(explained), "scale_of_all": scale_document(result.tests.scale)},
        "model_tests": {
            "false_alarm_rate": FALSE_ALARM,
            "false_alarm_rate_free": FREE_ALARM,
            "laws": result.tests.laws,
            "free": result.tests.free,
            "motion": result.tests.motion,
        },
        "validation": _validation(result, result.validation),
        "verdict": result.verdict,
        "findings": [
            *(Finding(GAP_FINDING, None, text.partition(":")[0], text).as_dict() for text in result.lost),
            *(finding.as_dict() for finding in result.contradictions),
        ],
        "doubts": [doubt.text for doubt in result.all_doubts],
        "doubt_codes": [doubt.code for doubt in result.all_doubts],
        "by": result.by,
        "left_out": list(result.notes),
    }
    return dict(plain(found))


def _consistent(result: Identification) -> dict[str, Any]:
    """The nearest bodies that can exist, a member of the set that the record determines; or why there are none."""
    try:
        found = result.consistent
    except DataError as error:
        return {"free_estimate_feasible": None, "reason": str(error)}
    seen = result.identified.identifiability
    return {
        "free_estimate_feasible": found.free_is_feasible,
        "distance_in_standard_errors": found.distance,
        "what": "one of those that the record leaves, nearest to the mechanism's file where it does not tell",
        "parameters": [
            {"name": name, "value": float(value), "determined": name not in seen.undetermined}
            for name, value in zip(seen.names, found.parameters, strict=True)
        ],
    }


def _validation(result: Identification, validation: Validation | None) -> dict[str, Any]:
    def by_row(shares: Floats) -> dict[str, float]:
        return dict(zip(result.rows, shares.tolist(), strict=True))

    def ratios(of: Identification | Validation, prefix: str = "") -> dict[str, Any]:
        below = by_row(of.rms_ratio_in_band)
        return {f"{prefix}rms_ratio": by_row(of.rms_ratio), f"{prefix}rms_ratio_below_cutoff": below}

    if validation is None:
        return {"on": "held-out blocks", **ratios(result)}
    angles = None if validation.angles is None else document(validation.angles)
    return {
        "on": "separate runs",
        "runs": list(validation.runs),
        **ratios(validation),
        "simulated_angle_error_rad": angles and {key: angles[key] for key in angles if key != "all_rms"},
        **ratios(result, "held_out_"),
    }
