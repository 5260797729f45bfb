"""What ``import testbench`` offers: each function takes names, files or objects, and quantities as texts with units.

The commands call the same functions. A campaign is a ``Campaign`` or its folder; runs are ``Run`` objects or files.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal, overload

from balance.mechanism.mechanism import Mechanism

from .store import Campaign, Run, open_campaign, open_run

if TYPE_CHECKING:  # what each function needs is imported when it is called: a command starts as quickly as without
    from balance.input_files import Measured
    from balance.task_pool import TaskPool

    from .campaign_plan import Plan
    from .cross_examination import Examination
    from .identification import Identification
    from .identification.estimators import Method
    from .identification.records import By
    from .ingestion import Outcome
    from .next_run import Design, Question
    from .readers import ReadOptions
    from .recording import Recording
    from .report.overlay import Overlay
    from .rig import Rig
    from .rotating import SteadySpeedFit
    from .runs.si_run import SIRun
    from .signal import Metric
    from .signal.filters import Band
    from .synchronization.run_alignment import RunClocks
    from .trimming import Source, Trim
    from .vibration.comparison import Comparison
    from .vibration.metrics import Measure
    from .vibration.reduction import Analysis

VIBRATION = "1..200"
"""Frequencies that count as vibration [Hz], unless others are given."""
Runs = Campaign | Run | str | Path | Sequence[Run]
"""What a function takes for runs: a campaign, one run, or the path of either; or runs that are open."""


AlignBy = Literal["correlation", "tap", "trigger"]
"""By what clocks are aligned."""


def runs_of(*given: Runs) -> list[Run]:
    """The runs that are meant. Raises StoreError for one that cannot be opened."""
    found: list[Run] = []
    for one in given:
        if isinstance(one, str | Path):
            one = open_campaign(one) if Path(one).is_dir() else open_run(one)
        found += [one] if isinstance(one, Run) else one.runs if isinstance(one, Campaign) else one
    return found


def bound_runs(runs: Sequence[Runs | SIRun], rig: Rig | str | Path | None = None) -> list[SIRun]:
    """Runs in SI, with their calibration in force; ``rig`` in place of the one stored with each. SI runs are as is."""
    from .runs.si_run import SIRun

    described = _rig(rig)
    return [
        one
        for given in runs
        for one in ([given] if isinstance(given, SIRun) else [SIRun.of(run, described) for run in runs_of(given)])
    ]


def load_rig(name: str | Path) -> Rig:
    """A rig, what is measured where: a shipped name or a TOML file.

    >>> import testbench
    >>> sorted(testbench.load_rig("parallelogram-6bar").loggers)
    ['controller', 'daq', 'forces']
    """
    from . import rig

    return rig.load_rig(name)


def load_plan(name: str | Path) -> Plan:
    """A plan of runs: a shipped name or a TOML file.

    >>> import testbench
    >>> len(testbench.load_plan("kiper2019").runs())
    52
    """
    from . import campaign_plan

    return campaign_plan.load_plan(name)


def new_project(folder: str | Path, mechanism: str | Path) -> list[str]:
    """Write what a test of a mechanism needs into a new folder: motion, plan, rig, run table; the files' names.

    ``mechanism``: a file or a shipped name. What it does not say is guessed, marked ``(guess)``, and to be edited.

    >>> import testbench
    >>> testbench.new_project("my-test", "four-bar")
    ['four-bar.xml', 'motion.toml', 'plan.toml', 'rig.toml', 'README.md', 'runs.csv']
    """
    from . import project

    return project.new_project(Path(folder), str(mechanism))


def encoder_speed(log: str | Path, pulses: int, ratio: float = 1.0) -> SteadySpeedFit:
    """The steady turn of a crank from the instants of encoder edges: speed over angle, fluctuation, with intervals.

    ``log``: a table of one column, unit in its header (``t (s)``). ``pulses``: edges in a turn of the disc, which turns
    ``ratio`` times in a turn of the crank. Time over angle is fitted with a few harmonics. Intervals hold for a
    concentric disc: ``testbench speed --pitch`` takes a calibration. Raises LostEdges.

    >>> import testbench
    >>> print(f"{testbench.encoder_speed('edges.csv', pulses=60).mean.value:.2f} rad/s")
    10.47 rad/s
    """
    from .rotating import Disc, number_edges, periodic_turn, read_edge_times

    path = Path(log)
    return periodic_turn(number_edges(path.name, read_edge_times(path), Disc(pulses, ratio)))


def formats() -> dict[str, str]:
    """The formats of logs that can be read, and what each needs installed.

    >>> import testbench
    >>> testbench.formats()["CSV"]
    ''
    """
    from .readers import readers

    return {reader.name: reader.needs or "" for reader in readers()}


def read(log: str | Path, options: ReadOptions | None = None) -> Recording:
    """A logger's file as it is: groups of channels with units, clock and findings; values are read when asked for.

    >>> import testbench
    >>> [channel.label for channel in testbench.read("log.csv").groups[0].channels]
    ['t', 'a']
    """
    from .readers import open_recording

    return open_recording(log, options)


def ingest(
    logs: Iterable[str | Path],
    to: str | Path,
    rig: Rig | str | Path | None = None,
    runs: str | Path | None = None,
    accept: Iterable[str] = (),
    options: ReadOptions | None = None,
) -> list[Outcome]:
    """Store logs in the campaign folder ``to``, one HDF5 file a run; an outcome for each log.

    ``runs``: the run table, a CSV file with the conditions of each run. ``accept``: codes of findings in spite of which
    a log is stored. What is refused is an outcome with its reason, not an exception; the others are stored.

    >>> import testbench
    >>> [one.status for one in testbench.ingest(["log.csv"], to="new-campaign")]
    ['stored']
    """
    from .ingestion import Ingest
    from .ingestion.log_sources import SiblingLogs, own_files
    from .ingestion.planned_runs import plan_runs

    given, folder, described = [Path(log) for log in logs], Path(to), _rig(rig)
    own = own_files(given, folder)
    files = [file for file in given if file not in own]
    work = Ingest(folder, described, options, frozenset(accept))
    others = SiblingLogs(files if runs is None else (), work.reading)
    work = replace(work, sibling_log=others.holding)
    work.reading.add_logs(files)
    return [outcome for run in plan_runs(files, None if runs is None else Path(runs)) for outcome in work.run(run)]


def _rig(rig: Rig | str | Path | None) -> Rig | None:
    return load_rig(rig) if isinstance(rig, str | Path) else rig


def simulate(plan: Plan | str | Path, rig: Rig | str | Path, to: str | Path, seed: int | None = None) -> list[Path]:
    """Write the logs that a test bench would write into a new folder ``to``, marked as simulated; gives their paths.

    >>> import testbench
    >>> logs = testbench.simulate("one-run.toml", "parallelogram-6bar", "new-logs")
    >>> len(logs)
    3
    """
    from .simulator.campaign import simulate_campaign

    planned, bench = load_plan(plan) if isinstance(plan, str | Path) else plan, _rig(rig)
    assert bench is not None
    return simulate_campaign(planned if seed is None else planned.model_copy(update={"seed": seed}), bench, Path(to))


def analyze(
    campaign: Runs,
    metric: Metric | Measure = "peak_to_peak",
    band: Band | str | None = VIBRATION,
    accept: Sequence[str] = (),
    mechanism: Mechanism | str | None = None,
    pool: TaskPool | None = None,
) -> Analysis:
    """By how many per cent counter-masses reduce the base's vibration, by condition, sensor and axis, with intervals.

    ``metric``: ``peak``, ``peak_to_peak`` or ``rms`` of the acceleration [m/s2] in ``band`` [Hz], or a ``Measure`` of
    both. ``accept``: codes of contradictions that a person accepts. Intervals of 95 % by propagation of distributions
    (JCGM 101), near the noise those of Feldman and Cousins. Raises AnalysisError where no two runs can be compared. The
    column ``kind`` tells numbers from bounds (``at_least``, ``at_most``) and from what is ``withheld``.

    >>> import testbench
    >>> rows = testbench.analyze("campaign").table()
    >>> rows[rows["kind"] == "number"][["axis", "reduction_percent"]].shape
    (3, 2)
    """
    from balance.task_pool import cores

    from .vibration.reduction import analyze as analyze_runs

    runs = runs_of(campaign)
    return analyze_runs(runs, _measure(metric, band), accept, _mechanism(mechanism), pool or cores(len(runs)))


def _measure(metric: Metric | Measure, band: Band | str | None) -> Measure:
    from .errors import AnalysisError
    from .signal.filters import band_of
    from .vibration.metrics import Measure

    if isinstance(metric, Measure):
        if band != VIBRATION:
            raise AnalysisError(f"band: {band}: the metric is a Measure, which has a band of its own; give it there")
        return metric
    return Measure(metric, band_of(band) if isinstance(band, str) else band)


def _mechanism(mechanism: Mechanism | str | None) -> Mechanism | None:
    from balance.mechanism.mjcf_parser import load_mechanism

    return load_mechanism(mechanism) if isinstance(mechanism, str) else mechanism


def compare(
    campaign: Runs,
    published: str | None = None,
    metric: Metric | Measure = "peak_to_peak",
    band: Band | str | None = VIBRATION,
    accept: Sequence[str] = (),
    mechanism: str | None = None,
) -> Comparison:
    """The same reductions from logs, simulated anew, and as ``published``: a shipped table or a file.

    >>> import testbench
    >>> testbench.compare("campaign").table()["simulated_percent"].notna().all()
    np.True_
    """
    from balance.task_pool import cores

    from .published_tables import load_published
    from .vibration.comparison import compare_campaign

    table, runs = load_published(published) if published else None, runs_of(campaign)
    return compare_campaign(runs, table, _measure(metric, band), mechanism, accept, pool=cores(len(runs)))


def overlay(channel: str, *runs: Runs) -> Overlay:
    """A channel of runs over that of the first, aligned, and what each differs by, with an interval where it is known.

    ``channel``: sensor and axis of the rig (``"base x"``), or its name in the log of the first. Runs are aligned by
    command or encoders, else, of repeats, by what they show the same of, else by where the motion begins, which ``str``
    says. Values between samples are interpolated as band-limited, next to ends and gaps linearly.

    >>> import testbench
    >>> over = testbench.overlay("base_acc x", "campaign")
    >>> over.unit, over.names, over.table().attrs["units"]["r002 less r001"]
    ('m/s²', ['r001', 'r002'], 'm/s²')
    """
    from .report.overlay import overlay as overlaid

    return overlaid(runs_of(*runs), channel)


def doctor(
    campaign: Runs, accept: Sequence[str] = (), mechanism: Mechanism | str | None = None, pool: TaskPool | None = None
) -> Examination:
    """What the sensors of a campaign contradict in the run table, the rig or other runs.

    >>> import testbench
    >>> testbench.doctor("campaign").contradictions
    ()
    """
    from balance.task_pool import cores

    from .cross_examination import examine

    runs = runs_of(campaign)
    return examine(runs, accept, _mechanism(mechanism), pool or cores(len(runs)))


def plan_next(
    campaign: Runs,
    question: Question = "reduction",
    payload: str | float | Mapping[str, str | float] | None = None,
    motions: Sequence[str] = (),
    peaks: Sequence[str | Measured[float]] = (),
    axes: Sequence[str] = (),
    sites: Sequence[str] = (),
    metric: Metric | Measure = "peak_to_peak",
    band: Band | str | None = VIBRATION,
    accept: Sequence[str] = (),
    by: Sequence[Source] = (),
) -> Design:
    """Which run to make next: how far each narrows what is asked, the best first; ``.verdict`` names it.

    ``question``: ``reduction``, ``first-moment`` or ``counter-mass``. ``payload``: of the runs with this one alone, by
    body or site where several carry one (``{"tool": "1.5 kg"}``). ``motions``, ``peaks`` (``"2 g0"``): of a reduction
    these alone; of others candidates besides those made. ``axes``, ``metric``, ``band``, ``accept``: of a reduction;
    ``sites`` and ``by``, as of :func:`trim`: of the others. Raises AnalysisError where nothing that a run would show
    tells what is asked.

    >>> import testbench
    >>> testbench.plan_next("campaign", axes=["y"]).table()["run.repeats"].tolist()
    ['r001', 'r002']
    """
    from balance.units import si

    from .errors import AnalysisError
    from .next_run import next_for_first_moment, next_for_reduction
    from .rig.key_types import PEAK_ACCELERATION

    stated = payload if isinstance(payload, Mapping) else {} if payload is None else {"": payload}
    payloads = [(name, si(mass, "mass")) for name, mass in stated.items()]
    sizes = [PEAK_ACCELERATION.parse(peak) if isinstance(peak, str) else peak for peak in peaks]
    if unfit := "sites" if sites and question == "reduction" else "axes" if axes and question != "reduction" else "":
        raise AnalysisError(f"{unfit}: nothing of a {question}; sites are of first moments, axes of reductions")
    if by and question == "reduction":
        raise AnalysisError("by: nothing of a reduction; sources are of first moments and counter-masses")
    if question == "reduction":
        return next_for_reduction(runs_of(campaign), _measure(metric, band), payloads, motions, sizes, axes, accept)
    return next_for_first_moment(runs_of(campaign), question, sites, payloads, motions, sizes, by)


def _model(mechanism: Mechanism | str | None, runs: Sequence[SIRun]) -> Mechanism:
    """The mechanism that is given, or that of the first run."""
    from .kinematics.encoder_motion import mechanism_of

    return mechanism if isinstance(mechanism, Mechanism) else mechanism_of(runs[0], mechanism)


def identify(
    mechanism: Mechanism | str | None,
    *runs: Runs | SIRun,
    by: By | None = None,
    method: Method | None = None,
    rig: Rig | str | Path | None = None,
    accept: Sequence[str] = (),
    validate: Sequence[Runs] = (),
    done: Callable[[int], None] = lambda steps: None,
) -> Identification:
    """Inertial parameters and friction of a mechanism from the positions, torques and forces of runs.

    ``mechanism``: None for that of the first run. ``by``: ``torque``, ``wrench`` or ``both``; ``method``: ``ls``,
    ``iv`` or ``oe``; ``validate``: runs that have no part in it, to hold the result against; ``done`` is told of
    ``identification.STEPS`` as they are done. Intervals by a
    delete-block jackknife, widened to contain the answers of other choices.

    >>> import testbench
    >>> testbench.identify("parallelogram-6bar", "campaign/r002.h5", by="wrench").table()["unit"][0]
    'kg m'
    """
    from .cross_examination import examine
    from .identification import identify as identified
    from .identification import result
    from .identification.records import assemble
    from .runs.aligned_run import AlignedRun

    bound = bound_runs(runs, rig)
    model = _model(mechanism, bound)
    aligned = [AlignedRun(run, model) for run in bound]
    taken = assemble(aligned, by, accept)
    open_findings = examine(bound, accept, model).open_findings
    found = identified(taken.records, taken.mechanism, method, done=done)
    found = replace(found, contradictions=(*open_findings, *taken.findings), by=taken.by, notes=taken.notes)
    if not validate:
        return found
    separate = [AlignedRun(run, model) for run in bound_runs(validate, rig)]
    records = assemble([aligned[0], *separate], taken.by, accept).records[1:]
    return replace(found, validation=result.validate(found, records))


def trim(
    mechanism: Mechanism | str | None,
    *runs: Runs | SIRun,
    sites: Sequence[str] = (),
    stock: str | Path | None = None,
    by: Sequence[Source] = (),
    cutoff_hz: float | None = None,
    rig: Rig | str | Path | None = None,
    accept: Sequence[str] = (),
) -> Trim:
    """What first moment [kg m] is missing at which site of a mechanism as built, and which mass to add there.

    ``mechanism``: None for that of the first run. ``by``: ``wrench``, ``torque``, ``vibration``, ``trials`` [default:
    what the rig has], weighted by their inverse covariances.

    >>> import testbench
    >>> testbench.trim("parallelogram-6bar", "campaign/r002.h5", by=["wrench"]).table()["site"].tolist()
    ['counter_A0A', 'counter_B0B']
    """
    from balance.balancing.stock_plates import load_stock

    from .cross_examination import examine
    from .runs.aligned_run import AlignedRun, recorded_clocks
    from .trimming import trim_runs

    bound, plates = bound_runs(runs, rig), load_stock(stock) if stock else []
    model = _model(mechanism, bound)
    aligned = [AlignedRun(run, model, recorded_clocks(run)) for run in bound]
    found = trim_runs(aligned, sites, plates, by or None, cutoff_hz)
    examination = examine(bound, accept, model)
    accepted = tuple(finding for finding in examination.findings if finding.code in examination.accepted)
    return replace(found, findings=(*found.findings, *examination.open_findings), accepted=accepted)


@overload
def align(
    runs: Run, reference: str | None = None, drift: bool = True, record: bool = False, by: AlignBy = "correlation"
) -> RunClocks: ...


@overload
def align(
    runs: Campaign | Sequence[Run],
    reference: str | None = None,
    drift: bool = True,
    record: bool = False,
    by: AlignBy = "correlation",
) -> list[RunClocks]: ...


@overload
def align(
    runs: str | Path,
    reference: str | None = None,
    drift: bool = True,
    record: bool = False,
    by: AlignBy = "correlation",
) -> RunClocks | list[RunClocks]: ...


def align(
    runs: Runs,
    reference: str | None = None,
    drift: bool = True,
    record: bool = False,
    by: AlignBy = "correlation",
) -> RunClocks | list[RunClocks]:
    """The clocks of a run's loggers: offset [s] and drift against that of the encoders or ``reference``.

    Of a campaign, or its folder, a list of those of each run. ``by``: ``correlation`` of common signals (else the
    trigger that the rig names), a ``tap``, or the edges of that ``trigger``. What is not aligned has the reason in
    ``refused``. With ``record`` the result is added to the campaign: tables of several loggers are joined by it.

    >>> import testbench
    >>> sorted(testbench.align("campaign/r002.h5").aligned)
    ['r002_daq', 'r002_forces']
    """
    from .errors import AnalysisError
    from .kinematics.encoder_motion import loaded_mechanism, mechanism_of
    from .runs.si_run import SIRun
    from .synchronization.event_alignment import METHODS
    from .synchronization.known_clocks import align_by
    from .synchronization.run_alignment import write_alignments

    if by not in METHODS:
        raise AnalysisError(f"by: {by!r}: expected {', '.join(METHODS)}")
    opened = runs_of(runs)
    found: list[RunClocks] = []
    for one in opened:
        bound = SIRun.of(one)

        def mounted(run: SIRun = bound) -> Mechanism:
            return loaded_mechanism(run, mechanism_of(run, None))

        found.append(align_by(by, bound, mounted, reference, drift))
    done = [(one.path, clocks) for one, clocks in zip(opened, found, strict=True) if clocks.aligned]
    for folder in dict.fromkeys(path.parent for path, _ in done) if record else ():
        write_alignments(folder, [one for one in done if one[0].parent == folder])
    single = isinstance(runs, Run) or (isinstance(runs, str | Path) and not Path(runs).is_dir())
    return found[0] if single else found
