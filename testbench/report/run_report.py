"""The report of one run, each part with its definition or the reason why it is unknown, and the figures of a report."""

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from balance.errors import CounterpoiseError
from balance.mechanism.mechanism import Mechanism
from balance.mechanism.mjcf_parser import load_mechanism
from balance.report.plotted import PlottedRun
from balance.results import plain
from balance.task_pool import HERE, TaskPool

from .. import figures
from ..cross_examination import Examination, Observation, hear
from ..cross_examination.examination import observed
from ..kinematics import motion_recognition
from ..kinematics.encoder_motion import encoder_gaps, mechanism_of
from ..kinematics.gaps import gap_reach
from ..loads import command_tracking, drive_torque
from ..loads.shaking_wrench import shaking_wrench
from ..recording import Finding
from ..rig.sensors import Encoder
from ..runs.aligned_run import AlignedRun
from ..runs.si_run import SIRun
from ..vibration.channel_levels import ChannelLevels, channel_levels, level_definitions
from ..vibration.metrics import DEFAULT_BAND, Measure
from ..vibration.run_amplitudes import AmplitudesOfRun, amplitudes_or_reason
from ..vibration.run_pairs import pairs
from . import sections
from .page_contents import plotted_run
from .sections import Part, attempt_part, base_response

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..signal.filters import Band
    from ..store import Run


@dataclass(frozen=True)
class RunReport:
    """The parts of a report by name, in the order of the text; one that is unknown has a ``reason`` alone."""

    run: "Run"
    parts: dict[str, Part]
    findings: tuple[Finding, ...]
    plotted: PlottedRun | None = None
    """Its channels as a page draws them."""
    amplitudes: AmplitudesOfRun | str | None = None
    """For reductions, or why there are none; None where not asked for."""

    def as_dict(self) -> dict[str, Any]:
        """The report as it stands in JSON."""
        about = {"run": self.run.name, "origin": str(self.run.origin), "conditions": dict(self.run.conditions)}
        return dict(plain({**about, **self.parts, "findings": self.findings}))


@dataclass(frozen=True)
class Reporting:
    """How runs are reported: vibration and forces in ``band``, accelerations and torques below ``bandwidth_hz``."""

    point: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """That moments are about [m]."""
    band: "Band | None" = DEFAULT_BAND
    bandwidth_hz: float = command_tracking.BANDWIDTH_HZ
    mechanism: str | None = None
    """In place of the one that the rigs name."""
    measure: Measure | None = None
    """Of the amplitudes that reductions need; None: of none."""

    def runs(
        self, runs: "Sequence[Run]", accept: Iterable[str] = (), pool: TaskPool = HERE, spans: int | None = None
    ) -> tuple[Examination, dict[str, RunReport], dict[str, str]]:
        """The examination of runs of one campaign, their reports by name, and by name why a run has none.

        Each run is a task of the ``pool``, its channels read once; with ``spans``, those of a page's curves, it is
        plotted too. ``accept``: codes of contradictions that a person accepts.
        """
        given = load_mechanism(self.mechanism) if self.mechanism else None
        work = partial(_observed_and_reported, how=self, known={}, given=given, spans=spans)
        found = pool.map(work, runs, imports=True)
        examination = hear([seen for seen, _ in found if seen], accept).decided(runs)
        reports, unread = {}, dict[str, str]()
        for run, (_, one) in zip(runs, found, strict=True):
            if isinstance(one, str):
                unread[run.name] = one
            else:
                contradicted = [statement.finding for statement in examination.about(run.name)]
                reports[run.name] = replace(one, run=run, findings=(*one.findings, *contradicted))
        return examination, reports, unread


def _observed_and_reported(
    run: "Run", how: Reporting, known: dict[object, Mechanism], given: Mechanism | None, spans: int | None
) -> tuple[Observation | None, RunReport | str]:
    """What a run shows, and its report, without contradictions, or why it has none."""
    seen = None
    try:
        bound = SIRun.of(run)
        with suppress(CounterpoiseError):  # what needs a channel that cannot be read says why
            bound = bound.preloaded([column for column in bound.rig.columns() if bound.holds(column)])
        seen = observed(bound, known, given)
        report = _report(bound, how, seen, spans)
        return seen, replace(report, amplitudes=amplitudes_or_reason(bound, how.measure) if how.measure else None)
    except CounterpoiseError as error:
        return seen, str(error)


