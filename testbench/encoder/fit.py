"""Least squares of time over angle: rows, how many harmonics a record supports, which turns are steady."""

import numpy as np

from balance.arrays import Floats, Indices

from ..errors import AnalysisError
from .edges import Edges


def time_rows(phi: Floats, harmonics: int) -> Floats:
    """Rows that take t0 and the coefficients to instants, (n, 2 harmonics + 2)."""
    h = np.arange(1, harmonics + 1)
    waves = np.stack([np.cos(np.outer(phi, h)), np.sin(np.outer(phi, h))], axis=2)
    line = np.stack([np.ones_like(phi), phi / (2.0 * np.pi)], axis=1)
    return np.hstack([line, waves.reshape(len(phi), 2 * harmonics)])


def fit(edges: Edges, harmonics: int) -> tuple[Floats, Floats]:
    """t0 and the coefficients (2 harmonics + 2,), and what is left over (n,) [s]."""
    rows = time_rows(edges.angle, harmonics)
    start = edges.time[0]
    solved = np.linalg.lstsq(rows, edges.time - start, rcond=None)[0]
    residual = edges.time - start - rows @ solved
    solved[0] += start
    return solved, residual


def supported(edges: Edges, most: int) -> int:
    """Harmonics that the record supports: least n log(RSS / n) + k log n, RSS of the turn averaged over turns.

    Averaged, what repeats in every turn and is no low harmonic (errors of the disc) counts as noise, once.
    """
    count = edges.disc.whole or int(edges.disc.per_turn)
    most = max(1, min(most, (count - 3) // 2))
    solved, residual = fit(edges, most)
    power = 0.5 * (solved[2::2] ** 2 + solved[3::2] ** 2)
    rest = float(np.mean(_average_turn(edges, residual, count) ** 2))
    left = rest + np.array([power[h:].sum() for h in range(most + 1)]) + 1e-40
    cost = count * np.log(left) + (2 * np.arange(most + 1) + 2) * np.log(count)
    return max(1, int(np.argmin(cost)))


def _average_turn(edges: Edges, values: Floats, count: int) -> Floats:
    """Values at edges averaged over the turns, by place in the turn, places without an edge left out."""
    place = np.rint(edges.angle / (2.0 * np.pi) * count).astype(int) % count
    have = np.bincount(place, minlength=count)
    mean: Floats = (np.bincount(place, values, count) / np.maximum(have, 1))[have > 0]
    return mean


def by_place(edges: Edges, residual: Floats, sought: int, turns: int) -> tuple[float, float] | None:
    """Standard deviation of what repeats every turn, and of what does not [s]; None where nothing can repeat."""
    whole = edges.disc.whole
    if whole is None or turns < 2:
        return None
    slot = edges.pulse % whole
    have = np.bincount(slot, minlength=whole)
    mean = np.bincount(slot, residual, whole) / np.maximum(have, 1)
    used = int((have > 0).sum())
    apart = float(((residual - mean[slot]) ** 2).sum() / max(len(slot) - used, 1))
    return float(np.sqrt((mean**2).sum() / max(used - sought, 1))), float(np.sqrt(apart))


def covariance(edges: Edges, rows: Floats, residual: Floats, places: tuple[float, float] | None) -> Floats:
    """Of t0 and the coefficients, from jitter of each instant and from what repeats in each place of the turn [s2].

    A place's error is one error for all turns: what the solution takes from its instants is summed before squaring.
    """
    inverse = np.linalg.inv(rows.T @ rows)
    whole = edges.disc.whole
    if places is None or whole is None:
        found: Floats = float((residual**2).sum() / max(len(residual) - rows.shape[1], 1)) * inverse
        return found
    pattern, jitter = places
    turns = len(residual) / whole
    taken = inverse @ rows.T
    summed = np.stack([np.bincount(edges.pulse % whole, row, whole) for row in taken])
    repeated = max(0.0, pattern**2 - jitter**2 / turns)
    both: Floats = jitter**2 * inverse + repeated * (summed @ summed.T)
    return both


def steady_turns(edges: Edges, within: float) -> tuple[int, int, int]:
    """First steady turn, the one after the last, and how many whole turns the log has."""
    whole = int(np.floor(edges.angle[-1] / (2.0 * np.pi) + 1e-9))
    if whole < 2:
        raise AnalysisError(
            f"{edges.name}: {edges.angle[-1] / (2 * np.pi):.2f} turns of the crank; expected two or more"
        )
    ends = np.interp(2.0 * np.pi * np.arange(whole + 1), edges.angle, edges.time)
    duration = np.diff(ends)
    usual = float(np.median(duration[whole // 2 :]))
    steady = np.abs(duration - usual) <= within * usual
    first, last = _longest_run(steady)
    if last - first < 2:
        spread = 100.0 * np.ptp(duration[whole // 2 :]) / usual
        raise AnalysisError(
            f"{edges.name}: no two turns in a row are steady: the later ones differ by {spread:.2g} % in duration; "
            f"allow more with --steady-within, or look at the speed edge by edge"
        )
    return first, last, whole


def _longest_run(flags: Indices) -> tuple[int, int]:
    """Begin and end of the longest run of True; the later of equals."""
    best, begin = (0, 0), 0
    for k, flag in enumerate([*flags, False]):
        if not flag:
            best = (begin, k) if k - begin >= best[1] - best[0] else best
            begin = k + 1
    return best
