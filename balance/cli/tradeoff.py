"""``balance tradeoff``: the front of shaking force, shaking moment, drive torque and added mass."""

import click

from . import options
from .framework import Detail, emit_json, emit_table, json_option

_SHOWN = 12


@click.command(
    epilog="""\b
Examples:
  balance tradeoff parallelogram-6bar --motion x -p platform=5kg
  balance tradeoff four-bar --motion four-bar --limit counter_A0A=3kg --points 300 --figure front.svg --json

\b
Root mean squares over the motion, of force and moment as vectors, of the torques of all motors that turn together; the
moment is about the base frame's origin. No point of the front is bettered in one of the four without a loss in
another."""
)
@options.mechanism_argument
@click.option("--motion", required=True, metavar="TOML", help="The motion.")
@options.payload_option
@options.site_option
@click.option(
    "--limit",
    type=options.NamedQuantity("SITE", "mass", "5kg"),
    multiple=True,
    metavar="SITE=M",
    help="Largest counter-mass at a site.",
)
@click.option(
    "--points", type=click.IntRange(4, 3000), default=300, show_default=True, help="Weights that are tried, at most."
)
@options.figure_option
@json_option
def tradeoff(
    mechanism: str,
    motion: str,
    payload: tuple[tuple[str, float], ...],
    site: tuple[str, ...],
    limit: tuple[tuple[str, float], ...],
    points: int,
    figure: str | None,
    as_json: bool,
) -> None:
    """What less shaking force costs in shaking moment, drive torque and mass: the front of MECH on one motion."""
    from ..balancing.tradeoff import FrontPoint
    from ..front_door import tradeoff as found_front
    from ..results import document, table

    model = options.load_mechanism_option(mechanism, payload)
    found = found_front(model, motion, site, options.distinct(limit, "--limit"), points)
    if figure:
        from ..figures.mechanism import save

        save(found.plot(), figure)
    if as_json:
        emit_json(document(found))
        return
    front = found.points
    lightest = min(front, key=lambda one: one.added_mass)
    click.echo(
        f"From {front[0].force:.4g} N of force with {front[0].added_mass:.4g} kg to {lightest.force:.4g} N with "
        f"{lightest.added_mass:.4g} kg: {len(front)} point{'s' * (len(front) != 1)} of the front."
    )
    count = len(front) if Detail.everything else min(len(front), _SHOWN)
    shown = [front[k * (len(front) - 1) // max(count - 1, 1)] for k in range(count)]
    remark = f"{count} of {len(front)} points; all are in --all and --json." if count < len(front) else ""
    title = f"{model.name}, motion {motion}: masses at {', '.join(front[0].masses)}"
    emit_table(title, *table(FrontPoint, shown), remark)
