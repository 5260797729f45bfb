"""Channels of a stored run as the rig understands them: calibrated, in SI, finite, with a rate."""

from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats

from .calibration import applied
from .errors import AnalysisError

if TYPE_CHECKING:
    from .rig import Column
    from .store import Run


def in_si(run: "Run", column: "Column") -> tuple[Floats, float]:
    """A channel (n,) [SI] and its rate [Hz], by the calibration that holds. In an acceleration, ``g`` is 9.81 m/s2.

    Raises AnalysisError if it has no unit, two different ones, no regular clock, or samples that are no number.
    """
    group, _ = run.find(column.channel)
    if group.rate_hz is None:
        raise AnalysisError(f"{run.name}: channel {column.channel!r} has no sampling rate: expected a regular clock")
    values = applied.readings(run, column)
    odd = np.flatnonzero(~np.isfinite(values))
    if odd.size:
        raise AnalysisError(
            f"{run.name}: channel {column.channel!r} holds no number at sample {odd[0]}; repair it first"
        )
    return values, group.rate_hz


def instants(run: "Run", column: "Column") -> Floats:
    """When what a channel's samples show happened, on its logger's clock, (n,) [s].

    Where the rig states the logger's filter (``low_pass``), that is earlier than the sample by the filter's delay.
    """
    time = run.time(run.find(column.channel)[0].name)
    return time - column.delay if column.delay else time
