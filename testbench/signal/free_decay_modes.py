"""Modes from free decay: what rings on after a motion, as damped sines that all channels share.

y_c(t) = o_c + sum_k e^(-z_k w_k t) (a_ck cos(w_dk t) + b_ck sin(w_dk t)), w_dk = w_k sqrt(1 - z_k^2). Amplitudes and
offsets are linear and solved for at every step (variable projection). Modes are added one by one where the residual has
most power, until another does not pay by the Bayesian information criterion. Intervals of 95 % follow from the
curvature of the least squares and the correlation of the residual. Ambient vibration (floor, machines) at a mode's own
frequency is fitted with the mode and so is not in the residual: where a record at rest is given, its density there
widens that mode's intervals.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from balance.arrays import Floats
from balance.estimation.estimate import coverage_factor

from ..errors import AnalysisError

MOST_MODES = 6
"""Modes that are looked for: as many as a rigid base has."""
LARGEST_FREQUENCY_ERROR = 0.05
"""Half an interval of a frequency, as a share of it, above which a mode is not determined."""
LARGEST_DAMPING_ERROR = 0.5
"""Half an interval of a damping ratio, as a share of it, above which a mode is not determined."""
LEAST_SHARE = 0.02
"""Of the strongest mode's amplitude, below which a mode may be the residual of stronger ones."""
LEAST_PERIODS = 2.0
"""Of a mode within the decay, below which it cannot be distinguished from a drift."""
ROUGHLY, EXACTLY = 1e-3, 1e-8
"""Change of the sum of squares, as a share of it, that ends a search: while modes are sought, and at last."""
LEAST_SAMPLES = 40
BLOCK = 40
"""Samples of a damped sine that are computed; the others are these, turned [at most LEAST_SAMPLES]."""


@dataclass(frozen=True)
class Mode:
    """One mode with intervals of 95 %."""

    frequency: float
    """Undamped, [Hz]."""
    frequency_interval: tuple[float, float]
    damping: float
    """Ratio to critical."""
    damping_interval: tuple[float, float]
    amplitudes: tuple[float, ...]
    """At the start of the decay, of each channel [unit]."""
    refused: str | None
    """Why the mode is not determined; None where it is."""

    def as_dict(self) -> dict[str, Any]:
        """As a JSON document; what is not determined is null."""
        known = self.refused is None
        return {
            "frequency_hz": self.frequency if known else None,
            "frequency_interval_hz": list(self.frequency_interval) if known else None,
            "damping_ratio": self.damping if known else None,
            "damping_interval": list(self.damping_interval) if known else None,
            "amplitudes": list(self.amplitudes),
            "near_hz": self.frequency,
            "reason": self.refused,
        }


def free_decay_modes(decay: Floats, rate_hz: float, highest_hz: float, ambient: Floats | None = None) -> list[Mode]:
    """Modes of channels that ring freely, (n, k) [any unit], below ``highest_hz``, rising in frequency.

    ``ambient`` (m, k) is a record of the same channels at rest. Channels must hold nothing above ``highest_hz``.
    Raises AnalysisError for a record that is too short, or in which no mode is determined.
    """
    stride = max(1, int(rate_hz / (4.0 * highest_hz)))
    values, rate_hz = decay[::stride], rate_hz / stride
    if len(values) < LEAST_SAMPLES or not np.isfinite(values).all():
        raise AnalysisError(
            f"{len(values)} samples of free decay at {rate_hz:g} per second, or some that are no numbers: expected at "
            f"least {LEAST_SAMPLES}; let the loggers go on for longer after the motion"
        )
    size = float(np.abs(values - values.mean(axis=0)).max())
    if not size > 0.0:
        raise AnalysisError("the channels do not change after the motion: nothing rings")
    at_rest = None if ambient is None else ambient[::stride] / size
    fit = _Fit(values / size, np.arange(len(values)) / rate_hz, at_rest)
    pairs: Floats = np.empty((0, 2))
    best = fit.criterion(pairs)
    for _ in range(MOST_MODES):
        more = fit.refined(np.vstack([pairs, fit.next(pairs, highest_hz)]), highest_hz, ROUGHLY)
        found = fit.criterion(more)
        if not found < best:
            break
        pairs, best = more, found
    if not len(pairs):
        raise AnalysisError("nothing rings after the motion above the noise: no mode is determined")
    pairs = fit.refined(pairs, highest_hz, EXACTLY)
    return fit.with_intervals(pairs[np.argsort(pairs[:, 0])], size)


