"""Coverage of the intervals of ``testbench analyze``: simulated campaigns whose truth is known.

Single conditions below the file layer: each seed is a campaign of one condition, the same motion of the same bench seen
through new noise. And whole campaigns, analysed as a user has them: repeats of all conditions are pooled, and one of
them shakes the base hardly more than the accelerometer's noise.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from balance.mechanism.mjcf_parser import load_mechanism
from balance.units import G0
from testbench.campaign_plan import PlannedRun
from testbench.kinematics.motion_onset import rest_before
from testbench.rig import Rig, load_rig
from testbench.signal import Metric
from testbench.signal.filters import Band
from testbench.simulator.loggers import digitized, sample_instants
from testbench.simulator.run import simulate_run
from testbench.simulator.sensors import base_acceleration, true_signals
from testbench.vibration import Amplitude, AmplitudeLikelihood, ConditionAmplitude, Group, Noise, Ratio, Repeatability
from testbench.vibration.metrics import METRICS, Measure
from testbench.vibration.reduction import analyze

from .simulated_runs import Scene, edited_rig, scene
from .table import Row, Tally, covered

CONDITIONS = ((3.4116, 17.1105, "x", 1.0), (5.0, 24.2626, "y", 2.0), (5.0, 24.2626, "x", 0.25))
"""Of a whole campaign: payload [kg], counter-mass on each arm [kg], motion, peak acceleration [g0]."""


def study(count: int, brief: bool) -> Iterator[Row]:
    """Coverage by case, runs a side, axis and metric; briefly of one case and one metric."""
    for name in ("soft",) if brief else CASES:
        for (repeats, axis, metric), t in tally(CASES[name], range(count), 2 if brief else 3).items():
            note = f"{t.below_noise} below noise, {t.undefined} without a reduction"
            yield covered(f"{name}, {_runs(repeats)}, {axis}, {metric}", t.hits, t.count, note)
    for repeats, metric in product((2,) if brief else (1, 2), ("peak_to_peak",) if brief else METRICS):
        for (number, axis), t in campaigns(range(count), repeats, metric).items():
            payload, _, motion, acceleration = CONDITIONS[number]
            where = f"campaign, {payload:g} kg, motion {motion}, {acceleration:g} g0"
            note = f"{t.below_noise} below noise, {t.undefined} without a reduction"
            yield covered(f"{where}, {_runs(repeats)}, {axis}, {metric}", t.hits, t.count, note)


def _runs(repeats: int) -> str:
    return f"{repeats} run{'s' if repeats > 1 else ''} a side"


@dataclass(frozen=True)
class Case:
    """A bench and a condition on it."""

    rig: Rig
    payload: float
    counter_mass: float
    motion: str
    acceleration_g: float
    band: Band


SOFT = {  # softer mounts, a noisy sensor elsewhere that one sees in steps, a slow logger
    'stiffness = ["250 kN/m", "400 kN/m", "250 kN/m"]': 'stiffness = ["90 kN/m", "150 kN/m", "120 kN/m"]',
    'damping = ["400 N s/m", "600 N s/m", "400 N s/m"]': 'damping = ["500 N s/m", "700 N s/m", "600 N s/m"]',
    'noise = "0.002 g" ': 'noise = "0.006 g" ',
    'resolution = "0.0005 g"             # (assumed)\nposition = ["0.20 m", "-0.10 m", "0 m"]': (
        'resolution = "0.005 g"\nposition = ["-0.30 m", "0.25 m", "0.1 m"]'
    ),
    'rate = "5 kHz"\nstart = "-0.237 s"': 'rate = "1 kHz"\nstart = "-0.4 s"',
}
STIFF = {  # the full model, stiff mounts, a heavier base, a quiet sensor and a fast logger that starts late
    'stiffness = ["250 kN/m", "400 kN/m", "250 kN/m"]': 'stiffness = ["900 kN/m", "2000 kN/m", "900 kN/m"]',
    'mechanism = "parallelogram-6bar"': 'mechanism = "parallelogram-6bar-full"',
    'mass = "150 kg"': 'mass = "420 kg"',
    'noise = "0.002 g" ': 'noise = "0.0008 g" ',
    'position = ["0.20 m", "-0.10 m", "0 m"]          # (assumed)\nattached_to = "base"': (
        'position = ["0.35 m", "0.2 m", "-0.1 m"]\nattached_to = "base"'
    ),
    'rate = "5 kHz"\nstart = "-0.237 s"': 'rate = "8 kHz"\nstart = "-0.12 s"',
}
SHIPPED = load_rig("parallelogram-6bar")
CASES = {
    "shipped-x": Case(SHIPPED, 3.4116, 17.1105, "x", 1.0, Band(0.0, 200.0)),
    "shipped-y": Case(SHIPPED, 3.4116, 17.1105, "y", 1.0, Band(0.0, 200.0)),
    "soft": Case(edited_rig(SOFT), 5.0, 24.2626, "x", 1.0, Band(1.0, 100.0)),
    "stiff": Case(edited_rig(STIFF), 1.451, 9.0, "y", 2.0, Band(0.0, 150.0)),
}


@dataclass(frozen=True)
class Condition:
    """What the logger of the base's accelerometer saw, without noise [SI], by channel; and its rest."""

    case: Case
    seen: dict[str, np.ndarray]

    def draw(self, rng: np.random.Generator) -> dict[str, tuple[np.ndarray, Noise | None]]:
        """One run in noise: each axis of the base, with the noise of its own rest."""
        rig = self.case.rig
        logger = rig.sensors["base_acc"].logger
        rate = rig.loggers[logger].rate
        read = {c: digitized(c, self.seen[c.channel], rng) * c.factor for c in rig.columns(logger)}
        still = rest_before(list(read.values()), rate)
        assert still is not None
        return {
            c.component: (values, Noise.of(values[still], rate, c.resolution))
            for c, values in read.items()
            if c.sensor == "base_acc"
        }

    def truth(self, axis: str, measure: Measure) -> float:
        """The amplitude without noise [m/s2]."""
        sensor = self.case.rig.base_accelerometers["base_acc"]
        channel = next(c.channel for c in sensor.columns("base_acc") if c.component == axis)
        return measure.amplitude(self.seen[channel], self.case.rig.loggers[sensor.logger].rate)


