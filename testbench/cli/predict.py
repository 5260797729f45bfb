"""``testbench predict``."""

from typing import TYPE_CHECKING

import click

from balance.cli.console import emit_json, emit_table, json_option
from balance.cli.options import figure_option

if TYPE_CHECKING:
    from ..publication.forecast import Forecast
    from ..publication.forms import Form


@click.command(
    epilog="""\b
Examples:
  testbench predict kiper2019
  testbench predict kiper2019 --forms --figure predicted.png
  testbench predict kiper2019 --json
\b
Exit codes: 0 done, 1 refused (no such table, a plan without its conditions)."""
)
@click.argument("published")
@click.option(
    "--plan", "tests", metavar="PLAN", help="The plan of these tests, shipped or a file; else that of the name."
)
@click.option("--forms", "with_forms", is_flag=True, help="Also what the law is without some of its terms.")
@figure_option
@json_option
def predict(published: str, tests: str | None, with_forms: bool, figure: str | None, as_json: bool) -> None:
    """Calibrate on the lightest payload of a printed table, and predict all other payloads.

    Beside it: the error on what was calibrated on, each payload left out in turn, and baselines without mechanics.
    """
    from .. import plan
    from .. import published as tables
    from ..publication.document import document
    from ..publication.forecast import forecast
    from ..publication.forms import forms

    table = tables.load(published)
    made = forecast(table, plan.load(tests or _plan_of(table.name)))
    compared = forms(made.known) if with_forms else []
    if figure:
        from balance.figures.drawing import save

        from ..figures.prediction import prediction

        save(prediction(made), figure)
    if as_json:
        emit_json(document(made, compared))
    else:
        _print(made, compared)


def _plan_of(table: str) -> str:
    """The shipped plan that has the name of a table."""
    from balance import datasets

    from ..errors import AnalysisError

    if table not in datasets.names("plans", ".toml"):
        raise AnalysisError(f"{table}: no plan of that name is shipped: give that of these tests, --plan FILE")
    return table


def _print(made: "Forecast", compared: "list[Form]") -> None:
    _print_predictions(made)
    _print_parameters(made)
    header = ["mean absolute error, percentage points", "calibrated on", "predicted", "each payload left out",
              *(f"{p:g} kg left out" for p in made.scores[0].leave_one_payload_out)]  # fmt: skip
    rows = [[s.name, *map(_points, (s.calibrated_on, s.held_out, s.left_out, *s.leave_one_payload_out.values()))]
            for s in made.scores]  # fmt: skip
    emit_table("How far off", header, rows)
    header = ["payload kg", "axis", "mean absolute", "mean", ""]
    rows = [[f"{g.payload_kg:g}", g.axis, _points(g.mean_absolute), f"{g.mean:+.1f}", "fails" if g.fails else ""]
            for g in made.groups]  # fmt: skip
    emit_table("Where, percentage points", header, rows)
    if compared:
        _print_forms(made, compared)
    for note in made.notes:
        click.echo(click.wrap_text(note, 110))


def _print_predictions(made: "Forecast") -> None:
    from balance.quantities import G0

    from ..publication.cases import AXES

    asked = made.asked
    cells = [f"{middle:.0f} ({low:.0f} .. {high:.0f})  {printed:.1f}" for middle, (low, high), printed in
             zip(made.predicted, made.interval, asked.printed, strict=True)]  # fmt: skip
    axes = len(AXES)
    rows = [
        [f"{asked.payload_kg[i]:g}", str(asked.motion[i]), f"{asked.peak_acceleration[i] / G0:g}", *cells[i : i + axes]]
        for i in range(0, len(cells), axes)
    ]
    header = ["payload kg", "motion", "peak g0", *(f"{axis}: predicted (95 %)  printed" for axis in AXES)]
    emit_table(f"Reduction of the base's acceleration, %, {made.published.name}", header, rows)


def _print_parameters(made: "Forecast") -> None:
    from ..publication.model import PARAMETERS, SCATTER

    rows = []
    for p in (*PARAMETERS, SCATTER):
        middle, low, high = made.posterior.interval(p.name)
        rows.append([p.key, f"{middle:.3g}", f"{low:.3g} .. {high:.3g}", f"{p.low:g} .. {p.high:g}", p.meaning])
    emit_table("Calibrated", ["parameter", "median", "95 %", "bounds", "meaning"], rows)


def _print_forms(made: "Forecast", compared: "list[Form]") -> None:
    rows = [[" ".join(f.parameters), _points(f.fitted), _points(f.left_out)] for f in compared]
    title = f"Which terms the {made.known.payloads[0]:g} kg table asks for, percentage points"
    emit_table(title, ["free parameters", "fitted", "each condition left out"], rows)


def _points(value: float) -> str:
    return f"{value:.1f}"
