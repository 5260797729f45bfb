"""Whether torques are those of the bodies that were identified from them: tests, each with its rate of false alarms.

All look at the equations tau = W pi at the chosen cut-off and delay. Each asks whether something that bodies do not do
explains the torques better, or as well, and alarms falsely in FALSE_ALARM of records whose noise is white, where what
varies freely is sought in FREE_ALARM:

* **A law of position and velocity** (a controller that holds up the weight, or a spring, while a hand moves the joint).
  tau_j = f(q, v) + s M_j(q) a with f free: s is one where bodies are accelerated and zero where a law makes the torque.
  In as many terms as a third of what the record has of independent readings, each record with an f of its own. s must
  lie nearer to one than to zero with a probability of error of FALSE_ALARM: that bounds the laws that pass for bodies.
* **A torque from outside** (a hand, an obstacle): one that varies freely in time, piecewise linear; a brief one: the
  best of its pieces alone, its chance multiplied by their number.
* **An encoder or a load that slips**: a deviation of each joint's angle that varies freely in time likewise; **an
  encoder of another scale**: one that is a share of the angle. All by Fisher's F, with 2 f T independent readings in T
  seconds below f.
* **The form of the friction**: at low speed, after the joint turned, with the square of the speed, by direction: of the
  ``FRICTION_LAWS`` the one that explains most, its chance multiplied by their number, then the next; as above.
* **The simulated motion.** What the torque lacks, driven through the joints' dynamics, makes the angles deviate. The
  intervals take what it lacks for independent from block to block; then the deviation has the mean square of the
  blocks' own deviations. Where what lacks adds up instead, the deviation is larger: by random signs of the blocks
  (a wild bootstrap) its probability, by the ratio of the squares the factor that the covariance is multiplied with.
* **The scale of each torque** where runs differ by masses that are known (``torque_scales.py``).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np

from balance.arrays import Floats
from balance.dynamics.regressor import FRICTION_LAWS
from balance.estimation.base_parameters import BaseParameters
from balance.estimation.estimate import LEVEL_TEXT, Estimate, f_tail, student_quantile
from balance.estimation.regression import RegressionRecord, fit
from balance.mechanism.mechanism import Mechanism
from balance.results import Key

from ..kinematics.smoothing_and_derivatives import ALMOST
from .estimators import Deviation, NotSimulated
from .records import Law
from .regression_equations import RecordEquations, RegressionEquations

if TYPE_CHECKING:
    from .torque_scales import TorqueScales

Cause = Literal["outside_torque", "brief_torque", "slip", "angle_scale", "friction"]
"""What a :class:`FreeTest` looks for."""
FALSE_ALARM = 1e-3
"""Probability with which a test doubts a record of white noise that has nothing of what the test looks for."""
FREE_ALARM = 5e-3
"""The same of a :class:`FreeTest`: a brief push or slip is seldom surer, and few honest records are lost by it."""
NEAREST_LAW = 0.5
"""Of the acceleration's share: halfway from a law of position and velocity, 0, to bodies, 1."""
LAW_TERMS = (6, 45)
"""Fewest and most terms of a law."""
LAW_SHARE = 3.0
"""Independent readings for each term of a law."""
KNOT_S, KNOT_PERIODS = 0.8, 2.0
"""Between points of what varies freely in time: at least so long, and so many periods of the cut-off."""
CAUSES: dict[Cause, tuple[float, str]] = {
    "outside_torque": (0.01, "a torque from outside, as of a hand or an obstacle,"),
    "brief_torque": (0.005, "a brief torque from outside, as of a hand or an obstacle,"),
    "slip": (0.01, "an angle that slips between encoder and body, or a base whose motion is not known,"),
    "angle_scale": (0.002, "an encoder that reads its angle by another scale, or a base whose motion is not known,"),
}
"""What is sought; and the part of the torques that smoothed positions may distort, along what varies freely, the one of
its columns that explains most, or the one of a scale: what explains less says nothing."""
ROUNDING = 1e-12
"""Part of the squares of the rows that is rounding: what is left of records without noise proves nothing."""
MOST_LAWS, LEAST_FRICTION = 2, 0.001
"""Of friction of a joint; part of its torque that smoothed speeds may distort where dry friction turns."""
SIZE_STEPS, LARGEST_STEP, BELOW_SIZES, LARGEST_SIZE = 8, 0.4, 0.6, 1.0
"""Of the logarithm of a law's size: how many, and the largest; its ends: in the least of FRICTION_LAWS; as a part."""
OVERSAMPLING = 8.0
"""Samples of low-passed equations kept for each period of the cut-off."""
WINDOW_S, WINDOW_BLOCKS = 1.0, 6
"""What is simulated from a recorded state, of the best: so long, and at least so many blocks of one period."""
DRAWS = 4000
"""Of signs of the blocks."""
JUMP = 6.0
"""Third difference of an encoder's readings, against that which one in twenty exceeds, or its step: normal noise and
steps stay below 4."""
STICTION = 2.0
"""Dry friction at rest, in that of the motion: more is not friction."""
REST_SIGMA = 4.0
"""Standard uncertainties, of what is unexplained in motion and of the parameters, which a torque at rest may exceed
that by."""
UNDETERMINED = 1e-6
"""Part of a row's columns outside those of the base parameters, from which the row says something else than these."""


