"""How surely the amplitudes of one place of a condition are known: noise, what repeats differ by, calibration.

Noise and scatter are of each side, with and without counter-masses. The error of the sensor's sensitivity is one from a
calibration to the next (JCGM 100:2008, 5.2.2): in an amplitude it is once, however many runs there are; in a reduction
it cancels where both sides have the same calibration, and is twice where the sensor was calibrated anew in between.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np

from balance.arrays import Floats
from balance.estimation.estimate import coverage_factor, effective_degrees_of_freedom
from balance.estimation.uncertainty_budget import Budget, Contribution

from ..runs.si_run import SensitivityUncertainty, SIRun
from .amplitude import Place
from .condition import ConditionAmplitude, pooled_degrees_of_freedom
from .ratio_interval import Ratio, feldman_cousins_acceptance, normal_deviates
from .run_pairs import Pair

if TYPE_CHECKING:
    from ..store import Run

Interval = tuple[float, float]
SIDES = ("with", "without")
"""Keys of a pair of numbers."""


@dataclass(frozen=True)
class SideCalibration:
    """The calibrations of one sensor and axis over the runs of one side, each with its share of the mean."""

    shares: tuple[tuple[SensitivityUncertainty, float], ...]

    @classmethod
    def of(cls, runs: "Sequence[Run]", place: Place) -> "SideCalibration":
        """From all runs of a side; those of one calibration share its error."""
        found: list[tuple[SensitivityUncertainty, float]] = []
        for run in runs:
            si = SIRun.of(run)
            (column,) = (c for c in si.rig.base_columns if (c.sensor, c.component) == place)
            stated = si.sensitivity_uncertainty(column)
            if stated is None:
                continue
            before = next((i for i, (one, _) in enumerate(found) if one.calibration == stated.calibration), None)
            if before is None:
                found.append((stated, 1.0 / len(runs)))
            else:
                found[before] = stated, found[before][1] + 1.0 / len(runs)
        return cls(tuple(found))

    def share_of(self, calibration: object) -> float:
        """Of the runs that have a calibration [-]."""
        return sum(share for one, share in self.shares if one.calibration == calibration)


@dataclass(frozen=True)
class AmplitudesUncertainty:
    """Of the amplitudes with and without counter-masses, and of what follows from both."""

    sides: tuple[ConditionAmplitude, ConditionAmplitude]
    calibrations: tuple[SideCalibration, SideCalibration]

    @classmethod
    def of(
        cls, sides: tuple[ConditionAmplitude, ConditionAmplitude], pair: Pair, place: Place
    ) -> "AmplitudesUncertainty":
        """With the calibrations in force for the runs of each side."""
        return cls(sides, (SideCalibration.of(pair.balanced, place), SideCalibration.of(pair.unbalanced, place)))

    def amplitude_interval(self, side: Literal[0, 1]) -> Interval | None:
        """Of an amplitude, 95 % [m/s2]: noise and scatter as the readings allow, calibration in quadrature.

        None where the sensor reached the end of its range.
        """
        one, freedom = self.sides[side], self.amplitude_budget(side).degrees_of_freedom
        if one.saturated:
            return None
        low, high = accepted_amplitudes(one)
        wider = coverage_factor(freedom) / coverage_factor(one.degrees_of_freedom)
        relative = np.sqrt(sum((share * stated.relative) ** 2 for stated, share in self.calibrations[side].shares))
        sure = coverage_factor(freedom) * one.amplitude * relative
        below, above = (float(np.hypot(wider * abs(one.amplitude - end), sure)) for end in (low, high))
        return max(one.amplitude - below, 0.0), one.amplitude + above

    def with_one_more(self, side: Literal[0, 1]) -> float:
        """Width of the reduction's interval with one more run on a side like those there are, relative to what it is.

        The variance of a side falls with the number of its runs. One where the reduction is not defined.
        """
        one, other = self.sides[side], self.sides[1 - side]
        count = max(len(one.runs), len(one.group.names))
        surer = _Surer(one.group, one.repeats, scale=float(np.sqrt(count / (count + 1.0))))
        now = Ratio(*self.sides).interval
        after = (Ratio(surer, other) if side == 0 else Ratio(other, surer)).interval
        return 1.0 if now is None or after is None or np.isinf(now[1]) else (after[1] - after[0]) / (now[1] - now[0])

    def amplitude_budget(self, side: Literal[0, 1]) -> Budget:
        """Of an amplitude [m/s2]."""
        one = self.sides[side]
        parts = [*self._scatter(side, 1.0), *(
            Contribution(f"sensitivity of the sensor ({stated.source})", "B", 100.0 * stated.relative, "%",
                         share * one.amplitude / 100.0, "normal", stated.degrees_of_freedom)
            for stated, share in self.calibrations[side].shares
        )]  # fmt: skip
        return Budget(f"amplitude {SIDES[side]}", one.amplitude, "m/s2", tuple(parts), self._freedom(parts, (side,)))

    def reduction_budget(self) -> Budget:
        """Of the reduction [%] of an amplitude above the noise."""
        balanced, unbalanced = (side.amplitude for side in self.sides)
        ratio = balanced / unbalanced
        parts = [*self._scatter(0, -100.0 / unbalanced), *self._scatter(1, 100.0 * ratio / unbalanced)]
        parts += [
            Contribution(f"sensitivity of the sensor ({stated.source})", "B", 100.0 * stated.relative, "%",
                         ratio * share, "normal", stated.degrees_of_freedom)
            for stated, share in self._left_by_ratio()
        ]  # fmt: skip
        return Budget("reduction", 100.0 * (1.0 - ratio), "%", tuple(parts), self._freedom(parts, (0, 1)))

    @property
    def budgets(self) -> tuple[Budget, ...]:
        """Of the reduction and of both amplitudes, as far as they are above the noise: within it nothing is linear."""
        above = [bool((found := self.amplitude_interval(side)) and found[0] > 0.0) for side in (0, 1)]
        amplitudes = tuple(self.amplitude_budget(side) for side in (0, 1) if above[side])
        return (self.reduction_budget(), *amplitudes) if all(above) else amplitudes

    def with_calibration(self, interval: Interval, percent: float) -> Interval:
        """An interval of the reduction [%], with what calibrations that differ between the sides add to it."""
        left = sum((share * stated.relative) ** 2 for stated, share in self._left_by_ratio())
        more = coverage_factor() * (100.0 - percent) * float(np.sqrt(left))
        low, high = interval
        return percent - float(np.hypot(percent - low, more)), min(
            percent + float(np.hypot(high - percent, more)), 100.0
        )

    def _left_by_ratio(self) -> list[tuple[SensitivityUncertainty, float]]:
        """Calibrations whose error a ratio of both sides keeps, each with the share that is kept."""
        balanced, unbalanced = self.calibrations
        each = list(balanced.shares)
        each += [one for one in unbalanced.shares if not balanced.share_of(one[0].calibration)]
        kept = [(s, balanced.share_of(s.calibration) - unbalanced.share_of(s.calibration)) for s, _ in each]
        return [(stated, share) for stated, share in kept if abs(share) > 1e-9]

    def _scatter(self, side: Literal[0, 1], sensitivity: float) -> list[Contribution]:
        """Noise of a side's runs, and what its repeats differ by beyond it."""
        one, where = self.sides[side], SIDES[side]
        noise, whole = standard_uncertainty(ConditionAmplitude(one.group)), standard_uncertainty(one)
        if whole <= noise:  # repeats calmer than the noise, which they show alone
            known = bool(np.isinf(one.degrees_of_freedom))
            return [Contribution(f"noise of the runs {where}", "A", whole, "m/s2", sensitivity,
                                 "normal" if known else "t", one.degrees_of_freedom)]  # fmt: skip
        beyond = float(np.sqrt(whole**2 - noise**2))
        return [
            Contribution(f"noise of the runs {where}", "A", noise, "m/s2", sensitivity, "normal"),
            Contribution(f"repeatability of the runs {where}", "A", beyond, "m/s2", sensitivity, "t",
                         one.degrees_of_freedom),
        ]  # fmt: skip

    def _freedom(self, parts: Sequence[Contribution], among: Sequence[Literal[0, 1]]) -> float:
        """Degrees of freedom of the combined uncertainty; scatter that is pooled over the campaign counts once."""
        sides = [self.sides[side] for side in among]
        sure = [part for part in parts if part.evaluation == "B"]
        scatter = [
            sum(part.size**2 for part in parts if part.evaluation == "A" and part.source.endswith(f" {SIDES[side]}"))
            for side in among
        ]
        whole = max(sum(scatter), 1e-300)
        pooled = pooled_degrees_of_freedom(sides, [one / whole for one in scatter])
        variances = np.array([whole, *(part.size**2 for part in sure)])
        return effective_degrees_of_freedom(variances, np.array([pooled, *(part.degrees_of_freedom for part in sure)]))


