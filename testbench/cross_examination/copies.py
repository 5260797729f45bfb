"""Runs that are copies of another: the same noise, whatever their names, their timestamps, their units and their cut.

Two repeats of a run vibrate alike, but their noise is not the same. So runs are compared in what no motion repeats: the
phases of a band of high frequencies, at any lag (generalised cross-correlation with phase transform, Knapp & Carter
1976). Where these agree, a copy must also leave nothing: less of the difference than a quarter of the record's noise,
which a fast motion in that band does not raise. One channel is enough: a log may be put together of two runs.
"""

from collections import defaultdict
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from balance.arrays import Floats
from balance.task_pool import HERE, TaskPool

from .observation import SPANS, ChannelRecord, Observation
from .statement import Statement

Complexes = NDArray[np.complexfloating]
LOW_SHARE, HIGH_SHARE = 0.15, 0.45
"""The band, as shares of the lowest rate of the campaign: above the motions, below the loggers' filters."""
MOST_BINS = 1024
"""Frequencies of the band that are used."""
LEAST_BINS = 24
"""Frequencies below which nothing is compared."""
SIMILAR = 0.3
"""Correlation of the phases from which two records are compared in full; of independent noise below 0.15."""
COARSE, COARSELY_SIMILAR = 4, 0.2
"""At first every fourth frequency is looked at, and as little correlation, as 1 in 50 pairs of other noise has."""
REMAINDER = 0.25
"""Share of the noise that the difference of two records may have to be one: 2 of independent noise, 0 of copies."""


class _Signature:
    """A band of the start of one channel, of one length in all runs, from its ``first`` frequency to its ``last``."""

    def __init__(self, record: ChannelRecord, seconds: float, first: int, last: int) -> None:
        values = record.start[: round(seconds * record.rate_hz)].astype(float)
        values -= values.mean()
        self.band = np.fft.rfft(values)[first:last] / len(values)
        self.phases = (self.band / np.maximum(np.abs(self.band), 1e-300)).astype(np.complex64)
        self.noise = record.noise**2 / len(values)
        """Power in a frequency of white noise as large as the record's."""
        self._values, self._frequencies = values, slice(first, last)

    @property
    def windowed(self) -> Complexes:
        """The band of the windowed start, in which lines do not leak, (k,)."""
        return np.fft.rfft(self._values * np.hanning(len(self._values)))[self._frequencies] / len(self._values)


@dataclass(frozen=True)
class OneRecording:
    """Runs that hold the same noise of the same channels, in the order of the campaign."""

    runs: tuple[Observation, ...]
    channels: tuple[str, ...]
    whole: bool
    """Whether these are all channels that have noise."""

    def logs(self, run: Observation) -> dict[str, None]:
        """The files of a run that hold the channels."""
        return dict.fromkeys(run.logs[channel] for channel in self.channels if channel in run.logs)

    def files(self, run: Observation) -> str:
        """The same as text."""
        return ", ".join(self.logs(run))

    def holds(self, statement: Statement) -> bool:
        """Whether a statement is about a channel of these logs."""
        return any(
            run.name == statement.run and run.logs.get(statement.channel or "") in self.logs(run) for run in self.runs
        )

    def statements(self, *contradicted: Collection[str]) -> list[Statement]:
        """Of each run that is not the original, which all but it are; where nothing tells which it is, of all.

        The original is the only run that is not ``contradicted``, by the first of these that tells; of several in one
        condition the first counts.
        """
        agreeing = list(self.runs)
        for names in contradicted:
            agreeing = [run for run in agreeing if run.name not in names] or agreeing
        original = agreeing[0] if all(run.condition == agreeing[0].condition for run in agreeing) else None
        noise = f"the same noise of {', '.join(self.channels)}"
        found = []
        for run in self.runs:
            if run is original:
                continue
            others = tuple(other.name for other in self.runs if other is not run and (original or other) is other)
            held = "one log" if self.whole else f"the same channels ({', '.join(map(self.files, self.runs))})"
            both = f"{' and '.join((run.name, *others))} hold {held}: {noise}"
            if original is None:
                shown = f"{both}; nothing tells whose, and none of them counts"
            elif any(one is run for one in agreeing):
                shown = f"{both}; of one condition, they count once, as {original.name}"
            else:
                part = "the log" if self.whole else f"in {self.files(run)} channels of {self.files(original)},"
                shown = f"{run.name} holds {part} of {original.name}, with which all else agrees: {noise}"
            stated = "a run of its own by the run table"
            found.append(
                Statement(run.name, "copy", None, stated, shown, "its recorded channels", "copied_run", others)
            )
        return found


