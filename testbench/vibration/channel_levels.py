"""Levels of every channel of a run: each metric in a band, the power spectral density, and its peaks."""

from collections import defaultdict, deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated

import numpy as np

from balance.arrays import Floats
from balance.estimation.estimate import coverage_factor
from balance.results import INLINE, Key, per_cent
from balance.units import SI_UNITS

from ..errors import AnalysisError
from ..rig import Column
from ..runs.si_run import SIRun
from ..signal.filters import LANES, Band
from ..signal.welch import SEGMENT, Spectra, welch
from .metrics import DEFAULT_BAND, METRICS

if TYPE_CHECKING:
    import pandas

    from ..store import Run

BLOCK_CHANNELS = LANES
"""Channels of one rate that are filtered together."""
PARALLEL_RUNS = 2
"""Runs that are analysed at the same time."""
_UNITS = {"acceleration": "m_s2", "force": "N", "moment": "Nm", "angle": "rad", "length": "m"}
PEAK_SEPARATION = 0.1
"""Least distance between two peaks, as a share of the frequency."""
LEAST_SEGMENT = 256
"""Segment below which a short record has no spectrum [samples]."""
MOST_PEAKS = 5
"""Peaks that are listed."""
_LEVELS = 32
"""Of power, by which lines are told beforehand that are not prominent."""
PROMINENCE = 10.0
"""Least peak over the median of the two octaves around it [-]."""


