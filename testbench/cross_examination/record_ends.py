"""Records that begin or end in mid-motion: against the stored motion, the other runs of the motion and the repeats."""

from collections.abc import Sequence

import numpy as np

from balance.arrays import Floats

from .observation import SPEED_RATE_HZ, VIBRATION_RATE_HZ, VIBRATION_S, Observation
from .statement import Statement

FOLLOWS = {"motion": 0.95, "vibration": 0.9}
"""Correlation with a part of the other record from which a record is that part: of speeds, of vibrations."""
MOVES = {"motion": 0.05, "vibration": 0.15}
"""Share of the largest value above which a joint moves, or a base vibrates."""
LEAST_S = 0.05
"""Least time that a record lacks, twice what its lag is known to [s]."""
SEEN_S = {"motion": LEAST_S, "vibration": 0.2}
"""First or last part of a record that shows whether it is at rest there: longer than a period of vibration [s]."""
REPEATS, REPEATED_SHARE, LIKE = 2, 0.25, 0.1
"""A motion repeats where its last quarter stood there twice before, but for a tenth of its power: where a record of a
period of it, or more, begins or ends does not matter."""


def record_ends(observations: Sequence[Observation]) -> list[Statement]:
    """Runs of which something of the motion was not recorded. Nothing is said of motions that repeat."""
    found = []
    for seen in observations:
        lacking = _by_stored_motion(seen) or _by_other_runs(seen, observations) or _by_encoders(seen)
        if lacking:
            witness, stated, witnessed = lacking
            found.append(Statement(seen.name, "record", None, stated, witnessed, witness, "short_record"))
    return found


def _by_stored_motion(seen: Observation) -> tuple[str, str, str] | None:
    names = [name for name in seen.encoders if name in seen.commanded_speeds]
    if not names:
        return None
    part = seen.encoder_speeds[:, [seen.encoders.index(name) for name in names]]
    whole = np.column_stack([seen.commanded_speeds[name] for name in names])
    if not (_rests(whole, -1, "motion") and _rests(whole, 0, "motion")):
        return None
    lacks = _lacks(part, whole, "motion")
    return _said("its encoders", "the motion that is stored with the run", part, whole, lacks, "motion")


def _by_other_runs(seen: Observation, observations: Sequence[Observation]) -> tuple[str, str, str] | None:
    """By encoders of runs of the same motion, by accelerometers of repeats: they are at rest where this run is not."""
    for other in observations:
        if other is seen or other.commanded != seen.commanded:
            continue
        pairs = [(seen.encoder_speeds, other.encoder_speeds, "motion")] if seen.encoders == other.encoders else []
        if other.condition == seen.condition:
            longest = int(VIBRATION_S * VIBRATION_RATE_HZ)
            both = [(v, other.vibrations[k], "vibration") for k, v in seen.vibrations.items() if k in other.vibrations]
            pairs += [one for one in both if max(len(one[0]), len(one[1])) < longest]
        for part, whole, kind in pairs:
            if not (part.size and whole.size):
                continue
            before, after = _lacks(part, whole, kind)
            before = 0.0 if _rests(part, 0, kind) or not _rests(whole, 0, kind) else before
            after = 0.0 if _rests(part, -1, kind) or not _rests(whole, -1, kind) else after
            witness = "its encoders" if kind == "motion" else "its accelerometers"
            if said := _said(witness, f"the {kind} of {other.name}", part, whole, (before, after), kind):
                return said
    return None


def _by_encoders(seen: Observation) -> tuple[str, str, str] | None:
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
) -> tuple[str, str, str] | None:
    """Witness, what it states and what the run holds, where it lacks something of ``whole`` [s]."""
    if max(lacks) < LEAST_S or min(_period(part), _period(whole)) <= len(part):
        return None
    moving = np.flatnonzero(_moving(whole, kind))
    moved, (before, after) = (moving[-1] + 1 - moving[0]) / SPEED_RATE_HZ, lacks
    where = {(True, True): "begins and ends", (True, False): "begins", (False, True): "ends"}
    witnessed = f"the record of {len(part) / SPEED_RATE_HZ:.3g} s {where[before >= LEAST_S, after >= LEAST_S]} in "
    witnessed += f"mid-motion: it holds {max(moved - before - after, 0.0):.3g} s of that"
    return witness, f"{what} goes on for {moved:.3g} s", witnessed


def _lacks(part: Floats, whole: Floats, kind: str) -> tuple[float, float]:
    """Times in which ``whole`` (m, k) moves before ``part`` (n, k) begins and after it ends [s]; 0 where it is no part.

    Both at SPEED_RATE_HZ; at the lag where ``part`` follows ``whole`` best, over what ``whole`` is there.
    """
    from scipy.signal import correlate

    part, count = part.astype(float), len(part)
    padded = np.pad(whole.astype(float), ((count, count), (0, 0)))
    power = np.cumsum(np.pad((padded**2).sum(axis=1), (1, 0)))
    energy = power[count:] - power[:-count]
    products = sum(correlate(a, b, "valid", "fft") for a, b in zip(padded.T, part.T, strict=True))
    least = 0.01 * float(energy.max())
    own = float((part**2).sum())
    likeness = products / np.sqrt(np.maximum(np.maximum(energy, least) * own, 1e-300))
    best = int(np.argmax(likeness))
    moving = np.flatnonzero(_moving(whole, kind))
    if likeness[best] < FOLLOWS[kind] or not moving.size:
        return 0.0, 0.0
    begin = best - count
    before, after = begin - int(moving[0]), int(moving[-1]) + 1 - begin - count
    return max(before, 0) / SPEED_RATE_HZ, max(after, 0) / SPEED_RATE_HZ


def _moving(values: Floats, kind: str) -> np.ndarray:
    """Where anything moves, (n,)."""
    size = np.linalg.norm(values, axis=1)
    return size > MOVES[kind] * float(size.max(initial=0.0))


def _rests(values: Floats, end: int, kind: str) -> bool:
    """Whether a record (n, k) is at rest at its beginning, 0, or its end, -1."""
    count = round(SEEN_S[kind] * SPEED_RATE_HZ)
    return not _moving(values, kind)[slice(-count, None) if end else slice(count)].any()


def _period(values: Floats) -> float:
    """Samples after which what moves repeats, 0 of a steady turn; infinite where it does not.

    It repeats where its last quarter stood there before at REPEATS places, half of it apart, or more.
    """
    from scipy.signal import correlate

    moving = np.flatnonzero(_moving(values, "motion"))
    values = values[moving[0] : moving[-1] + 1].astype(float)
    count = max(round(REPEATED_SHARE * len(values)), 4)
    last, earlier = values[-count:], values[:-count]
    if len(earlier) < REPEATS * count:
        return np.inf
    power = np.cumsum(np.pad((earlier**2).sum(axis=1), (1, 0)))
    products = sum(correlate(a, b, "valid", "fft") for a, b in zip(earlier.T, last.T, strict=True))
    own = float((last**2).sum())
    places = np.flatnonzero(power[count:] - power[:-count] + own - 2.0 * products < LIKE * own)
    found, free = 0, 0
    for place in map(int, places):
        if place >= free:
            found, free = found + 1, place + count // 2
    if found < REPEATS:
        return np.inf
    groups = np.concatenate((places[:1], places[1:][np.diff(places) > LEAST_S * SPEED_RATE_HZ]))
    return float(np.diff(groups).min()) if len(groups) > 1 else 0.0
