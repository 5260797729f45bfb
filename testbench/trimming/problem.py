"""What is asked of the runs, the equations of one run in one form for all sources, and what a source estimates."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

import numpy as np
from scipy.linalg import null_space

from balance.arrays import Floats
from balance.balancing.conditions import Conditions
from balance.closure import Trajectory
from balance.estimation.estimate import Estimate
from balance.estimation.first_moment_imbalance import Imbalance, Subspace
from balance.estimation.identifiability import NotIdentifiable
from balance.estimation.regression import RegressionRecord, equal_blocks
from balance.mechanism.mechanism import Mechanism

from ..errors import AnalysisError
from ..kinematics.gaps import ValidSamples, true_segments
from ..recording import Finding, peak_text
from ..runs.aligned_run import AlignedRun

MOVES = 1e-3
"""Change of a joint's position in a block from which it moves there [rad, m]."""


class NoValidMotion(AnalysisError):
    """Gaps leave nothing of a run's motion."""


Source = Literal["wrench", "torque", "vibration", "trials"]


class SourceWords(NamedTuple):
    """What is told of a source."""

    name: str
    measured: str
    doubtful_share: float
    """Of what was measured that stays unexplained, from which a result is doubtful: noise leaves half of that where
    sensors are as their data sheets say, and what is systematic is not in the intervals. By trial masses more noise
    makes what is found too small: it hides in the response of the base, which is fitted to it."""
    help: str
    """What helps where it cannot tell."""
    lacks: str = ""
    """What its model leaves out, which may be unexplained."""


_MORE_RUNS = "add runs of a motion in another direction, with more acceleration, or a second accelerometer on the base"
SOURCES: dict[Source, SourceWords] = {
    "wrench": SourceWords("force sensors", "force", 0.1, _MORE_RUNS),
    "torque": SourceWords(
        "motor torques", "torque", 0.15, "give longer runs that move more, or runs of several motions"
    ),
    "vibration": SourceWords(
        "vibration of the base, by the base that the rig states", "vibration", 0.1, _MORE_RUNS,
    ),
    "trials": SourceWords(
        "vibration of the base, by trial masses", "vibration", 0.15, "use heavier trial masses, or more runs",
        "; noise, by which what is missing is found too small; of bodies that move up and down, the weight's moment, "
        "which is left out",
    ),
}  # fmt: skip
BLOCKS = 20
"""Of a record, of equal information on the conditions, that are left out in turn."""
INDEPENDENT = 1e-7
"""Singular value of columns of unit length, relative to the largest, below which a combination is not excited."""
LEAST_REST_PERIODS = 2.0
"""Rest of a run that counts, in periods of the cut-off: of one period two values are independent."""
NOTHING = 1e-12
"""Length of a column, relative to the longest, that is rounding."""
FILE_KNOWN = 0.01
"""Of a first moment that is taken from the file, as a part of the largest of the mechanism without counter-masses, what
it may be wrong by: a mass centre off its line by a hundredth of what counts (Type B, rectangular)."""
DETERMINED = 0.02
"""Half of an interval of what a body lacks, as a part of the most that one does without counter-masses, up to which a
source determines it; else the file's value is taken where no mass at the sites changes it."""
Entry = tuple[str, int, int]
"""Of a sensor's sensitivity matrix: the sensor, which of its channels shows, and which is exposed."""
MASS: Entry = ("mass", -1, -1)
"""Stands for the mass of the mechanism on a base that moves, as a part of that by file and run table."""
Effects = Mapping[Entry, Floats]
"""By entry: how the readings of a record change per unit of it, (n, rows) [N, N m, m/s2]."""


