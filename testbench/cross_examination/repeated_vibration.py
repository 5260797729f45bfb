"""Axes and signs of accelerometers against those of a run's repeats, which needs no model of the base."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from balance.arrays import Floats

from .observation import Observation
from .statement import Statement

FOLLOWS = 0.9
"""Correlation of an axis, or of two together, from which one run shows what the other does."""
EXCHANGED = 0.35
"""Two axes are exchanged, or one reversed, where that leaves less than this share of what stays unexplained without."""
MOST_REPEATS = 5
"""With which a run is compared."""
DECIDED = 0.5
"""Of two runs the other runs say whose axes are wrong: their votes for the one must exceed those for the other by this
share of what exchanging, or reversing, changes in the comparison of the two. Below that, both are named."""


class _Vibration:
    """What the axes of an accelerometer show in one run, as spectra of ``size`` samples: none overlaps with itself."""

    def __init__(self, seen: Observation, values: Floats, size: int) -> None:
        from scipy.fft import rfft

        self.seen, self.condition, self.commanded, self.size = seen, seen.condition, seen.commanded, size
        self.spectra, self.power = rfft(values, size, axis=0).T, (values**2).sum(axis=0)

    def likeness(self, other: "_Vibration", axes: list[int]) -> tuple[float, float]:
        """Correlation of axes with those of another, as they are, and exchanged or one reversed, at best lag [-]."""
        from scipy.fft import irfft

        power = max(float(self.power[axes].sum() * other.power[axes].sum()) ** 0.5, 1e-300)
        one, turned = self.spectra[axes], other.spectra[axes].conj()
        sign = 1.0 if len(axes) > 1 else -1.0
        products = np.stack([(one * turned).sum(axis=0), sign * (one * turned[::-1]).sum(axis=0)])
        own, otherwise = irfft(products, self.size).max(axis=1)
        return float(own / power), float(otherwise / power)


def repeated_vibration(observations: Sequence[Observation]) -> list[Statement]:
    """Pairs of axes of an accelerometer that in one run show, each, what the other shows in a repeat, and single axes
    that show the opposite.

    Which of the two is wrong other runs of the motion tell, that show the same; else both are named.
    """
    from scipy.fft import next_fast_len

    found = []
    for channels in dict.fromkeys(channels for seen in observations for channels in seen.vibrations):
        shown = [(seen, seen.vibrations[channels]) for seen in observations if channels in seen.vibrations]
        size = next_fast_len(2 * max(len(values) for _, values in shown), real=True)
        having = [_Vibration(seen, values, size) for seen, values in shown]
        for pair in combinations(range(len(channels)), 2):
            found += _statements(channels, list(pair), having)
        known = {(one.run, one.channel) for one in found if one.code}
        signs = [one for axis in range(len(channels)) for one in _statements(channels, [axis], having) if one.code]
        found += [one for one in signs if (one.run, one.channel) not in known]
    return found


def _statements(channels: tuple[str, ...], chosen: list[int], having: Sequence[_Vibration]) -> list[Statement]:
    """Of two axes that may be exchanged, or of one that may be reversed."""
    same, exchanged = dict[str, str](), dict[str, set[str]]()
    for n, one in enumerate(having):
        repeats = [other for other in having[n + 1 :] if other.condition == one.condition]
        for other in repeats[:MOST_REPEATS]:
            own, crosswise = one.likeness(other, chosen)
            names = one.seen.name, other.seen.name
            if own > FOLLOWS and own > crosswise:
                same |= dict([names, names[::-1]])
            if not (crosswise > FOLLOWS and _remainder(crosswise) < EXCHANGED * _remainder(own)):
                continue
            ahead = _votes(one, having, chosen) - _votes(other, having, chosen)
            apart = DECIDED * (crosswise - own)
            for (name, beside), more in ((names, ahead), (names[::-1], -ahead)):
                if more < apart:
                    exchanged.setdefault(name, set()).add(beside)
    axes = [channels[i] for i in chosen]
    statements = []
    for seen in (one.seen for one in having):
        columns = [seen.records[name].column for name in axes if name in seen.records]
        if len(columns) < len(axes) or seen.name not in same | exchanged:
            continue
        others = tuple(sorted(exchanged.get(seen.name, ())))
        both = [name for name in others if seen.name in exchanged.get(name, ())]
        where, what = ", here or there" * bool(both), "axis" if len(axes) > 1 else "sign"
        if not others:
            witnessed = f"they show the same as in {same[seen.name]}"
        elif what == "axis":
            witnessed = f"axes exchanged{where}: each shows what the other shows in {others[0]}"
        else:
            witnessed = f"reversed{where}: it shows the opposite of what it shows in {others[0]}"
        stated = ", ".join(f"{name} is axis {one.component}" for name, one in zip(axes, columns, strict=True))
        code = f"{what}_contradiction" if others else None
        statements += [
            Statement(seen.name, what, channel, f"{stated} by the rig", witnessed, "its repeats", code, tuple(both))
            for channel in (axes if others else axes[:1])
        ]
    return statements


def _votes(one: _Vibration, having: Sequence[_Vibration], axes: list[int]) -> float:
    """By how much more runs of the same motion, that show the same, follow a run as it is than otherwise."""
    total = 0.0
    for other in having:
        if other is one or other.commanded != one.commanded:
            continue
        own, crosswise = one.likeness(other, axes)
        total += own - crosswise if max(own, crosswise) > FOLLOWS else 0.0
    return total


def _remainder(correlation: float) -> float:
    """Share that two signals of this correlation leave unexplained of each other: 0 of equal ones, 1 of unrelated ones.

    (1 - c^2) / (1 + c^2): what is left of both, scaled to each other, over the power of both.
    """
    return (1.0 - correlation**2) / (1.0 + correlation**2) if correlation > 0.0 else 1.0
