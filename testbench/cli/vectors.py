"""``testbench vectors``."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from balance.cli.framework import Answer, Quantity, Word, argument, command, option
from balance.cli.options import FIGURE, draw
from balance.cli.printing import emit_findings, emit_table, say, with_interval

from ..signal import METRIC_NAMES
from . import options

if TYPE_CHECKING:
    from ..rotating.order_tracking import Vectors
    from ..signal import Metric
    from ..store import Run

_ROUNDING = 1e-9
"""Relative change of speed that counts as rounding."""
_SAID = 4
"""Sensors of the first sentence."""


@command(
    epilog="""\b
Examples:
  testbench vectors as-found.h5 --tacho tacho --figure vectors.png
  testbench vectors as-found.h5 --tacho tacho --speed 3000rpm --toml "as found" >> runs.toml
  testbench vectors trial-1.h5 --tacho tacho --speed 3000rpm --toml "trial 1" \\
    --weight "fan end=10 g @ 0 deg" --came-off >> runs.toml
  balance rotor influence runs.toml

\b
Phase counts from the pulse. lead: the peak comes so much of a turn before the pulse, and weight angles
count with the rotation; lag: so much after it. The file of trial runs must say the same (phase,
amplitude), as the comment above each table says; planes stand at its head: balance schema
trial-runs --text.

