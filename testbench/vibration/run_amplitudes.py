"""What a stored run's accelerometers on the base recorded, with the rest before the motion, by place."""

from collections.abc import Container
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats

from ..errors import AnalysisError
from ..quality.clipping import flat_tops, is_dead, stuck_value
from ..rig.sensors import Accelerometer, Encoder, Target
from ..runs.si_run import SIRun
from .amplitude import Amplitude, Place
from .metrics import Measure, base_accelerations
from .motion_timing import MotionTiming
from .noise_floor import Noise
from .tonal_lines import SHORTEST_S

if TYPE_CHECKING:
    from ..store import Run

_SAMPLES = 10_000
"""That are looked at for the step of a channel."""
_CLIPPED = ("clipping", "clipping_suspected")


AmplitudesOfRun = dict[Place, Amplitude]


def amplitudes_of_run(run: SIRun, measure: Measure, mains: Container[Place] = ()) -> AmplitudesOfRun:
    """Each axis of each accelerometer on the base [m/s2].

    ``mains``: places whose rests show the mains in other runs; where this one has no rest that could, they are
    sought in all of it.
    """
    clipped = {f.channel for f in run.doubts(run.rig.base_columns) if f.code in _CLIPPED}
    columns = {(c.sensor, c.component): c for c in run.rig.base_columns}
    run = run.preloaded([c for k in (Accelerometer, Target, Encoder) for c in run.rig.columns_of(k) if run.holds(c)])
    records = base_accelerations(run)
    places: dict[str, list[Place]] = {}
    for place, column in columns.items():
        places.setdefault(run.recorded.find(column.channel)[0].name, []).append(place)
    found = {}
    for group, some in places.items():
        timing, rate = MotionTiming.of(run, group), records[some[0]][1]
        values = np.array([records[place][0] for place in some])
        steps = [columns[place].resolution or observed_resolution(row) for place, row in zip(some, values, strict=True)]
        hidden = (timing.rest is None or timing.rest[1] < SHORTEST_S) and any(place in mains for place in some)
        quiet = (0.0, values.shape[1] / rate) if hidden else timing.unfelt
        amplitudes = Amplitude.of(values, rate, measure, timing.rest, timing.moving, steps, quiet)
        for place, row, one in zip(some, values, amplitudes, strict=True):
            where, index = run.recorded.find(columns[place].channel)
            clipping_found = where.channels[index].name in clipped
            faults = _faults(row, rate, clipping_found)
            saturated = clipping_found or any(code in _CLIPPED for code, _ in faults)
            stated = Noise.stated(columns[place].noise, rate)
            one = replace(one, timed=timing.timed, clocks=timing.clocks, stated=stated, faults=faults)
            found[place] = replace(one, saturated=saturated, dead=is_dead(row))
    return {place: found[place] for place in columns}


def amplitudes_or_reason(run: "Run | SIRun", measure: Measure) -> AmplitudesOfRun | str:
    """:func:`amplitudes_of_run`, or why there are none."""
    try:
        return amplitudes_of_run(run if isinstance(run, SIRun) else SIRun.of(run), measure)
    except AnalysisError as error:
        return str(error)


def _faults(values: Floats, rate_hz: float, clipping_found: bool) -> tuple[tuple[str, str], ...]:
    """Signs of a failed sensor in a record; ``clipping_found``: ingest reported already that it clipped."""
    shown = {
        "held_value": stuck_value(values, rate_hz),
        "clipping_suspected": None if clipping_found else flat_tops(values),
    }
    return tuple((code, message) for code, message in shown.items() if message)


def observed_resolution(values: Floats) -> float:
    """Smallest step between values (n,) [unit] of a channel [unit]: its resolution, where the rig states none.

    So many samples show the step of any converter that is not lost in noise.
    """
    steps = np.diff(np.sort(values[:: max(len(values) // _SAMPLES, 1)]))
    real = steps[steps > 1e-9 * max(float(np.abs(values).max(initial=0.0)), 1e-300)]
    return float(real.min()) if real.size else 0.0