@dataclass(frozen=True)
class _Surer(ConditionAmplitude):
    """A side whose standard deviation is scaled."""

    scale: float = 1.0

    @cached_property
    def _error(self) -> float:
        return self.scale * super()._error


def accepted_amplitudes(side: ConditionAmplitude) -> Interval:
    """Amplitudes that the mean reading does not contradict, 95 % [unit]: Feldman and Cousins', as for a ratio."""
    grid = side.amplitudes
    score = normal_deviates(side.deviation(grid), side.degrees_of_freedom)
    lowest, highest = feldman_cousins_acceptance(side.distance(grid))
    inside = np.flatnonzero((lowest <= score) & (score <= highest))
    if not inside.size:
        return side.amplitude, side.amplitude
    return _crossing(grid, highest - score, inside[0], -1), _crossing(grid, score - lowest, inside[-1], 1)


def _crossing(grid: Floats, excess: Floats, last: int, step: int) -> float:
    """Where an excess (k,) passes zero next to the last point of the grid (k,) at which it is positive."""
    beyond = last + step
    if not 0 <= beyond < len(grid):
        return float(grid[last])
    return float(np.interp(0.0, excess[[beyond, last]], grid[[beyond, last]]))


def standard_uncertainty(side: ConditionAmplitude) -> float:
    """Of an amplitude, as its readings scatter [unit]: half of what they allow at 95 %, over the coverage factor.

    Of normally distributed readings their standard deviation; of others what gives their interval.
    """
    grid, factor = side.amplitudes, coverage_factor(side.degrees_of_freedom)
    falling = np.minimum.accumulate(side.deviation(grid))
    low, high = np.interp([-factor, factor], -falling, grid)
    return float(0.5 * (high - low)) / factor
