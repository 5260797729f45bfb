"""The swings of a course of vibration, and what they would be if its largest value were another.

Several swings may be of nearly like height; in noise any of them may be read as the largest. Under the hypothesis that
the largest is h, the likeliest heights of all are: as estimated where that is less than h, h where it is more, and h
for the highest (maximum likelihood under the constraint max = h; Silvapulle and Sen, "Constrained Statistical
Inference", 2005). Noise added to the course as estimated would be too sure: what noise made the
largest would count as larger.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from balance.arrays import Floats


@dataclass(frozen=True)
class Lobes:
    """A course (n,) [unit], in swings from one local minimum of its size to the next."""

    course: Floats

    def of_peak(self, peak: float) -> Floats:
        """The likeliest course whose largest absolute value is ``peak``, (n,)."""
        return self._held(peak, self._heights)

    def of_peak_to_peak(self, span: float) -> Floats:
        """The likeliest course whose largest value less smallest is ``span``, (n,).

        What the span is more or less than estimated is shared alike by both ends, neither of them passing zero.
        """
        up, down = self._signed
        top, bottom = float(up.max()), float(down.max())
        shared = float(np.clip(top + 0.5 * (span - top - bottom), 0.0, span))
        high = shared if top > 0.0 and bottom > 0.0 else span * (top > 0.0)
        return self._held(high, up) + self._held(span - high, down)

    @cached_property
    def highest(self) -> "Lobes":
        """The highest swing alone."""
        only = np.arange(len(self._heights)) == int(np.argmax(self._heights))
        return Lobes(self.course * np.repeat(only, self._lengths))

    def _held(self, peak: float, heights: Floats) -> Floats:
        """The swings of ``heights`` (m,), none higher than ``peak`` and the highest just so high; the others away."""
        if not heights.any():
            return np.zeros_like(self.course)
        wanted = np.minimum(heights, peak)
        wanted[np.argmax(heights)] = peak
        factors = np.divide(wanted, heights, out=np.zeros_like(heights), where=heights > 0.0)
        return self.course * np.repeat(factors, self._lengths)

    @cached_property
    def _starts(self) -> np.ndarray:
        """Where a swing begins: where the sign changes, and at local minima of the size."""
        size = np.abs(self.course)
        low = (size[1:-1] <= size[:-2]) & (size[1:-1] < size[2:])
        turned = np.signbit(self.course[1:]) != np.signbit(self.course[:-1])
        return np.unique(np.concatenate([[0], np.flatnonzero(low) + 1, np.flatnonzero(turned) + 1]))

    @cached_property
    def _lengths(self) -> np.ndarray:
        return np.diff(np.append(self._starts, len(self.course)))

    @cached_property
    def _heights(self) -> Floats:
        return np.maximum.reduceat(np.abs(self.course), self._starts)

    @cached_property
    def _signed(self) -> tuple[Floats, Floats]:
        """Heights of the swings above zero, and depths of those below; zero for the others."""
        above = np.maximum.reduceat(self.course, self._starts)
        below = -np.minimum.reduceat(self.course, self._starts)
        return np.maximum(above, 0.0), np.maximum(below, 0.0)
