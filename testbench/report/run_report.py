"""All that one run tells, each part with what it is by definition, or with why it is not known.

Figures of a report: each run by itself, and runs with counter-masses beside those without.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from balance.errors import CounterpoiseError

from .. import figures
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
from .force_sign_check import reversed_polarity
from .sections import Part, attempt_part, base_response

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..kinematics.motion_recognition import RecognizedMotion
    from ..signal.filters import Band
    from ..store import Run

Point = tuple[float, float, float]
OF_A_SIZE = 2.0
"""Up to this factor a torque and its model may differ without a finding: friction, a payload that was estimated."""


@dataclass(frozen=True)
class RunReport:
    """One run; every part is a document, or has a ``reason`` alone."""

    run: "Run"
    motions: Part
    command: Part
    vibration: Part
    modes: Part
    response: Part
    wrench: Part
    torque: Part
    findings: tuple[Part, ...]

    @property
    def parts(self) -> dict[str, Part]:
        """By name, in the order in which they are printed."""
        names = ("motions", "command", "vibration", "modes", "response", "wrench", "torque")
        return {name: getattr(self, name) for name in names}

    def as_dict(self) -> dict[str, Any]:
        """As it is printed."""
        return {
            "run": self.run.name,
            "origin": str(self.run.origin),
            "conditions": dict(self.run.conditions),
            **self.parts,
            "findings": list(self.findings),
        }


def report(
    run: "SIRun",
    point: Point = (0.0, 0.0, 0.0),
    band: "Band | None" = DEFAULT_BAND,
    bandwidth_hz: float = command_tracking.BANDWIDTH_HZ,
    given: str | None = None,
) -> RunReport:
    """Analyse one run: vibration and forces in ``band``, accelerations and torques below ``bandwidth_hz``.

    ``given`` is a mechanism in place of the one that the rig names.
    """
    aligned = cache(lambda: AlignedRun(run, mechanism_of(run, given)))
    found, reasons = motion_recognition.recognized_motions(run, aligned)
    shown, of_command = _command(aligned, bandwidth_hz)
    forces: Part = {}
    response: Part = {}
    findings: list[Part] = [finding.as_dict() for finding in run.doubts(run.rig.base_columns)]
    try:
        wrench = shaking_wrench(run, point)
        forces = attempt_part(lambda: sections.wrench_part(wrench, band))
        response = attempt_part(lambda: base_response(run, wrench))
        findings += [finding.as_dict() for finding in wrench.findings]
    except CounterpoiseError as error:
        forces = response = {"reason": str(error)}
    torque = attempt_part(lambda: sections.torque_part(aligned(), bandwidth_hz))
    findings += _gaps(run, bandwidth_hz)
    findings += [finding.as_dict() for finding in reversed_polarity(run, aligned)]
    findings += _contradicted(run, torque)
    return RunReport(
        run.recorded,
        _motions(run, found, reasons, findings),
        of_command,
        attempt_part(lambda: sections.base_levels(run, band)),
        attempt_part(lambda: sections.base_modes(run, sections.motion_on_base_clock(run, found, shown))),
        response,
        forces,
        torque,
        tuple(findings),
    )


def _command(
    aligned: Callable[[], AlignedRun], bandwidth_hz: float
) -> tuple[command_tracking.CommandPerformance | None, Part]:
    try:
        shown = command_tracking.command_performance(aligned(), bandwidth_hz)
    except CounterpoiseError as error:
        return None, {"reason": str(error)}
    return shown, {
        "axes": [one.as_dict() for one in shown.reached()],
        "bandwidth_hz": bandwidth_hz,
        "left_out_s": shown.left_out_s,
        "accelerometer_shifted_s": shown.lag_s,
        "encoder_noise": shown.encoder_noise,
        "definitions": command_tracking.DEFINITIONS,
    }


def _gaps(run: "SIRun", bandwidth_hz: float) -> list[Part]:
    """What of the encoders' record is left out, if they have a gap."""
    if not run.rig.columns_of(Encoder):
        return []
    try:
        gaps = encoder_gaps(run)
    except CounterpoiseError:
        return []
    return [finding.as_dict() for finding in gaps.findings(run.name, gap_reach(bandwidth_hz))]


def _contradicted(run: "SIRun", torque: Part) -> list[Part]:
    """Drives whose torque is of another size than the model's, a finding each."""
    return [
        Finding(
            "torque_contradiction",
            None,
            run.name,
            f"{run.name}: torque of {drive['joint']} is {drive['rms_ratio']:.2g} times the model's (RMS): expected "
            f"{1.0 / OF_A_SIZE:g} to {OF_A_SIZE:g}; units in rig and log, payload and counter-masses on the sheet?",
        ).as_dict()
        for drive in torque.get("drives", [])
        if not 1.0 / OF_A_SIZE <= drive["rms_ratio"] <= OF_A_SIZE
    ]


def _motions(
    run: "SIRun",
    found: "dict[motion_recognition.Source, list[RecognizedMotion]]",
    reasons: "dict[motion_recognition.Source, str]",
    findings: list[Part],
) -> Part:
    """The motions by each source; where sources or the sheet contradict each other, a finding."""
    names = {source: [one.name for one in some] for source, some in found.items()}
    known = {source: some for source, some in names.items() if some and "unknown" not in some}
    said = run.conditions.get("motion")
    for source, some in known.items():
        if said is not None and any(name != said for name in some):
            message = f"{run.name}: its sheet says motion {said}, by {source} it is {', '.join(some)}"
            findings.append(Finding("motion_contradiction", None, run.name, message).as_dict())
    return {
        "found": [one.as_dict() for some in found.values() for one in some],
        "reasons": dict(reasons),
        "definition": "from leaving a place at rest to coming back to it, by legs from rest to rest",
    }


def draw(runs: "Sequence[Run]", folder: Path, mechanism: str | None, bandwidth_hz: float) -> list[Path]:
    """Write what can be drawn as SVG; what a rig lacks is not drawn, as the report says why."""
    written = []
    for run in runs:
        written += _one(folder / f"{run.name}-command.svg", partial(_draw_command, run, mechanism, bandwidth_hz))
        written += _one(folder / f"{run.name}-spectrum.svg", partial(figures.base_spectrum, run))
    for pair in pairs(runs)[0]:
        for name, path in _names(pair, folder).items():
            written += _one(path, partial(getattr(figures, name), pair.balanced[0], pair.unbalanced[0]))
    return written


def _draw_command(run: "Run", mechanism: str | None, bandwidth_hz: float) -> "Figure":
    return figures.command_performance(run, mechanism_of(SIRun.of(run), mechanism), bandwidth_hz)


def _names(pair: Pair, folder: Path) -> dict[str, Path]:
    both = f"{pair.balanced[0].name}-{pair.unbalanced[0].name}"
    ends = {"base_acceleration": "base", "motor_torques": "torques", "force_sensors": "forces"}
    return {name: folder / f"{both}-{end}.svg" for name, end in ends.items()}


def _one(path: Path, work: "Callable[[], Figure]") -> list[Path]:
    try:
        figure = work()
    except CounterpoiseError:
        return []
    figure.savefig(path)
    return [path]
