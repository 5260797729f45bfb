"""Axes of accelerometers against those of a run's repeats, which needs no model of the base."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from balance.arrays import Floats

from .observation import Observation
from .statement import Statement

FOLLOWS = 0.9
"""Correlation of two axes together from which one run shows what the other does."""
EXCHANGED = 0.35
"""Two axes are exchanged where exchanging them leaves less than this share of what stays unexplained without."""
MOST_REPEATS = 5
"""With which a run is compared."""
DECIDED = 0.5
"""Of two runs the other runs say whose axes are exchanged: their votes for the one must exceed those for the other by
this share of what exchanging changes in the comparison of the two. Below that, both are named."""


class _Vibration:
    """What the axes of an accelerometer show in one run, as spectra of ``size`` samples: none overlaps with itself."""

    def __init__(self, seen: Observation, values: Floats, size: int) -> None:
        from scipy.fft import rfft

        self.seen, self.condition, self.commanded, self.size = seen, seen.condition, seen.commanded, size
        self.spectra, self.power = rfft(values, size, axis=0).T, (values**2).sum(axis=0)

    def likeness(self, other: "_Vibration", pair: tuple[int, int]) -> tuple[float, float]:
        """Correlation of two axes together with those of another, as they are and exchanged, at its best lag [-]."""
        from scipy.fft import irfft

        power = max(float(self.power[list(pair)].sum() * other.power[list(pair)].sum()) ** 0.5, 1e-300)
        one, turned = self.spectra[list(pair)], other.spectra[list(pair)].conj()
        products = np.stack([(one * turned).sum(axis=0), (one * turned[::-1]).sum(axis=0)])
        own, crosswise = irfft(products, self.size).max(axis=1)
        return float(own / power), float(crosswise / power)


def repeated_vibration(observations: Sequence[Observation]) -> list[Statement]:
    """Pairs of axes of an accelerometer that in one run show, each, what the other shows in a repeat.

    Which of the two is wrong other runs of the motion tell, that show the same; else both are named.
    """
    from scipy.fft import next_fast_len

    found = []
    for channels in dict.fromkeys(channels for seen in observations for channels in seen.vibrations):
        shown = [(seen, seen.vibrations[channels]) for seen in observations if channels in seen.vibrations]
        size = next_fast_len(2 * max(len(values) for _, values in shown), real=True)
        having = [_Vibration(seen, values, size) for seen, values in shown]
        for pair in combinations(range(len(channels)), 2):
            found += _pair_statements(channels, pair, having)
    return found


def _pair_statements(channels: tuple[str, ...], pair: tuple[int, int], having: Sequence[_Vibration]) -> list[Statement]:
    same, exchanged = dict[str, str](), dict[str, set[str]]()
    for n, one in enumerate(having):
        repeats = [other for other in having[n + 1 :] if other.condition == one.condition]
        for other in repeats[:MOST_REPEATS]:
            own, crosswise = one.likeness(other, pair)
            names = one.seen.name, other.seen.name
            if own > FOLLOWS and own > crosswise:
                same |= dict([names, names[::-1]])
            if not (crosswise > FOLLOWS and _remainder(crosswise) < EXCHANGED * _remainder(own)):
                continue
            ahead = _votes(one, having, pair) - _votes(other, having, pair)
            apart = DECIDED * (crosswise - own)
            for (name, beside), more in ((names, ahead), (names[::-1], -ahead)):
                if more < apart:
                    exchanged.setdefault(name, set()).add(beside)
    axes = [channels[i] for i in pair]
    statements = []
    for seen in (one.seen for one in having):
        columns = [seen.records[name].column for name in axes if name in seen.records]
        if len(columns) < 2 or seen.name not in same | exchanged:
            continue
        others = tuple(sorted(exchanged.get(seen.name, ())))
        both = [name for name in others if seen.name in exchanged.get(name, ())]
        witnessed = (
            f"axes exchanged{', here or there' if both else ''}: each shows what the other shows in {others[0]}"
            if others
            else f"they show the same as in {same[seen.name]}"
        )
        statements += [
            Statement(seen.name, "axis", channel, f"{axes[0]} is axis {columns[0].component}, {axes[1]} axis "
                      f"{columns[1].component} by the rig", witnessed, "its repeats",
                      "axis_contradiction" if others else None, tuple(both))
            for channel in (axes if others else axes[:1])
        ]  # fmt: skip
    return statements


def _votes(one: _Vibration, having: Sequence[_Vibration], pair: tuple[int, int]) -> float:
    """By how much more runs of the same motion, that show the same, follow a run as it is than with axes exchanged."""
    total = 0.0
    for other in having:
        if other is one or other.commanded != one.commanded:
            continue
        own, crosswise = one.likeness(other, pair)
        total += own - crosswise if max(own, crosswise) > FOLLOWS else 0.0
    return total


def _remainder(correlation: float) -> float:
    """Share that two signals of this correlation leave unexplained of each other: 0 of equal ones, 1 of unrelated ones.

    (1 - c^2) / (1 + c^2): what is left of both, scaled to each other, over the power of both.
    """
    return (1.0 - correlation**2) / (1.0 + correlation**2) if correlation > 0.0 else 1.0