@dataclass(frozen=True)
class ChannelLevels:
    """Levels of one channel, in SI."""

    column: Annotated[Column, INLINE]
    rate_hz: float
    mean: Annotated[float, Key("mean_{0.unit}")]
    band: Annotated[Band | None, Key("band_hz", to=Band.limits)]
    metrics: dict[str, float]
    """``peak``, ``peak_to_peak``, ``rms``, after removing the mean over the record and filtering by the band."""
    spectrum: Spectra | None
    """Of the whole record without a band; None where it is shorter than two short segments."""
    calibration: Annotated[float | None, Key("calibration_percent", to=per_cent)] = None
    """Half of the 95 % interval of every level that its sensor's calibration leaves open [-]; None: none is stated."""

    @property
    def levels(self) -> Annotated[dict[str, float], INLINE]:
        """The metrics by their keys."""
        return {f"{name}_{self.unit}": value for name, value in self.metrics.items()}

    @property
    def resolution(self) -> Annotated[float | None, Key("resolution_hz")]:
        """Of the spectrum [Hz]."""
        return float(self.spectrum.frequency[1]) if self.spectrum else None

    @property
    def unit(self) -> str:
        """Unit of the channel as it is written in keys."""
        return _UNITS[self.column.dimensions[0]]

    @property
    def peaks(self) -> Annotated[list[dict[str, float]], Key("spectrum_peaks")]:
        """The strongest peaks of the spectrum: frequency [Hz], density [SI2/Hz], strongest first."""
        if self.spectrum is None:
            return []
        power, frequency = self.spectrum.power(), self.spectrum.frequency
        tops = 2 + np.flatnonzero((power[1:-2] < power[2:-1]) & (power[2:-1] >= power[3:]))
        tops = tops[_may_be_prominent(power, tops)]
        apart: list[int] = []
        for i in tops[np.argsort(-power[tops], kind="stable")]:
            if len(apart) < MOST_PEAKS and all(abs(i - j) > PEAK_SEPARATION * j for j in apart):
                apart += [i] if power[i] > PROMINENCE * np.median(power[i // 2 : 2 * i + 1]) else []
        return [{"frequency_hz": float(frequency[i]), "density_si2_hz": float(power[i])} for i in apart]


def _may_be_prominent(power: Floats, tops: np.ndarray) -> np.ndarray:
    """Which lines ``tops`` (k,) of a spectrum (m,) may exceed PROMINENCE times the median of those about them, (k,):
    where more than half of these are above that share, rounded up to a level of some, the median is.
    """
    shares = power[tops] / PROMINENCE
    levels = np.quantile(shares, np.linspace(0.0, 1.0, _LEVELS)) if len(tops) else shares
    above = np.pad(np.cumsum(power >= levels[:, None], axis=1), [(0, 0), (1, 0)])
    begin, end, level = tops // 2, np.minimum(2 * tops + 1, len(power)), np.searchsorted(levels, shares)
    level = np.minimum(level, _LEVELS - 1)
    return np.asarray(2 * (above[level, end] - above[level, begin]) <= end - begin)


def level_definitions(band: "Band | None") -> dict[str, str]:
    """Definition of each metric and of the spectrum."""
    shared = f"mean over the record removed, band {band or 'not limited'}"
    return {name: f"{words}, {shared}" for name, (words, _) in METRICS.items()} | {
        "spectrum": "one-sided power spectral density by Welch, Hann window, half overlap, mean of each segment removed"
    }


def channel_levels(
    run: SIRun, columns: "Iterable[Column]", band: "Band | None" = DEFAULT_BAND, segment: int = SEGMENT
) -> list[ChannelLevels]:
    """Levels of channels of a run, BLOCK_CHANNELS at a time.

    Raises AnalysisError for a channel that is not in SI, or a band that its rate does not allow.
    """
    wanted = list(columns)
    run = run.preloaded(wanted)
    together: dict[tuple[float, int], list[tuple[Column, Floats]]] = defaultdict(list)
    found: list[ChannelLevels] = []
    for column in wanted:
        values, rate = run.signal(column)
        waiting = together[rate, len(values)]
        waiting.append((column, values))
        if len(waiting) == BLOCK_CHANNELS:
            found += _levels_of_block(waiting, rate, band, segment)
            waiting.clear()
    for (rate, _), waiting in together.items():
        if waiting:
            found += _levels_of_block(waiting, rate, band, segment)
    return [replace(one, calibration=_calibration(run, one.column)) for one in found]


def spectra(run: SIRun, channels: "Sequence[str]" = (), segment: int = SEGMENT) -> "pandas.DataFrame":
    """Power spectral densities of channels of a run, as :meth:`testbench.Run.spectra` gives them.

    Raises AnalysisError for a channel that the rig does not have, or that is not in SI.
    """
    import pandas

    known = {f"{column.sensor} {column.component}": column for column in run.rig.columns()}
    known_as = {column.channel: name for name, column in known.items()}
    wanted = [known_as.get(name, name) for name in channels] or list(known)
    if unknown := [name for name in wanted if name not in known]:
        raise AnalysisError(f"{run.name}: {unknown[0]!r} is no channel of its rig: there are {', '.join(known)}")
    levels = dict(zip(wanted, channel_levels(run, [known[name] for name in wanted], None, segment), strict=True))
    found = pandas.DataFrame(
        {
            name: pandas.Series(
                *(() if one.spectrum is None else (one.spectrum.power(), one.spectrum.frequency)), dtype=float
            )
            for name, one in levels.items()
        }
    )
    found.index.name = "frequency (Hz)"
    found.attrs.update(
        {
            "run": run.name,
            "origin": str(run.origin),
            "units": {name: f"({SI_UNITS[run.dimension(known[name])]})^2/Hz" for name in wanted},
            "resolution_hz": {name: one.resolution for name, one in levels.items()},
            "segments": {name: one.spectrum.segments if one.spectrum else 0 for name, one in levels.items()},
        }
    )
    return found


def _calibration(run: SIRun, column: Column) -> float | None:
    stated = run.sensitivity_uncertainty(column)
    return None if stated is None else coverage_factor(stated.degrees_of_freedom) * stated.relative


def _segment_length(count: int, wanted: int) -> int:
    """The wanted segment, or a shorter one that fits twice into the record; zero where that is too short."""
    whole = min(wanted, 1 << max(count // 2, 1).bit_length() - 1)
    return whole if whole >= min(LEAST_SEGMENT, wanted) else 0


def levels_of_runs(
    runs: "Iterable[Run]", band: "Band | None" = DEFAULT_BAND, segment: int = SEGMENT
) -> "Iterator[tuple[Run, list[ChannelLevels]]]":
    """Levels of all channels of each run's rig, in the order of the runs; PARALLEL_RUNS in memory at a time."""
    waiting: deque[tuple[Run, Future[list[ChannelLevels]]]] = deque()
    with ThreadPoolExecutor(PARALLEL_RUNS) as pool:
        for run in runs:
            si = SIRun.of(run)
            waiting.append((run, pool.submit(channel_levels, si, si.rig.columns(), band, segment)))
            if len(waiting) > PARALLEL_RUNS:
                done, found = waiting.popleft()
                yield done, found.result()
        for done, found in waiting:
            yield done, found.result()


def _levels_of_block(
    some: "Sequence[tuple[Column, Floats]]", rate: float, band: "Band | None", segment: int
) -> Iterator[ChannelLevels]:
    means = [float(v.mean()) for _, v in some]
    shaped: Floats = np.empty((len(some), len(some[0][1])))
    for (_, values), mean, shape in zip(some, means, shaped, strict=True):
        np.subtract(values, mean, out=shape)
    if band:
        shaped = band.filtered(shaped, rate, in_place=True)
    whole = _segment_length(shaped.shape[1], segment)
    for (column, recorded), mean, shape in zip(some, means, shaped, strict=True):
        spectrum = welch([recorded], rate, whole) if whole else None
        metrics: dict[str, float] = {name: measure(shape) for name, (_, measure) in METRICS.items()}
        yield ChannelLevels(column, rate, mean, band, metrics, spectrum)
