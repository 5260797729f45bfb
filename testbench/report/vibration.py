"""Base vibration, and its modes from the decay after the motion."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ..errors import AnalysisError
from ..levels import definitions, levels
from ..signals import Band
from ..spectra.modes import modes
from .part import Part

if TYPE_CHECKING:
    from ..command import CommandPerformance
    from ..motion.motions import FoundMotion, Source
    from ..rig import Column
    from ..runs.si_run import SIRun

HIGHEST_HZ = 100.0
"""Of the modes that are looked for [Hz]: a base on its mounts, and what a motion excites."""
SETTLED_S = 0.02
"""After the end of the motion from which on the base rings freely; the zero-phase band smears as far [s]."""


def base_columns(run: "SIRun") -> "list[Column]":
    """The channels of the accelerometers on the base. Raises AnalysisError if there is none."""
    columns = run.rig.base_columns
    if not columns:
        raise AnalysisError(f"{run.name}: its rig has no accelerometer that is attached_to the base")
    return columns


def base_levels(run: "SIRun", band: Band | None) -> Part:
    """Every metric of every axis, and where its spectrum peaks."""
    found = levels(run, base_columns(run), band)
    return {"axes": [level.as_dict() for level in found], "definitions": definitions(band)}


def base_modes(run: "SIRun", moved: tuple[float, float]) -> Part:
    """Modes from what rings after the motion ``moved``, on the clock of the accelerometers on the base [s]."""
    start, end = moved
    columns = base_columns(run)
    group = run.group_of(columns[0])
    columns = [c for c in columns if run.group_of(c) == group]
    time, rate = run.instants(columns[0]), run.rate(columns[0])
    band = Band(0.0, min(HIGHEST_HZ, 0.2 * rate))
    values = np.column_stack([band.of(*run.signal(c)) for c in columns])
    after = time > end + SETTLED_S
    found = modes(values[after], rate, band.high_hz, ambient=values[time < start - SETTLED_S])
    return {
        "modes": [_named(mode.as_dict()) for mode in found],
        "channels": [c.channel for c in columns],
        "from_s": end + SETTLED_S,
        "to_s": float(time[-1]),
        "group": group,
        "band_hz": [band.low_hz, band.high_hz],
        "definition": "free decay after the motion as damped sines that all channels share; intervals of 95 %, in them "
        "what shakes the base before the motion",
    }


def _named(mode: Part) -> Part:
    return {"amplitudes_m_s2" if name == "amplitudes" else name: value for name, value in mode.items()}


def motion_on_base_clock(
    run: "SIRun", found: "Mapping[Source, list[FoundMotion]]", shown: "CommandPerformance | None"
) -> tuple[float, float]:
    """When the first motion began and the last ended, on the clock of the base's accelerometers [s].

    Raises AnalysisError where no source of motions tells it on that clock.
    """
    group = run.group_of(base_columns(run)[0])
    for motions in found.values():
        if motions and motions[-1].group == group and motions[-1].source != "acceleration":
            return motions[0].start, motions[-1].end
    if shown is not None and shown.group == group and found.get("command"):
        shift = shown.lag_s + shown.first - float(shown.time[0])
        return found["command"][0].start + shift, found["command"][-1].end + shift
    if (felt := found.get("acceleration")) and felt[-1].group == group:
        return felt[0].start, felt[-1].end
    raise AnalysisError(
        f"{run.name}: no source of motions shares the clock of the base's accelerometers, {group}: nothing says when "
        "the base rings freely"
    )
