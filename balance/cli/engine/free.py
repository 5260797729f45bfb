"""``balance engine free``."""

from typing import TYPE_CHECKING

import click

from .. import options
from ..console import emit_json, emit_table, json_option
from ..rotor.given import Quantity, speed_option

if TYPE_CHECKING:
    from ...engines.engine import Engine
    from ...engines.left import OverATurn
    from ...engines.orders import Free
    from ...engines.shafts import Shaft

_SHOWN = 2
"""Highest order for which shafts are printed: higher ones are not built."""


@click.command(
    epilog="""\b
Examples:
  balance engine free in-line-4
  balance engine free v8-90-crossplane --ratio 0.3 --figure orders.png
  balance engine free v4-72-offset --orders 6 --json
\b
An engine sheet (TOML); angles in the sense of rotation, banks from upright:
  throws = ["0 deg", "180 deg", "180 deg", "0 deg"]
  banks = ["0 deg", "0 deg", "0 deg", "0 deg"]     # optional: all upright
  at = [0, 1, 2, 3]                                # optional: places in spacings
  firing_order = [1, 3, 4, 2]                      # optional: else the most even one
  strokes = 4
  spacing = "90 mm"                                # these and [slider_crank] give newtons; without them the result is
  speed = "3000 rpm"                               # in m r omega^2 and m r omega^2 a
  [[counterweights]]                               # optional, on the crankshaft; at in spacings
  name = "front"
  unbalance = "30 kg mm @ 180 deg"
  at = 0"""
)
@click.argument("engine", metavar="ENGINE")
@speed_option
@click.option("--ratio", type=float, help="r / l of an engine without sizes [default: 0.25].")
@click.option(
    "--orders", type=click.IntRange(1, 64), default=8, show_default=True, help="Highest order of the exact motion."
)
@click.option("--second-order", is_flag=True, help="The usual approximation by first and second order.")
@click.option(
    "--about",
    type=Quantity("length"),
    metavar="Z",
    help="Moments about here, 1 m for a spacing without sizes [default: the middle].",
)
@options.figure_option
@json_option
def free(
    engine: str,
    speed: float | None,
    ratio: float | None,
    orders: int,
    second_order: bool,
    about: float | None,
    figure: str | None,
    as_json: bool,
) -> None:
    """Free forces and moments of ENGINE, a sheet (TOML) or a shipped one, by orders of its crankshaft's speed.

    Forward is the part that turns with the crankshaft: at first order its counterweights remove it. The force of an
    order swings between the half-axes of an ellipse. Moments are force times distance along the crankshaft, in the
    direction of the force.
    """
    from ...engines import orders as free_orders
    from ...engines.document import document
    from ...engines.engine_files import DEFAULT_RATIO, load_engine
    from ...engines.left import over_a_turn
    from ...engines.shafts import shafts

    model = load_engine(engine, DEFAULT_RATIO if ratio is None else ratio)
    _refuse_unused(model, speed, ratio)
    omega = 1.0 if model.normalised else speed if speed is not None else model.speed
    if omega is None:
        raise click.UsageError("the forces need --speed (or speed in the sheet)")
    found = free_orders.free(model, orders, "second-order" if second_order else "exact", about)
    places = [c.at for c in model.cylinders]
    balancing = shafts(found, min(places), max(places))
    left = over_a_turn(model, [s for s in balancing if s.order <= _SHOWN], omega, found[0].about)
    units = ("m r omega^2", "m r omega^2 a") if model.normalised else ("N", "N m")
    if figure:
        from ...figures.drawing import save
        from ...figures.orders import draw_orders

        save(draw_orders(found, model.name, omega**2, units, left), figure)
    if as_json:
        emit_json(document(model, found, balancing, left, omega))
    else:
        _print(model, found, balancing, left, omega, units)


def _refuse_unused(engine: "Engine", speed: float | None, ratio: float | None) -> None:
    """Refuse options that an engine has no use for: nothing typed is ignored."""
    if engine.normalised and speed is not None:
        raise click.UsageError(f"--speed: {engine.name} has no sizes, so its forces are in m r omega^2 at any speed")
    if not engine.normalised and ratio is not None:
        raise click.UsageError(f"--ratio: {engine.name} has sizes, r / l = {engine.cylinders[0].crank.ratio:.5g}")


