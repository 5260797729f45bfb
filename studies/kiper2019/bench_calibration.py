"""The simulated bench's quantities, given the printed reductions of the lightest payload: the likeliest values.

Residuals are reductions less printed ones over their scatter, and each quantity's distance from its prior's median in
standard deviations: the sum of squares is least at the likeliest values. It has many minima, so the bench linearised is
fitted from several starts first. The best is then fitted on the simulator itself: each step is one of the linear
bench, moved and tilted so that it agrees with what was simulated before (manifold mapping: Echeverria, Hemker 2008,
Manifold mapping: a two-level optimization technique, Comput. Vis. Sci. 11; the tilt by Broyden's update).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats
from balance.cli.printing import emit_table
from balance.units import G0
from testbench.campaign_plan import Plan, PlannedRun
from testbench.errors import AnalysisError, RigError
from testbench.published_tables import Published

from .bench_model import AXES, LinearBench, Priors, rig_of, simulated_reductions

STARTS = 6
STEPS = 10
"""Steps on the simulator."""
RATE_HZ = 2500.0
"""Of the simulation meanwhile: it moves no reduction by more than its scatter by far."""
_NEAR = 0.6
"""How far a first step on the simulator reaches, in standard deviations of each prior."""
_SEED = 1
_WORST = 60.0
"""Largest residual that counts, in scatters: a mode without damping may have any."""
Pair = tuple[PlannedRun, PlannedRun]


@dataclass(frozen=True)
class Calibrated:
    """The likeliest values of the bench's quantities."""

    deviations: Floats
    """From the medians of the priors [standard deviations], (k,)."""
    reductions: Floats
    """Simulated with them, (conditions, 3) [%]."""
    printed: Floats
    """(conditions, 3) [%]"""
    cost: float
    """Half the sum of squared residuals."""

    @property
    def mean_error(self) -> float:
        """Mean absolute error [percentage points]."""
        return float(np.abs(self.reductions - self.printed).mean())


def conditions(published: Published, plan: Plan, lightest: bool) -> tuple[list[Pair], Floats]:
    """Pairs of planned runs, with and without counter-masses, and their printed reductions (n, 3) [%].

    Of the lightest payload, or of all others. Raises AnalysisError where the plan has none of the table's.
    """
    runs = [run for run in plan.runs() if run.repeat == 1 and run.payload is not None and run.peak_acceleration]
    least, pairs, printed = min((run.payload for run in runs if run.payload), default=0.0), [], []
    bare = {(r.payload, r.motion, r.peak_acceleration): r for r in runs if not r.counter_masses}
    for run in runs:
        key = run.payload, run.motion, run.peak_acceleration
        assert run.payload is not None
        assert run.peak_acceleration is not None
        if not run.counter_masses or key not in bare or (run.payload == least) is not lightest:
            continue
        values = [published.reduction(run.payload, run.motion, run.peak_acceleration / G0, axis) for axis in AXES]
        if None not in values:
            pairs.append((run, bare[key]))
            printed.append(values)
    if not pairs:
        raise AnalysisError(
            f"{published.name}: the plan has none of its conditions: give the plan of these tests, --plan FILE"
        )
    return pairs, np.array(printed, dtype=float)


def calibrate(priors: Priors, pairs: Sequence[Pair], printed: Floats, starts: int = STARTS) -> Calibrated:
    """The likeliest values for printed reductions (n, 3) [%] of pairs of runs."""
    linear, rng = LinearBench(pairs), np.random.default_rng(_SEED)
    known = _Known(priors, pairs, printed, linear)
    begun = [np.zeros(len(priors.quantities)), *0.7 * rng.normal(size=(starts - 1, len(priors.quantities)))]
    best, _ = min((known.fitted(start) for start in begun), key=lambda end: end[1])
    return known.followed(best)