@dataclass(frozen=True)
class TrimProblem:
    """What is asked."""

    runs: Sequence[AlignedRun]
    conditions: Conditions
    """Of the mechanism as mounted in the first run."""
    sites: Sequence[str]
    cutoff: float | None
    """Highest frequency [Hz]; None: as is best for the source."""
    free: Subspace | None = None
    """Directions in which the conditions' values are estimated, the others as by the file; None: as records tell."""

    @property
    def mechanism(self) -> Mechanism:
        """Without payload and counter-masses."""
        return self.runs[0].unloaded

    @property
    def mounted(self) -> Mechanism:
        """As mounted in the first run."""
        return self.runs[0].mechanism

    @property
    def largest(self) -> Floats:
        """By condition, the largest value of those of its unit, without payload and counter-masses, by the file,
        (rank,) [kg m, or kg of masses alone].
        """
        return np.array([self.conditions.residual(unit, self.mechanism) for unit in self.conditions.units])

    def determined(self, found: Imbalance, estimate: Callable[[Floats], Estimate | None]) -> bool:
        """Whether what each body lacks, and conditions on masses alone, are determined, which a source estimates so."""
        kinds = zip(np.eye(self.conditions.rank), self.conditions.units, self.largest, strict=True)
        asked = [(row, most) for row, unit, most in kinds if unit != "kg m"]
        asked += [(row, self.conditions.residual("kg m", self.mechanism)) for rows in found.lacking for row in rows]
        each = ((estimate(row), most) for row, most in asked)
        return all(one is not None and one.half_width() <= DETERMINED * most for one, most in each)

    @property
    def at_sites(self) -> Subspace:
        """What masses at the sites can change."""
        return Subspace.at_sites(self.conditions, self.mounted, self.sites)

    def free_directions(self, found: Imbalance, estimate: Callable[[Floats], Estimate | None]) -> Subspace:
        """All, where a source that estimates so determines all; else what masses at the sites can change, and what it
        tells better than the file.
        """
        free, more = self.at_sites, list[Floats]()
        with suppress(NotIdentifiable):
            if free.is_whole or self.determined(found, estimate):
                return Subspace.all_values(self.conditions)
        for row, direction, most in self._beyond_sites(found, free):
            with suppress(NotIdentifiable):
                if (one := estimate(row)) is not None and one.half_width() <= FILE_KNOWN * most:
                    more.append(direction)
        return free.joined(more)

    def _beyond_sites(self, found: Imbalance, free: Subspace) -> Iterator[tuple[Floats, Floats, float]]:
        """Combinations (rank,) [-] of the conditions that no mass at the sites changes: of what a body lacks, along the
        axes in which it is known apart, and of masses alone; the direction (rank,) in which each is free; and the most
        that the mechanism lacks of such [kg m, kg]. All the same in any order of bodies.
        """
        lacking, units = np.asarray(self.conditions.lacking), self.conditions.units
        alone = np.eye(len(units))[[unit != "kg m" for unit in units]]
        metric = np.linalg.pinv(np.einsum("bik,bij->kj", lacking, lacking) + alone.T @ alone, hermitian=True)
        for row in alone:
            yield row, metric @ row, float(self.largest @ row)
        most = self.conditions.residual("kg m", self.mechanism)
        for rows in lacking:
            axes, sizes, _ = np.linalg.svd(rows @ free.directions.T)
            own = axes[:, np.count_nonzero(sizes > NOTHING * max(sizes[0], 1e-300)) :].T @ rows
            for row in np.linalg.svd(own @ found.covariance @ own.T)[0].T @ own:
                if np.linalg.norm(row) > NOTHING * np.linalg.norm(rows):
                    yield row, metric @ row, most

    @property
    def names(self) -> str:
        """Of the runs."""
        return ", ".join(run.name for run in self.runs)


@dataclass(frozen=True)
class RunEquations:
    """One run: readings = columns @ (conditions, then unknowns of all runs) + nuisance @ (unknowns of this run)."""

    record: RegressionRecord
    period: float
    """Of the cut-off [samples]."""
    findings: tuple[Finding, ...]
    """What gaps take of the run."""
    effects: Effects = field(default_factory=dict)
    """Of the sensors' stated errors."""
    at_rest: Floats | None = None
    """Sum of the squares of each row's independent readings in the rest before the motion, offset and drift taken out,
    (rows,) [N^2]; None where there is none."""
    freedom_at_rest: float = 0.0
    """How many are independent, less offset and drift [-]."""
    about_values: bool = False
    """Whether these are equations of first order about values of the conditions, to be made anew about those found."""
    explained: Effects = field(default_factory=dict)
    """Instruments for those of the effects that hold noise of the readings: what the model explains of them."""

    @classmethod
    def of(
        cls,
        valid: ValidSamples,
        cutoff: float,
        columns: Floats,
        readings: Floats,
        nuisance: Floats,
        used: Floats,
        motion: str,
        rows: Sequence[str],
        rank: int,
        effects: Effects | None = None,
        rest: Floats | None = None,
    ) -> "RunEquations":
        """In blocks of equal information on the ``rank`` conditions; arguments as of ``RegressionRecord``.

        Information is leverage, the same however conditions are combined: their form follows the order of bodies.
        ``rest`` (m, rows) are readings before the motion.
        """
        period = 1.0 / (cutoff * valid.grid.step)
        told = columns[:, :, :rank] @ excited_combinations([columns[:, :, :rank]])
        blocks = equal_blocks(np.sum(told**2 / np.sum(told**2, axis=(0, 1)), axis=(1, 2)), period, BLOCKS)
        record = RegressionRecord.of(columns, readings, blocks, nuisance, used, motion=motion, rows=rows)
        at_rest, freedom = None, 0.0
        if rest is not None and len(rest) >= LEAST_REST_PERIODS * period:
            slow, freedom = np.vander(np.linspace(-1.0, 1.0, len(rest)), 2), 2.0 * len(rest) / period - 2.0
            left = rest - slow @ np.linalg.lstsq(slow, rest, rcond=None)[0]
            at_rest = np.sum(left**2, axis=0) * 2.0 / period
        return cls(record, period, valid.findings, effects or {}, at_rest, freedom)