def _print(
    engine: "Engine",
    free: "list[Free]",
    balancing: "list[Shaft]",
    left: "OverATurn",
    omega: float,
    units: tuple[str, str],
) -> None:
    _orders(engine, free, omega, units)
    _shafts(engine, balancing)
    _left(left, units)
    _sums(engine)
    _firing(engine)
    if engine.source:
        click.echo(f"Source: {engine.source}.")


def _length(engine: "Engine") -> tuple[float, str]:
    """Factor and unit of lengths along the crankshaft."""
    return (1.0, "a") if engine.normalised else (1e3, "mm")


def _orders(engine: "Engine", free: "list[Free]", omega: float, units: tuple[str, str]) -> None:
    scale, (factor, length) = omega**2, _length(engine)
    rows = [
        [
            str(f.force.order),
            *(f"{scale * v:.5g}" for v in (f.force.largest, abs(f.force.forward), abs(f.force.backward))),
            *(f"{scale * v:.5g}" for v in (f.moment.largest, abs(f.moment.forward), abs(f.moment.backward))),
            "-" if f.place is None else f"{factor * f.place:.5g}",
        ]
        for f in free
        if f.force.largest or f.moment.largest
    ]
    header = ["order", f"force [{units[0]}]", "forward", "backward", f"moment [{units[1]}]", "forward", "backward"]
    note = f"moments about {factor * free[0].about:.5g} {length}; forward turns with the crankshaft"
    note += "" if engine.normalised else f"; at {omega:.5g} rad/s"
    emit_table(f"Free forces and moments of {engine.name}", [*header, f"place [{length}]"], rows, note)
    if not rows:
        click.echo("No free forces and moments: every order computed is balanced.")


def _shafts(engine: "Engine", balancing: "list[Shaft]") -> None:
    from ...rotors.polar import polar

    rows, (factor, length) = [], _length(engine)
    for shaft in (s for s in balancing if s.order <= _SHOWN):
        what = "crankshaft" if shaft.is_crankshaft else f"shaft {'with' if shaft.forward else 'against'} the crankshaft"
        for u in shaft.unbalances:
            rows.append([str(shaft.order), what, f"{factor * u.at:.5g}", polar(u.vector, factor)])
    if rows:
        header = ["order", "on", f"at [{length}]", f"unbalance [{'m r' if engine.normalised else 'kg mm'}]"]
        note = "angles when the crankshaft's mark is at x; equal shafts that turn against each other at equal height; "
        note += f"orders above {_SHOWN} with --json"
        emit_table("What would balance them", header, rows, note)


def _left(left: "OverATurn", units: tuple[str, str]) -> None:
    from ...engines.left import STAGES

    rows = [
        [STAGES[stage], f"{each.largest_force:.5g}", f"{each.largest_moment:.5g}"]
        for stage, each in left.stages.items()
    ]
    header = ["engine", f"force [{units[0]}]", f"moment [{units[1]}]"]
    emit_table(f"Largest over a turn, exact; shafts of orders up to {_SHOWN}", header, rows)


def _sums(engine: "Engine") -> None:
    from ...engines.orders import sums

    factor, length = _length(engine)
    for k in (1, 2) if engine.in_line else ():
        (fc, fs), (mc, ms) = sums(engine, k)["force"], sums(engine, k)["moment"]
        click.echo(
            f"Sums of order {k}: cos {fc:+.5g}, sin {fs:+.5g}; times z from cylinder 1: {factor * mc:+.5g}, "
            f"{factor * ms:+.5g} {length}"
        )


def _firing(engine: "Engine") -> None:
    from ...engines.firing import firing

    fired = firing(engine)
    click.echo(
        f"Fires {'-'.join(map(str, fired.order))}, {engine.strokes}-stroke, at intervals of "
        f"{', '.join(f'{i:g}' for i in fired.intervals_deg)} deg: {'even' if fired.even else 'uneven'}."
    )
