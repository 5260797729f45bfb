"""Reductions of records that are not as one would wish: clipped, without rest, with a short one, in motion at once."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from studies import simulated_runs as memory
from testbench import campaign_plan as plans
from testbench.rig import load_rig
from testbench.runs.si_run import SIRun
from testbench.signal.filters import Band
from testbench.simulator import simulated_logs
from testbench.simulator.simulated_logs import stored
from testbench.store import open_campaign
from testbench.vibration.metrics import METRICS, Measure
from testbench.vibration.motion_timing import MotionTiming
from testbench.vibration.reduction import Reduction, analyze, verdict

from ..conftest import PAIR, simulated
from ..coverage import assert_holds

BAND = Band(0.0, 200.0)
SHIPPED = load_rig("parallelogram-6bar")
PLAN = """
mechanism = "parallelogram-6bar"
[[conditions]]
payload = "3.4116 kg"
counter_masses = { counter_A0A = "17.1105 kg", counter_B0B = "17.1105 kg" }
motion = "x"
peak_acceleration = "3 g0"
"""


@cache
def scenes() -> tuple[memory.Scene, memory.Scene]:
    """The same motion with counter-masses and without."""
    return memory.scene("x"), memory.scene("x", masses={})


def cut(run: memory.MemoryRun, seconds: float, name: str = "daq") -> memory.MemoryRun:
    """The run, as if its logger, by default that of accelerations, had started later."""
    group = run.group(name)
    lost = round(seconds * group.rate_hz)
    prefix = f"{group.path}/"
    data = {k: v[lost:] if k.startswith(prefix) else v for k, v in run.provenance["data"].items()}
    groups = tuple(replace(g, samples=g.samples - lost) if g is group else g for g in run.groups)
    return replace(run, groups=groups, provenance={"data": data})


def rests(scene: memory.Scene, seed: int) -> float:
    """How long the accelerometers' logger of a run is at rest [s]."""
    return -scene.starts(seed)["daq"]["start"]


def pair(rest_s: tuple[float, float], seed: int = 0) -> list[memory.MemoryRun]:
    """Runs with and without counter-masses, with so much rest [s] left of them; below zero they start in motion."""
    return [
        cut(scene.run(seed * 2 + k), rests(scene, seed * 2 + k) - rest)
        for k, (scene, rest) in enumerate(zip(scenes(), rest_s, strict=True))
    ]


@pytest.mark.parametrize("start", [0.2, 0.4])
def test_no_rest(start):
    """In motion at once, of a sensor whose noise nobody states: what was read, without an interval, and a finding."""
    measure = Measure("rms", BAND)
    runs = [replace(run, rig=re.sub(r"(?m)^noise = .*$", "", run.rig)) for run in pair((-start, -start))]
    analysis = analyze(runs, measure)
    assert {f.code for f in analysis.findings} == {"no_noise_floor"}
    for reduction in analysis.reductions:
        assert (reduction.interval, reduction.method, reduction.noise_floor) == (None, None, (None, None))
    assert analysis.reductions[0].percent == pytest.approx(_true(runs, "x", measure, start), abs=0.5)


def test_encoders_in_motion_at_once():
    """There is no rest then, though accelerometers, on a logger that started before, feel a quiet beginning."""
    runs = [cut(scene.run(seed), 0.45, "controller") for seed, scene in enumerate(scenes())]
    runs = [replace(run, rig=re.sub(r"(?m)^noise = .*$", "", run.rig)) for run in runs]
    assert all(rests(scene, seed) > 0.1 for seed, scene in enumerate(scenes()))
    assert [MotionTiming.of(SIRun.of(run), "daq").rest for run in runs] == [None, None]
    (found,) = analyze(runs, Measure("rms", BAND)).findings
    assert found.code == "no_noise_floor"
    assert "log half a second of rest" in found.message


def test_the_noise_that_the_rig_states():
    """In motion at once the noise that the rig states is taken off, but proves nothing: there is no interval."""
    analysis = analyze(pair((-0.2, -0.2)), Measure("rms", BAND))
    assert "noise_stated" in {f.code for f in analysis.findings}
    rested = analyze(pair((0.1, 0.1)), Measure("rms", BAND)).reductions
    for reduction, known in zip(analysis.reductions, rested, strict=True):
        assert (reduction.noise_stated, reduction.interval) == (True, None)
        assert reduction.noise_floor == pytest.approx(known.noise_floor, rel=0.35)
        assert not known.noise_stated


@pytest.mark.parametrize("metric", METRICS)
def test_rest_of_one_run(metric):
    """The noise of one run is that of the other too, whose record is in motion at once: the same channel."""
    for reduction in analyze(pair((0.1, -0.25)), Measure(metric)).reductions:
        low, high = reduction.interval
        assert low < reduction.percent < high
        assert reduction.noise_floor[0] == pytest.approx(reduction.noise_floor[1], rel=0.05)


@pytest.mark.parametrize("metric", ["rms", "peak"])
def test_short_rest(metric):
    """The 50 ms before a late logger sees anything move know the noise to a third; the intervals still hold."""
    measure, held = Measure(metric, BAND), 0
    for seed in range(3):
        runs = pair((-0.08, -0.08), seed)
        for reduction in analyze(runs, measure).reductions:
            low, high = reduction.interval
            held += low <= _true(runs, reduction.axis, measure, 0.08) <= high
    assert_holds(held, 9)


