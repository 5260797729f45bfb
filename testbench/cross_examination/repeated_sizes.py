"""Sizes of an accelerometer's channels in a run against those in its repeats: a gain that changed needs no model."""

from collections.abc import Collection, Sequence

import numpy as np

from balance.arrays import Floats, Mask
from balance.estimation.estimate import student_quantile

from .observation import Observation
from .statement import Statement

FALSE_ALARMS = 0.01
"""Rate at which something is said of an honest campaign by one kind of comparison, where errors are normal."""

FOLLOWS = 0.9
"""Correlation of a channel with a repeat, at best lag, from which their sizes are compared: a knock or a floor that
shakes in one of them is no gain."""
LEAST_CHANGE = 0.1
"""Of a size, from which another gain is named: repeats of one command may differ by some per cent."""
FEWEST = 5
"""Runs beside a repeat of which one may be told from the others."""


def repeated_sizes(
    observations: Sequence[Observation], wrong: Collection[tuple[str, str | None]] = ()
) -> list[Statement]:
    """Channels that are larger or smaller in one run than in its repeats, by more than repeats of the campaign scatter.

    RMS below BAND_HZ. Of two repeats both are named. A run and channel that is known to be ``wrong`` is left out.
    """
    found = []
    for channels in dict.fromkeys(channels for seen in observations for channels in seen.vibrations):
        for i, channel in enumerate(channels):
            shown = [o for o in observations if channels in o.vibrations and (o.name, channel) not in wrong]
            shown = [o for o in shown if not (o.records[channel].clipped or o.records[channel].dead)]
            rate = FALSE_ALARMS / len(channels)
            found += _statements(channel, {o.name: o.vibrations[channels][:, i] for o in shown}, shown, rate)
    return found


def _statements(
    channel: str, values: dict[str, np.ndarray], shown: Sequence[Observation], rate: float
) -> list[Statement]:
    entries, groups = list[tuple[float, str, list[str]]](), list[list[Observation]]()
    for seen in shown:
        same = next((group for group in groups if group[0].condition == seen.condition), None)
        groups.append([seen]) if same is None else same.append(seen)
    for group in groups:
        names = [o.name for o in group]
        alike = [a for a in names if any(_follow(values[a], values[b]) for b in names if b != a)]
        sizes = np.log([max(float(np.std(values[name])), 1e-300) for name in alike])
        for name, own in zip(alike, sizes, strict=True):
            others = [other for other in alike if other != name]
            # The middle one of its repeats shows no scatter; of two each is half of their difference away from it.
            if (apart := float(own - np.median(sizes)) * (2.0**0.5 if len(alike) == 2 else 1.0)) != 0.0:
                entries.append((apart, name, others))
    if len(entries) < FEWEST:
        return []
    odd = outlying(np.array([apart for apart, *_ in entries]), rate)
    found = []
    for is_odd, (apart, name, others) in zip(odd, entries, strict=True):
        factor = float(np.exp(apart * (2.0**0.5 if len(others) == 1 else 1.0)))
        both = tuple(others) if len(others) == 1 else ()
        wrong = bool(is_odd) and abs(np.log(factor)) > np.log(1.0 + LEAST_CHANGE)
        stated, witness = f"as large as in {' and '.join(others[:3])}", "its repeats"
        witnessed = f"{factor:.3g} times as large{', here or there' * bool(both)}"
        code = "gain_contradiction" if wrong else None
        found.append(Statement(name, "gain", channel, stated, witnessed, witness, code, both))
    return found


def _follow(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two records of a channel correlate, at best lag and of either sign."""
    from scipy.signal import correlate

    one, other = one - one.mean(), other - other.mean()
    power = float(np.linalg.norm(one) * np.linalg.norm(other))
    return bool(power > 0.0 and np.abs(correlate(one, other, method="fft")).max() > FOLLOWS * power)


def outlying(values: Floats, rate: float) -> Mask:
    """Of values (n,) [any unit], normally distributed but for fewer than half: which are of no such sample, (n,).

    Generalized extreme Studentized deviate, ``rate`` that of a false alarm in all n: Rosner, B., Percentage points for
    a generalized ESD many-outlier procedure, Technometrics 25 (1983), 165-172, the rate shared by its
    steps: below 15 values they add up. Of fewer than three none is.
    """
    kept, order, found = np.ones(len(values), dtype=bool), list[int](), 0
    steps = (len(values) - 1) // 2
    for _ in range(steps):
        apart, left = np.abs(values - values[kept].mean()), int(kept.sum())
        t = student_quantile(1.0 - rate / (2.0 * left * steps), left - 2.0)
        limit = (left - 1.0) * t / np.sqrt((left - 2.0 + t * t) * left)
        order.append(worst := int(np.argmax(np.where(kept, apart, -1.0))))
        found = len(order) if apart[worst] > limit * values[kept].std(ddof=1) else found
        kept[worst] = False
    mask = np.zeros(len(values), dtype=bool)
    mask[order[:found]] = True
    return mask