def _report(run: SIRun, how: Reporting, seen: Observation | None, spans: int | None) -> RunReport:
    point, band, bandwidth_hz = how.point, how.band, how.bandwidth_hz
    aligned = cache(lambda: AlignedRun(run, mechanism_of(run, how.mechanism)))
    found, reasons = motion_recognition.recognized_motions(run, aligned, seen.motions if seen else {})
    levels: list[ChannelLevels] = []

    def vibration() -> Part:
        levels.extend(channel_levels(run, sections.base_columns(run), band))
        return {"axes": plain(levels), "definitions": level_definitions(band)}

    def torque() -> Part:
        drives = [drive.as_dict() for drive in drive_torque.drive_torques(aligned(), bandwidth_hz)]
        return {"drives": drives, "definitions": drive_torque.DEFINITIONS}

    shown, of_command = _command(aligned, bandwidth_hz)
    forces: Part = {}
    response: Part = {}
    findings = run.doubts(run.rig.base_columns)
    try:
        wrench = shaking_wrench(run, point)
        forces = attempt_part(lambda: sections.wrench_part(wrench, band))
        response = attempt_part(lambda: base_response(run, wrench))
        findings += [found for found in wrench.findings if found not in findings]
    except CounterpoiseError as error:
        forces = response = {"reason": str(error)}
    with suppress(CounterpoiseError):  # a finding for each gap of the encoders, with what it removes from the analysis
        findings += encoder_gaps(run).findings(run.name, gap_reach(bandwidth_hz)) if run.rig.columns_of(Encoder) else []
    parts = {
        "motions": {
            "found": [one for some in found.values() for one in some],
            "reasons": dict(reasons),
            "definition": "from leaving a place at rest to coming back to it, by legs from rest to rest",
        },
        "command": of_command,
        "vibration": attempt_part(vibration),
        "modes": attempt_part(
            lambda: sections.base_modes(run, sections.motion_on_base_clock(run, found, shown, aligned))
        ),
        "response": response,
        "wrench": forces,
        "torque": attempt_part(torque),
    }
    plotted = None if spans is None else plotted_run(run, levels, spans)
    return RunReport(run.recorded, parts, tuple(findings), plotted)


def _command(
    aligned: Callable[[], AlignedRun], bandwidth_hz: float
) -> tuple[command_tracking.CommandPerformance | None, Part]:
    try:
        shown = command_tracking.command_performance(aligned(), bandwidth_hz)
    except CounterpoiseError as error:
        return None, {"reason": str(error)}
    return shown, {
        "axes": shown.reached(),
        "bandwidth_hz": bandwidth_hz,
        "left_out_s": shown.left_out_s,
        "accelerometer_shifted_s": shown.lag_s,
        "encoder_noise": shown.encoder_noise,
        "definitions": command_tracking.DEFINITIONS,
    }


def draw(runs: "Sequence[Run]", folder: Path, mechanism: str | None, bandwidth_hz: float) -> list[Path]:
    """Write figures as SVG; what cannot be drawn is left out, since the report has the reason."""
    drawn: dict[Path, Callable[[], Figure]] = {}
    for run in runs:
        drawn[folder / f"{run.name}-command.svg"] = lambda run=run: figures.command_performance(  # type: ignore[misc]
            run, mechanism_of(SIRun.of(run), mechanism), bandwidth_hz
        )
        drawn[folder / f"{run.name}-spectrum.svg"] = partial(figures.base_spectrum, run)
    ends = {"base": figures.base_acceleration, "torques": figures.motor_torques, "forces": figures.force_sensors}
    for pair in pairs(runs)[0]:
        sides = pair.balanced[0], pair.unbalanced[0]
        for end, draw_pair in ends.items():
            drawn[folder / f"{sides[0].name}-{sides[1].name}-{end}.svg"] = partial(draw_pair, *sides)
    written = []
    for path, work in drawn.items():
        with suppress(CounterpoiseError):
            work().savefig(path)
            written.append(path)
    return written
