"""The equations of a fit of one clock to another: what each signal says of offset, drift and factors of its own.

y(t) = c + e t + Z(t) g + X(s) b + f(s) at s = p + (1 + d)(t - t0), f known, both sides behind one filter. Noise on both
sides leaves p unbiased, but not the first-order bend of the sum of squares: second derivatives are therefore included.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats, Indices

from .shared import Flags
from .whitening import filtered

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

MOVES = 2
"""Parameters of the clock: when its middle was, and its drift."""


@dataclass(frozen=True)
class Place:
    """Where the own clock is thought to run on the reference's: ``at`` + (1 + drift) (own - middle)."""

    middle: float
    at: float
    drift: float = 0.0

    def instants(self, own: Floats) -> Floats:
        """Own instants on the reference's clock, (n,) [s]."""
        return self.at + (1.0 + self.drift) * (own - self.middle)


@dataclass(frozen=True)
class Stretch:
    """A stretch of the own clock without holes, and which of its samples count."""

    own: Floats
    """(n,) [s]"""
    seen: Floats
    """(n, signals)"""
    beside: Floats
    """What else moves the signals, on the own clock, (n, k)."""
    used: Flags
    """(n,)"""

    @property
    def step(self) -> float:
        """Between samples [s]."""
        return float(self.own[-1] - self.own[0]) / (len(self.own) - 1)


class Signal:
    """One signal of the own clock against its columns at a place; constant, trend and factors are solved for.

    ``along`` columns, the last of the spline's, like those beside, are what the model of the others lacks.
    """

    def __init__(
        self, stretch: Stretch, index: int, spline: "BSpline", place: Place, taps: Floats, along: int = 0
    ) -> None:
        at, used, lever = place.instants(stretch.own), stretch.used, stretch.own - place.middle
        self.lever = np.column_stack([np.ones_like(lever), lever])[used]
        beside = np.column_stack([np.ones_like(lever), lever / np.abs(lever).max(), stretch.beside])
        self.still = beside.shape[1]
        free = spline.c.shape[1] - 1 - along
        self.lacking = np.r_[np.zeros(2), np.ones(self.still - 2), np.zeros(free), np.ones(along)].astype(bool)
        raw = [np.asarray(spline(at, order)) for order in (0, 1, 2)]
        value, rate, bow = (filtered(x, taps)[used] for x in raw)
        self.columns = np.column_stack([filtered(beside, taps)[used], value[:, 1:]])
        self.seen = filtered(stretch.seen[:, index], taps)[used]
        self.factors = np.linalg.lstsq(self.columns, self.seen - value[:, 0], rcond=None)[0]
        share = np.r_[1.0, self.factors[self.still :]]
        self.rates, self.fixed_rate, self.speed, self.bow = rate[:, 1:], rate[:, 0], rate @ share, bow @ share
        self.left = stretch.seen[:, index] - raw[0] @ share - beside @ self.factors[: self.still]
        """Residual before the filter, of all samples of the stretch."""
        whitened = filtered(self.left, taps)
        self.residual = whitened[used]
        self.seen_speed = self.speed + np.gradient(whitened, stretch.step)[used]

    @cached_property
    def weight(self) -> float:
        """1 / mean square of the residual."""
        return 1.0 / max(float(np.mean(self.residual**2)), 1e-12 * float(np.mean(self.seen**2)))

    def design(self, speed: Floats) -> Floats:
        """How the signal answers to the clock's parameters and to its own, (n, p), at its rates ``speed`` (n,)."""
        return np.column_stack([self.lever * speed[:, None], self.columns])

    def equations(self) -> tuple[Floats, Floats]:
        """Gradient (p,) and bend (p, p) of half the weighted sum of squares."""
        design = self.design(self.speed)
        first_order = design.T @ design
        bend, at = first_order.copy(), MOVES + self.still
        bend[:MOVES, :MOVES] -= (self.lever * (self.residual * self.bow)[:, None]).T @ self.lever
        crossed = self.lever.T @ (self.residual[:, None] * self.rates)
        bend[:MOVES, at:] -= crossed
        bend[at:, :MOVES] -= crossed.T
        if np.linalg.eigvalsh(bend).min() <= 0.0:
            bend = first_order
        return -self.weight * (design.T @ self.residual), self.weight * bend


def joined(signals: list[Signal], place: Place, loose: float | None) -> tuple[Floats, Floats]:
    """The equations of all signals: the clock's parameters are shared, the others each signal's own.

    ``loose``: standard deviation about zero within which the drift is taken to be; None: nothing is known of it.
    """
    size = int(places(signals)[-1][-1]) + 1
    gradient, bend = np.zeros(size), np.zeros((size, size))
    for signal, index in zip(signals, places(signals), strict=True):
        its_gradient, its_bend = signal.equations()
        gradient[index] += its_gradient
        bend[index[:, None], index] += its_bend
    if loose is not None:
        gradient[1] += place.drift / loose**2
        bend[1, 1] += 1.0 / loose**2
    return gradient, bend


def places(signals: list[Signal]) -> list[Indices]:
    """Where the parameters of each signal stand among all."""
    ends = MOVES + np.cumsum([s.columns.shape[1] for s in signals])
    return [np.r_[0:MOVES, end - s.columns.shape[1] : end] for s, end in zip(signals, ends, strict=True)]
