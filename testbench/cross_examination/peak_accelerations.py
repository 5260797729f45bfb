"""Peak accelerations by encoders: in the band in which their steps and noise tell it, with what they leave open.

What an encoder reads differs from the position by half a step at most, and by noise. In a second derivative that counts
with the square of the frequency, and a low pass takes of a motion's peak. So of several bands that one is used in which
both together leave least open.
"""

from typing import NamedTuple

import numpy as np

from balance.arrays import Floats

from ..kinematics.smoothing_and_derivatives import low_pass, reading_steps, smoothed_derivatives
from ..rig import Column
from .model_loads import POSITION_HZ, ModelledRun

BANDS_HZ = (POSITION_HZ, 40.0, 20.0, 10.0, 5.0)
"""Low passes of which that one counts that leaves least open [Hz]."""
DEVIATIONS = 4.0
"""Standard deviations of an acceleration's noise within which the largest of a run lies."""
_ENDS_S, _REST = 0.02, 0.1
"""Beginning and end of a record [s], in which a run that is recorded whole rests, and its largest speed there [-]."""
_OVERSHOOT = 0.25
"""Of a peak, by which a wide band may show more than there is where accelerations change at once."""
_RESPONSE_S = 3.0
"""Length of the computed response to one reading [s]."""


class Peak(NamedTuple):
    """A peak acceleration and what its witness leaves open."""

    value: float
    """[rad/s2, m/s2]."""
    less: float = 1.0
    """The least that it may be, over the value [-]."""
    more: float = 1.0
    """The most, likewise [-]."""

    @property
    def least(self) -> float:
        """The least that it may be [rad/s2, m/s2]."""
        return self.value * self.less

    @property
    def most(self) -> float:
        """The most that it may be [rad/s2, m/s2]."""
        return self.value * self.more

    def contradicts(self, stated: float, share: float) -> bool:
        """Whether a stated peak [rad/s2, m/s2] is outside by more than a ``share`` [-]."""
        return not self.least * (1.0 - share) <= stated <= self.most * (1.0 + share)


class EncoderErrors:
    """Largest errors of what is made of a run's encoders, by band."""

    def __init__(self, run: ModelledRun, columns: list[Column]) -> None:
        readings = run.run.stacked(columns)
        speeds = np.linalg.norm(run.path.v[run.valid], axis=1)
        ends = round(_ENDS_S * run.grid.rate) + 1
        self.cut = max(*speeds[:ends], *speeds[-ends:], 0.0) > _REST * speeds.max(initial=0.0)
        """Whether the record begins or ends in motion: the largest acceleration may be outside of it."""
        parts = np.array_split(readings, max(1, min(40, len(readings) // 8)))  # with enough third differences each
        rough = np.array([np.diff(part, 3, axis=0).std(axis=0) for part in parts])
        self.run, self.steps = run, reading_steps(readings)
        self.noise = np.quantile(rough, 0.1, axis=0) / 20.0**0.5
        self.bands = [hz for hz in BANDS_HZ if hz <= run.cutoff] or [run.cutoff]

    def of(self, factors: Floats, cutoff: float) -> float:
        """Largest error of accelerations [rad/s2] below ``cutoff`` [Hz], of encoders times ``factors`` (k,) [-]."""
        most, root = self._response(cutoff)
        return float(np.linalg.norm(factors * (0.5 * self.steps * most + DEVIATIONS * self.noise * root)))

    def _response(self, cutoff: float) -> tuple[float, float]:
        """Sums of an acceleration's response to single readings, absolute and root of squares [1/s2]."""
        fine, coarse = self.run.fine, self.run.grid
        impulse = np.zeros((int(_RESPONSE_S * fine.rate), 1))
        impulse[len(impulse) // 2] = 1.0
        at = np.arange(0.0, _RESPONSE_S, 1.0 / coarse.rate)
        smooth = low_pass(impulse, self.run.cutoff, fine.rate)[:, 0]
        position = np.interp(at, np.arange(len(impulse)) / fine.rate, smooth)[:, None]
        shown = smoothed_derivatives(position, self.run.cutoff, coarse.rate).a
        shown = low_pass(shown, cutoff, coarse.rate) if cutoff < self.run.cutoff else shown
        readings = fine.rate / coarse.rate  # of the encoders, a sample of the grid
        return readings * float(np.abs(shown).sum()), float(np.sqrt(readings * np.sum(shown**2)))

    def peak(self, accelerations: Floats, factors: Floats) -> Peak:
        """Largest norm of accelerations (n, k) [rad/s2], made of encoders times ``factors`` (k,) [-]."""
        found = []
        for cutoff in self.bands:
            below = low_pass(accelerations, cutoff, self.run.grid.rate) if cutoff < self.run.cutoff else accelerations
            again = low_pass(accelerations, 0.5 * cutoff, self.run.grid.rate)  # which takes more than the band did
            value, left = (float(np.linalg.norm(a, axis=1)[self.run.valid].max(initial=0.0)) for a in (below, again))
            if value > 0.0:
                error = self.of(factors, cutoff) / value
                found.append(Peak(value, max(1.0 - error, 0.0), (1.0 + error) * max(value / max(left, 1e-300), 1.0)))
        least = max(
            (one.least for one in found), default=0.0
        )  # a low pass may take more of a peak than half of it does
        found = [one for one in found if one.most >= (1.0 - _OVERSHOOT) * least]
        best = min(found, key=lambda one: one.more - one.less, default=Peak(0.0))
        return best._replace(more=np.inf) if self.cut else best
