"""What a stored run's accelerometers on the base recorded, with the rest before the motion, by place."""

from dataclasses import replace

import numpy as np

from balance.arrays import Floats

from ..quality.clipping import flat_tops, is_dead, stuck_value
from ..runs.si_run import SIRun
from .amplitude import Amplitude, Place
from .metrics import Measure, base_accelerations
from .motion_timing import MotionTiming
from .noise_floor import Noise

_CLIPPED = ("clipping", "clipping_suspected")


def amplitudes_of_run(run: SIRun, measure: Measure) -> dict[Place, Amplitude]:
    """Each axis of each accelerometer on the base [m/s2]."""
    clipped = {f.channel for f in run.doubts(run.rig.base_columns) if f.code in _CLIPPED}
    columns = {(c.sensor, c.component): c for c in run.rig.base_columns}
    timings: dict[str, MotionTiming] = {}
    found = {}
    for place, (values, rate) in base_accelerations(run).items():
        column = columns[place]
        group, index = run.recorded.find(column.channel)
        if group.name not in timings:
            timings[group.name] = MotionTiming.of(run, group.name)
        timing = timings[group.name]
        clipping_found = group.channels[index].name in clipped
        faults = _faults(values, rate, clipping_found)
        step = column.resolution or observed_resolution(values)
        one = Amplitude.of(values, rate, measure, timing.rest, timing.moving, step)
        saturated = clipping_found or any(code in _CLIPPED for code, _ in faults)
        stated = Noise.stated(column.noise, rate)
        found[place] = replace(one, saturated=saturated, dead=is_dead(values), stated=stated, faults=faults)
    return found


def _faults(values: Floats, rate_hz: float, clipping_found: bool) -> tuple[tuple[str, str], ...]:
    """Signs of a failed sensor in a record; ``clipping_found``: ingest reported already that it clipped."""
    shown = {
        "held_value": stuck_value(values, rate_hz),
        "clipping_suspected": None if clipping_found else flat_tops(values),
    }
    return tuple((code, message) for code, message in shown.items() if message)


def observed_resolution(values: Floats) -> float:
    """Smallest step between the values (n,) [unit] of a channel [unit]: its resolution, where the rig states none."""
    steps = np.diff(np.unique(values))
    real = steps[steps > 1e-9 * max(float(np.abs(values).max(initial=0.0)), 1e-300)]
    return float(real.min()) if real.size else 0.0
