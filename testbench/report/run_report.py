"""The report of one run, each part with its definition or the reason why it is unknown, and the figures of a report."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from balance.errors import CounterpoiseError
from balance.results import plain

from .. import figures
from ..cross_examination import Examination, examine
from ..kinematics import motion_recognition
from ..kinematics.encoder_motion import encoder_gaps, mechanism_of
from ..kinematics.gaps import gap_reach
from ..loads import command_tracking
from ..loads.shaking_wrench import shaking_wrench
from ..recording import Finding
from ..rig.sensors import Encoder
from ..runs.aligned_run import AlignedRun
from ..runs.si_run import SIRun
from ..vibration.metrics import DEFAULT_BAND
from ..vibration.run_pairs import Pair, pairs
from . import sections
from .sections import Part, attempt_part, base_response

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..kinematics.motion_recognition import RecognizedMotion
    from ..signal.filters import Band
    from ..store import Run

Point = tuple[float, float, float]


@dataclass(frozen=True)
class RunReport:
    """The parts of a report by name, in the order of the text; one that is unknown has a ``reason`` alone."""

    run: "Run"
    parts: dict[str, Part]
    findings: tuple[Finding, ...]

    def as_dict(self) -> dict[str, Any]:
        """The report as it stands in JSON."""
        about = {"run": self.run.name, "origin": str(self.run.origin), "conditions": dict(self.run.conditions)}
        return dict(plain({**about, **self.parts, "findings": self.findings}))


def report(
    run: "SIRun",
    point: Point = (0.0, 0.0, 0.0),
    band: "Band | None" = DEFAULT_BAND,
    bandwidth_hz: float = command_tracking.BANDWIDTH_HZ,
    given: str | None = None,
    examination: Examination | None = None,
) -> RunReport:
    """Analyse one run: vibration and forces in ``band``, accelerations and torques below ``bandwidth_hz``.

    ``given`` is a mechanism in place of the one that the rig names; ``point`` [m] that of the moments.
    ``examination`` is that of the run's campaign; without one the run is examined by itself.
    """
    aligned = cache(lambda: AlignedRun(run, mechanism_of(run, given)))
    found, reasons = motion_recognition.recognized_motions(run, aligned)
    shown, of_command = _command(aligned, bandwidth_hz)
    forces: Part = {}
    response: Part = {}
    findings = run.doubts(run.rig.base_columns)
    try:
        wrench = shaking_wrench(run, point)
        forces = attempt_part(lambda: sections.wrench_part(wrench, band))
        response = attempt_part(lambda: base_response(run, wrench))
        findings += wrench.findings
    except CounterpoiseError as error:
        forces = response = {"reason": str(error)}
    torque = attempt_part(lambda: sections.torque_part(aligned(), bandwidth_hz))
    findings += _gaps(run, bandwidth_hz)
    examination = examination or examine([run], mechanism=None if given is None else aligned().unloaded)
    findings += [statement.finding for statement in examination.about(run.name)]
    parts = {
        "motions": _motions(found, reasons),
        "command": of_command,
        "vibration": attempt_part(lambda: sections.base_levels(run, band)),
        "modes": attempt_part(lambda: sections.base_modes(run, sections.motion_on_base_clock(run, found, shown))),
        "response": response,
        "wrench": forces,
        "torque": torque,
    }
    return RunReport(run.recorded, parts, tuple(findings))


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


def _gaps(run: "SIRun", bandwidth_hz: float) -> Sequence[Finding]:
    """A finding for each gap of the encoders, with what it removes from the analysis."""
    if not run.rig.columns_of(Encoder):
        return []
    try:
        gaps = encoder_gaps(run)
    except CounterpoiseError:
        return []
    return gaps.findings(run.name, gap_reach(bandwidth_hz))


def _motions(
    found: "dict[motion_recognition.Source, list[RecognizedMotion]]", reasons: "dict[motion_recognition.Source, str]"
) -> Part:
    """The motions by each source."""
    return {
        "found": [one for some in found.values() for one in some],
        "reasons": dict(reasons),
        "definition": "from leaving a place at rest to coming back to it, by legs from rest to rest",
    }


def draw(runs: "Sequence[Run]", folder: Path, mechanism: str | None, bandwidth_hz: float) -> list[Path]:
    """Write figures as SVG; what cannot be drawn is left out, since the report has the reason."""
    written = []
    for run in runs:
        written += _saved(folder / f"{run.name}-command.svg", partial(_draw_command, run, mechanism, bandwidth_hz))
        written += _saved(folder / f"{run.name}-spectrum.svg", partial(figures.base_spectrum, run))
    for pair in pairs(runs)[0]:
        for name, path in _names(pair, folder).items():
            written += _saved(path, partial(getattr(figures, name), pair.balanced[0], pair.unbalanced[0]))
    return written


def _draw_command(run: "Run", mechanism: str | None, bandwidth_hz: float) -> "Figure":
    return figures.command_performance(run, mechanism_of(SIRun.of(run), mechanism), bandwidth_hz)


def _names(pair: Pair, folder: Path) -> dict[str, Path]:
    both = f"{pair.balanced[0].name}-{pair.unbalanced[0].name}"
    ends = {"base_acceleration": "base", "motor_torques": "torques", "force_sensors": "forces"}
    return {name: folder / f"{both}-{end}.svg" for name, end in ends.items()}


def _saved(path: Path, work: "Callable[[], Figure]") -> list[Path]:
    try:
        figure = work()
    except CounterpoiseError:
        return []
    figure.savefig(path)
    return [path]
