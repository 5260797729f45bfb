"""``testbench predict``: the study of one paper, which is not in the installed packages."""

import click

from balance.cli.framework import emit_json, json_option
from balance.cli.options import figure_option

from ..errors import AnalysisError


@click.command(
    epilog="""\b
Examples:
  testbench predict kiper2019
  testbench predict kiper2019 --forms --figure predicted.png
  testbench predict kiper2019 --json
\b
Exit codes: 0 done, 1 refused (no such table, a plan without its conditions, no checkout with the study)."""
)
@click.argument("published")
@click.option(
    "--plan", "tests", metavar="PLAN", help="The plan of these tests, shipped or a file; else that of the name."
)
@click.option("--forms", "with_forms", is_flag=True, help="Also with some terms of the law left out.")
@figure_option
@json_option
def predict(published: str, tests: str | None, with_forms: bool, figure: str | None, as_json: bool) -> None:
    """Calibrate on the lightest payload of a published table, and predict all other payloads.

    Also: the error on the calibration data, each payload left out in turn, and baselines without mechanics.
    """
    from .. import campaign_plan
    from .. import published_tables as tables

    try:
        from studies.kiper2019 import results, validation
    except ModuleNotFoundError as error:
        if error.name not in ("studies", "studies.kiper2019"):
            raise
        raise AnalysisError(
            "predict: the study studies/kiper2019 comes with the source alone: clone counterpoise, install it with "
            "pip install --editable . and run this command again"
        ) from error

    table = tables.load_published(published)
    made = validation.forecast(table, campaign_plan.load_plan(tests or _plan_of(table.name)))
    compared = validation.forms(made.known) if with_forms else []
    if figure:
        from balance.figures.mechanism import save

        save(results.prediction(made), figure)
    if as_json:
        emit_json(results.document(made, compared))
    else:
        results.emit_tables(made, compared)


def _plan_of(table: str) -> str:
    """The shipped plan that has the name of a table."""
    from balance import datasets

    if table not in datasets.dataset_names("plans", ".toml"):
        raise AnalysisError(f"{table}: no plan of that name is shipped: give the plan of these tests, --plan FILE")
    return table