def _true(runs: list[memory.MemoryRun], axis: str, measure: Measure, start: float) -> float:
    """Reduction without noise [%] over the spans of runs that begin ``start`` [s] into the motion."""
    amplitudes = []
    for scene, run in zip(scenes(), runs, strict=True):
        group = run.groups[0]
        signal = scene.seen[scene.rig.sensors["base_acc"].channels[axis]]
        instants = start + np.arange(group.samples) / group.rate_hz
        amplitudes.append(measure.amplitude(np.interp(instants, scene.bench.time, signal, left=0.0), group.rate_hz))
    return 100.0 * (1.0 - amplitudes[0] / amplitudes[1])


@pytest.mark.parametrize(("limit_g", "limit"), [(0.15, "at_least"), (0.05, None)])
def test_clipping(tmp_path, limit_g, limit):
    """A sensor at its range saw at least so much: clipped without counter-masses alone, a lower bound."""
    measure = Measure("peak", BAND)
    made = simulated(tmp_path, PLAN, SHIPPED.text.replace('range = "50 g"', f'range = "{limit_g} g"', 1))
    analysis = analyze(open_campaign(made.campaign).runs, measure)
    found = next(r for r in analysis.reductions if r.axis == "x")
    assert "clipping" in {f.code for f in analysis.findings}
    assert found.limit == limit
    if limit is None:
        assert found.interval is None
        return
    assert found.interval[1] == 100.0
    assert 0.0 < found.at_least < found.percent < _true(pair((0.2, 0.2)), "x", measure, -0.2)


def loud(run: memory.MemoryRun, gain: float, noise: float, seed: int) -> memory.MemoryRun:
    """The run on a base that moves ``gain`` times as much, with noise [g] on its accelerometer."""
    rng = np.random.default_rng(seed)
    data = {
        path: gain * values + noise * rng.normal(size=len(values)) if path.startswith("daq/Acc") else values
        for path, values in run.provenance["data"].items()
    }
    return replace(run, provenance={"data": data})


def test_hardly_above_the_noise():
    """Where the amplitude without counter-masses may be next to nothing, an upper bound, no endless interval."""
    measure, bounds, held = Measure("rms", BAND), 0, 0
    balanced, bare = scenes()
    truth = _true([balanced.run(0), bare.run(1)], "y", measure, -0.2)
    for seed in range(8):
        runs = [loud(balanced.run(2 * seed), 12.0, 0.27, 2 * seed), loud(bare.run(2 * seed + 1), 1.0, 0.27, seed + 99)]
        analysis = analyze(runs, measure)
        found = next(r for r in analysis.reductions if r.axis == "y")
        assert found.interval is None or found.interval[0] > -1000.0
        if found.kind == "at_most":
            held += 100.0 * (1.0 - 12.0 * (1.0 - truth / 100.0)) <= found.percent
            bounds += 1
            assert "upper bounds" in next(f for f in analysis.findings if f.code == "below_noise").message
            assert f"y: raised by at least {-found.percent:.1f} % (hardly above" in verdict(analysis.reductions)
    assert bounds >= 3
    assert_holds(held, bounds)


def test_files_and_memory(shared):
    """What the files give is what the loggers recorded, without the truth: the same numbers, to the last digit."""
    runs = [stored(run, SHIPPED) for run in simulated_logs.simulate_logs(plans.plan_from_text(PAIR), SHIPPED)]
    found = [
        analyze(some, Measure("peak", BAND)).reductions for some in (runs, open_campaign(shared(PAIR).campaign).runs)
    ]
    memory_alone, files = ([replace(r, runs=()) for r in some] for some in found)
    assert len(files) == 3
    assert memory_alone == files


@cache
def repeated() -> tuple[memory.MemoryRun, ...]:
    """Two repeats a side of two conditions."""
    runs = []
    for number, acceleration in enumerate((1.0, 3.0)):
        for side, masses in enumerate(({}, memory.BUILT)):
            seen = memory.scene("x", acceleration, masses)
            runs += [seen.run(100 * number + 10 * side + k) for k in range(2)]
    return tuple(runs)


@cache
def repeated_reductions() -> tuple[Reduction, ...]:
    """Of all of them."""
    return analyze(repeated(), Measure("rms", BAND)).reductions


def test_repeats_of_other_conditions():
    """An interval of two repeats a side is no wider where other conditions were repeated too."""
    pooled = [r for r in repeated_reductions() if r.key.peak_acceleration_g == 3.0]
    alone = analyze(repeated()[-4:], Measure("rms", BAND)).reductions
    assert [(r.axis, r.method, r.n) for r in pooled] == [(axis, "repeats", (2, 2)) for axis in "xyz"]
    widths = np.array([[r.interval[1] - r.interval[0] for r in some] for some in (pooled, alone)])
    assert np.exp(np.diff(np.log(widths[::-1]), axis=0).mean()) < 1.1
    for reduction in pooled:
        assert reduction.interval[0] < reduction.percent < reduction.interval[1]


def test_repeats_that_differ():
    """Repeats that differ far more than all others are said, and widen no other condition's interval."""
    runs = list(repeated())
    group, index = runs[0].find("AccX")
    runs[0] = memory.with_values(runs[0], "AccX", 1.8 * runs[0].provenance["data"][f"{group.path}/{group.keys[index]}"])
    analysis = analyze(runs, Measure("rms", BAND))
    assert {f.code for f in analysis.findings} >= {"repeats_differ"}
    said = [f.message for f in analysis.findings if f.code == "repeats_differ"]
    assert len(said) == 1
    assert "1 g0, base_acc along x" in said[0]
    assert f"({runs[0].name} {runs[1].name})" in said[0]
    for new, old in zip(analysis.reductions, repeated_reductions(), strict=True):
        if new.axis == "x" and new.key.peak_acceleration_g > 1.0:
            assert np.diff(new.interval) < 2.0 * np.diff(old.interval)