@dataclass(frozen=True)
class SourceEstimate:
    """What one source estimates."""

    source: Source
    imbalance: Imbalance
    about: tuple[str, ...]
    """How it was found, for people."""
    doubts: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()
    runs: Sequence[AlignedRun] = ()
    """Those of which the regression has a record, in its order."""
    by_steps: float = 0.0
    """Share of what was measured that the encoders' steps leave unexplained; zero where it was not asked."""
    over_rest: float = np.inf
    """Largest residual of a row over what it shows at rest, root mean squares [-]; infinite where no rest tells."""
    of_steps: Floats | None = None
    """Part of the covariance that the encoders' steps make, (rank, rank) [kg2 m2]; None where it was not asked."""


def refuse_no_motion(valid: ValidSamples, path: Trajectory) -> None:
    """Raise NoValidMotion where the gaps leave no motion."""
    kept = true_segments(valid.kept > 0.0)
    if valid.gaps and not any(np.ptp(path.q[part], axis=0).max() > MOVES for part in kept):
        raise NoValidMotion(f"{valid.run}: {valid.texts}: nothing of its motion is left; give another run")


def parameter_basis(conditions: Conditions) -> Floats:
    """Parameters per unit of each condition's value, then of each combination that they leave free, (10 nb, 10 nb)."""
    return np.hstack([np.linalg.pinv(conditions.matrix), null_space(conditions.matrix)])


def offset_and_drift(kept: Floats, rows: int) -> Floats:
    """Nuisances of rows that each have an offset and a drift, zero where ``kept`` (n,) is, (n, rows, 2 rows) [-]."""
    time = np.linspace(-1.0, 1.0, len(kept))
    unit = np.eye(rows)[None]
    return np.concatenate([unit * kept[:, None, None], unit * (time * kept)[:, None, None]], axis=2)


def motion_name(run: AlignedRun) -> str:
    """What repeats of one motion have in common; empty where the conditions do not say."""
    motion, peak = run.conditions.get("motion"), peak_text(run.conditions)
    return f"{motion} at {peak}" if motion and peak else ""


def shared_unknowns(records: Sequence[RegressionRecord], rank: int) -> Floats:
    """The combinations (p, k) [-] of the unknowns beyond ``rank`` conditions that the runs together excite."""
    return excited_combinations([record.columns[:, :, rank:] for record in records])


def with_shared_unknowns(
    records: Sequence[RegressionRecord], rank: int, combinations: Floats
) -> list[RegressionRecord]:
    """The records with columns of the conditions, then of ``combinations`` (p, k) [-] of their other unknowns."""
    columns = [np.concatenate([r.columns[:, :, :rank], r.columns[:, :, rank:] @ combinations], axis=2) for r in records]
    return [replace(record, columns=own) for record, own in zip(records, columns, strict=True)]


def excited_combinations(parts: Sequence[Floats], least: float = INDEPENDENT) -> Floats:
    """The matrix (p, k) [-] that turns columns (n, rows, p) of runs into the combinations that they together excite.

    ``least`` is the singular value of columns of unit length, relative to the largest, that counts.
    """
    length = np.sqrt(sum(np.sum(part**2, axis=(0, 1)) for part in parts))
    used = np.flatnonzero(length > NOTHING * length.max(initial=0.0))
    if not len(used):
        return np.zeros((len(length), 0))
    stacked = np.concatenate([part[:, :, used].reshape(-1, len(used)) for part in parts])
    values, rows = np.linalg.svd(np.linalg.qr(stacked / length[used], mode="r"))[1:]
    kept = rows[: int(np.count_nonzero(values > least * values.max(initial=0.0)))]
    turned = np.zeros((len(length), len(kept)))
    turned[used] = (kept / length[used]).T
    return turned
