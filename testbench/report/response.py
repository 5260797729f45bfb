"""What the base's acceleration has in step with the shaking force, and whether it follows the moment as well.

In one motion force and moment come together: a run is too short to tell their responses apart line by line. So the
gain is that of the force alone (H1), and each line names the other components that explain more of the acceleration
than the force does: where there are some, their effect is in the gain, which is then no property of the base.
"""

from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats
from balance.estimation.estimate import coverage_factor

from ..errors import AnalysisError
from ..runs.aligned_run import recorded_clocks
from ..spectra.conditioned import conditioned
from ..spectra.transfer import Transfer, transfer
from .part import Part
from .vibration import HIGHEST_HZ, base_columns

if TYPE_CHECKING:
    from ..rig import Column
    from ..runs.si_run import SIRun
    from ..wrench import MeasuredWrench

SEGMENT_S = 0.25
"""Of the response's segments [s]: several in a motion of a second, 4 Hz apart."""
STANDS_OUT = 3.0
"""How many times its scatter in the quietest twentieth of the record a component must scatter in all of it to count."""


def base_response(run: "SIRun", wrench: "MeasuredWrench", highest_hz: float = HIGHEST_HZ) -> Part:
    """Acceleration of the base along each axis per shaking force along it, where the coherence is significant."""
    pushes = _pushes(wrench)
    rows: list[Part] = []
    for column in base_columns(run):
        if (along := f"F{column.component}") in pushes:
            answer = _beside(run, wrench, column)
            rows += _rows(column, along, pushes, answer, wrench.rate, highest_hz)
    return {
        "rows": rows,
        "definition": "acceleration of the base per shaking force along the same axis (H1), where coherence is over "
        f"what 95 of 100 records of noise show; segments of {SEGMENT_S:g} s smear narrower resonances; what follows "
        "the components named in also_follows is in the gain, moments about the point",
        "point_m": list(wrench.point),
        "of_the_force_alone": not any(row["also_follows"] for row in rows),
    }


def _pushes(wrench: "MeasuredWrench") -> dict[str, Floats]:
    """The components that are determined throughout and stand out of their noise."""
    found = {}
    for name, values in wrench.values.items():
        if values is not None and not np.isnan(values).any():
            quiet = min(float(part.std()) for part in np.array_split(values, 20))
            if values.std() > STANDS_OUT * quiet:
                found[name] = values
    return found


def _rows(
    column: "Column", along: str, pushes: dict[str, Floats], answer: Floats, rate: float, highest_hz: float
) -> list[Part]:
    """The lines of one channel."""
    segment = 2 * round(0.5 * SEGMENT_S * rate)
    told = transfer(pushes[along], answer, rate, segment)
    kept = told.significant & (told.frequency > 0.0) & (told.frequency <= highest_hz)
    beside = {name: _explains(pushes[along], pushes[name], answer, rate, segment) for name in pushes if name != along}
    return [
        _row(column, told, int(i)) | {"also_follows": [name for name, more in beside.items() if more[i]]}
        for i in np.flatnonzero(kept)
    ]


def _explains(force: Floats, other: Floats, answer: Floats, rate: float, segment: int) -> Floats:
    """Whether another component explains, line by line, what the force leaves of the acceleration."""
    return np.asarray(conditioned([force, other], answer, rate, segment).significant[1])


def _row(column: "Column", told: Transfer, i: int) -> Part:
    gain, share = float(np.abs(told.response[i])), coverage_factor() * float(told.relative_deviation[i])
    return {
        "sensor": column.sensor, "axis": column.component, "frequency_hz": float(told.frequency[i]),
        "gain_1_kg": gain, "gain_interval_1_kg": [gain * max(1.0 - share, 0.0), gain * (1.0 + share)],
        "phase_rad": float(np.angle(told.response[i])), "coherence": float(told.coherence[i]),
    }  # fmt: skip


def _beside(run: "SIRun", wrench: "MeasuredWrench", column: "Column") -> Floats:
    """A channel at the instants of the forces, (n,). Raises AnalysisError where their clocks are not in line."""
    group, time = run.group_of(column), run.instants(column)
    values, at = run.values(column), wrench.time
    if group != wrench.group:
        maps = recorded_clocks(run)
        if missing := [name for name in (group, wrench.group) if name not in maps]:
            raise AnalysisError(
                f"{run.name}: the clock of {', '.join(missing)} is not aligned: testbench align {run.path} first"
            )
        time, at = maps[group].to_reference(time), maps[wrench.group].to_reference(at)
    return np.interp(at, time, values)
