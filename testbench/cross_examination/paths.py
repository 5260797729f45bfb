"""Paths of a run beside the stored motion and the other runs: encoders' signs and units, records that are cut.

Speeds of encoders, or vibrations of repeats, are laid over each other at the lag at which they fit best.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from balance.arrays import Floats, Mask

from .observation import SPEED_RATE_HZ, VIBRATION_RATE_HZ, VIBRATION_S, Observation
from .statement import UNIT_SHARE, Statement

SAME_PATH = 0.95
"""Correlation, of either sign, from which an encoder shows the same path as what it is compared with."""
OTHER_PATH = 0.7
"""Correlation below which an encoder shows another motion than the stored one."""
_UP = {("deg", "rad"): 180.0 / np.pi, ("mm", "m"): 1000.0, ("mm", "in"): 25.4}
UNITS = _UP | {pair[::-1]: 1.0 / far for pair, far in _UP.items()}
"""Times as far that an encoder shows whose log is in the first unit and whose rig states the second."""
_SCALED = "{0:.3g} times as far, unlike {1}: another scale or unit of this encoder"
SAYS = {
    "same": ("encoder", "they agree"),
    "unit": ("encoder unit", "{0:.3g} times as far: the log is in {1}"),
    "scaled": ("encoder scale", _SCALED),
    "either": ("encoder scale", f"{_SCALED}, or the motion of the run table is another: no run of it agrees"),
    "exchanged": ("encoder joint", "the path of another joint: that of {1}, exchanged in the rig or the log"),
    "farther": ("motion", "the path of another motion: {:.3g} times as far"),
    "unlike": ("motion", "the path of another motion or joint: correlation of the speeds {:.2f} at best"),
}
"""By kind, the subject, and what an encoder says beside what it is compared with."""
OF_THE_MOTION = ("farther", "unlike")
"""Kinds that contradict a stored motion; of the other runs nothing is known that states it."""
LEAST_SHARE = 0.05
"""Of the fastest joint's speed, below which a joint is not compared, nor an encoder where it is slower than its own."""
LEAST_POWER = 5e-7
"""Of the wanted path's power, below which an encoder shows nothing of it: one in m for mm shows 1e-6."""
FOLLOWS = {"motion": 0.95, "vibration": 0.9}
"""Correlation with a part of the other record from which a record is that part: of speeds, of vibrations."""
MOVES = {"motion": 0.05, "vibration": 0.15}
"""Share of the largest value above which a joint moves, or a base vibrates."""
LEAST_S = 0.05
"""Least time that a record lacks, twice what its lag is known to [s]."""
SEEN_S = {"motion": LEAST_S, "vibration": 0.2}
"""First or last part of a record that shows whether it is at rest there: longer than a period of vibration [s]."""
REPEATS, REPEATED_SHARE, LEFT = 2, 0.25, 0.1
"""A motion repeats where its last quarter stood there twice before, but for a tenth of its power: where a record of a
period of it, or more, begins or ends does not matter."""


def encoder_paths(observations: Sequence[Observation]) -> list[Statement]:
    """Encoders that are reversed, or in another unit than the rig's, by the stored motion, else by most other runs.

    One of another scale in all runs of a stored motion may be right, and the motion another.
    """
    found = []
    moving = [o for o in observations if o.encoder_speeds.size]
    by_motion = {o.name: _compared(o, o.commanded_speeds) for o in moving}
    for seen in moving:
        others = [o for o in moving if o is not seen and o.commanded == seen.commanded]
        by_runs = [_compared(seen, dict(zip(o.encoders, o.encoder_speeds.T, strict=True))) for o in others]
        for channel in seen.encoders:
            votes = [one[channel] for one in by_runs if channel in one]
            stored = by_motion[seen.name].get(channel)
            said = stored or (_most(votes) if len(votes) > 1 else None)
            if said is None:
                continue
            kinds = {by_motion[o.name][channel].kind for o in (seen, *others) if channel in by_motion[o.name]}
            if said is stored and kinds == {"scaled"}:
                said = said._replace(kind="either")
            subject = SAYS[said.kind][0] if said.value > 0.0 else "encoder sign"
            code = {"encoder": None, "motion": "motion_contradiction"}.get(subject, "encoder_contradiction")
            stated = f"path, sign and unit of {channel} as in the rig"
            if subject == "motion":
                stated = f"{channel} follows the motion of the run table"
            witness = f"the {'motion that is stored with the run' if stored else 'other runs of this motion'}"
            found.append(Statement(seen.name, subject, channel, stated, str(said), witness, code))
    return found