\b
Exit codes: 0 done, 3 done with findings, 1 refused."""
)
def vectors(
    run_file: Path = argument("RUN"),
    tacho: str = option("Channel with pulses, one a turn, or an encoder's angle.", default="tacho", metavar="CHANNEL"),
    level: float | None = option("Level of a pulse, in the channel's unit [default: half swing].", metavar="V"),
    falling: bool = option("Pulses begin where the signal falls."),
    pulses: int | None = option("Marks a turn [default: 1].", click.IntRange(1), metavar="N"),
    begin: float | None = option("Use the record from this time on.", Quantity("time"), "--from", metavar="TIME"),
    end: float | None = option("Use it up to this time, such as 8s.", Quantity("time"), "--to", metavar="TIME"),
    sensor: tuple[str, ...] = option(
        "Vibration sensor [default: all with the tacho, in SI by the rig].", metavar="CHANNEL"
    ),
    order: int = option("Multiple of the speed.", click.IntRange(1, 100), default=1),
    phase: str = option("Whether a phase is a lead or a lag.", Word(["lead", "lag"]), default="lead"),
    amplitude: "Metric" = option("Metric of an amplitude.", Word(METRIC_NAMES), default="peak"),
    steady_within: float = option(
        "Speed that counts as steady.", click.FloatRange(0.0, 50.0, min_open=True), default=1.0, metavar="PERCENT"
    ),
    speed: str | None = option(
        "Speed at which the vectors are given, such as 3000rpm [default: the mean].", metavar="N"
    ),
    toml: str | None = option("Write it as this run of a file of trial runs; needs --speed.", metavar="NAME"),
    weight: tuple[str, ...] = option('Trial weight of this run, "fan end=10 g @ 0 deg".', metavar="PLANE=W@A"),
    stayed_on: bool | None = option(
        "Whether the trial weight stayed on after this run.", None, "--stayed-on/--came-off", default=None
    ),
    figure: str | None = FIGURE,
) -> Answer:
    """Amplitude and phase of each vibration sensor of RUN, a stored run, at an order of its speed.

    The tachometer's pulses, one a turn or --pulses, cut the record into turns; intervals (95 %) come from the noise
    near the order, where tones that do not turn with the rotor are fitted and named. Where the speed changes, vectors
    are fitted over it and given at one. Refused: lost or spurious pulses, a speed that is not steady, too few turns.
    """
    if toml and click.get_current_context().params["as_json"]:
        raise click.UsageError("give either --toml or --json")
    if not 0.0 < steady_within <= 50.0:
        raise click.UsageError(f"--steady-within is {steady_within:g}: expected more than 0, at most 50 %")
    if level is not None and not math.isfinite(level):
        raise click.UsageError(f"--level is {level:g}: expected a number")
    if twice := [name for i, name in enumerate(sensor) if name in sensor[:i]]:
        raise click.UsageError(f"--sensor names {twice[0]!r} twice")
    if toml and not speed:
        raise click.UsageError("--toml needs --speed: trial runs are matched by their nominal speed")
    if toml and order != 1:
        raise click.UsageError("--toml is for order 1: unbalance turns with the rotor")
    if (weight or stayed_on is not None) and not toml:
        raise click.UsageError("--weight, --stayed-on and --came-off go with --toml")
    if bool(weight) != (stayed_on is not None):
        raise click.UsageError("--weight needs --stayed-on or --came-off, and they need --weight")
    if wrong := [text for text in weight if "=" not in text or "@" not in text]:
        raise click.UsageError(f"--weight {wrong[0]!r}: expected 'PLANE=10 g @ 0 deg'")
    from ..rotating import order_tracking
    from ..store import open_run

    run = open_run(run_file)
    found = order_tracking.vectors(
        run, tacho, sensor, order, speed, level=level, falling=falling, steady_within=steady_within / 100.0,
        pulses=pulses, begin=begin, end=end, amplitude=amplitude, phase=phase,
    )  # fmt: skip
    document = found.document()
    draw(figure, "testbench.figures.rotating:draw_vectors", found)
    pairs = [text.partition("=") for text in weight]
    weights = {plane.strip(): on.strip() for plane, _, on in pairs}

    def show() -> None:
        if toml:
            click.echo(found.to_toml(toml, weights, stayed_on))
        else:
            _print(run, found, document)

    return Answer(document, show, bool(document["findings"]))


def _print(run: "Run", found: "Vectors", document: dict[str, Any]) -> None:
    """Speed and vectors in one sentence, then all that is known of each vector."""
    from ..rotating.order_tracking import METRICS, NO_SENSOR, UNITS

    rows, said = [], []
    for v in found.vectors:
        angle = with_interval(found.degrees(v.value), math.degrees(v.phase_within)) if v.is_significant else ""
        factor = METRICS[found.amplitude]
        length = f"{with_interval(factor * abs(v.value), factor * v.amplitude_within)} {UNITS[v.dimension]}"
        said.append(f"{v.sensor} {length} {f'at {angle} deg' if angle else 'in the scatter'}")
        rows.append([v.sensor, length, angle or "in the scatter", f"{v.coherence:.4f}", f"{v.share:.3f}"])
    change = f"{document['speed_change_percent']:.2g}" if found.turns.change > _ROUNDING else "0"
    at = f", given at {found.asked}" if found.asked else ""
    say(
        f"{run.name} ({run.origin}), {found.turns.count} turns, "
        f"{found.turns.marks} mark{'s' * (found.turns.marks > 1)} each, "
        f"at {document['speed_rpm']:.6g} rpm, changing by {change} %{at}: order {found.order} {'; '.join(said[:_SAID])}"
        f"{f' and {len(said) - _SAID} more' if len(said) > _SAID else ''}."
    )
    title = f"Order {found.order} of {run.name} ({run.origin}), {found.amplitude}, phase as {found.phase} of the pulse"
    emit_table(title, ["sensor", "amplitude", "phase [deg]", "coherence", "share of power"], rows)
    findings = document["findings"]
    for v in found.vectors:
        if (course := found.course(v)) and not any(course in finding for finding in findings):
            say(f"{v.sensor}: {course}.")
        if v.tones:
            tones = ", ".join(f"{tone:.4g} Hz" for tone in v.tones)
            say(f"{v.sensor}: near the order {tones}, which does not turn with the rotor; fitted with it.")
    if found.left_out:
        say(f"Left out: {', '.join(found.left_out)}: {NO_SENSOR}")
    options.print_calibrations(options.calibrations([run]))
    emit_findings(("Finding", f"{finding}.") for finding in findings)
