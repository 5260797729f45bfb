"""Clocks aligned by the rising edges of a trigger that both loggers recorded."""

import numpy as np

from balance.arrays import Floats

from ..errors import AnalysisError
from .correlation import Aligned
from .events import Events, line, match
from .shared import Shared

LOW, HIGH = 0.25, 0.75
"""Shares of the swing below and above which a signal is clearly off and on."""
MOST_EDGES = 500


def by_trigger(shared: Shared, drift: bool = True) -> Aligned:
    """Align by edges. Raises AnalysisError if a side has none, or they do not tell which belongs to which."""
    reference = edges(shared.name, shared.reference_time, shared.columns[0][:, 0])
    own = edges(shared.name, shared.own_time, shared.seen[:, 0])
    one, other = match(shared.name, reference, own)
    clock = line(shared.name, reference.among(one), own.among(other), drift)
    return Aligned(clock, "trigger", f"{len(one)} edges, {shared.name}", None)


def edges(name: str, time: Floats, values: Floats) -> Events:
    """Instants at which a signal goes from off to on: the middle between its last sample off and its first on.

    The edge lies anywhere between: its standard deviation is that of a uniform distribution.
    """
    low, high = float(np.min(values)), float(np.max(values))
    if not high > low:
        raise AnalysisError(f"{name}: a channel that never changes holds no trigger")
    level = np.where(values >= low + HIGH * (high - low), 1, np.where(values <= low + LOW * (high - low), -1, 0))
    clear = np.flatnonzero(level)
    rises = np.flatnonzero(np.diff(level[clear]) > 0)
    if not 0 < len(rises) <= MOST_EDGES:
        raise AnalysisError(
            f"{name}: {len(rises)} rising edges: expected 1 to {MOST_EDGES}; name the channel that holds the trigger"
        )
    before, after = clear[rises], clear[rises + 1]
    step = float(np.median(np.diff(time)))
    widest = float(np.max(time[after] - time[before]))
    return Events(
        0.5 * (time[before] + time[after]), max(step, widest) / np.sqrt(12.0), (float(time[0]), float(time[-1]))
    )
