"""Each encoder's speed against the stored motion, or the runs of the same motion: its sign and its unit."""

from collections.abc import Sequence

import numpy as np

from balance.arrays import Floats

from .observation import Observation
from .statement import Statement

SAME_PATH = 0.95
"""Correlation, of either sign, from which an encoder shows the same path as what it is compared with."""
UNIT_SHARE = 0.1
"""Share by which the factor between two paths may differ from that of two units."""
DEGREES = 180.0 / np.pi
LEAST_SHARE = 0.05
"""Of the fastest joint's speed, below which a joint is not compared."""
LEAST_POWER = 1e-6
"""Of the wanted path's power, below which an encoder shows nothing of it: one in radians for degrees shows 3e-4."""


def encoder_paths(observations: Sequence[Observation]) -> list[Statement]:
    """Encoders that are reversed, or in another unit than the rig's, by the stored motion, else by most other runs.

    What is made of the encoders is the whole run's, and so is the statement.
    """
    found = []
    for seen in observations:
        if not seen.encoder_speeds.size:
            continue
        others = [o for o in observations if o is not seen and o.encoder_speeds.size and o.commanded == seen.commanded]
        by_motion = _errors(seen, seen.commanded_speeds)
        by_runs = [_errors(seen, dict(zip(o.encoders, o.encoder_speeds.T, strict=True))) for o in others]
        for channel in seen.encoders:
            votes = [one[channel] for one in by_runs if channel in one]
            if channel in by_motion:
                wrong, witness = by_motion[channel], "the motion that is stored with the run"
            elif len(votes) > 1:
                wrong, witness = max(set(votes), key=votes.count), "the other runs of this motion"
                wrong = wrong if 2 * votes.count(wrong) > len(votes) else ""
            else:
                continue
            code = "encoder_contradiction" if wrong else None
            stated = f"sign and unit of {channel} as in the rig"
            found.append(Statement(seen.name, "axis", None, stated, wrong or "they agree", witness, code))
    return found


def _errors(seen: Observation, wanted: dict[str, Floats]) -> dict[str, str]:
    """By channel, what is wrong with an encoder that shows a path of ``wanted`` (n,) by channel; empty if nothing."""
    names = [name for name in seen.encoders if name in wanted]
    if not names:
        return {}
    shown = np.column_stack([seen.encoder_speeds[:, seen.encoders.index(name)] for name in names])
    correlation, gain = _compared(shown, np.column_stack([wanted[name] for name in names]))
    found = {}
    for name, likeness, factor in zip(names, correlation, gain, strict=True):
        if abs(likeness) < SAME_PATH:
            continue
        unit = ""
        for ratio, text in ((DEGREES, "the log is in deg where the rig says rad"),
                            (1.0 / DEGREES, "the log is in rad where the rig says deg")):  # fmt: skip
            if abs(abs(factor) / ratio - 1.0) < UNIT_SHARE:
                unit = f"{abs(factor):.3g} times as far: {text}"
        found[name] = "; ".join(text for text in ("reversed" if likeness < 0.0 else "", unit) if text)
    return found


def _compared(shown: Floats, wanted: Floats) -> tuple[Floats, Floats]:
    """Correlation and factor of each path of ``shown`` (n, k) with that of ``wanted`` (m, k), where they fit best.

    All are taken at one lag, at which the squares of the correlations are largest: signs and units do not matter.
    """
    from scipy.signal import correlate

    count = len(wanted)
    wanted, shown = wanted.astype(float), np.pad(shown.astype(float), ((count, count), (0, 0)))
    power = np.cumsum(np.pad(shown**2, ((1, 0), (0, 0))), axis=0)
    own, energy = (wanted**2).sum(axis=0), power[count:] - power[:-count]
    products = np.column_stack([correlate(a, b, "valid", "fft") for a, b in zip(shown.T, wanted.T, strict=True)])
    least = LEAST_SHARE**2 * energy.max(axis=0)
    correlation = products / np.sqrt(np.maximum(np.maximum(energy, least) * own, 1e-300))
    correlation[:, (own < LEAST_SHARE**2 * own.max()) | (energy.max(axis=0) < LEAST_POWER * own)] = 0.0
    best = int(np.argmax((correlation**2).sum(axis=1)))
    return correlation[best], products[best] / np.maximum(own, 1e-300)
