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
"""Remainder with two axes exchanged over that without from which they are exchanged."""
MOST_REPEATS = 5
"""With which a run is compared."""
DECIDED = 0.5
"""Of what one comparison shows, by which all of one run must differ from those of its repeat to tell whose axes are
exchanged."""


def repeated_vibration(observations: Sequence[Observation]) -> list[Statement]:
    """Pairs of axes of an accelerometer that in one run show, each, what the other shows in a repeat.

    Which of the two is wrong other runs of the motion tell, that show the same; else both are named.
    """
    found = []
    for channels in dict.fromkeys(channels for seen in observations for channels in seen.vibrations):
        having = [seen for seen in observations if channels in seen.vibrations]
        for pair in combinations(range(len(channels)), 2):
            found += _pair_statements(channels, pair, having)
    return found


def _pair_statements(
    channels: tuple[str, ...], pair: tuple[int, int], having: Sequence[Observation]
) -> list[Statement]:
    same, exchanged = dict[str, str](), dict[str, set[str]]()
    for n, seen in enumerate(having):
        repeats = [o for o in having[n + 1 :] if o.condition == seen.condition]
        for other in repeats[:MOST_REPEATS]:
            own, crosswise = _likeness(seen, other, channels, pair)
            if own > FOLLOWS and own > crosswise:
                same |= {seen.name: other.name, other.name: seen.name}
            if not (crosswise > FOLLOWS and _remainder(crosswise) < EXCHANGED * _remainder(own)):
                continue
            votes = [_votes(one, having, channels, pair) for one in (seen, other)]
            apart = DECIDED * (crosswise - own)
            for one, beside, ahead in ((seen, other, votes[0] - votes[1]), (other, seen, votes[1] - votes[0])):
                if ahead < apart:
                    exchanged.setdefault(one.name, set()).add(beside.name)
    names = [channels[i] for i in pair]
    statements = []
    for seen in having:
        columns = [seen.records[name].column for name in names if name in seen.records]
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
            Statement(seen.name, "axis", channel, f"{names[0]} is axis {columns[0].component}, {names[1]} axis "
                      f"{columns[1].component} by the rig", witnessed, "its repeats",
                      "axis_contradiction" if others else None, tuple(both))
            for channel in (names if others else names[:1])
        ]  # fmt: skip
    return statements


def _votes(seen: Observation, having: Sequence[Observation], channels: tuple[str, ...], pair: tuple[int, int]) -> float:
    """By how much more runs of the same motion, that show the same, follow a run as it is than with axes exchanged."""
    total = 0.0
    for other in having:
        if other is seen or other.commanded != seen.commanded:
            continue
        own, crosswise = _likeness(seen, other, channels, pair)
        total += own - crosswise if max(own, crosswise) > FOLLOWS else 0.0
    return total


def _likeness(
    seen: Observation, other: Observation, channels: tuple[str, ...], pair: tuple[int, int]
) -> tuple[float, float]:
    """Correlation of two axes together, as they are and exchanged, each at the lag at which it is largest [-]."""
    a, b = seen.vibrations[channels][:, pair], other.vibrations[channels][:, pair]
    return _largest(a, b), _largest(a, b[:, ::-1])


def _largest(a: Floats, b: Floats) -> float:
    from scipy.signal import correlate

    power = float(np.linalg.norm(a)) * float(np.linalg.norm(b))
    total = sum(correlate(x, y, method="fft") for x, y in zip(a.T, b.T, strict=True))
    return float(np.max(total)) / power if power > 0.0 else 0.0


def _remainder(correlation: float) -> float:
    """What is left, over the power of both: 0 nothing, 1 all."""
    return (1.0 - correlation**2) / (1.0 + correlation**2) if correlation > 0.0 else 1.0