@dataclass(frozen=True)
class _Known:
    priors: Priors
    pairs: Sequence[Pair]
    printed: Floats
    linear: LinearBench

    def fitted(
        self, start: Floats, moved: Floats | float = 0.0, tilt: Floats | None = None, near: float = np.inf
    ) -> tuple[Floats, float]:
        """Deviations that fit the linear bench best, and half their sum of squares.

        Its reductions are ``moved`` (n, 3) [%], and by ``tilt`` (3 n, k) per deviation from ``start``, from which each
        step of ``near`` standard deviations costs as much as one from the median.
        """
        from scipy.optimize import least_squares

        def residuals(at: Floats) -> Floats:
            errors = (self.linear.reductions(self.priors.values(at)) + moved - self.printed).ravel()
            if tilt is not None:
                errors = errors + tilt @ (at - start)
            fit = np.clip(np.nan_to_num(errors / self.priors.scatter, nan=_WORST), -_WORST, _WORST)
            return np.concatenate([fit, at, (at - start) / near])

        reach = self.priors.reach
        within = np.clip(start, -reach + 0.01, reach - 0.01)
        found = least_squares(residuals, within, bounds=(-reach, reach), diff_step=[1e-3] * len(within), max_nfev=40)
        return found.x, float(found.cost)

    def followed(self, start: Floats) -> Calibrated:
        """The fit on the simulator from ``start``."""
        best, near = self._simulated(start), _NEAR
        tilt = np.zeros((self.printed.size, len(start)))
        for _ in range(STEPS):
            at = best.deviations
            moved = best.reductions - self._linear(at)
            try:
                trial = self._simulated(self.fitted(at, moved, tilt, near)[0])
            except RigError:  # a bench so soft that its motion is not found is no better one
                near *= 0.4
                continue
            step = trial.deviations - at
            seen = (trial.reductions - self._linear(trial.deviations) - moved).ravel()
            tilt += np.outer(seen - tilt @ step, step) / max(float(step @ step), 1e-12)
            near = 2.0 * near if trial.cost < best.cost else 0.4 * near
            best = min(best, trial, key=lambda one: one.cost)
        return best

    def _linear(self, at: Floats) -> Floats:
        return self.linear.reductions(self.priors.values(at))

    def _simulated(self, at: Floats) -> Calibrated:
        found = simulated_reductions(rig_of(self.priors.values(at)), self.pairs, RATE_HZ)
        errors = np.clip((found - self.printed) / self.priors.scatter, -_WORST, _WORST)
        return Calibrated(at, found, self.printed, float((errors**2).sum() + (at**2).sum()) / 2.0)


@dataclass(frozen=True)
class BenchForecast:
    """A calibrated bench, and what it gives for all other payloads."""

    priors: Priors
    known: Calibrated
    known_pairs: Sequence[Pair]
    asked_pairs: Sequence[Pair]
    asked: Floats
    """Simulated, (conditions, 3) [%]."""
    printed: Floats
    """(conditions, 3) [%]"""

    @property
    def values(self) -> dict[str, float]:
        """Of the bench's quantities, in SI."""
        return self.priors.values(self.known.deviations)

    @property
    def held_out(self) -> float:
        """Mean absolute error on all other payloads [percentage points]."""
        return float(np.abs(self.asked - self.printed).mean())

    def groups(self) -> list[tuple[str, str, str, int, float, float]]:
        """Payload, motion, axis, count, mean absolute and mean error [percentage points] of each group of cells."""
        found: dict[tuple[str, str, str], list[float]] = {}
        cells = (
            (self.known_pairs, self.known.reductions - self.known.printed),
            (self.asked_pairs, self.asked - self.printed),
        )
        for pairs, errors in cells:
            for (run, _), row in zip(pairs, errors, strict=True):
                for axis, error in zip(AXES, row, strict=True):
                    found.setdefault((f"{run.payload:g}", run.motion, axis), []).append(float(error))
        return [(*key, len(some), float(np.abs(some).mean()), float(np.mean(some))) for key, some in found.items()]


def forecast_bench(published: Published, plan: Plan, starts: int = STARTS) -> BenchForecast:
    """Calibrate the bench on the lightest payload, and simulate all others. Raises AnalysisError as ``conditions``."""
    priors, (pairs, printed) = Priors.load(), conditions(published, plan, lightest=True)
    known = calibrate(priors, pairs, printed, starts)
    rig = rig_of(priors.values(known.deviations))
    others, others_printed = conditions(published, plan, lightest=False)
    again = Calibrated(known.deviations, simulated_reductions(rig, pairs), printed, known.cost)
    return BenchForecast(priors, again, pairs, others, simulated_reductions(rig, others), others_printed)


def emit_bench(made: BenchForecast) -> None:
    """Print the tables of a calibrated bench."""
    values = made.values
    rows = [
        [q.name, f"{values[q.name]:.4g}", f"{deviation:+.1f}", f"{q.median:.4g}", q.reason]
        for q, deviation in zip(made.priors.quantities, made.known.deviations, strict=True)
    ]
    emit_table("Calibrated, in SI", ["quantity", "value", "deviations", "median", "prior"], rows)
    groups = [[*key, str(count), f"{error:.1f}", f"{mean:+.1f}"] for *key, count, error, mean in made.groups()]
    emit_table(
        "Simulated less printed reductions, percentage points",
        ["payload kg", "motion", "axis", "numbers", "mean absolute", "mean"],
        groups,
        note=f"Mean absolute error {made.known.mean_error:.1f} on the {made.known.printed.size} numbers fitted, "
        f"{made.held_out:.1f} on the {made.printed.size} others.",
    )


def bench_document(made: BenchForecast) -> dict[str, object]:
    """The same for JSON."""
    cells = [
        {"payload_kg": run.payload, "motion": run.motion, "peak_acceleration_m_s2": run.peak_acceleration,
         "simulated_percent": list(map(float, simulated)), "published_percent": list(map(float, printed))}
        for (run, _), simulated, printed in zip(
            [*made.known_pairs, *made.asked_pairs], np.vstack([made.known.reductions, made.asked]),
            np.vstack([made.known.printed, made.printed]), strict=True)
    ]  # fmt: skip
    return {
        "values": made.values,
        "fitted_mean_absolute_points": made.known.mean_error,
        "held_out_mean_absolute_points": made.held_out,
        "cells": cells,
    }
