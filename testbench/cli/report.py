"""``testbench report``."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from balance.cli.console import EXIT_REFUSED, EXIT_WITH_FINDINGS, emit_json, emit_table, json_option

from . import calibrations, stored_runs
from .measuring import BandText
from .reported import say

if TYPE_CHECKING:
    from ..pairing import Pair
    from ..report import RunReport
    from ..signals import Band
    from ..store import Run


class PointText(click.ParamType[tuple[float, float, float]]):
    """``X,Y,Z``, each with a unit of length."""

    name = "x,y,z"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:  # noqa: ANN401
        """Read the text; a wrong one fails as a wrong command line."""
        from balance.errors import UnitError
        from balance.quantities import parse

        if not isinstance(value, str):
            return value
        parts = value.split(",")
        if len(parts) != 3:
            self.fail(f"{value!r}: expected three lengths such as 0m,-0.1m,25mm", param, ctx)
        try:
            return tuple(parse(part.strip(), "length") for part in parts)
        except UnitError as error:
            self.fail(str(error), param, ctx)


@click.command(
    epilog="""\b
Examples:
  testbench report campaign/r001.h5
  testbench report campaign -o figures
  testbench report campaign/r001.h5 --at 0m,-0.1m,0m --band 1..100 --json
\b
Exit codes: 0 done, 3 done with findings (a clipped or dead sensor, a motion or torque not the sheet's), 1 some
run was refused (the others are reported)."""
)
@click.argument("runs", metavar="RUN|CAMPAIGN...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--at", "point", type=PointText(), default="0m,0m,0m", show_default=True,
              help="The point of the base that moments are about.")  # fmt: skip
@click.option("--band", type=BandText(), default="0..200", show_default=True,
              help="Of vibration and forces [Hz], zero-phase Butterworth; none: all.")  # fmt: skip
@click.option("--bandwidth", type=float, default=80.0, show_default=True, metavar="HZ",
              help="Of accelerations from encoders and of torques [Hz].")  # fmt: skip
@click.option("--mechanism", metavar="MECH", help="A mechanism in place of the one that the rig names.")
@click.option(
    "-o", "--output", type=click.Path(path_type=Path, file_okay=False), help="Folder for figures and report.json."
)
@json_option
def report(
    runs: tuple[Path, ...],
    point: tuple[float, float, float],
    band: "Band | None",
    bandwidth: float,
    mechanism: str | None,
    output: Path | None,
    as_json: bool,
) -> int:
    """What each RUN tells by itself, every number with its definition, and for what is not known the reason.

    Motions found (x, y, triangle; by command, encoders, acceleration); how well the command was reached; vibration of
    the base, its modes from the free decay, its response to the shaking force; force and moment at a point; torques
    against the model. With --output also figures: each run, and runs with counter-masses beside those without.
    """
    from ..pairing import pairs
    from ..report import report as reported
    from ..runs.si_run import SIRun

    if not bandwidth > 0.0:
        raise click.UsageError(f"--bandwidth {bandwidth:g}: expected a positive frequency")
    opened, refused = stored_runs.each(runs)
    found = {}
    for run in opened:
        found[run.name] = reported(SIRun.of(run), point, band, bandwidth, mechanism)
    compared = [_compared(pair, found) for pair in pairs(opened)[0]]
    document = {
        "runs": [one.as_dict() for one in found.values()],
        "compared": compared,
        "calibrations": calibrations.document(opened),
        "refused": [one.as_dict() for one in refused],
    }
    written = _write(output, opened, document, mechanism, bandwidth) if output and opened else []
    if as_json:
        emit_json({**document, "written": [str(path) for path in written]})
    else:
        for one in found.values():
            say(one)
        _say_compared(compared)
        for path in written:
            click.echo(f"Wrote {path}.")
        calibrations.say(opened)
    stored_runs.say(refused)
    if refused:
        return EXIT_REFUSED
    return EXIT_WITH_FINDINGS if any(one.findings for one in found.values()) else 0


def _compared(pair: "Pair", found: "dict[str, RunReport]") -> dict[str, Any]:
    """What counter-masses do to the torques of one condition."""
    from ..report.loads import fallen

    sides = [[found[run.name].torque for run in runs] for runs in (pair.balanced, pair.unbalanced)]
    return {
        "condition": str(pair.key),
        "counter_masses_kg": pair.counter_masses,
        "origin": pair.key.origin,
        "runs": [run.name for run in pair.runs],
        "torques": fallen(sides[0], sides[1]),
    }


def _say_compared(compared: list[dict[str, Any]]) -> None:
    kinds = ("measured", "model")
    rows = []
    for pair in compared:
        for row in pair["torques"]:
            values = [row[f"{kind}_rms_{'Nm' if 'measured_rms_Nm' in row else 'N'}"] for kind in kinds]
            cells = [f"{value[side]:.2f}" for value in values for side in ("without", "with")]
            times = ["-" if row[f"{kind}_times"] is None else f"{row[f'{kind}_times']:.3f}" for kind in kinds]
            rows.append([pair["condition"], row["joint"], *cells, *times, pair["origin"]])
    if rows:
        header = ["condition", "joint", "measured without", "with", "model without", "with", "measured times",
                  "model times", "origin"]  # fmt: skip
        title = "RMS torque of the drives with and without counter-masses [N m, or N]"
        emit_table(title, header, rows, "means of repeats, runs with a gap left out; times: with over without")


def _write(
    folder: Path, runs: "list[Run]", document: dict[str, Any], mechanism: str | None, bandwidth: float
) -> list[Path]:
    """Figures and the document, in a folder that is made if it is not there."""
    from ..report.figures import draw

    folder.mkdir(parents=True, exist_ok=True)
    written = draw(runs, folder, mechanism, bandwidth)
    target = folder / "report.json"
    target.write_text(json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")
    return [*written, target]
