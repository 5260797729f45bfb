"""Axes and signs of accelerometers against those of a run's repeats, which needs no model of the base."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations

import numpy as np

from balance.arrays import Floats
from balance.results import first_of

from .mounting import Signs, exchanged_axes, exchanges, signs_of
from .observation import Observation
from .statement import Statement

FOLLOWS = 0.9
"""Correlation of an axis, or of two together, from which one run shows what the other does."""
EXCHANGED = 0.35
"""Axes are exchanged, or one reversed, where that leaves less than this share of what stays unexplained without; those
that are also reversed where all else, such as two that are reversed and not exchanged, leaves more."""
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

    def likeness(self, other: "_Vibration", axes: list[int]) -> "_Likeness":
        """Axes compared with those of another run, at best lag: as they are, and exchanged or one reversed."""
        from scipy.fft import irfft

        power = max(float(self.power[axes].sum() * other.power[axes].sum()) ** 0.5, 1e-300)
        lags = irfft(self.spectra[axes][:, None] * other.spectra[axes].conj()[None, :], self.size)

        def best(order: Sequence[int], signs: Signs) -> float:
            each = (sign * lags[n, k] for n, (k, sign) in enumerate(zip(order, signs, strict=True)))
            return float(sum(each).max()) / power

        same, every = tuple(range(len(axes))), signs_of(len(axes))
        own = best(same, every[0])
        if len(axes) == 1:
            return _Likeness(own, best(same, every[1]), same, every[1])
        plain, order = max((best(order, every[0]), order) for order in exchanges(len(axes)))
        turned, turn, signs = max((best(o, s), o, s) for o in exchanges(len(axes)) for s in every)
        stay = [o for o in permutations(same) if o not in exchanges(len(axes))]
        without = max(best(o, s) for o in stay for s in every)
        if not _remainder(turned) < EXCHANGED * _remainder(max(without, plain if len(axes) == 2 else 0.0)):
            return _Likeness(own, plain, order, every[0], is_told=len(axes) == 2)
        flipped = (best(turn, (*signs[:n], -signs[n], *signs[n + 1 :])) for n in same)
        told = [_remainder(turned) < EXCHANGED * _remainder(one) for one in flipped]
        return _Likeness(own, turned, turn, tuple(np.multiply(signs, told).tolist()))


@dataclass(frozen=True)
class _Likeness:
    """Correlations of axes with those of another run [-]."""

    own: float
    otherwise: float
    """Exchanged, or reversed."""
    order: tuple[int, ...]
    """Of the axes exchanged: the axis of the other run that each shows."""
    signs: Signs
    """Of each in that; 0 where that is not told."""
    is_told: bool = True
    """Whether exchanging fewer axes would explain less."""

    @property
    def inverse(self) -> tuple[tuple[int, ...], Signs]:
        """Order and signs seen from the other run."""
        order = tuple(self.order.index(n) for n in range(len(self.order)))
        return order, tuple(self.signs[n] for n in order)


def repeated_vibration(
    observations: Sequence[Observation], wrong: Collection[tuple[str, str | None]] = ()
) -> list[Statement]:
    """Axes of an accelerometer that in one run show, each, what another shows in a repeat, or its opposite, as those of
    a sensor do that was turned; and single axes that show the opposite.

    Which of the two is wrong other runs of the motion tell, that show the same; else both are named, and all where it
    changed from a run on. A run and channel that is known to be ``wrong`` is no witness.
    """
    from scipy.fft import next_fast_len

    found = []
    for channels in dict.fromkeys(channels for seen in observations for channels in seen.vibrations):
        shown = [(seen, seen.vibrations[channels]) for seen in observations if channels in seen.vibrations]
        size = next_fast_len(2 * max(len(values) for _, values in shown), real=True)
        having = [_Vibration(seen, values, size) for seen, values in shown]
        told = dict[int, list[Statement]]()
        for count in range(min(len(channels), 3), 0, -1):
            known = {(one.run, one.channel) for of_more in told.values() for one in of_more if one.code}
            about = list[Statement]()
            for chosen in combinations(range(len(channels)), count):
                sure = [one for one in having if not any((one.seen.name, channels[i]) in wrong for i in chosen)]
                about += _statements(channels, list(chosen), sure)
            told[count] = [one for one in about if (one.code or count == 2) and (one.run, one.channel) not in known]
        found += [one for of_as_many in told.values() for one in of_as_many]
    return found


def _statements(channels: tuple[str, ...], chosen: list[int], having: Sequence[_Vibration]) -> list[Statement]:
    """Of two or three axes that may be exchanged, or of one that may be reversed."""
    same, exchanged = dict[str, str](), dict[str, dict[str, str]]()
    axes, what = [channels[i] for i in chosen], "axis" if len(chosen) > 1 else "sign"
    runs, alike, unlike = [one.seen.name for one in having], set[tuple[int, int]](), set[tuple[int, int]]()
    for n, one in enumerate(having):
        repeats = [k for k in range(n + 1, len(having)) if having[k].condition == one.condition]
        for k in repeats[:MOST_REPEATS]:
            found = one.likeness(other := having[k], chosen)
            own, crosswise = found.own, found.otherwise
            names = runs[n], runs[k]
            if own > FOLLOWS and own > crosswise:
                same |= dict([names, names[::-1]])
                alike.add((n, k))
            if not (found.is_told and crosswise > FOLLOWS and _remainder(crosswise) < EXCHANGED * _remainder(own)):
                continue
            unlike.add((n, k))
            ahead = _votes(one, having, chosen) - _votes(other, having, chosen)
            apart = DECIDED * (crosswise - own)
            seen_from = ((names, ahead, (found.order, found.signs)), (names[::-1], -ahead, found.inverse))
            for (name, beside), more, how in seen_from:
                if more < apart:
                    exchanged.setdefault(name, {})[beside] = exchanged_axes(axes, *how, "shows", "shows")
    statements = _change(what, axes, runs, alike, unlike)
    known = {s.run for s in statements}
    for seen in (one.seen for one in having):
        columns = [seen.records[name].column for name in axes if name in seen.records]
        if len(columns) < len(axes) or seen.name in known or seen.name not in same | exchanged:
            continue
        others = tuple(sorted(exchanged.get(seen.name, ())))
        both = [name for name in others if seen.name in exchanged.get(name, ())]
        where = ", here or there" * bool(both)
        if not others:
            witnessed = f"they show the same as in {same[seen.name]}"
        elif what == "axis":
            witnessed = f"axes exchanged{where}: {exchanged[seen.name][others[0]]} in {others[0]}"
        else:
            witnessed = f"reversed{where}: it shows the opposite of what it shows in {others[0]}"
        stated = ", ".join(f"{name} is axis {one.component}" for name, one in zip(axes, columns, strict=True))
        code = f"{what}_contradiction" if others else None
        statements += [
            Statement(seen.name, what, channel, f"{stated} by the rig", witnessed, "its repeats", code, tuple(both))
            for channel in (axes if others else axes[:1])
        ]
    return statements


def _change(
    what: str, axes: Sequence[str], runs: Sequence[str], alike: set[tuple[int, int]], unlike: set[tuple[int, int]]
) -> list[Statement]:
    """Statements on all runs where those from one on show otherwise than those before, two or more on each side.

    The larger side need not be the right one: a sensor may be mounted wrong for most of a campaign.
    """
    last, first = max((n for n, _ in unlike), default=0), min((k for _, k in unlike), default=0)
    differing = {n for pair in unlike for n in pair}
    shown = sorted(differing | {n for pair in alike if differing & {*pair} for n in pair})
    sides = [[runs[n] for n in shown if n <= last], [runs[n] for n in shown if n >= first]]
    if last >= first or min(map(len, sides)) < 2 or any(n <= last and k >= first for n, k in alike):
        return []
    between, either = f"{runs[last]} and {runs[first]}", " or ".join(first_of(s, 6) for s in sorted(sides, key=len))
    how = "exchange their axes" if what == "axis" else "changes its sign"
    one = "has them exchanged" if what == "axis" else "is inverted"
    witnessed = f"{', '.join(axes)} {how} between {between}: one side {one}, {either}"
    return [
        Statement(run, what, channel, "as in the rig", witnessed, "its repeats", f"{what}_contradiction", tuple(other),
                  changed=between)
        for side, other in (sides, sides[::-1]) for run in side for channel in axes
    ]  # fmt: skip


def _votes(one: _Vibration, having: Sequence[_Vibration], axes: list[int]) -> float:
    """By how much more runs of the same motion, that show the same, follow a run as it is than otherwise."""
    total = 0.0
    for other in having:
        if other is one or other.commanded != one.commanded:
            continue
        found = one.likeness(other, axes)
        total += found.own - found.otherwise if max(found.own, found.otherwise) > FOLLOWS else 0.0
    return total


def _remainder(correlation: float) -> float:
    """Share that two signals of this correlation leave unexplained of each other: 0 of equal ones, 1 of unrelated ones.

    (1 - c^2) / (1 + c^2): what is left of both, scaled to each other, over the power of both.
    """
    return (1.0 - correlation**2) / (1.0 + correlation**2) if correlation > 0.0 else 1.0
