"""What may stand behind a difference to values that others give: each shown by a fit of its own.

* A joint alone: the first moments from each joint's torque by itself. Where they differ, a torque is scaled, or a joint
  has friction that the model lacks.
* Scale between joints: tau_k = s W_k pi with tau_1 = W_1 pi. Bodies that both torques move tie them together. A scale
  common to all of them cannot be told from heavier bodies: every parameter scales alike.
* Scale of all torques: told where runs differ by masses that are known: tau = s (W pi + W dpi).
* Friction: none, dry alone, dry and viscous, dry that differs by direction, and that of the mechanism's file.
* Delay and cut-off: no delay between torque and motion, from low to high cut-offs. Noise of the motion that a high
  cut-off lets in pulls least squares towards zero.
* The file's own parameters: what they leave of the same torques.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from balance.arrays import Floats
from balance.estimation.base_parameters import BaseParameters
from balance.estimation.estimate import Estimate
from balance.estimation.identifiability import Identifiability, identifiability
from balance.estimation.regression import RegressionFit, RegressionRecord, fit

from .cross_validation import CrossValidation, unexplained
from .records import JointRecord
from .regression_equations import RegressionEquations, regression_equations
from .result import Identification

SCALE_UNKNOWN = (
    "a scale common to all torques and heavier bodies look alike: it takes runs that differ by a mass that is known "
    "(conditions payload_kg or counter_masses)"
)
SCALE_KNOWN = "from masses that are known to differ between the runs"
_ROUNDS = 20
_SETTLED = 1e-9


@dataclass(frozen=True)
class Fit:
    """First moments by one way of fitting, None where it does not determine them."""

    name: str
    first_moments: Mapping[str, Estimate | None]
    left: Mapping[str, float]
    """Part of each row below the cut-off that the fit itself leaves."""

    def document(self) -> dict[str, object]:
        """For the JSON document."""
        return {
            "fit": self.name,
            "first_moments_kgm": {
                text: None if found is None else _estimate_document(found) for text, found in self.first_moments.items()
            },
            "rms_ratio_below_cutoff": dict(self.left),
        }


@dataclass(frozen=True)
class Explanation:
    """The fits, all of least squares at the cut-off and delay of an identification."""

    result: Identification

    @property
    def evidence(self) -> RegressionEquations:
        """The equations."""
        return self.result.choice.evidence

    def rows_alone(self) -> list[Fit]:
        """First moments from each row by itself."""
        return [self._alone(k, self.result.named(row)) for k, row in enumerate(self.result.rows)]

    def friction(self) -> list[Fit]:
        """First moments with other models of friction."""
        names = self.evidence.names
        without = {
            "no friction": ("coulomb[", "viscous["),
            "dry friction": ("viscous[",),
            "viscous friction": ("coulomb[",),
            "dry and viscous friction": ("none",),
        }
        fits = []
        for name, out in without.items():
            kept = [k for k, parameter in enumerate(names) if not parameter.startswith(out)]
            fits.append(self._fit(name, self._columns[:, :, kept], [names[k] for k in kept]))
        more, named = self._by_direction()
        return [*fits, self._fit("dry and viscous friction, dry by direction", more, named)]

    def file_friction(self) -> Fit:
        """First moments with dry and viscous friction taken from the mechanism's file."""
        names = self.evidence.names
        fixed = [k for k, name in enumerate(names) if name.startswith(("coulomb[", "viscous["))]
        kept = [k for k in range(len(names)) if k not in fixed]
        known = self._columns[:, :, fixed] @ self.result.in_file[fixed]
        return self._fit("friction of MECH's file", self._columns[:, :, kept], [names[k] for k in kept], known=known)

    def file_left(self) -> dict[str, float]:
        """Part of each row below the cut-off that the parameters of the mechanism's file leave."""
        left = unexplained(self._rows, self._columns @ self.result.in_file, self.evidence.moving)
        return dict(zip(self.result.rows, left.tolist(), strict=True))

    def without_delay(self) -> list[Fit]:
        """First moments without delay, at every cut-off that the records allow."""
        records = [part.record for part in self.evidence.parts]
        return [self._without_delay(records, one.cutoff) for one in self.result.choice.best_of_each]

    def _without_delay(self, records: Sequence[JointRecord], cutoff: float) -> Fit:
        result = self.result
        held_out = CrossValidation(
            regression_equations(records, result.mechanism, cutoff), result.mechanism, self._seen
        )
        chosen = replace(result.chosen, cutoff=cutoff, delay=0.0)
        other = replace(result, choice=replace(result.choice, chosen=chosen, held_out=held_out))
        fit = Explanation(other)
        return fit._fit(f"no delay, {cutoff:.3g} Hz", fit._columns, fit.evidence.names)

    def scale_between(self) -> dict[str, Estimate]:
        """Scale of each joint's torque against the first joint's, for those that share a body."""
        joints = self.result.joints
        return {f"{joint} / {joints[0]}": self._scale(k) for k, joint in enumerate(joints) if k}

    def scale_of_all(self) -> Estimate | None:
        """Scale of all rows by masses that are known to differ between the runs; None where none do."""
        known = np.concatenate([part.inside(part.low_passed(part.known))
                                for part in self.evidence.parts])  # fmt: skip
        if not np.any(known):
            return None
        base = self._columns[:, :, list(self._seen.pivots)]
        columns = np.concatenate([base, known[:, :, None]], axis=2)
        return self._fitted(columns, self._rows + known).estimate(np.eye(columns.shape[2])[-1])

    def document(self) -> dict[str, object]:
        """For the JSON document; first moments in kg m."""
        torques = bool(self.result.joints)
        whole = self.scale_of_all()
        return {
            "fits_by": "least squares at the chosen cut-off and delay",
            "rows_alone": [fit.document() for fit in self.rows_alone()],
            "friction": [fit.document() for fit in self.friction()] if torques else [],
            "friction_of_file": self.file_friction().document() if torques else None,
            "without_delay": [fit.document() for fit in self.without_delay()] if torques else [],
            "file_rms_ratio_below_cutoff": self.file_left(),
            "torque_scale_between_joints": {name: _estimate_document(s) for name, s in self.scale_between().items()},
            "scale_of_all": {
                "identifiable": whole is not None,
                "reason": SCALE_KNOWN if whole is not None else SCALE_UNKNOWN,
                **({} if whole is None else _estimate_document(whole)),
            },
        }

    @cached_property
    def _columns(self) -> Floats:
        return self.evidence.low_passed_columns(range(len(self.evidence.names)))

    @cached_property
    def _rows(self) -> Floats:
        return self.evidence.low_passed_torque(self.result.chosen.delay)

    @property
    def _seen(self) -> Identifiability:
        return self.result.identified.identifiability

    def _fitted(self, columns: Floats, rows: Floats, used: Floats | None = None) -> RegressionFit:
        blocks = self.evidence.blocks(1.0 / self.evidence.cutoff)
        everything = self.evidence.moving if used is None else used
        return fit([RegressionRecord.of(columns, rows, blocks, used=everything)])

    def _alone(self, row: int, name: str) -> Fit:
        return self._fit(name + " alone", self._columns[:, [row]], self.evidence.names, [row])

    def _fit(
        self,
        name: str,
        columns: Floats,
        names: Sequence[str],
        rows: Sequence[int] | None = None,
        known: Floats | float = 0.0,
    ) -> Fit:
        chosen = list(range(len(self.result.rows)) if rows is None else rows)
        moving, measured = self.evidence.moving[:, chosen], (self._rows - known)[:, chosen]
        seen = identifiability(columns * moving[:, :, None], names)
        base = columns[:, :, list(seen.pivots)]
        found = BaseParameters(seen, self._fitted(base, measured, moving))
        ratio = unexplained(self._rows[:, chosen], self._rows[:, chosen] - measured + base @ found.values, moving)
        return Fit(
            name,
            {text: self._estimate(found, row, names) for text, row in self.result.moment_rows()},
            {self.result.rows[k]: float(r) for k, r in zip(chosen, ratio, strict=True)},
        )

    def _estimate(self, found: BaseParameters, row: Mapping[str, float], names: Sequence[str]) -> Estimate | None:
        if not set(row) <= set(names):
            return None
        vector = found.identifiability.vector(row)
        return found.estimate(vector) if found.identifiability.is_identifiable(vector) else None

    def _by_direction(self) -> tuple[Floats, list[str]]:
        """A column for the square of the direction of each joint: dry friction that differs by direction, beside it."""
        names = list(self.evidence.names)
        places = [names.index(f"coulomb[{joint}]") for joint in self.result.joints]
        raw = [part.whole[:, :, places] ** 2 for part in self.evidence.parts]
        smooth = np.concatenate([p.inside(p.low_passed(r)) for p, r in zip(self.evidence.parts, raw, strict=True)])
        added = [f"uneven[{joint}]" for joint in self.result.joints]
        return np.concatenate([self._columns, smooth], axis=2), [*names, *added]

    def _scale(self, joint: int) -> Estimate:
        """Gauss-Newton on tau_k = s W_k pi: columns s W_k, and W_k pi for the change of s."""
        base = self._columns[:, :, list(self._seen.pivots)]
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
        change = found.estimate(np.eye(len(found.values))[-1])
        return replace(change, values=np.array([scale]))


def _estimate_document(found: Estimate) -> dict[str, object]:
    return {"value": found.value, "interval": list(found.interval())}