def copies(observations: Sequence[Observation], pool: TaskPool = HERE) -> list[OneRecording]:
    """Runs of one noise, together for the channels they share; each channel is a task of the ``pool``."""
    by_channel: dict[str, list[tuple[int, ChannelRecord]]] = defaultdict(list)
    noisy = [_noisy(seen) for seen in observations]
    for i, own in enumerate(noisy):
        for record in own:
            by_channel[record.column.channel].append((i, record))
    shared: dict[tuple[int, ...], list[str]] = defaultdict(list)
    for channel, pairs in zip(by_channel, pool.in_memory.map(_equal, list(by_channel.values())), strict=True):
        for runs in _joined(pairs):
            shared[runs].append(channel)
    recordings = []
    for runs, same in sorted(shared.items()):
        whole = all(len(same) == len(noisy[i]) for i in runs)
        recordings.append(OneRecording(tuple(observations[i] for i in runs), tuple(same), whole))
    return recordings


def _joined(pairs: Iterable[tuple[int, int]]) -> list[tuple[int, ...]]:
    """Those that pairs connect, together."""
    found: list[set[int]] = []
    for pair in pairs:
        apart = [one for one in found if one.isdisjoint(pair)]
        found = [*apart, set(pair).union(*(one for one in found if one not in apart))]
    return [tuple(sorted(one)) for one in found]


def _noisy(seen: Observation) -> list[ChannelRecord]:
    """The channels that have noise of their own, which encoders and commands have not.

    None of a run with a channel that cannot be read: it is not analysed.
    """
    if any(column.channel in seen.reasons for column in seen.rig.columns()):
        return []
    records = (record for record in seen.records.values() if record.column.dimensions[0] != "length")
    return [record for record in records if not record.dead and record.noise > 0.0]


def _equal(records: list[tuple[int, ChannelRecord]]) -> list[tuple[int, int]]:
    """Pairs of runs whose records of one channel are the same."""
    if len(records) < 2:
        return []
    seconds = min(len(record.start) / record.rate_hz for _, record in records)
    rate = min(record.rate_hz for _, record in records)
    first, last = int(LOW_SHARE * rate * seconds), int(HIGH_SHARE * rate * seconds)
    last = min(last, first + MOST_BINS)
    if last - first < LEAST_BINS:
        return []
    signatures = [_Signature(record, seconds, first, last) for _, record in records]
    phases, pairs = np.stack([one.phases for one in signatures]), []
    coarse = phases[:, ::COARSE]
    for i in range(len(records) - 1):
        others = i + 1 + np.flatnonzero(_alike(coarse[i], coarse[i + 1 :]) > COARSELY_SIMILAR)
        for j in others[_alike(phases[i], phases[others]) > SIMILAR]:
            if _difference(signatures[i], signatures[j]) < REMAINDER:
                pairs.append((records[i][0], records[j][0]))
    return pairs


def _alike(phases: Complexes, others: Complexes) -> Floats:
    """Largest correlation at any lag of phases (k,) with others (n, k), (n,) [-]."""
    from scipy.fft import ifft

    found = ifft(phases * others.conj(), 2 * len(phases), axis=1)
    return np.asarray(2.0 * np.sqrt((found.real**2 + found.imag**2).max(axis=1)))  # abs takes a root of each


def _difference(first: _Signature, second: _Signature) -> float:
    """What the best lag and gain leave: the larger of two shares [-].

    In the median span, the power of the difference over the noise, which repeats of a motion share with nothing: the
    lesser of that in quiet spans and of that by the record's third differences. In the median frequency, over the power
    of both, which repeats in one mains hum do not share.
    """
    one, other = first.band, second.band
    count = len(one)
    fine = np.fft.ifft(one * other.conj(), 16 * count)
    lag = int(np.argmax(np.abs(fine))) / (16.0 * count)
    moved = other * np.exp(-2j * np.pi * lag * np.arange(count))
    a, b = np.fft.ifft(one), np.fft.ifft(moved)
    gain = np.vdot(b, a) / max(float(np.vdot(b, b).real), 1e-300)
    rest = np.abs(a - gain * b) ** 2
    spans = np.array_split(np.arange(count), min(SPANS, count // 8))
    noise = np.quantile([float(np.mean(np.abs(a[s]) ** 2)) for s in spans], 0.2)
    noise = min(float(noise), first.noise / count)
    inside = float(np.median([float(np.mean(rest[s])) for s in spans]) / max(noise, 1e-300))
    turned = gain * np.exp(-2j * np.pi * lag * np.arange(count)) * second.windowed
    power = np.abs(first.windowed) ** 2 + np.abs(turned) ** 2
    return max(inside, float(np.median(np.abs(first.windowed - turned) ** 2 / np.maximum(power, 1e-300))))
