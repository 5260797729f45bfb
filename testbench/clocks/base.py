"""The base's acceleration as clocks need it: what an AC-coupled accelerometer was exposed to, and its noise."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats

from ..motion import base_motion
from ..motion.segments import rest_before

if TYPE_CHECKING:
    from ..rig import Column
    from ..runs.si_run import SIRun


@dataclass(frozen=True)
class Base:
    """What the accelerometers on the base recorded in one group."""

    group: str
    rows: Floats
    """What each channel sees of the base's accelerations, (k, 6)."""
    time: Floats
    """On the group's clock, (m,) [s]."""
    values: Floats
    """(m, k) [m/s2]"""
    noise: Floats
    """Standard deviation of a sample by the rig, (k,) [m/s2]; zero where it states none."""


def recorded(run: "SIRun", group: str | None = None) -> Base | None:
    """The accelerometers on the base that a group holds; of any group, the one with most channels. None: no such."""
    found = base_motion.recorded(run, group)
    if found is None:
        return None
    rate = (len(found.time) - 1) / float(found.time[-1] - found.time[0])
    corners = [getattr(run.rig.sensors[column.sensor], "high_pass", None) for column in found.columns]
    values = [restored(v, rate, corner) for v, corner in zip(found.values.T, corners, strict=True)]
    noise = np.array([stated_noise(column) for column in found.columns])
    return Base(found.group, found.rows, found.time, np.column_stack(values), noise)


def stated_noise(column: "Column") -> float:
    """Standard deviation of one sample as the rig states it, steps of q as noise of q^2 / 12 [SI]."""
    return float(np.hypot(column.noise, column.resolution / np.sqrt(12.0)))


def restored(values: Floats, rate_hz: float, corner: float | None) -> Floats:
    """What an AC-coupled sensor was exposed to, less its level at rest (or its mean): x = y + w int y dt, (n,).

    The inverse of s / (s + w), w = 2 pi times the ``corner`` [Hz] that its data sheet states; None: as it is. Without
    it, what is slow comes early: by half a millisecond in the forces of a balanced machine, at 0.3 Hz.
    """
    if corner is None:
        return values
    still = rest_before([values], rate_hz)
    passed = values - float(np.mean(values if still is None else values[still]))
    middle = 0.5 * (passed[1:] + passed[:-1])
    return np.asarray(passed + 2.0 * np.pi * corner / rate_hz * np.r_[0.0, np.cumsum(middle)])
