"""How sure the mean is of what two lengths of a base's memory say of the same values (see ``balance.trials``)."""

import numpy as np

from .arrays import Floats


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
