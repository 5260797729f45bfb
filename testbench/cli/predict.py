"""``testbench predict``: the study of one paper, which is not in the installed packages."""

from pathlib import Path

import click

from balance.cli.framework import Answer, argument, command, option
from balance.cli.options import FIGURE, draw

from ..errors import AnalysisError


@command(
    epilog="""\b
Examples:
  testbench predict kiper2019
  testbench predict kiper2019 --forms --figure predicted.png
  testbench predict kiper2019 --json
  testbench predict kiper2019 --rig calibrated.toml
\b
Exit codes: 0 done, 1 refused (no such table, a plan without its conditions, no checkout with the study)."""
)
def predict(
    published: str = argument(),
    tests: str | None = option(
        "The plan of these tests, shipped or a file; else that of the name.", None, "--plan", metavar="PLAN"
    ),
    rig_file: Path | None = option(
        "Calibrate the simulated bench instead of the law, and write its rig to this new file (some minutes).",
        click.Path(path_type=Path, dir_okay=False),
        "--rig",
    ),
    with_forms: bool = option("Also with some terms of the law left out.", None, "--forms"),
    figure: str | None = FIGURE,
) -> Answer:
    """Calibrate on the lightest payload of a published table, and predict all other payloads.

    Also: the error on the calibration data, each payload left out in turn, and baselines without mechanics.
    """
    from .. import campaign_plan
    from .. import published_tables as tables

    try:
        from studies.kiper2019 import bench_calibration, bench_model, results, validation
    except ModuleNotFoundError as error:
        if error.name not in ("studies", "studies.kiper2019"):
            raise
        raise AnalysisError(
            "predict: the study studies/kiper2019 comes with the source alone: clone counterpoise, install it with "
            "pip install --editable . and run this command again"
        ) from error

    table = tables.load_published(published)
    plan = campaign_plan.load_plan(tests or _plan_of(table.name))
    if rig_file is not None:
        if figure or with_forms:
            raise AnalysisError("predict: --forms and --figure are of the law: leave them out with --rig")
        if rig_file.exists():
            raise AnalysisError(f"{rig_file}: exists; name a new file")
        bench = bench_calibration.forecast_bench(table, plan)
        rig_file.write_text(bench_model.rig_text(bench.values), encoding="utf-8")
        return Answer(bench_calibration.bench_document(bench), lambda: bench_calibration.emit_bench(bench))
    made = validation.forecast(table, plan)
    compared = validation.forms(made.known) if with_forms else []
    draw(figure, lambda: results.prediction(made))
    return Answer(results.document(made, compared), lambda: results.emit_tables(made, compared))


def _plan_of(table: str) -> str:
    """The shipped plan that has the name of a table."""
    from balance import datasets

    if table not in datasets.dataset_names("plans", ".toml"):
        raise AnalysisError(f"{table}: no plan of that name is shipped: give the plan of these tests, --plan FILE")
    return table