@dataclass(frozen=True)
class Doubt:
    """A reason against a result."""

    code: Annotated[str, Key()]
    text: Annotated[str, Key()]


@dataclass(frozen=True)
class LawTest:
    """The acceleration's share of a joint's torque beyond any law of position and velocity."""

    joint: Annotated[str, Key()]
    share: Annotated[Estimate, Key("acceleration_share", to=lambda share: share.value)]

    @property
    def least(self) -> Annotated[float, Key("acceleration_share_at_least")]:
        """What the share exceeds but for FALSE_ALARM [-]."""
        return self.share.value - student_quantile(1.0 - FALSE_ALARM, self.share.degrees_of_freedom) * (
            self.share.standard_uncertainty
        )

    @property
    def doubts(self) -> list[Doubt]:
        """One where a law explains the torque as well as bodies do."""
        text = (
            f"the torque of {self.joint} is as well explained by a law of position and velocity alone, as of a "
            f"controller while something else moves the joint: beyond such a law the acceleration has "
            f"{self.share.value:.2f} of its share, at least {self.least:.2f}; expected more than {NEAREST_LAW:g}"
        )
        return [] if self.least > NEAREST_LAW else [Doubt("feedback_law", text)]


@dataclass(frozen=True)
class FreeTest:
    """Whether a torque from outside, an angle that slips, or one of another scale explains what bodies do not."""

    joint: Annotated[str, Key()]
    code: Annotated[Cause, Key()]
    share: Annotated[float, Key("explained_rms_ratio")]
    """What it explains beyond bodies, as a part of the rms of the joint's torque [-]."""
    probability: Annotated[float, Key()]
    """Of so much by noise alone."""

    law: Law | None = None
    """Of friction, which it found."""
    at_end: bool = False
    """Whether the size of the law is at an end of what is tried."""

    @property
    def doubts(self) -> list[Doubt]:
        """One where neither noise nor what smoothed positions leave of the torques may be it."""
        least, what = CAUSES[self.code]
        text = f"{what} explains {self.share:.1%} of its torque that bodies do not (by chance {self.probability:.1g})"
        code = "outside_torque" if self.code == "brief_torque" else self.code
        passed = self.probability >= FREE_ALARM or self.share < least
        return [] if passed else [Doubt(code, f"{self.joint}: {text}")]


