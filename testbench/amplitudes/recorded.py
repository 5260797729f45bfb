"""The amplitudes of a stored run: each axis of each accelerometer on the base, with the noise of its own rest."""

from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats

from ..checks.clipping import flat_tops, stuck_value
from ..errors import AnalysisError
from ..motion.segments import rest_before
from ..vibration import Measure, base_accelerations
from .amplitude import Amplitude
from .noise import ENOUGH, Noise

if TYPE_CHECKING:
    from ..runs.si_run import SIRun

Place = tuple[str, str]
"""Sensor and axis."""
_CLIPPED = ("clipping", "clipping_suspected")


def amplitudes(run: "SIRun", measure: Measure) -> dict[Place, Amplitude]:
    """Amplitude of the base's vibration by (sensor, axis), in m/s2; without noise where no rest stretch shows it."""
    clipped = {f.channel for f in run.doubts(run.rig.base_columns) if f.code in _CLIPPED}
    columns = {(c.sensor, c.component): c for c in run.rig.base_columns}
    rests: dict[str, slice | None] = {}
    found = {}
    for place, (values, rate) in base_accelerations(run).items():
        group, index = run.recorded.find(columns[place].channel)
        if group.name not in rests:
            rests[group.name] = _rest(run, group.name, rate)
        column = columns[place]
        noise = _noise(values, rate, rests[group.name], column.resolution, measure)
        stated = Noise.stated(column.noise, rate, column.resolution)
        said = group.channels[index].name in clipped
        faults = _faults(values, rate, said)
        bound = said or any(code in _CLIPPED for code, _ in faults)
        found[place] = Amplitude(values, rate, measure, noise, bound, stated=stated, faults=faults)
    return found


def _faults(values: Floats, rate_hz: float, said: bool) -> tuple[tuple[str, str], ...]:
    """What a record shows of a sensor that failed; ``said``: ingest found already that it clipped."""
    shown = {"held_value": stuck_value(values, rate_hz), "clipping_suspected": None if said else flat_tops(values)}
    return tuple((code, message) for code, message in shown.items() if message)


def _noise(values: Floats, rate_hz: float, still: slice | None, step: float, measure: Measure) -> Noise | None:
    if still is None:
        return None
    try:
        noise = Noise.of(values[still], rate_hz, step or smallest_step(values))
    except AnalysisError:
        return None
    return noise if noise.freedom(measure.band) >= ENOUGH else None


def _rest(run: "SIRun", group: str, rate_hz: float) -> slice | None:
    """The stretch before anything moves that the logger of ``group`` records."""
    signals = [run.recorded.channel(c.channel, group) for c in run.rig.columns() if run.holds(c, group)]
    return rest_before([s for s in signals if np.isfinite(s).all()], rate_hz)


def smallest_step(values: Floats) -> float:
    """The smallest step between values that a channel took: its resolution, where the rig states none."""
    steps = np.diff(np.unique(values))
    real = steps[steps > 1e-9 * max(float(np.abs(values).max(initial=0.0)), 1e-300)]
    return float(real.min()) if real.size else 0.0