def conditions(case: Case) -> tuple[Condition, Condition]:
    """The runs of a case with counter-masses and without."""
    mechanism = load_mechanism(case.rig.mechanism)
    logger = case.rig.loggers[case.rig.sensors["base_acc"].logger]
    found = []
    for mass in (case.counter_mass, 0.0):
        masses = {"counter_A0A": mass, "counter_B0B": mass} if mass else {}
        run = simulate_run(
            case.rig, mechanism, PlannedRun("r", case.payload, masses, case.motion, case.acceleration_g * G0, 1)
        )
        true = sample_instants(logger, float(run.time[-1]))[1]
        found.append(
            Condition(case, {name: np.interp(true, run.time, s) for name, s in true_signals(case.rig, run).items()})
        )
    return found[0], found[1]


@dataclass
class RatioTally(Tally):
    """And how many were below noise, or not defined."""

    below_noise: int = 0
    undefined: int = 0


def tally(case: Case, seeds: range, repeats: int = 1, axes: str = "xyz") -> dict[tuple[int, str, str], RatioTally]:
    """By runs a side, axis and metric, over campaigns of several seeds; fewer runs a side are the first of more."""
    pair = conditions(case)
    rate = case.rig.loggers[case.rig.sensors["base_acc"].logger].rate
    found: dict[tuple[int, str, str], RatioTally] = {}
    for seed in seeds:
        rng = np.random.default_rng([seed, 77])
        runs = [[condition.draw(rng) for condition in pair] for _ in range(repeats)]
        for axis, metric in product(axes, METRICS):
            measure = Measure(metric, case.band)
            truth = pair[0].truth(axis, measure) / pair[1].truth(axis, measure)
            judged = [
                [AmplitudeLikelihood.of(Amplitude(r[axis][0], rate, measure, r[axis][1])) for r in both]
                for both in runs
            ]
            for count in range(1, repeats + 1):
                sums, ratio = found.setdefault((count, axis, metric), RatioTally()), ratio_of(judged[:count])
                sums.add(ratio.accepts(truth))  # where no reduction is defined, every truth is possible
                sums.undefined += not ratio.defined
                sums.below_noise += ratio.defined and ratio.below_noise
    return found


def ratio_of(judged: Sequence[list[AmplitudeLikelihood]]) -> Ratio:
    """Of runs with and without counter-masses, (repeats, 2), as those of a campaign of one condition."""
    balanced, unbalanced = (Group(runs) for runs in zip(*judged, strict=True))
    scatter = Repeatability.of([balanced, unbalanced])
    return Ratio(ConditionAmplitude(balanced, scatter), ConditionAmplitude(unbalanced, scatter))


def campaigns(seeds: range, repeats: int, metric: Metric) -> dict[tuple[int, str], RatioTally]:
    """By condition and axis, over whole campaigns; reductions without an interval are not counted."""
    measure = Measure(metric)
    scenes = {
        (number, balanced): scene(motion, acceleration, dict.fromkeys(("counter_A0A", "counter_B0B"), mass * balanced),
                                  payload)
        for number, (payload, mass, motion, acceleration) in enumerate(CONDITIONS) for balanced in (True, False)
    }  # fmt: skip
    true = {key: _amplitudes(one, measure) for key, one in scenes.items()}
    numbers: dict[tuple[float | None, str], int] = {
        (payload, motion): n for n, (payload, _, motion, _) in enumerate(CONDITIONS)
    }
    found: dict[tuple[int, str], RatioTally] = {}
    for seed in seeds:
        planned = [one for one in scenes.values() for _ in range(repeats)]
        runs = [one.run(1000 * seed + k, ("daq",)) for k, one in enumerate(planned)]
        for reduction in analyze(runs, measure).reductions:
            number, axis = numbers[reduction.key.payload_kg, reduction.key.motion], reduction.axis
            sums = found.setdefault((number, axis), RatioTally())
            sums.below_noise += reduction.below_noise
            sums.undefined += reduction.interval is None
            if reduction.interval:
                low, high = reduction.interval
                sums.add(low <= 100.0 * (1.0 - true[number, True][axis] / true[number, False][axis]) <= high)
    return found


def _amplitudes(one: Scene, measure: Measure) -> dict[str, float]:
    """Amplitude at the base accelerometer without noise, by axis [m/s2]."""
    logger, time = one.rig.loggers["daq"], one.bench.time
    true = sample_instants(logger, float(time[-1]))[1]
    seen = base_acceleration(one.rig.base_accelerometers["base_acc"], one.bench)
    return {axis: measure.amplitude(np.interp(true, time, seen[axis]), logger.rate) for axis in "xyz"}
