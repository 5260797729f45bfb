"""Influence coefficients of a linkage: what is missing where, from how trial masses change the vibration of its base.

The base answers the wrench of run r linearly, Y_r = H U_r at each frequency, with H unknown and the same in all runs.
What runs differ by is known: their motions, and the trial masses on them. U_r = A_r c + B_r z + K_r, with A and B the
wrench per unit of the balance conditions' values c and of what else is unknown z, K what is known, trial masses
included: with them c has a scale. H is solved for with c and z, by least squares (variable projection, Golub, Pereyra,
SIAM J. Numer. Anal. 10, 1973), as the transform of a response that dies away within MEMORY_S.

All transforms are at s = sigma + i omega: a base that rings on when a record ends would leak into that of i omega,
exp(-sigma t) has it die away.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Complexes, Floats, Indices
from ..balancing.conditions import Conditions
from ..errors import DataError
from .first_moment_imbalance import Imbalance, Subspace
from .identifiability import NotIdentifiable

SIGMA = 3.0
"""Decay of the transforms [1/s]: a base of 8 Hz damped to 6 % rings down as fast."""
MEMORY_S = (0.5, 0.8)
"""How long the base remembers a push, decay included [s]: found with both, for neither is right. The shorter leaves out
what rings on, the longer explains noise."""
BEFORE_S = 0.04
"""What a response may show before the push: clocks are aligned to less, band limits need some [s]."""
TAPS_PER_PERIOD = 2.5
"""Of the highest frequency: the response in between is given by its band."""
BAND_HZ = 3.0
"""Within which noise of one run is correlated, for the decay of the transforms spreads it over about 1 Hz."""
_DEPENDENT = 1e-4
"""Singular value of the response's columns, relative to the largest, below which a combination is not used."""
_BLIND = 1e-3
"""The same of the unknowns: what lies below the runs do not determine."""
_SETTLED = 5e-6
"""Change of a condition's value at which it counts as found [kg m]; in a flat valley steps of 3e-5 lead far."""
_STEPS = 100
_WHOLE = 1e-3
"""Part of a condition's value that may lie in what the runs do not determine."""


@dataclass(frozen=True)
class Trial:
    """One run, transformed: at K frequencies."""

    columns: Complexes
    """Wrench per unit of the conditions' values, then of the other unknowns, (K, inputs, rank + shared)."""
    known: Complexes
    """Wrench that is known: of trial masses, and of the values that the other unknowns start from, (K, inputs)."""
    reading: Complexes
    """Of the accelerometers, (K, channels)."""
    nuisance: Complexes
    """Nuisances of a channel: offset, drift, (K, k)."""


def transform_frequencies(seconds: float, highest: float) -> Floats:
    """Frequencies of transforms of records of at most so many seconds, (K,) [Hz]."""
    return np.arange(1, int(highest * seconds) + 1) / seconds


def transform(values: Floats, time: Floats, at: Floats) -> Complexes:
    """Of values (n, ...) at even instants (n,) [s] from zero, at frequencies (K,) [Hz], (K, ...)."""
    kernel = np.exp(-np.outer(SIGMA + 2j * np.pi * at, time)) * (time[1] - time[0])
    return np.asarray((kernel @ values.reshape(len(time), -1)).reshape(len(at), *values.shape[1:]))


def trial_mass_imbalance(
    trials: Sequence[Trial], at: Floats, conditions: Conditions, start: Floats, subspace: Subspace
) -> Imbalance:
    """Values of the conditions (rank,) from runs with trial masses, beginning at ``start`` (rank,) [kg m].

    Raises NotIdentifiable where the runs do not determine them, DataError where no solution is found.
    """
    short_s, long_s = MEMORY_S
    long = _found(_Problem(trials, at, long_s, start, subspace))
    short = _found(_Problem(trials, at, short_s, start, subspace), long)
    size = len(subspace.directions)
    moved = [one.sides.moved_by(long.sides.residual)[:, :size] for one in (short, long)]
    covariance = mean_covariance(short.unknown[:size], long.unknown[:size], *moved)
    mean = 0.5 * (short.unknown + long.unknown)[:size]
    return Imbalance(
        conditions,
        start + mean @ subspace.directions,
        subspace.directions.T @ covariance @ subspace.directions,
        subspace,
        short.determined,
        long.sides.unexplained,
        long.sides.degrees_of_freedom,
    )


