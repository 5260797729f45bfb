"""Time series and spectra for a page: least and largest value of each of many equal spans, so that no peak is lost.

A series of more samples than there is room for is cut into equal spans of time; each keeps its least and its largest
value in the order in which they came. Values are rounded to 65,534 steps of the series' range.
"""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats

BUDGET_BYTES = 7_000_000
"""All series of a page, as they stand in it."""
BYTES_PER_VALUE = 8.0 / 3.0
"""Two bytes in base64."""
LEAST_SPANS = 64
"""Of a series, however many there are."""
STEPS = 65534
"""Of the range of a series, into which its values are rounded."""
_MISSING = -32768
SPECTRUM_POINTS = 400
"""Cells of a spectrum, equally wide on a logarithmic axis; each keeps its largest line."""


@dataclass(frozen=True)
class PlottedChannel:
    """One channel of a run, reduced."""

    kind: str
    """What it is listed under."""
    name: str
    unit: str
    start: float
    """Time of the first span [s]."""
    step: float
    """Between two values: half a span [s]."""
    samples: int
    """In the log."""
    values: NDArray[np.int16]
    """Least and largest of each span in their order, or every sample, (k,) [steps]."""
    limits: tuple[float, float]
    """Values of the lowest and the highest step [unit]."""

    @property
    def whole(self) -> bool:
        """Whether every sample is there."""
        return len(self.values) >= self.samples

    def as_dict(self) -> dict[str, Any]:
        """For the page's script."""
        return {
            "kind": self.kind, "name": self.name, "unit": self.unit, "start": self.start, "step": self.step,
            "samples": self.samples, "whole": self.whole, "low": self.limits[0], "high": self.limits[1],
            "values": base64.b64encode(self.values.astype("<i2").tobytes()).decode("ascii"),
        }  # fmt: skip


@dataclass(frozen=True)
class PlottedRun:
    """A run, or a design, with its channels; ``balanced`` where it has counter-masses."""

    name: str
    label: str
    balanced: bool
    channels: tuple[PlottedChannel, ...] = ()
    spectra: tuple[Mapping[str, Any], ...] = field(default=())

    def as_dict(self) -> dict[str, Any]:
        """For the page's script."""
        return {
            "name": self.name, "label": self.label, "balanced": self.balanced,
            "channels": [one.as_dict() for one in self.channels], "spectra": list(self.spectra),
        }  # fmt: skip


def spans_for(samples: Sequence[int], budget_bytes: float = BUDGET_BYTES) -> int:
    """Number of spans such that series of these lengths fit the budget, those that are shorter kept whole."""
    room, waiting = budget_bytes / BYTES_PER_VALUE, sorted(samples)
    for i, count in enumerate(waiting):
        share = room / (len(waiting) - i)
        if count > share:
            return max(int(share / 2), LEAST_SPANS)
        room -= count
    return max(waiting, default=LEAST_SPANS)


class Spans:
    """Equal spans of instants (n,) [s] that do not fall, NaN where there is none: once for channels of one clock."""

    def __init__(self, time: Floats, spans: int) -> None:
        known = np.isfinite(time)
        self._known = None if known.all() else known
        time = time if self._known is None else time[known]
        count = self._count = len(time)
        self.start = float(time[0])
        self.step = float(time[-1] - time[0]) / (count - 1) if count > 1 else 1.0
        steps = np.diff(time)
        even = count < 3 or bool(steps.min() >= 0.5 * self.step and steps.max() <= 1.5 * self.step)
        self.whole = count <= 2 * spans and even
        """Whether every sample is kept: at most two a span, evenly spaced."""
        if self.whole:
            return
        spans = spans if even else min(spans, max(count // 4, 1))  # so that a span without a sample is a gap
        width = float(time[-1] - time[0]) / spans
        self.step = 0.5 * width
        begins = np.searchsorted(time, time[0] + width * np.arange(spans))
        counts = np.diff(begins, append=count)
        self._filled = counts > 0
        self._begins, self._counts = begins[self._filled], counts[self._filled]

    def plotted(self, kind: str, name: str, unit: str, values: Floats) -> PlottedChannel:
        """A channel (n,) [unit], NaN where there is none; a sample without an instant is not drawn."""
        values = values if self._known is None else values[self._known]
        if self.whole:
            return PlottedChannel(kind, name, unit, self.start, self.step, self._count, *_rounded(values))
        # Least or largest of the samples of each span, (spans,) [unit]; NaN where a span holds none but NaN.
        found = [np.asarray(pick.reduceat(values, self._begins)) for pick in (np.fmin, np.fmax)]
        places = []
        for sought in found:
            hits = np.append(np.flatnonzero(values == np.repeat(sought, self._counts)), self._count)
            places.append(hits[np.searchsorted(hits, self._begins)])
        extremes = np.full((len(self._filled), 2), np.nan)
        extremes[self._filled] = np.where(places[0] <= places[1], found, found[::-1]).T
        return PlottedChannel(kind, name, unit, self.start, self.step, self._count, *_rounded(extremes.ravel()))


def plotted(kind: str, name: str, unit: str, time: Floats, values: Floats, spans: int) -> PlottedChannel:
    """A channel at instants (n,) [s] that do not fall, values (n,) [unit], either NaN where there is none.

    A sample without an instant is not drawn. Kept whole where it has at most two samples a span and they are evenly
    spaced, else reduced to ``spans`` spans.
    """
    return Spans(time, spans).plotted(kind, name, unit, values)


def _rounded(values: Floats) -> tuple[NDArray[np.int16], tuple[float, float]]:
    """Values (k,) in steps of their range, (k,), and the range."""
    known = np.isfinite(values)
    if not known.any():
        return np.full(len(values), _MISSING, dtype=np.int16), (0.0, 1.0)
    low, high = float(values[known].min()), float(values[known].max())
    steps = np.rint((np.where(known, values, low) - low) * (STEPS / ((high - low) or 1.0))) - STEPS // 2
    return np.where(known, steps, _MISSING).astype(np.int16), (low, high)


def spectrum(kind: str, name: str, unit: str, frequency: Floats, density: Floats) -> dict[str, Any]:
    """A spectrum (m,) [Hz] and its density (m,) [unit2/Hz] for the page: the largest line of each logarithmic cell."""
    used = (frequency > 0.0) & (density > 0.0)
    f, d = frequency[used], density[used]
    if not len(f):
        return {"kind": kind, "name": name, "unit": unit, "frequency_hz": [], "density": []}
    cell = (np.log(f / f[0]) / max(np.log(f[-1] / f[0]), 1e-12) * (SPECTRUM_POINTS - 1)).astype(np.intp)
    order = np.lexsort((-d, cell))
    kept = np.sort(order[np.unique(cell[order], return_index=True)[1]])
    return {
        "kind": kind, "name": name, "unit": unit, "frequency_hz": [float(f"{x:.5g}") for x in f[kept]],
        "density": [float(f"{x:.4g}") for x in d[kept]],
    }  # fmt: skip
