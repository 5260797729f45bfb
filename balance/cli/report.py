"""``balance report`` and ``balance animate``."""

from dataclasses import replace
from pathlib import Path

import click

from . import options
from .framework import EXIT_WITH_FINDINGS, emit_json, json_option


def _html(_context: click.Context, _parameter: click.Parameter, path: Path) -> Path:
    """The path of a page; another ending, or no folder for it, is refused before anything is computed."""
    if path.suffix.lower() != ".html":
        raise click.BadParameter(f"{path}: expected a name ending in .html")
    from ..report.page import writable

    return writable(path)


output_option = click.option(
    "-o", "--output", type=click.Path(path_type=Path, dir_okay=False), required=True, callback=_html,
    help="The page to write, a name ending in .html.",
)  # fmt: skip


@click.command(
    epilog="""\b
Examples:
  balance report four-bar --motion four-bar -o report.html
  balance report parallelogram-6bar -p platform=5kg --motion x --stock kiper2019 -o report.html
\b
Exit code 3: no masses at these sites balance it completely, or plates leave more than 5 % where others would."""
)
@options.mechanism_argument
@options.payload_option
@options.site_option
@click.option("--stock", metavar="CSV", help="Counter-masses of these plates: a CSV file, or kiper2019.")
@click.option(
    "--motion", required=True, metavar="TOML", help="The motion that is shown, and whose force is made small."
)
@output_option
@json_option
def report(
    mechanism: str,
    payload: tuple[tuple[str, float], ...],
    site: tuple[str, ...],
    stock: str | None,
    motion: str,
    output: Path,
    as_json: bool,
) -> int:
    """The counter-masses of MECH on one page to sign and mail: verdict, sizing, conditions, a motion with and without.

    The page reads without network and without script, and shows the mechanism moving to scale. Counter-masses are those
    of balance size; --json prints every number of the page.
    """
    from ..balancing.conditions import balance_conditions
    from ..balancing.objective import objective_of
    from ..balancing.remaining_force import verdict_of
    from ..balancing.sizing import best_sets_from_stock, exact_sizing
    from ..balancing.stock_plates import load_stock
    from ..dynamics.inverse_dynamics import simulate
    from ..report.design_page import design_page

    model = options.load_mechanism_option(mechanism, payload)
    trajectory = options.follow_motion(model, motion)
    conditions, target = balance_conditions(model), objective_of(model, trajectory)
    any_mass = result = exact_sizing(conditions, model, site, objective=target)
    if stock:
        (result,) = best_sets_from_stock(conditions, model, load_stock(stock), site, objective=target)
    result = replace(result, payload_bodies=options.payload_bodies(model, payload))
    verdict = verdict_of(result, any_mass, lambda one: simulate(one, trajectory).force)
    page = design_page(result, verdict, trajectory, motion)
    path = page.write(output)
    if as_json:
        emit_json({**page.document, "written": str(path)})
    else:
        click.echo(f"{model.name}: {page.document['verdict']}")
        click.echo(f"Wrote {path}.")
    return EXIT_WITH_FINDINGS if verdict.has_finding else 0


@click.command(
    epilog="""\b
Examples:
  balance animate delta --motion delta -o delta.html
  balance animate four-bar --motion four-bar -c counter_A0A=1.07kg -c counter_B0B=1.37kg -o four-bar.html"""
)
@options.mechanism_argument
@options.payload_option
@options.counter_option
@click.option("--motion", required=True, metavar="TOML", help="A motion file, or a shipped one: x, y, triangle.")
@output_option
def animate(
    mechanism: str,
    payload: tuple[tuple[str, float], ...],
    counter: tuple[tuple[str, float], ...],
    motion: str,
    output: Path,
) -> None:
    """MECH moving to scale on a page: play and scrub, centre of mass and shaking force as arrows.

    With --counter side by side without and with the counter-masses, arrows to one scale.
    """
    from ..report.moving import animation_page, designs_of

    model = options.load_mechanism_option(mechanism, payload)
    designs = designs_of(model, options.distinct(counter, "--counter"))
    page = animation_page(model.name, motion, options.follow_motion(model, motion), designs)
    click.echo(f"Wrote {page.write(output)}.")