@dataclass(frozen=True)
class _Found:
    """Solution with one length of memory."""

    unknown: Floats
    sides: "_Sides"
    determined: Floats


def _found(problem: "_Problem", near: _Found | None = None) -> _Found:
    """From what another memory found on, each channel weighted as there."""
    size = problem.free
    unknown, noise = (near.unknown, near.sides.noise) if near else (np.zeros(size + problem.shared), None)
    for _ in range(_STEPS):
        sides = problem.sides(unknown, noise)
        step, determined = sides.step()
        unknown = unknown + step
        if np.abs(step[:size]).max() < _SETTLED:
            break
    else:
        largest = float(np.abs(step[:size]).max())
        raise DataError(
            "the runs with trial masses do not tell what is missing: "
            f"{sides.unexplained:.1%} of the vibration stays unexplained, and after {_STEPS} steps the values still "
            f"change by {largest:.2g} kg m; see that what was mounted in each run is what the run table says, or {MORE}"
        )
    eye = np.eye(determined.shape[1])[: problem.free]
    outside = np.abs(eye - (eye @ determined.T) @ determined).max(axis=1, initial=0.0)
    if (outside > _WHOLE).any():
        raise NotIdentifiable(f"the runs with trial masses do not tell what is missing; {MORE}")
    return _Found(unknown, sides, determined)


MORE = "mount heavier trial masses, or add runs of a motion unlike these, as fast, with each of them"


def _singular_values(matrix: Floats, least: float) -> tuple[Floats, Floats, Floats, Floats]:
    """Of a matrix (n, p) whose columns are first scaled to length one: U (n, k), the k singular values above a share
    ``least`` of the largest, and V' (k, p); then the lengths that the columns had, (p,).

    By the squares of its columns, which take a tenth of the time and hold shares down to 1e-8.
    """
    length = np.linalg.norm(matrix, axis=0)
    length[length == 0.0] = 1.0
    scaled = matrix / length
    squares, rows = np.linalg.eigh(scaled.T @ scaled)
    kept = squares > least**2 * squares[-1]
    sizes, rows = np.sqrt(squares[kept]), rows[:, kept].T
    return scaled @ (rows.T / sizes), sizes, rows, length


@dataclass(frozen=True)
class _Sides:
    """Least squares of what a step of the unknowns changes, the base's response solved for; rows of unit noise."""

    slope: Floats
    residual: Floats
    bands: Indices
    """Number of the run and band that each row is of."""
    shrunk: float
    """Share of the equations that the response does not take up."""
    unexplained: float
    noise: Floats
    """What each channel's rows were divided by, (channels,)."""

    def step(self) -> tuple[Floats, Floats]:
        """Gauss-Newton step (p,), and the orthonormal combinations (k, p) that are determined."""
        u, sizes, rows, length = _singular_values(self.slope, _BLIND)
        step = (rows.T @ ((u.T @ self.residual) / sizes)) / length
        return step, np.linalg.qr((rows * length).T)[0].T

    @property
    def degrees_of_freedom(self) -> int:
        """Bands less unknowns."""
        return len(np.unique(self.bands)) - self.slope.shape[1]

    def moved_by(self, residual: Floats) -> Floats:
        """How far the residual of each band moves the unknowns, (bands, p): correlated within one, not between them.

        Of a residual (rows,), larger by what the response took up of it.
        """
        _, sizes, rows, length = _singular_values(self.slope, _BLIND)
        half = rows / sizes[:, None] / length
        scores = np.zeros((int(self.bands.max()) + 1, self.slope.shape[1]))
        np.add.at(scores, self.bands, self.slope * residual[:, None])
        return np.asarray(scores @ half.T @ half / np.sqrt(self.shrunk))