class _Fit:
    """Least squares of damped sines; ``pairs`` (modes, 2) hold a frequency [Hz] and a damping ratio [-] each."""

    def __init__(self, values: Floats, time: Floats, ambient: Floats | None) -> None:
        self.values, self.time, self.ambient = values, time, ambient
        self.solved = lru_cache(2)(self._solved)

    def basis(self, pairs: Floats) -> Floats:
        """Columns of the linear part, (n, 1 + 2 modes)."""
        frequency, damping = pairs.T
        pole = 2.0 * np.pi * frequency * (-damping + 1j * np.sqrt(1.0 - damping**2))
        # Instants are equally spaced: of each block the first, times those of the first block.
        first, others = (np.exp(np.outer(some, pole)) for some in (self.time[::BLOCK], self.time[:BLOCK]))
        rings = (first[:, None] * others).reshape(len(first) * BLOCK, len(pairs))[: len(self.time)]
        return np.column_stack([np.ones_like(self.time), rings.view(np.float64)])

    def _solved(self, pairs: tuple[float, ...]) -> tuple[Floats, Floats, Floats, Floats]:
        """Basis (n, 1 + 2 modes), an orthonormal one of its columns, linear part (1 + 2 modes, k), residual (n, k)."""
        basis = self.basis(np.array(pairs).reshape(-1, 2))
        along, triangle = np.linalg.qr(basis)
        rotated, sizes, turned = np.linalg.svd(triangle)
        used = sizes > 1e-10 * sizes[0]
        along, turned = along @ rotated[:, used], turned[used]
        linear = turned.T @ ((along.T @ self.values) / sizes[used, None])
        return basis, along, linear, self.values - basis @ linear

    def residual(self, pairs: Floats) -> Floats:
        """Readings less modes and offsets, (n, k)."""
        return self.solved(tuple(pairs.ravel()))[3]

    def slopes(self, pairs: Floats) -> Floats:
        """Derivatives of the residual but for a part that is orthogonal to it, (1 + 2 modes, 2 modes).

        In axes of which the residual lies along the first. L. Kaufman, BIT 15, 49 (1975): the gradient of the sum of
        squares is exact, and so is its minimum.
        """
        basis, orthonormal, linear, residual = self.solved(tuple(pairs.ravel()))
        rates = self.time[:, None] * basis[:, 1:]
        axes, triangle = np.linalg.qr(rates - orthonormal @ (orthonormal.T @ rates))
        # What a mode is by its complex amplitude, and its pole's derivatives by frequency and damping.
        complex_amplitudes = linear[1::2] - 1j * linear[2::2]
        frequency, damping = pairs.T
        root = np.sqrt(1.0 - damping**2)
        turns = 2.0 * np.pi * np.stack([-damping + 1j * root, frequency * (-1.0 - 1j * damping / root)])
        turned = turns[:, :, None] * complex_amplitudes
        shapes = np.stack([-turned.real, turned.imag], axis=-1)
        found = np.einsum("rmc,pmkc->krmp", triangle.reshape(-1, len(pairs), 2), shapes)
        inside = axes.T @ residual
        outside = np.linalg.norm(residual - axes @ inside)
        both = np.column_stack([inside.T.ravel(), found.reshape(-1, 2 * len(pairs))])
        _, small = np.linalg.qr(np.vstack([both, np.eye(1, both.shape[1]) * outside]))
        return np.asarray(small[:, 1:] * (np.sign(small[0, 0]) or 1.0))

    def next(self, pairs: Floats, highest: float) -> Floats:
        """Frequency at which the residual has most power, with a damping to start from, (1, 2)."""
        from scipy.fft import next_fast_len, rfft

        residual = self.residual(pairs)
        count = next_fast_len(4 * len(residual), real=True)
        frequency = np.fft.rfftfreq(count, float(self.time[1]))
        power = (np.abs(rfft(residual.T, count)) ** 2).sum(axis=0)
        power[(frequency < 1.0 / float(self.time[-1])) | (frequency > highest)] = 0.0
        return np.array([[float(frequency[power.argmax()]), 0.05]])

    def refined(self, pairs: Floats, highest: float, share: float) -> Floats:
        """The least squares near ``pairs``, to a ``share`` of their sum [-]; frequency and damping bounded."""
        from scipy.optimize import least_squares

        first = np.eye(1, 1 + 2 * len(pairs))[0]
        low = np.tile([0.3 / float(self.time[-1]), 1e-4], len(pairs))
        high = np.tile([1.2 * highest, 0.7], len(pairs))
        start = np.clip(pairs.ravel(), 1.001 * low, 0.999 * high)

        def residual(x: Floats) -> Floats:
            return first * np.linalg.norm(self.residual(x.reshape(-1, 2)))

        def slopes(x: Floats) -> Floats:
            return self.slopes(x.reshape(-1, 2))

        done = least_squares(residual, start, slopes, ftol=share, bounds=(low, high), x_scale=start, max_nfev=60)
        return np.asarray(done.x).reshape(-1, 2)

    def criterion(self, pairs: Floats) -> float:
        """Bayesian information criterion of a fit with these modes."""
        residual = self.residual(pairs)
        parameters = 2 * len(pairs) + (1 + 2 * len(pairs)) * residual.shape[1]
        count = residual.size
        return count * float(np.log(np.mean(residual**2) + 1e-24)) + parameters * float(np.log(count))

    def with_intervals(self, pairs: Floats, size: float) -> list[Mode]:
        """The modes with their intervals; amplitudes are scaled by ``size``."""
        residual = self.residual(pairs)
        freedom = max(residual.size - 2 * len(pairs) - (1 + 2 * len(pairs)) * residual.shape[1], 1)
        jacobian = self._jacobian(pairs)
        variance = float((residual**2).sum()) / freedom
        unit = np.sqrt(np.diag(np.linalg.pinv(jacobian.T @ jacobian))).reshape(-1, 2)
        linear = self.solved(tuple(pairs.ravel()))[2][1:].reshape(len(pairs), 2, -1)
        sizes = size * np.hypot(linear[:, 0], linear[:, 1])
        noise = np.maximum(variance * _correlation_widening(residual), self._ambient_variance(pairs, sizes))
        half = coverage_factor(min(freedom, 1000)) * np.sqrt(noise)[:, None] * unit
        shares = sizes.max(axis=1) / sizes.max()
        return [self._mode(*row) for row in zip(pairs, half, sizes, shares, strict=True)]

    def _ambient_variance(self, pairs: Floats, sizes: Floats) -> Floats:
        """Variance of white noise that has, at each mode, the density of the record at rest, (modes,).

        Channels are weighted by how much the mode rings in them. A short record smears a resonance: the largest density
        within two of its lines is taken.
        """
        if self.ambient is None or len(self.ambient) < LEAST_SAMPLES:
            return np.zeros(len(pairs))
        rate, count = 1.0 / float(self.time[1]), len(self.ambient)
        window = np.hanning(count)[:, None]
        lines = np.abs(np.fft.rfft((self.ambient - self.ambient.mean(axis=0)) * window, 4 * count, axis=0)) ** 2
        density = lines / float((window**2).sum())
        frequency = np.fft.rfftfreq(4 * count, 1.0 / rate)
        near = [np.abs(frequency - f) <= 2.0 * rate / count for f in pairs[:, 0]]
        top = np.array([density[n].max(axis=0) for n in near])
        return np.asarray((top * sizes**2).sum(axis=1) / (sizes**2).sum(axis=1))

    def _jacobian(self, pairs: Floats) -> Floats:
        def at(step: Floats) -> Floats:
            return self.residual((pairs.ravel() + step).reshape(-1, 2)).ravel()

        steps = 1e-5 * np.maximum(pairs.ravel(), 1e-3)
        return np.column_stack([(at(step) - at(-step)) / (2.0 * step.max()) for step in np.diag(steps)])

    def _mode(self, pair: Floats, half: Floats, sizes: Floats, share: float) -> Mode:
        (frequency, damping), (f, z) = map(float, pair), map(float, half)
        weak = f"it rings with {100.0 * share:.1f} % of the strongest: expected {100.0 * LEAST_SHARE:g} %"
        why = weak if share < LEAST_SHARE else _refusal(frequency, damping, f, z, float(self.time[-1]))
        return Mode(
            frequency, (frequency - f, frequency + f), damping, (max(damping - z, 0.0), damping + z),
            tuple(map(float, sizes)), why,
        )  # fmt: skip