@dataclass(frozen=True)
class MotionTest:
    """How far the simulated motion deviates, and how far it would by chance."""

    error: Annotated[float, Key("error_rms")]
    """Over segments and joints, from the best initial states [rad, m]."""
    expected: Annotated[float, Key("expected_rms")]
    """Were what the torques lack independent from block to block [rad, m]."""
    probability: Annotated[float, Key()]
    """Of so large an error by chance."""

    @property
    def factor(self) -> Annotated[float, Key("covariance_factor")]:
        """By which the motion demands a larger covariance than the blocks show, at least one [-]."""
        return max(1.0, (self.error / self.expected) ** 2) if self.expected > 0.0 else 1.0

    @property
    def doubts(self) -> list[Doubt]:
        """One where what the torques lack adds up."""
        text = (
            f"the simulated motion deviates by {self.error:.2g} rms, and would by {self.expected:.2g} if what the "
            "torques lack were independent from block to block: it adds up"
        )
        return [] if self.probability >= FALSE_ALARM else [Doubt("motion_not_followed", text)]


@dataclass(frozen=True)
class ModelTests:
    """The tests of base parameters that were found from equations, torques ``delay`` [s] late."""

    mechanism: Mechanism
    equations: RegressionEquations
    delay: float
    identified: BaseParameters

    @property
    def joints(self) -> tuple[str, ...]:
        """Driven joints whose torques count."""
        return self.mechanism.driven if self.equations.records[0].torque.shape[1] else ()

    @cached_property
    def laws(self) -> list[LawTest]:
        """Of each joint."""
        return [LawTest(joint, self._law(k)) for k, joint in enumerate(self.joints)]

    @cached_property
    def free(self) -> list[FreeTest]:
        """Four of each joint."""
        causes: tuple[Cause, ...] = ("outside_torque", "brief_torque", "slip", "angle_scale")
        return [self._free(joint, code) for joint in range(len(self.joints)) for code in causes]

    @cached_property
    def friction(self) -> list[FreeTest]:
        """Laws of friction beyond the equations', one of a kind, MOST_LAWS a joint; by chance FALSE_ALARM each."""
        found: list[FreeTest] = []
        laws: list[Law] = []
        for place, joint in enumerate(self.joints):
            sizes = {
                kind: [part * self._extent(joint, kind) for part in parts] for kind, parts in FRICTION_LAWS.items()
            }
            tried = [Law(joint, kind, size) for kind, own in sizes.items() for size in own or (1.0,)]
            columns = self._friction(tried)
            for _ in range(MOST_LAWS):
                test = self._explained(place, "friction", self._friction(_terms(laws)), columns, tried)
                if test.probability >= FALSE_ALARM or test.share < LEAST_FRICTION or test.law is None:
                    break
                sized = self._sized([*laws, test.law])
                if sized[-1].has_size and sized[-1].size == self._ends(sized[-1])[0]:
                    break  # so narrow is the turn of the sign, of which smoothed speeds tell nothing
                found, laws = [*found, test], sized
                other = [k for k, one in enumerate(tried) if one.kind != test.law.kind]
                columns, tried = columns[:, :, other], [tried[k] for k in other]
        ends = [law.has_size and law.size in self._ends(law) for law in laws]
        return [
            replace(test, law=law._replace(size=float(f"{law.size:.3g}")), at_end=end)
            for test, law, end in zip(found, laws, ends, strict=True)
        ]

    def _friction(self, laws: Sequence[Law]) -> Floats:
        """Low-passed columns of laws of friction, (n, joints, laws)."""

        def of(part: RecordEquations) -> Floats:
            return part.low_passed(np.stack([part.friction(law, part.motion) for law in laws], axis=2))

        joints = len(self.joints)
        return self.equations.joined(of)[:, :joints] if laws else self._base[:, :joints, :0]

    def _extent(self, joint: str, kind: str) -> float:
        """Top speed of a joint [rad/s, m/s], for hysteresis its travel [rad, m]."""
        k = self.mechanism.driven.index(joint)
        if kind == "hysteresis":
            return max(float(np.ptp(part.motion.q[:, k])) for part in self.equations.parts)
        return max(float(np.abs(part.motion.v[:, k]).max()) for part in self.equations.parts)

    def _ends(self, law: Law) -> tuple[float, float]:
        """Least and largest size of a law that is tried [rad/s, rad, m/s, m]."""
        extent = self._extent(law.joint, law.kind)
        return BELOW_SIZES * min(FRICTION_LAWS[law.kind]) * extent, LARGEST_SIZE * extent

    def _sized(self, laws: list[Law]) -> list[Law]:
        """With the sizes of least squares, by Gauss-Newton steps of all at once up to the ends of what is tried."""
        joints = len(self.joints)
        used = self.equations.moving[:, :joints]
        for _ in range(SIZE_STEPS if any(law.has_size for law in laws) else 0):
            terms = _terms(laws)
            columns = np.concatenate([self._base[:, :joints], self._friction(terms)], axis=2)
            values = self.equations.fitted(columns, self._rows[:, :joints], used).values[-len(terms) :]
            found = dict(zip(terms, values, strict=True))
            for k, law in enumerate(laws):
                if law.has_size:
                    step = float(np.clip(found[law.terms[1]] / found[law], -LARGEST_STEP, LARGEST_STEP))
                    laws[k] = law._replace(size=float(np.clip(law.size * np.exp(step), *self._ends(law))))
        return laws

    @cached_property
    def motion(self) -> MotionTest | None:
        """None where there are no torques, where no motion can be simulated, or records are too short."""
        if not self.joints:
            return None
        pairs = zip(self.equations.parts, self._models, strict=True)
        try:
            sums = [one for part, model in pairs for one in self._squares(part, model)]
        except NotSimulated:
            return None
        if not sums:
            return None
        products, samples = [one for one, _ in sums], sum(count for _, count in sums)
        rng, drawn = np.random.default_rng(0), np.zeros(DRAWS)
        for one in products:
            signs = rng.choice([-1.0, 1.0], (DRAWS, len(one)))
            drawn += np.einsum("di,ij,dj->d", signs, one, signs)
        error = sum(float(one.sum()) for one in products)
        expected = sum(float(np.trace(one)) for one in products)
        root = np.sqrt(np.maximum([error, expected], 0.0) / samples)
        return MotionTest(float(root[0]), float(root[1]), float(np.mean(drawn >= error)))

    @cached_property
    def scales(self) -> "TorqueScales":
        """Of each torque, and of all forces, by masses that are known to differ between the runs."""
        from .torque_scales import TorqueScales

        forces = ("forces",) if self._rows.shape[1] > len(self.joints) else ()
        return TorqueScales(self.equations, (*self.joints, *forces), self._base, self._rows, self._known)

    @property
    def scale(self) -> Estimate | None:
        """Scale of all rows by masses known to differ between the runs; None where none do, or scales differ."""
        return self.scales.common

    @cached_property
    def negative_inertia(self) -> list[str]:
        """Joints whose own inertia, as their torques show it, is negative."""
        if not self.joints:
            return []
        own = np.concatenate([np.einsum("njj->nj", model.inertia) for model in self._models])
        return [joint for joint, one in zip(self.joints, np.median(own, axis=0), strict=True) if one < 0.0]

    @cached_property
    def jumps(self) -> dict[str, float]:
        """Instants at which positions jump as no motion does, by joint, on their record's clock [s]."""
        found: dict[str, float] = {}
        for record in self.equations.records:
            third = np.abs(np.diff(record.q, 3, axis=0))
            third *= record.valid(0.0)[: len(third)] * record.valid(0.0)[3:]
            for joint, values, positions in zip(self.mechanism.driven, third.T, record.q.T, strict=True):
                steps = np.diff(np.unique(positions))
                usual = max(float(np.percentile(values, 95.0)), float(steps[steps > 1e-9].min(initial=np.inf)))
                worst = int(np.argmax(values))
                if values[worst] > JUMP * usual:
                    found.setdefault(joint, float(record.grid.time[worst + 1]))
        return found

    @cached_property
    def stalls(self) -> dict[str, tuple[float, float]]:
        """Seconds at rest under a torque that neither weight nor friction explains, and its rms, by joint."""
        found = {}
        friction = np.array([name.startswith("coulomb[") for name in self.equations.names])
        for k, joint in enumerate(self.joints):
            at = self.equations.names.index(f"coulomb[{joint}]")
            dry = 0.0
            if at in self.identified.identifiability.pivots:
                one = self.identified.estimate(np.eye(len(friction))[at])
                dry = max(one.value + one.half_width(), 0.0)
            columns = self.equations.low_passed_columns(np.flatnonzero(~friction).tolist())
            left = self._rows[:, k] - columns[:, k] @ self._full[~friction]
            known = self._torque_uncertainty(k)
            moving = self.equations.moving[:, k] > 0.0
            resting = (self.equations.valid[:, 0] > 0.0) & ~moving
            noise = np.sqrt(np.mean(self._residual[moving, k] ** 2)) if moving.any() else 0.0
            stalled = resting & (np.abs(left) > STICTION * dry + REST_SIGMA * np.hypot(noise, known))
            seconds = float(stalled.sum()) * self.equations.records[0].grid.step
            if seconds > 1.0 / self.equations.cutoff:
                found[joint] = seconds, float(np.sqrt(np.mean(left[stalled] ** 2)))
        return found

    @property
    def doubts(self) -> list[Doubt]:
        """Of all tests."""
        found = [*self._doubts_of_scale, *(doubt for law in self.laws for doubt in law.doubts)]
        free = [(test.joint, doubt) for test in self.free for doubt in test.doubts]
        found += {(joint, doubt.code): doubt for joint, doubt in reversed(free)}.values()  # the first of a kind
        bodies = {law.joint: law.share.value > NEAREST_LAW for law in self.laws}
        for joint in self.negative_inertia:
            text = f"{joint}: the torque shows a negative inertia"
            turned = Doubt("torque_sign", f"{text}, as it does where its sign is reversed: check the sign in the rig")
            found.append(turned if bodies[joint] else Doubt("negative_inertia", text))
        for joint, at in self.jumps.items():
            found.append(Doubt("encoder_jump", f"{joint}: the position jumps at {at:.4g} s as no motion does"))
        for joint, (seconds, torque) in self.stalls.items():
            load = f"{torque:.3g} {self.mechanism.drive_unit(joint)}"
            found.append(Doubt("stall", f"{joint} rests for {seconds:.2g} s under {load} not of weight or friction"))
        if self.motion is not None:
            found += self.motion.doubts
        elif self.joints and not self.negative_inertia:
            found.append(Doubt("no_motion", "no motion can be simulated with what the torques show"))
        return found

    def _torque_uncertainty(self, joint: int) -> Floats:
        """Standard uncertainty of the torque that the parameters make, (n,) [N m, N]; infinite: not determined.

        A record tells the weight where the joint moves; where it rests may be far from there.
        """
        seen, base = self.identified.identifiability, self._base[:, joint]
        whole = self.equations.low_passed_columns(range(len(seen.names)))[:, joint]
        outside = np.abs(whole - base @ seen.combinations).max(axis=1)
        uncertain = np.sqrt(np.maximum(np.einsum("nr,rs,ns->n", base, self.identified.covariance, base), 0.0))
        return np.where(outside > UNDETERMINED * np.abs(whole).max(axis=1), np.inf, uncertain)

    @property
    def _doubts_of_scale(self) -> list[Doubt]:
        """Torques that disagree with masses that are known."""
        found, each = [], self.scales.each
        sensors = dict(zip(self.joints, self.equations.records[0].sensors, strict=False))
        equal = {"": [*each]} if self.scale is not None else {name: [name] for name in each}
        for which, names in equal.items():
            one = each[names[0]]
            low, high = one.interval(1.0 - FALSE_ALARM)
            if low <= 1.0 <= high:
                continue
            inner = "{:.4f} .. {:.4f}".format(*one.interval())
            what = f"the torque of {which} reads" if which in self.joints else f"the {which or 'torques'} read"
            should = "it should" if which in self.joints else "they should"
            orders = ", ".join(
                f'testbench calibrate CAMPAIGN {sensors.get(name, "SENSOR")} --sensitivity "{one.value:.4g} '
                f'{self._sensitivity_unit(name)}" --uncertainty "{100.0 * one.half_width() / one.value:.2g} %" '
                "--coverage-factor 2 --reason ..."
                for name in (names if all(name in sensors for name in names) else names[:1])
            )
            text = (
                f"by masses known to differ between the runs {what} {one.value:.4f} times what {should} "
                f"({LEVEL_TEXT}: {inner}), or the run table's masses are wrong, or the base moves, of which the rig "
                "says nothing (state [bench]); where masses are right and the base rests, correct the sensor: "
                f"{orders}, or what the rig has as sensitivity times that number; until then the values "
                "are of the torques as they read, and their intervals reach to those of torques divided by it"
            )
            found.append(Doubt("torque_scale", text))
        return found

    def _sensitivity_unit(self, name: str) -> str:
        """Of a sensor that reads what it measures."""
        return "N/N" if name in self.joints and self.mechanism.drive_unit(name) == "N" else "N m/(N m)"

    @property
    def _each(self) -> Iterator[tuple[RecordEquations, Deviation, slice]]:
        """Records, their models, and their places among the equations."""
        return zip(self.equations.parts, self._models, self.equations.places, strict=True)

    def _law(self, joint: int) -> Estimate:
        """Least squares of the share with the terms of a law as nuisances of each record."""
        blocks, records = self.equations.blocks(1.0 / self.equations.cutoff), []
        for part, model, own in self._each:
            used = part.inside(part.moving)[:, [joint]]
            readings = 2.0 * self.equations.cutoff * float(used.sum()) * model.step
            count = int(np.clip(readings / LAW_SHARE, *LAW_TERMS))
            accelerated = np.einsum("nk,nk->n", model.inertia[:, joint], part.motion.a)
            columns = np.column_stack([accelerated, law_terms(part.motion.q, part.motion.v, joint)[:, :count]])
            smooth = part.inside(part.low_passed(columns))[:, None]
            rows = part.inside(part.delayed(part.smooth[0], self.delay))[:, [joint]]
            terms = _directions(smooth[:, 0, 1:] * used)[:, None] * np.sqrt(len(used))
            law = RegressionRecord.of(smooth[:, :, :1], rows, blocks[own], terms, used, rows=("torque",))
            records.append(law)
        return fit(records, conditions=0).estimate(np.ones(1))

    def _free(self, joint: int, code: Cause) -> FreeTest:
        """By columns of a torque, or an angle, of a joint that varies in time.

        Or by the column of an angle that is read a share too large; the encoder's zero is a nuisance parameter: a
        weight's sine has its period in true angles, and a second joint turns by them, no bodies make up for that.
        """
        joints, nuisances, added = len(self.joints), [], []
        for part, model, own in self._each:
            slip = model.stiffness[:, :, joint]
            if code == "angle_scale":
                slopes = (one[:, :, joint] for one in (model.stiffness, model.damping, model.inertia))
                path = (one[:, joint, None] for one in (part.motion.q, part.motion.v, part.motion.a))
                read = sum(slope * along for slope, along in zip(slopes, path, strict=True))
                both = part.inside(part.low_passed(np.stack([slip, read], axis=2)))
                nuisances.append(both[:, :, :1])
                added.append(both[:, :, 1:])
                continue
            count = part.record.grid.count
            points = max(3, int(count * model.step / max(KNOT_S, KNOT_PERIODS / self.equations.cutoff)))
            away = np.abs(np.linspace(0.0, points - 1.0, count)[:, None] - np.arange(points))
            column = slip if code == "slip" else np.tile(np.eye(joints)[joint], (count, 1))
            alone = np.zeros((len(self._rows), joints, points))
            alone[own] = part.inside(part.low_passed(column[:, :, None] * np.maximum(1.0 - away, 0.0)[:, None]))
            added.append(alone)
        if nuisances:
            return self._explained(joint, code, np.concatenate(nuisances), np.concatenate(added))
        return self._explained(joint, code, self._base[:, :joints, :0], np.concatenate(added, axis=2))

    def _explained(
        self, joint: int, code: Cause, nuisance: Floats, added: Floats, laws: Sequence[Law | None] = (None,)
    ) -> FreeTest:
        """By the squares that ``added`` columns take off what bodies and ``nuisance`` columns leave, (n, joints, k).

        A brief torque, and one of the ``laws`` of friction, is the one column that takes off most: its chance is that
        of any of them.
        """
        joints, cutoff = len(self.joints), self.equations.cutoff
        used = self.equations.moving[:, :joints]
        weights = used / np.sqrt(np.maximum(np.mean(self._residual[:, :joints] ** 2, axis=0), np.finfo(float).tiny))
        keep = max(1, int(self.equations.records[0].grid.rate / ALMOST / (OVERSAMPLING * cutoff)))

        def stacked(values: Floats) -> Floats:
            return np.asarray((values[:, :joints] * weights[:, :, None])[::keep].reshape(-1, values.shape[2]))

        scaled = self.scales.columns[:, :joints]  # a wrong scale has its own test
        columns = stacked(np.concatenate([self._base[:, :joints], scaled, nuisance], axis=2))
        rows = stacked(self._rows[:, :, None])[:, 0]
        before, terms = _left(columns, rows)
        tried, best, free = 1, 0, stacked(added)
        if code in ("brief_torque", "friction"):
            tried, best = free.shape[1], _best(columns, rows, free)
            free = free[:, [best]]
        after, more = _left(np.hstack([columns, free]), rows)
        freedom = 2.0 * cutoff * float(used.sum()) * self.equations.records[0].grid.step - more
        own = float(np.sum((self._rows[:, joint] * weights[:, joint])[::keep] ** 2))
        share = float(np.sqrt(max(before - after, 0.0) / max(own, np.finfo(float).tiny)))
        by_chance = 1.0
        if freedom >= 1.0 and more > terms:
            by_chance = f_tail((before - after) / (more - terms) / (after / freedom), more - terms, freedom)
        law = laws[best] if code == "friction" else None
        return FreeTest(self.joints[joint], code, share, min(tried * by_chance, 1.0), law)

    def _squares(self, part: RecordEquations, model: Deviation) -> list[tuple[Floats, int]]:
        """Of each segment of a record, products of the blocks' deviations (blocks, blocks), and samples."""
        model.refuse_negative_inertia()
        block = max(1, round(1.0 / self.equations.cutoff / model.step))
        edge, joints = part.record.edge, len(self.joints)
        inside = part.record.grid.count - 2 * edge
        blocks = min(max(WINDOW_BLOCKS, round(WINDOW_S * self.equations.cutoff)), inside // block)
        left = (part.measured(self.delay) - part.whole @ self._full)[:, :joints]
        found: list[tuple[Floats, int]] = []
        for begin in range(edge, edge + inside - blocks * block + 1, max(blocks * block, 1)):
            window = slice(begin, begin + blocks * block)
            if blocks < 2 or not part.valid[window].all():
                continue
            load = np.zeros((blocks * block, joints, blocks))
            for k in range(blocks):
                load[k * block : (k + 1) * block, :, k] = left[window][k * block : (k + 1) * block]
            made, free = model.segment(window).from_any_state(load)
            base = np.linalg.qr(free.reshape(-1, 2 * joints))[0]
            away = made.reshape(-1, blocks)
            away = away - base @ (base.T @ away)
            found.append((away.T @ away, len(away)))
        return found

    @cached_property
    def _full(self) -> Floats:
        """Parameters (p,) that make the same rows as the base parameters."""
        return self.identified.identifiability.over_all(self.identified.values)

    @cached_property
    def _models(self) -> list[Deviation]:
        """Of each record, about the identified parameters; none where there are no torques."""
        parts = self.equations.parts if self.joints else ()
        return [Deviation.of(part, self.mechanism, self._full) for part in parts]

    @cached_property
    def _base(self) -> Floats:
        return self.equations.low_passed_columns(self.identified.identifiability.pivots)

    @cached_property
    def _rows(self) -> Floats:
        return self.equations.low_passed_torque(self.delay)

    @cached_property
    def _known(self) -> Floats:
        return self.equations.joined(lambda part: part.smooth[1])

    @cached_property
    def _residual(self) -> Floats:
        return np.asarray((self._rows - self._base @ self.identified.values) * self.equations.moving)


def law_terms(q: Floats, v: Floats, joint: int) -> Floats:
    """Terms of a law of positions and velocities (n, joints) [rad, rad/s, m, m/s] for a joint, simplest first, (n, k).

    Products of powers of its own angle and speed, counted from the middle of their range, weights, dry and quadratic
    friction; of other joints' the first and second powers and products with its own.
    """
    x = (q - 0.5 * (q.max(axis=0) + q.min(axis=0))) / np.maximum(0.5 * np.ptp(q, axis=0), 1e-9)
    w = v / np.maximum(np.abs(v).max(axis=0), 1e-9)
    own, speed = x[:, joint], w[:, joint]
    terms = [(float(i + k), own**i * speed**k) for i in range(9) for k in range(min(5, 9 - i))]
    sine, cosine = np.sin(q[:, joint]), np.cos(q[:, joint])
    terms += [(0.5, sine), (0.5, cosine), (1.5, np.sign(speed)), (2.5, sine * speed), (2.5, cosine * speed)]
    terms += [(3.5, np.abs(speed) * speed)]
    for other in set(range(q.shape[1])) - {joint}:
        angle, rate, both = x[:, other], w[:, other], q[:, joint] + q[:, other]
        terms += [(0.6, np.sin(both)), (0.6, np.cos(both)), (1.4, angle), (1.4, rate)]
        terms += [(2.4, np.sin(q[:, other])), (2.4, np.cos(q[:, other])), (2.4, angle**2), (2.4, rate**2)]
        terms += [(2.4, one * two) for one in (angle, rate) for two in (own, speed)]
    return np.stack([values for _, values in sorted(terms, key=lambda term: term[0])], axis=1)


def _terms(laws: Sequence[Law]) -> list[Law]:
    return [term for law in laws for term in law.terms]


def _directions(columns: Floats) -> Floats:
    """Orthonormal ones of columns (n, k), as many as count, (n, rank)."""
    lengths = np.linalg.norm(columns, axis=0)
    present = lengths > 1e-9 * lengths.max(initial=0.0)
    orthonormal, triangle = np.linalg.qr(columns[:, present] / lengths[present])
    turned, sizes, _ = np.linalg.svd(triangle)
    return np.asarray(orthonormal @ turned[:, : len(sizes)][:, sizes > 1e-6 * sizes.max(initial=0.0)])


def _left(columns: Floats, rows: Floats) -> tuple[float, int]:
    """Sum of squares that columns (n, k) leave of rows (n,), and how many of them count."""
    kept = _directions(columns)
    whole = float(rows @ rows)
    return max(whole - float(np.sum((kept.T @ rows) ** 2)), ROUNDING * whole, np.finfo(float).tiny), kept.shape[1]


def _best(columns: Floats, rows: Floats, added: Floats) -> int:
    """The one of the ``added`` columns (n, k) that takes most squares off what ``columns`` leave of rows (n,)."""
    directions = np.linalg.qr(columns)[0]
    left, own = (one - directions @ (directions.T @ one) for one in (rows, added))
    lengths = np.linalg.norm(own, axis=0)
    clear = lengths > 1e-4 * np.linalg.norm(added, axis=0).max()
    return int(np.argmax(np.where(clear, np.abs(own.T @ left) / np.maximum(lengths, np.finfo(float).tiny), 0.0)))
