"""``balance engine free``."""

from typing import TYPE_CHECKING, Any

import click

from .. import options
from ..console import emit_json, emit_table, json_option
from ..rotor.given import Quantity, speed_option

if TYPE_CHECKING:
    from ...engines.engine import Engine
    from ...engines.orders import Free, Turning
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
@click.option("--ratio", type=float, default=0.25, show_default=True, help="r / l of an engine without sizes.")
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
    ratio: float,
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
    from ...engines.reading import load
    from ...engines.shafts import shafts

    model = load(engine, ratio)
    omega = 1.0 if model.normalised else speed if speed is not None else model.speed
    if omega is None:
        raise click.UsageError("the forces need --speed (or speed in the sheet)")
    found = free_orders.free(model, orders, "second-order" if second_order else "exact", about)
    places = [c.at for c in model.cylinders]
    balancing = shafts(found, min(places), max(places))
    units = ("m r omega^2", "m r omega^2 a") if model.normalised else ("N", "N m")
    if figure:
        from ...figures.drawing import save
        from ...figures.orders import draw_orders

        save(draw_orders(found, model.name, omega**2, units), figure)
    if as_json:
        emit_json(_document(model, found, balancing, omega))
    else:
        _print(model, found, balancing, omega, units)


def _document(engine: "Engine", free: "list[Free]", balancing: "list[Shaft]", omega: float) -> dict[str, Any]:
    from ...engines.firing import dead_centres, firing
    from ...engines.orders import sums
    from ...rotors.polar import document

    force, moment = ("mrw2", "mrw2a") if engine.normalised else ("N", "Nm")
    length, unbalance = ("a", "mr") if engine.normalised else ("m", "kgm")
    fired = firing(engine)
    return {
        "engine": engine.name,
        "source": engine.source or None,
        "normalised": engine.normalised,
        "ratio_r_over_l": engine.cylinders[0].crank.ratio,
        "speed_rad_per_s": None if engine.normalised else omega,
        f"moments_about_{length}": free[0].about,
        "orders": [
            {
                "order": f.force.order,
                "force": _turning(f.force, force, omega),
                "moment": _turning(f.moment, moment, omega),
                f"place_{length}": f.place,
            }
            for f in free
        ],
        "textbook_sums": {str(k): sums(engine, k) for k in (1, 2)} if engine.in_line else None,
        "balance_shafts": [
            {
                "order": s.order,
                "turns": "forward" if s.forward else "backward",
                "is_crankshaft": s.is_crankshaft,
                "unbalances": [{f"at_{length}": u.at} | document(u.vector, unbalance) for u in s.unbalances],
            }
            for s in balancing
        ],
        "over_a_turn_exact": _exact(engine, omega, free[0].about, force, moment),
        "firing": {
            "strokes": engine.strokes,
            "order": list(fired.order),
            "angles_deg": list(fired.angles_deg),
            "intervals_deg": list(fired.intervals_deg),
            "even": fired.even,
            "dead_centres_deg": dead_centres(engine),
        },
    }


def _turning(part: "Turning", unit: str, omega: float) -> dict[str, Any]:
    from math import degrees

    from ...rotors.polar import document

    scale = omega**2
    return {
        f"largest_{unit}": scale * part.largest,
        f"least_{unit}": scale * part.least,
        "direction_of_largest_deg": degrees(part.direction) % 180.0,
        "forward": document(scale * part.forward, unit),
        "backward": document(scale * part.backward, unit),
    }


def _exact(engine: "Engine", omega: float, about: float, force: str, moment: str) -> dict[str, float]:
    """Largest values of the exact motion over a turn, all orders together."""
    import numpy as np

    from ...engines.peak import turn

    theta = turn(3600)
    return {
        f"force_{force}": float(np.abs(engine.force(theta, omega)).max()),
        f"moment_{moment}": float(np.abs(engine.tilting(theta, omega, about=about)).max()),
        f"rolling_moment_{moment.replace('a', 'r')}": float(np.abs(engine.rolling(theta, omega)).max()),
    }


def _print(
    engine: "Engine", free: "list[Free]", balancing: "list[Shaft]", omega: float, units: tuple[str, str]
) -> None:
    from ...engines.firing import firing
    from ...engines.orders import sums
    from ...rotors.polar import polar

    scale, length = omega**2, "a" if engine.normalised else "mm"
    to_length = 1.0 if engine.normalised else 1e3
    rows = [
        [
            str(f.force.order),
            *(f"{scale * v:.5g}" for v in (f.force.largest, abs(f.force.forward), abs(f.force.backward))),
            *(f"{scale * v:.5g}" for v in (f.moment.largest, abs(f.moment.forward), abs(f.moment.backward))),
            "-" if f.place is None else f"{to_length * f.place:.5g}",
        ]
        for f in free
        if f.force.largest or f.moment.largest
    ]
    header = ["order", f"force [{units[0]}]", "forward", "backward", f"moment [{units[1]}]", "forward", "backward"]
    note = f"moments about {to_length * free[0].about:.5g} {length}; forward turns with the crankshaft"
    note += "" if engine.normalised else f"; at {omega:.5g} rad/s"
    emit_table(f"Free forces and moments of {engine.name}", [*header, f"place [{length}]"], rows, note)
    if not rows:
        click.echo("No free forces and moments: every order computed is balanced.")
    rows = []
    for shaft in (s for s in balancing if s.order <= _SHOWN):
        what = "crankshaft" if shaft.is_crankshaft else f"shaft {'with' if shaft.forward else 'against'} the crankshaft"
        for u in shaft.unbalances:
            size = polar(u.vector, 1.0 if engine.normalised else 1e3)
            rows.append([str(shaft.order), what, f"{to_length * u.at:.5g}", size])
    if rows:
        header = ["order", "on", f"at [{length}]", f"unbalance [{'m r' if engine.normalised else 'kg mm'}]"]
        note = "angles when the crankshaft's mark is at x; equal shafts that turn against each other at equal height; "
        note += f"orders above {_SHOWN} with --json"
        emit_table("What would balance them", header, rows, note)
    if engine.in_line:
        for k in (1, 2):
            (fc, fs), (mc, ms) = sums(engine, k)["force"], sums(engine, k)["moment"]
            click.echo(
                f"Sums of order {k}: cos {fc:+.5g}, sin {fs:+.5g}; times z from cylinder 1: {to_length * mc:+.5g}, "
                f"{to_length * ms:+.5g} {length}"
            )
    fired = firing(engine)
    click.echo(
        f"Fires {'-'.join(map(str, fired.order))}, {engine.strokes}-stroke, at intervals of "
        f"{', '.join(f'{i:g}' for i in fired.intervals_deg)} deg: {'even' if fired.even else 'uneven'}."
    )
    if engine.source:
        click.echo(f"Source: {engine.source}.")