def _refusal(frequency: float, damping: float, f: float, z: float, seconds: float) -> str | None:
    if frequency * seconds < LEAST_PERIODS:
        return f"the decay of {seconds:.3g} s holds {frequency * seconds:.1f} periods: expected {LEAST_PERIODS:g}"
    if f > LARGEST_FREQUENCY_ERROR * frequency:
        return _wide("frequency", f / frequency, LARGEST_FREQUENCY_ERROR)
    if z > LARGEST_DAMPING_ERROR * damping:
        return _wide("damping", z / damping, LARGEST_DAMPING_ERROR)
    return None


def _wide(what: str, share: float, most: float) -> str:
    """``its damping is known to 50.1 % only: expected 50 %``, in digits that show which is more."""
    if share > 2.0:
        return f"its {what} is not known: expected within {100.0 * most:g} %"
    digits = next(n for n in range(17) if n == 16 or float(f"{100.0 * share:.{n}f}") > 100.0 * most)
    return f"its {what} is known to {100.0 * share:.{digits}f} % only: expected {100.0 * most:g} %"


def _correlation_widening(residual: Floats) -> float:
    """Factor by which correlation in time widens a variance: 1 + 2 sum of the autocorrelation up to its first zero."""
    widened = []
    for column in residual.T:
        power = np.abs(np.fft.rfft(column, 2 * len(column))) ** 2
        correlation = np.fft.irfft(power)[: len(column) // 4]
        if not correlation[0] > 0.0:
            continue
        first = int(np.argmax(correlation <= 0.0)) or len(correlation)
        widened.append(float(2.0 * correlation[:first].sum() / correlation[0] - 1.0))
    return max(widened, default=1.0)
