"""``testbench new`` and ``testbench check``: the folder of a test of one's own machine."""

from pathlib import Path

import click

from balance.cli.framework import EXIT_WITH_FINDINGS, emit_json, emit_table, json_option, plain_text
from balance.results import document, table


@click.command(
    epilog="""\b
Examples:
  testbench new my-test --from my-machine.xml
  testbench new my-test --from robot.urdf --loggers 1
  testbench new trial
\b
Exit codes: 0 done, 1 the mechanism cannot be read, or the folder is in use."""
)
@click.argument("folder", type=click.Path(path_type=Path))
@click.option(
    "--from", "mechanism", metavar="MECH", help="A mechanism file or a shipped one; parallelogram-6bar unless given."
)
@click.option(
    "--loggers",
    type=click.IntRange(1, 2),
    default=2,
    show_default=True,
    help="Of the accelerometer and the drives: one, or one each.",
)
def new(folder: Path, mechanism: str | None, loggers: int) -> None:
    """Write a FOLDER with all that a test needs: mechanism, motion, rig, plan, run table, and what to do next.

    It is valid as it is and runs on simulated logs; what the mechanism does not say is a guess, marked (guess).
    """
    from ..project import new_project

    files = new_project(folder, mechanism, loggers)
    click.echo(f"{plain_text(str(folder))}: {', '.join(map(plain_text, files))}. README.md says what to do next.")


@click.command(
    epilog="""\b
Examples:
  testbench check my-test
  testbench check . --json
\b
Exit codes: 0 nothing is missing, 3 something is, 1 no such folder."""
)
@click.argument("folder", type=click.Path(path_type=Path))
@json_option
def check(folder: Path, as_json: bool) -> int:
    """Say all that is missing in FOLDER, or contradicts: rig.toml, plan.toml, runs.csv, mechanism and motions."""
    from ..project import Problem, project_problems

    problems = project_problems(folder)
    if as_json:
        emit_json({"problems": [document(problem) for problem in problems]})
    elif not problems:
        click.echo(f"{plain_text(str(folder))}: nothing is missing and nothing contradicts.")
    else:
        click.echo(f"{plain_text(str(folder))}: {len(problems)} problem{'s' if len(problems) > 1 else ''}.")
        emit_table("Problems", *table(Problem, problems))
    return EXIT_WITH_FINDINGS if problems else 0