class _Problem:
    """The equations of all runs."""

    def __init__(self, trials: Sequence[Trial], at: Floats, memory: float, start: Floats, subspace: Subspace) -> None:
        self.free, self.start, rank = len(subspace.directions), start, len(start)
        own = [
            np.concatenate([t.columns[:, :, :rank] @ subspace.directions.T, t.columns[:, :, rank:]], 2) for t in trials
        ]
        self.columns = np.concatenate(own)
        self.known = np.concatenate([t.known + t.columns[:, :, :rank] @ start for t in trials])
        self.readings = np.concatenate([t.reading for t in trials])
        s = SIGMA + 2j * np.pi * at
        taps = np.arange(-BEFORE_S, memory, 1.0 / (TAPS_PER_PERIOD * at[-1]))
        self.memory = np.tile(np.exp(-np.outer(s, taps)), (len(trials), 1))
        band = (at / BAND_HZ).astype(np.intp)
        self.bands = np.concatenate([band + r * (band[-1] + 1) for r in range(len(trials))])
        self.nuisance = _block_diagonal([t.nuisance for t in trials])
        self.delay = [_block_diagonal([s[:, None] * t.reading[:, q : q + 1] for t in trials]) for q in self.channels]
        self.shared = self.columns.shape[2] - self.free

    @property
    def channels(self) -> range:
        """Of the accelerometers."""
        return range(self.readings.shape[1])

    def sides(self, unknown: Floats, noise: Floats | None = None) -> _Sides:
        """All channels, each weighted by its noise (channels,): that given, else that of the residual."""
        pushed: Complexes = self.known + self.columns @ unknown.astype(complex)
        slopes, residuals, noises, freedoms, left_out, whole = [], [], [], 0, 0.0, 0.0
        for q in self.channels:
            slope, residual, freedom = self._channel(q, pushed)
            noises.append(float(np.sqrt(residual @ residual / freedom)) if noise is None else float(noise[q]))
            slopes.append(slope / noises[q])
            residuals.append(residual / noises[q])
            freedoms, left_out = freedoms + freedom, left_out + float(residual @ residual)
            whole += float(np.sum(np.abs(self.readings[:, q]) ** 2))
        every = np.concatenate(residuals)
        bands = np.tile(self.bands, 2 * len(self.channels))
        unexplained = float(np.sqrt(left_out / whole))
        return _Sides(np.concatenate(slopes), every, bands, freedoms / len(every), unexplained, np.array(noises))

    def _channel(self, q: int, pushed: Complexes) -> tuple[Floats, Floats, int]:
        """Slopes, residual and degrees of freedom of a channel, its response to pushes taken out."""
        inputs = range(pushed.shape[1])
        answer = [pushed[:, j, None] * self.memory for j in inputs]
        design = _real(np.concatenate([*answer, self.nuisance, self.delay[q]], axis=1))
        u, sizes, rows, length = _singular_values(design, _DEPENDENT)
        reading = _real(self.readings[:, q])
        freedom = len(reading) - len(sizes) - self.columns.shape[2]
        if freedom < 1:
            raise DataError(f"{len(reading)} equations for {len(sizes)} numbers of the base's response: {MORE}")
        response = (rows.T @ ((u.T @ reading) / sizes)) / length
        taps = self.memory.shape[1]
        gains = np.stack([self.memory @ response[j * taps : (j + 1) * taps] for j in inputs], axis=1)
        slope = _real(np.einsum("kj,kjp->kp", gains, self.columns))
        return slope - u @ (u.T @ slope), reading - u @ (u.T @ reading), freedom


def mean_covariance(short: Floats, long: Floats, by_short: Floats, by_long: Floats) -> Floats:
    """Of the mean of what two memories say of the same values (k,), (k, k), from what bands of noise move each by.

    ``by_short`` and ``by_long`` are (bands, k), of the same noise, independent from band to band: the noise of the mean
    is the sum of squares of its own, so that what both share counts once. Beyond that they differ because the shorter
    leaves out what rings on, where the longer is right, or because the longer explains noise, where the shorter is:
    two values as likely, half their distance a from the mean, of variance a^2. (Were the truth as likely anywhere
    between, it would be the a^2 / 3 of JCGM 100:2008, 4.3.7: it is not, see docs/trim.md.) Of a^2, noise alone explains
    k / chi^2, at most all, with chi^2 = a' N^-1 a, N the noise of a.
    """
    mean, apart = 0.5 * (by_short + by_long), 0.5 * (by_long - by_short)
    half = 0.5 * (long - short)
    chi_square = float(half @ np.linalg.pinv(apart.T @ apart) @ half)
    beyond = max(0.0, 1.0 - len(half) / chi_square) if chi_square > 0.0 else 0.0
    return np.asarray(mean.T @ mean + beyond * np.outer(half, half))


def _real(values: Complexes) -> Floats:
    return np.concatenate([values.real, values.imag])


def _block_diagonal(parts: Sequence[Complexes]) -> Complexes:
    from scipy.linalg import block_diag

    return np.asarray(block_diag(*parts))