class PathShown(NamedTuple):
    """An encoder's path beside the one that it is compared with."""

    kind: str
    """A key of SAYS."""
    joint: str
    """Whose path it shows instead; of one that is scaled, those that are not; of a unit, both; else empty."""
    value: float
    """How many times as far it goes, below zero if reversed; where it is unlike, the size of the correlation [-]."""

    def __str__(self) -> str:
        text = SAYS[self.kind][1].format(abs(self.value), self.joint)
        return text if self.value > 0.0 else "reversed" if self.kind == "same" else f"reversed; {text}"


def _most(votes: Sequence[PathShown]) -> PathShown | None:
    """What most runs say, by the median factor, the own being one that agrees; None where that is nothing, or says
    nothing of encoders.
    """
    votes = sorted([*votes, PathShown("same", "", 1.0)], key=lambda one: one.value)
    alike = [(one.kind, one.joint * (one.kind != "scaled"), one.value > 0.0) for one in votes]
    most = max(alike, key=alike.count)
    saying = [one for one, what in zip(votes, alike, strict=True) if what == most]
    sure = 2 * len(saying) > len(votes) and most[0] not in OF_THE_MOTION
    return saying[0]._replace(value=float(np.median([one.value for one in saying]))) if sure else None


def _compared(seen: Observation, wanted: dict[str, Floats]) -> dict[str, PathShown]:
    """Encoders, by channel, beside the paths ``wanted`` (n,) by channel; what may be either is left out.

    All are compared at one lag, at which the squares of the correlations are largest: signs and units do not matter.
    """
    names = [name for name in seen.encoders if name in wanted]
    if not names:
        return {}
    path = np.column_stack([wanted[name] for name in names])
    shown = np.pad(seen.encoder_speeds[:, [seen.encoders.index(name) for name in names]], ((len(path),) * 2, (0, 0)))
    products, power = _sliding(shown, path)
    own, largest = (path.astype(float) ** 2).sum(axis=0), power.max(axis=0)
    correlation = products / np.sqrt(np.maximum(np.maximum(power, LEAST_SHARE**2 * largest) * own, 1e-300))
    correlation[:, (own < LEAST_SHARE**2 * own.max()) | (largest < LEAST_POWER * own)] = 0.0
    best = int(np.argmax((correlation**2).sum(axis=1)))
    late = slice(best, best + len(path) + len(path) // 4)
    far, wide = (np.ptp(np.cumsum(one, axis=0, dtype=float), axis=0) for one in (shown[late], path))
    far = far / np.maximum(wide, 1e-300)
    part = len(seen.encoder_speeds) < len(path) and np.isfinite(_period(path))  # of a motion that repeats
    found = dict[str, PathShown]()
    for i, (name, likeness) in enumerate(zip(names, correlation[best], strict=True)):
        times = products[best, i] / max(own[i], 1e-300)
        units = (" where the rig says ".join(u) for u, one in UNITS.items() if abs(abs(times) / one - 1.0) < UNIT_SHARE)
        kind = "unit" if (joint := next(units, "")) else "same"
        if abs(likeness) < SAME_PATH:
            kind, times = "unlike", abs(likeness)
        elif kind == "same" and abs(far[i] - 1.0) > UNIT_SHARE and not part:
            kind, times = "farther", np.copysign(far[i], likeness)
        if kind == "unlike" and (part or not 0.0 < times < OTHER_PATH):
            continue
        if kind in OF_THE_MOTION and (joint := _followed(shown[:, i], path, names)) not in {"", name}:
            kind, times = "exchanged", abs(times)
        found[name] = PathShown(kind, joint, float(times))
    if same := " and ".join(name for name, one in found.items() if one.kind == "same"):
        found |= {n: one._replace(kind="scaled", joint=same) for n, one in found.items() if one.kind == "farther"}
    return found


def _followed(shown: Floats, path: Floats, names: Sequence[str]) -> str:
    """The joint whose path (m, k) a channel's speeds (n,) follow at some lag, as far as it goes; empty of none's."""
    products, power = _sliding(np.repeat(shown[:, None], len(names), axis=1), path)
    own = np.maximum((path.astype(float) ** 2).sum(axis=0), 1e-300)
    likeness = products / np.maximum(np.sqrt(np.maximum(power, 1e-12 * own) * own), 1e-150)
    best = np.argmax(likeness, axis=0), range(len(names))
    far = np.abs(products[best] / own - 1.0)
    near = int(np.argmin(np.where(likeness[best] > SAME_PATH, far, np.inf)))
    return names[near] if likeness[best][near] > SAME_PATH and far[near] < UNIT_SHARE else ""


def _sliding(whole: Floats, part: Floats) -> tuple[Floats, Floats]:
    """Of a ``part`` (m, k) at each place of ``whole`` (n, k): products with it, and the power there, (n - m + 1, k)."""
    from scipy.signal import correlate

    count, whole, part = len(part), whole.astype(float), part.astype(float)
    power = np.cumsum(np.pad(whole**2, ((1, 0), (0, 0))), axis=0)
    products = [correlate(a, b, "valid", "fft") for a, b in zip(whole.T, part.T, strict=True)]
    return np.column_stack(products), power[count:] - power[:-count]


Lacking = tuple[str, str, str]
"""Witness, what it states, and what the run holds."""


def record_ends(observations: Sequence[Observation]) -> list[Statement]:
    """Runs of which something of the motion was not recorded. Nothing is said of motions that repeat."""
    found = []
    for seen in observations:
        lacking = _by_stored_motion(seen) or _by_other_runs(seen, observations) or _by_encoders(seen)
        if lacking:
            witness, stated, witnessed = lacking
            found.append(Statement(seen.name, "record", None, stated, witnessed, witness, "short_record"))
    return found


def _by_stored_motion(seen: Observation) -> Lacking | None:
    names = [name for name in seen.encoders if name in seen.commanded_speeds]
    if not names:
        return None
    part = seen.encoder_speeds[:, [seen.encoders.index(name) for name in names]]
    whole = np.column_stack([seen.commanded_speeds[name] for name in names])
    if any(_moving_ends(whole, "motion")):
        return None
    if len(part) < LEAST_S * SPEED_RATE_HZ < len(whole):  # too short to be laid over anything
        moved = np.ptp(np.flatnonzero(_moving(whole, "motion"))) / SPEED_RATE_HZ
        stated = f"the motion that is stored with the run goes on for {moved:.3g} s"
        return "its encoders", stated, f"the record lasts {len(part) / SPEED_RATE_HZ:.2g} s or less"
    lacks = _lacks(part, whole, "motion")
    return _said("its encoders", "the motion that is stored with the run", part, whole, lacks, "motion")


def _by_other_runs(seen: Observation, observations: Sequence[Observation]) -> Lacking | None:
    """By encoders of runs of the same motion, by accelerometers of repeats: they are at rest where this run is not."""
    longest = int(VIBRATION_S * VIBRATION_RATE_HZ)
    speeds = _moving_ends(seen.encoder_speeds, "motion")
    ends_of = {channels: _moving_ends(values, "vibration") for channels, values in seen.vibrations.items()}
    vibrations = {channels: ends for channels, ends in ends_of.items() if any(ends)}
    for other in observations if any(speeds) or vibrations else ():
        if other is seen or other.commanded != seen.commanded:
            continue
        same = any(speeds) and seen.encoders == other.encoders
        pairs = [(seen.encoder_speeds, other.encoder_speeds, speeds, "motion")] if same else []
        for channels, ends in vibrations.items() if other.condition == seen.condition else ():
            part, whole = seen.vibrations[channels], other.vibrations.get(channels, np.zeros((0, 0)))
            if max(len(part), len(whole)) < longest:
                pairs.append((part, whole, ends, "vibration"))
        for part, whole, ends, kind in pairs:
            cut = [here and not there for here, there in zip(ends, _moving_ends(whole, kind), strict=True)]
            if not (whole.size and any(cut)):
                continue
            before, after = (lack * here for lack, here in zip(_lacks(part, whole, kind), cut, strict=True))
            witness = "its encoders" if kind == "motion" else "its accelerometers"
            if said := _said(witness, f"the {kind} of {other.name}", part, whole, (before, after), kind):
                return said
    return None


def _by_encoders(seen: Observation) -> Lacking | None:
    """An accelerometer's record that is shorter than the encoders move, on whatever clock."""
    moving = np.flatnonzero(_moving(seen.encoder_speeds, "motion")) if seen.encoder_speeds.size else np.zeros(0, int)
    for channels, values in seen.vibrations.items() if moving.size else ():
        held, moved = len(values) / VIBRATION_RATE_HZ, (moving[-1] - moving[0]) / SPEED_RATE_HZ
        if held + LEAST_S < min(moved, VIBRATION_S) and _period(seen.encoder_speeds) > held * SPEED_RATE_HZ:
            stated = f"the encoders move for {moved:.3g} s"
            return "its readings", stated, f"{seen.records[channels[0]].column.sensor} was recorded for {held:.3g} s"
    return None


def _said(
    witness: str, what: str, part: Floats, whole: Floats, lacks: tuple[float, float], kind: str
) -> Lacking | None:
    """Where the run lacks something of ``whole``, times before and after in ``lacks`` [s]; else None."""
    if max(lacks) < LEAST_S or min(_period(part), _period(whole)) <= len(part):
        return None
    moving = np.flatnonzero(_moving(whole, kind))
    moved, (before, after) = (moving[-1] + 1 - moving[0]) / SPEED_RATE_HZ, lacks
    where = " and ".join(text for text, lack in (("begins", before), ("ends", after)) if lack >= LEAST_S)
    witnessed = (
        f"the record of {len(part) / SPEED_RATE_HZ:.3g} s {where} in mid-motion: it holds "
        f"{max(moved - before - after, 0.0):.3g} s of that"
    )
    return witness, f"{what} goes on for {moved:.3g} s", witnessed


def _lacks(part: Floats, whole: Floats, kind: str) -> tuple[float, float]:
    """Times in which ``whole`` (m, k) moves before ``part`` (n, k) begins and after it ends [s]; 0 where it is no part.

    Both at SPEED_RATE_HZ; at the lag where ``part`` follows ``whole`` best, over what ``whole`` is there.
    """
    count = len(part)
    products, power = (each.sum(axis=1) for each in _sliding(np.pad(whole, ((count, count), (0, 0))), part))
    own, least = float((part.astype(float) ** 2).sum()), 0.01 * float(power.max())
    likeness = products / np.sqrt(np.maximum(np.maximum(power, least) * own, 1e-300))
    best = int(np.argmax(likeness))
    moving = np.flatnonzero(_moving(whole, kind))
    if likeness[best] < FOLLOWS[kind] or not moving.size:
        return 0.0, 0.0
    begin = best - count
    before, after = begin - int(moving[0]), int(moving[-1]) + 1 - begin - count
    return max(before, 0) / SPEED_RATE_HZ, max(after, 0) / SPEED_RATE_HZ


def _moving(values: Floats, kind: str) -> Mask:
    """Where anything moves, (n,)."""
    size = np.linalg.norm(values, axis=1)
    return np.asarray(size > MOVES[kind] * float(size.max(initial=0.0)))


def _moving_ends(values: Floats, kind: str) -> tuple[bool, bool]:
    """Whether a record (n, k) is not at rest at its beginning, and at its end."""
    count, moving = round(SEEN_S[kind] * SPEED_RATE_HZ), _moving(values, kind) if values.size else np.zeros(0, bool)
    return bool(moving[:count].any()), bool(moving[-count:].any())


def _period(values: Floats) -> float:
    """Samples after which what moves repeats, 0 of a steady turn; infinite where it does not.

    It repeats where its last quarter stood there before at REPEATS places, half of it apart, or more.
    """
    moving = np.flatnonzero(_moving(values, "motion"))
    values = values[moving[0] : moving[-1] + 1]
    count = max(round(REPEATED_SHARE * len(values)), 4)
    last, earlier = values[-count:], values[:-count]
    if len(earlier) < REPEATS * count:
        return np.inf
    products, power = (each.sum(axis=1) for each in _sliding(earlier, last))
    own = float((last.astype(float) ** 2).sum())
    places = np.flatnonzero(power + own - 2.0 * products < LEFT * own)
    found, free = 0, 0
    for place in map(int, places):
        if place >= free:
            found, free = found + 1, place + count // 2
    if found < REPEATS:
        return np.inf
    groups = np.concatenate((places[:1], places[1:][np.diff(places) > LEAST_S * SPEED_RATE_HZ]))
    return float(np.diff(groups).min()) if len(groups) > 1 else 0.0
