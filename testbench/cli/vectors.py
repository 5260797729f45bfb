"""``testbench vectors``."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from balance.cli.framework import Answer, Word, argument, command, option
from balance.cli.options import FIGURE, draw
from balance.cli.printing import emit_findings, emit_table, say, with_interval

from ..signal import METRIC_NAMES
from . import options

if TYPE_CHECKING:
    from ..rotating.order_tracking import OrderVector, Vectors
    from ..signal import Metric
    from ..store import Run

_ROUNDING = 1e-9
"""Relative change of speed that counts as rounding."""
_NO_SENSOR = "no vibration in a unit of length, velocity or acceleration; if it is, the rig needs its calibration."
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
amplitude), as the comment above each table says; planes stand at its head: balance rotor influence --help.

\b
Exit codes: 0 done, 3 done with findings, 1 refused."""
)
def vectors(
    run_file: Path = argument("RUN"),
    tacho: str = option("Channel with one pulse a turn.", default="tacho", metavar="CHANNEL"),
    level: float | None = option("Level of a pulse, in the channel's unit [default: half swing].", metavar="V"),
    falling: bool = option("Pulses begin where the signal falls."),
    sensor: tuple[str, ...] = option(
        "Vibration sensor [default: all with the tacho, in SI by the rig].", metavar="CHANNEL"
    ),
    order: int = option("Multiple of the speed.", click.IntRange(1, 100), default=1),
    phase: str = option("Whether a phase is a lead or a lag.", Word(["lead", "lag"]), default="lead"),
    amplitude: "Metric" = option("Metric of an amplitude.", Word(METRIC_NAMES), default="peak"),
    steady_within: float = option(
        "Speed that counts as steady.", click.FloatRange(0.0, 50.0, min_open=True), default=1.0, metavar="PERCENT"
    ),
    speed: str | None = option("Nominal speed, such as 3000rpm: the run's must agree with it.", metavar="N"),
    toml: str | None = option("Write it as this run of a file of trial runs; needs --speed.", metavar="NAME"),
    weight: tuple[str, ...] = option('Trial weight of this run, "fan end=10 g @ 0 deg".', metavar="PLANE=W@A"),
    stayed_on: bool | None = option(
        "Whether the trial weight stayed on after this run.", None, "--stayed-on/--came-off", default=None
    ),
    figure: str | None = FIGURE,
) -> Answer:
    """Amplitude and phase of each vibration sensor of RUN, a stored run, at an order of its speed.

    The tachometer's pulses cut the record into turns, over which it is averaged; intervals (95 %) come from the noise
    near the order, where tones that do not turn with the rotor are fitted and named. Refused: lost or spurious
    pulses, a speed that is not steady, too few turns.
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
    from ..rotating.order_tracking import Tachometer, order_vectors
    from ..store import open_run

    run, within = open_run(run_file), steady_within / 100.0
    found = order_vectors(run, Tachometer(tacho, level, falling, within), sensor, order)
    if speed:
        _agrees(run, found, speed, within)
    document = _document(run, found, phase, amplitude)
    draw(figure, "testbench.figures.rotating:draw_vectors", document)

    def show() -> None:
        if toml:
            click.echo(_toml(run, found, (toml, speed or "", phase, amplitude), weight, stayed_on))
        else:
            _print(run, found, phase, amplitude)

    return Answer(document, show, bool(found.findings()))


def _agrees(run: "Run", found: "Vectors", text: str, within: float) -> None:
    from balance.units import parse

    from ..errors import AnalysisError

    nominal = parse(text, "angular velocity") / (2.0 * math.pi)
    if not nominal > 0.0:
        raise click.UsageError(f"--speed is {text!r}: expected more than zero")
    if abs(found.turns.speed / nominal - 1.0) > within:
        raise AnalysisError(
            f"{run.name}: turns at {60 * found.turns.speed:.5g} rpm, not at {text} within {100 * within:g} %"
        )


def _amplitude(vector: "OrderVector", metric: "Metric") -> tuple[float, float]:
    from ..rotating.order_tracking import METRICS

    return METRICS[metric] * abs(vector.value), METRICS[metric] * vector.amplitude_within


def _degrees(vector: "OrderVector", phase: str) -> float:
    import cmath

    return math.degrees(cmath.phase(vector.value)) * (1.0 if phase == "lead" else -1.0)


def _toml(
    run: "Run",
    found: "Vectors",
    written: "tuple[str, str, str, Metric]",
    weights: tuple[str, ...],
    stayed_on: bool | None,
) -> str:
    """A run of a file of trial runs, ``written`` its name, speed, phase and metric."""
    name, speed, phase, metric = written
    lines = [
        f'# from {run.name}, {run.origin}: phase = "{phase}", amplitude = "{metric}"',
        *(f"# finding: {finding}" for finding in found.findings()),
        *(f"# left out: {one}: {_NO_SENSOR}" for one in found.left_out),
        "[[runs]]",
        f"name = {_quoted(name)}",
    ]
    if weights:
        pairs = [text.partition("=") for text in weights]
        mounted = ", ".join(f"{_quoted(plane.strip())} = {_quoted(weight.strip())}" for plane, _, weight in pairs)
        lines += [f"weights = {{ {mounted} }}", f"stayed_on = {str(stayed_on).lower()}"]
    readings = ", ".join(f"{_quoted(v.sensor)} = {_quoted(_reading(v, phase, metric))}" for v in found.vectors)
    lines.append(f"readings.{_quoted(speed)} = {{ {readings} }}")
    if found.common_phase_normal_within > _ROUNDING:
        within = math.degrees(found.common_phase_normal_within)
        lines.append(f'phases_alike.{_quoted(speed)} = "{within:.3g} deg"')
    return "\n".join([*lines, ""])


def _reading(vector: "OrderVector", phase: str, metric: "Metric") -> str:
    """A reading with its intervals; one within the scatter has no interval of the phase."""
    from ..rotating.order_tracking import UNITS

    (size, within), unit = _amplitude(vector, metric), UNITS[vector.dimension]
    about = f" ± {math.degrees(vector.own_phase_within):.3g} deg" if vector.is_significant else ""
    return f"{size:.9g} {unit} ± {within:.3g} {unit} @ {_degrees(vector, phase):.6f} deg{about}"


def _quoted(text: str) -> str:
    """A basic string of TOML."""
    import json

    return json.dumps(text, ensure_ascii=False)


def _document(run: "Run", found: "Vectors", phase: str, metric: "Metric") -> dict[str, Any]:
    from balance.estimation.estimate import LEVEL_TEXT

    from ..rotating.order_tracking import UNITS

    suffix = {"m": "m", "m/s": "m_s", "m/s^2": "m_s2"}
    rows = []
    for v in found.vectors:
        key, (size, within) = f"amplitude_{suffix[UNITS[v.dimension]]}", _amplitude(v, metric)
        row: dict[str, Any] = {"sensor": v.sensor, "reading": v.dimension, key: size, f"{key}_within": within}
        row |= {"phase_deg": _degrees(v, phase), "phase_deg_within": math.degrees(v.phase_within)}
        rows.append(
            row
            | {"coherence": v.coherence, "share_of_power": v.share, "told": v.is_significant}
            | {"foreign_tones_Hz": list(v.tones)}
        )
    return {
        "run": run.name,
        "origin": run.origin,
        "order": found.order,
        "amplitude": metric,
        "phase": phase,
        "turns": found.turns.count,
        "speed_rpm": 60.0 * found.turns.speed,
        "speed_change_percent": 100.0 * found.turns.change,
        "interval": LEVEL_TEXT,
        "phases_off_alike_deg_within": math.degrees(found.common_phase_within),
        "findings": list(found.findings()),
        "vectors": rows,
        "left_out": list(found.left_out),
    }


def _print(run: "Run", found: "Vectors", phase: str, metric: "Metric") -> None:
    """Speed and vectors in one sentence, then all that is known of each vector."""
    from ..rotating.order_tracking import UNITS

    rows, said = [], []
    for v in found.vectors:
        size, within = _amplitude(v, metric)
        angle = with_interval(_degrees(v, phase), math.degrees(v.phase_within)) if v.is_significant else ""
        length = f"{with_interval(size, within)} {UNITS[v.dimension]}"
        said.append(f"{v.sensor} {length} {f'at {angle} deg' if angle else 'in the scatter'}")
        rows.append([v.sensor, length, angle or "in the scatter", f"{v.coherence:.4f}", f"{v.share:.3f}"])
    turns = found.turns
    change = f"{100 * turns.change:.2g}" if turns.change > _ROUNDING else "0"
    say(
        f"{run.name} ({run.origin}), {turns.count} turns at {60 * turns.speed:.6g} rpm, changing by {change} %: order "
        f"{found.order} {'; '.join(said[:_SAID])}{f' and {len(said) - _SAID} more' if len(said) > _SAID else ''}."
    )
    title = f"Order {found.order} of {run.name} ({run.origin}), {metric}, phase as {phase} of the pulse"
    emit_table(title, ["sensor", "amplitude", "phase [deg]", "coherence", "share of power"], rows)
    for v in found.vectors:
        if v.tones:
            tones = ", ".join(f"{tone:.4g} Hz" for tone in v.tones)
            say(f"{v.sensor}: near the order {tones}, which does not turn with the rotor; fitted with it.")
    if found.left_out:
        say(f"Left out: {', '.join(found.left_out)}: {_NO_SENSOR}")
    options.print_calibrations(options.calibrations([run]))
    emit_findings(("Finding", f"{finding}.") for finding in found.findings())
