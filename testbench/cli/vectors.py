"""``testbench vectors``."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from balance.cli.framework import Answer, Word, answering, emit_findings, emit_table
from balance.cli.options import draw, figure_option

from ..signal import METRIC_NAMES

if TYPE_CHECKING:
    from ..rotating.order_tracking import OrderVector, Vectors
    from ..signal import Metric
    from ..store import Run

_ROUNDING = 1e-9
"""Relative change of speed that counts as rounding."""


@click.command(
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
@click.argument("run_file", metavar="RUN", type=click.Path(path_type=Path))
@click.option("--tacho", default="tacho", show_default=True, metavar="CHANNEL", help="Channel with one pulse a turn.")
@click.option("--level", type=float, metavar="V", help="Level of a pulse, in the channel's unit [default: half swing].")
@click.option("--falling", is_flag=True, help="Pulses begin where the signal falls.")
@click.option("--sensor", multiple=True, metavar="CHANNEL", help="Vibration sensor [default: all with the tacho].")
@click.option("--order", type=click.IntRange(1, 100), default=1, show_default=True, help="Multiple of the speed.")
@click.option(
    "--phase",
    type=Word(["lead", "lag"]),
    default="lead",
    show_default=True,
    help="Whether a phase is a lead or a lag.",
)
@click.option("--amplitude", type=Word(METRIC_NAMES), default="peak", show_default=True, help="Metric of an amplitude.")
@click.option(
    "--steady-within",
    type=click.FloatRange(0.0, 50.0, min_open=True),
    default=1.0,
    show_default=True,
    metavar="PERCENT",
    help="Speed that counts as steady.",
)
@click.option("--speed", metavar="N", help="Nominal speed, such as 3000rpm: the run's must agree with it.")
@click.option("--toml", metavar="NAME", help="Write it as this run of a file of trial runs; needs --speed.")
@click.option("--weight", multiple=True, metavar="PLANE=W@A", help='Trial weight of this run, "fan end=10 g @ 0 deg".')
@click.option("--stayed-on/--came-off", default=None, help="Whether the trial weight stayed on after this run.")
@figure_option
@answering
def vectors(run_file: Path, **options: Any) -> Answer:  # noqa: ANN401
    """Amplitude and phase of each vibration sensor of RUN, a stored run, at an order of its speed.

    The tachometer's pulses cut the record into turns, over which it is averaged; intervals (95 %) come from the noise
    near the order, where tones that do not turn with the rotor are fitted and named. Refused: lost or spurious
    pulses, a speed that is not steady, too few turns.
    """
    _check(options)
    from ..rotating.order_tracking import Tachometer, order_vectors
    from ..store import open_run

    run = open_run(run_file)
    within = options["steady_within"] / 100.0
    tachometer = Tachometer(options["tacho"], options["level"], options["falling"], within)
    found = order_vectors(run, tachometer, options["sensor"], options["order"])
    if options["speed"]:
        _agrees(run, found, options["speed"], within)
    document = _document(run, found, options["phase"], options["amplitude"])
    draw(options["figure"], "testbench.figures.rotating:draw_vectors", document)

    def show() -> None:
        if options["toml"]:
            click.echo(_toml(run, found, options))
        else:
            _print(run, found, options["phase"], options["amplitude"])

    return Answer(document, show, bool(found.findings()))


def _check(options: dict[str, Any]) -> None:
    if options["toml"] and click.get_current_context().params["as_json"]:
        raise click.UsageError("give either --toml or --json")
    if not 0.0 < options["steady_within"] <= 50.0:
        raise click.UsageError(f"--steady-within is {options['steady_within']:g}: expected more than 0, at most 50 %")
    if options["level"] is not None and not math.isfinite(options["level"]):
        raise click.UsageError(f"--level is {options['level']:g}: expected a number")
    if twice := [name for i, name in enumerate(options["sensor"]) if name in options["sensor"][:i]]:
        raise click.UsageError(f"--sensor names {twice[0]!r} twice")
    if options["toml"] and not options["speed"]:
        raise click.UsageError("--toml needs --speed: trial runs are matched by their nominal speed")
    if options["toml"] and options["order"] != 1:
        raise click.UsageError("--toml is for order 1: unbalance turns with the rotor")
    if (options["weight"] or options["stayed_on"] is not None) and not options["toml"]:
        raise click.UsageError("--weight, --stayed-on and --came-off go with --toml")
    if bool(options["weight"]) != (options["stayed_on"] is not None):
        raise click.UsageError("--weight needs --stayed-on or --came-off, and they need --weight")
    if wrong := [text for text in options["weight"] if "=" not in text or "@" not in text]:
        raise click.UsageError(f"--weight {wrong[0]!r}: expected 'PLANE=10 g @ 0 deg'")


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


def _toml(run: "Run", found: "Vectors", options: dict[str, Any]) -> str:
    lines = [
        f'# from {run.name}, {run.origin}: phase = "{options["phase"]}", amplitude = "{options["amplitude"]}"',
        *(f"# finding: {finding}" for finding in found.findings()),
        "[[runs]]",
        f"name = {_quoted(options['toml'])}",
    ]
    if options["weight"]:
        pairs = [text.partition("=") for text in options["weight"]]
        weights = ", ".join(f"{_quoted(plane.strip())} = {_quoted(weight.strip())}" for plane, _, weight in pairs)
        lines += [f"weights = {{ {weights} }}", f"stayed_on = {str(options['stayed_on']).lower()}"]
    readings = ", ".join(f"{_quoted(v.sensor)} = {_quoted(_reading(v, options))}" for v in found.vectors)
    lines.append(f"readings.{_quoted(options['speed'])} = {{ {readings} }}")
    if found.common_phase_normal_within > _ROUNDING:
        within = math.degrees(found.common_phase_normal_within)
        lines.append(f'phases_alike.{_quoted(options["speed"])} = "{within:.3g} deg"')
    return "\n".join([*lines, ""])


def _reading(vector: "OrderVector", options: dict[str, Any]) -> str:
    """A reading with its intervals; one within the scatter has no interval of the phase."""
    from ..rotating.order_tracking import UNITS

    (size, within), unit = _amplitude(vector, options["amplitude"]), UNITS[vector.dimension]
    about = f" ± {math.degrees(vector.own_phase_within):.3g} deg" if vector.is_significant else ""
    return f"{size:.9g} {unit} ± {within:.3g} {unit} @ {_degrees(vector, options['phase']):.6f} deg{about}"


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
    }


def _print(run: "Run", found: "Vectors", phase: str, metric: "Metric") -> None:
    from ..rotating.order_tracking import UNITS

    rows = []
    for v in found.vectors:
        size, within = _amplitude(v, metric)
        angle = (
            f"{_degrees(v, phase):.2f} ± {math.degrees(v.phase_within):.2g}" if v.is_significant else "in the scatter"
        )
        unit = UNITS[v.dimension]
        rows.append([v.sensor, f"{size:.4g} ± {within:.2g} {unit}", angle, f"{v.coherence:.4f}", f"{v.share:.3f}"])
    emit_table(
        f"Order {found.order} of {run.name} ({run.origin}), {metric}, phase as {phase} of the pulse",
        ["sensor", "amplitude", "phase [deg]", "coherence", "share of power"],
        rows,
    )
    turns = found.turns
    change = f"{100 * turns.change:.2g}" if turns.change > _ROUNDING else "0"
    click.echo(f"{turns.count} turns at {60 * turns.speed:.6g} rpm, changing by {change} %.")
    for v in found.vectors:
        if v.tones:
            tones = ", ".join(f"{tone:.4g} Hz" for tone in v.tones)
            click.echo(f"{v.sensor}: near the order {tones}, which does not turn with the rotor; fitted with it.")
    emit_findings(("Finding", f"{finding}.") for finding in found.findings())
