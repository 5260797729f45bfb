"""Clocks aligned by taps: short shocks that both loggers felt, whatever else they recorded between them."""

import numpy as np

from balance.arrays import Floats

from ..errors import AnalysisError
from .correlation import Aligned
from .events import Events, match
from .refine import refine
from .search import Rough
from .shared import Prepared, Shared, prepare

LOUD = 0.3
"""Share of the loudest shock from which another one counts as a tap."""
STANDS_OUT = 10.0
"""By how much a tap is louder than the record's median."""
APART_S = 0.25
"""Two shocks closer than this are one tap [s]."""
WINDOW_S = 0.1
"""Of the record that is compared, to either side of a tap [s]."""


def by_taps(shared: Shared, drift: bool = True) -> Aligned:
    """Align by taps. Raises AnalysisError if a side shows none, or they do not tell which belongs to which."""
    content = prepare(shared)
    reference = taps(content, content.reference.time, np.concatenate(content.columns, axis=1))
    own = taps(content, content.own.time, content.seen)
    one, other = match(shared.name, reference, own)
    offset = float(np.mean(reference.time[one] - own.time[other]))
    heard = own.time[other]
    middle, half = 0.5 * (heard[0] + heard[-1]), 0.5 * (heard[-1] - heard[0]) + WINDOW_S
    near = np.min(np.abs(content.own.time[:, None] - heard[None, :]), axis=1) <= WINDOW_S
    found = refine(content, Rough(offset, 0.0, (middle - half, middle + half)), drift, near)
    return Aligned(found.clock, "tap", f"{len(one)} taps, {shared.name}", 1.0 - found.left, content.findings)


def taps(content: Prepared, time: Floats, values: Floats) -> Events:
    """Instants of the loudest samples (n, signals) of each tap, known to about a period of the highest frequency."""
    loud = np.sqrt(np.sum((values / np.maximum(values.std(axis=0), 1e-300)) ** 2, axis=1))
    if loud.max() < STANDS_OUT * np.median(loud):
        raise AnalysisError(
            f"{content.name}: no tap stands out: the loudest is {loud.max() / np.median(loud):.2g} times the median"
        )
    found: list[int] = []
    for k in np.argsort(loud)[::-1]:
        if loud[k] < LOUD * loud.max() or len(found) > 100:
            break
        if all(abs(time[k] - time[j]) > APART_S for j in found):
            found.append(int(k))
    return Events(np.sort(time[found]), 0.5 / content.cutoff, (float(time[0]), float(time[-1])))
