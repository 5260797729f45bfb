"""``balance engine single``."""

from math import isnan
from typing import Any

import click

from .. import options
from ..console import emit_json, emit_table, json_option
from ..rotor.given import Quantity, speed_option


@click.command(
    epilog="""\b
Examples:
  balance engine single single
  balance engine single single --speed 3000rpm --fraction 0.6 --radius 60mm --figure polar.png
\b
An engine sheet (TOML): throws = ["0 deg"], speed = "1000 rpm" and
  [slider_crank]
  crank_radius = "50 mm"
  rod_length = "200 mm"
  crank_mass = "1 kg"           # optional, with crank_centre along the throw and crank_inertia
  crank_centre = "25 mm"
  rod_mass = "1.2 kg"           # optional, with rod_centre from the crank pin and rod_inertia about the centre
  rod_centre = "60 mm"
  rod_inertia = "0.0101 kg m^2"
  piston_mass = "0.8 kg"
  offset = "0 mm"               # of the cylinder's axis (optional)"""
)
@click.argument("engine", metavar="ENGINE")
@speed_option
@click.option(
    "--fraction",
    "fractions",
    type=click.FloatRange(-1e3, 1e3),
    multiple=True,
    help="Balance also this fraction of the reciprocating.",
)
@click.option("--radius", type=Quantity("length", positive=True), metavar="R", help="Choose r_b: the mass follows.")
@click.option("--mass", type=Quantity("mass", positive=True), metavar="M", help="Choose m_b: the radius follows.")
@options.figure_option
@json_option
def single(
    engine: str,
    speed: float | None,
    fractions: tuple[float, ...],
    radius: float | None,
    mass: float | None,
    figure: str | None,
    as_json: bool,
) -> None:
    """The slider-crank of ENGINE, a sheet (TOML) or a shipped one: rod, shaking force, partial balance.

    x is along the cylinder's axis away from the crank, y a quarter turn on; the force is what the machine exerts on its
    base, weight excluded. Fraction: of the reciprocating mass, on the crank beside all that rotates.
    """
    from ...engines import partial
    from ...engines.engine_files import load_engine
    from ...engines.single import document

    if radius is not None and mass is not None:
        raise click.UsageError("give either --radius or --mass: m_b r_b is fixed")
    model = load_engine(engine)
    if model.normalised:
        raise click.UsageError(f"{model.name} is a layout without sizes: its sheet needs [slider_crank]")
    if any(isnan(fraction) for fraction in fractions):
        raise click.UsageError("--fraction: expected a number")
    omega = speed if speed is not None else model.speed
    if omega is None:
        raise click.UsageError("the forces need --speed (or speed in the sheet)")
    crank = model.cylinders[0].crank
    best = partial.best_fraction(crank)
    cases: dict[str, float] = {"unbalanced": 0.0, "rotating only": crank.rotating}
    wanted = {"1/2": 0.5, "2/3": 2 / 3, "best": best.fraction} | {f"{f:g}": f for f in fractions}
    cases |= {name: partial.counterweight(crank, fraction) for name, fraction in wanted.items()}
    if figure:
        from ...figures.drawing import save
        from ...figures.polar import draw_polar

        save(draw_polar(crank, cases, omega), figure)
    found = document(model, cases, omega, radius, mass)
    if as_json:
        emit_json(found)
    else:
        _print(found)
        if model.counterweights:
            names = ", ".join(weight.name for weight in model.counterweights)
            click.echo(f"The sheet's own counterweights ({names}) are left aside here: see balance engine free.")


def _print(document: dict[str, Any]) -> None:
    _rod(document)
    click.echo(
        f"Rotating {document['rotating_mass_at_r_kg']:.5g} kg at the crank radius, reciprocating "
        f"{document['reciprocating_mass_kg']:.5g} kg; at {document['speed_rad_per_s']:.5g} rad/s: rotating "
        f"{document['rotating_force_N']:.5g} N, first order {document['first_order_force_N']:.5g} N, second order "
        f"{document['second_order_force_N']:.5g} N.\n"
    )
    header = ["counterweight", "m_b r_b [kg mm]", "m_b [kg]", "r_b [mm]", "F max, order 1 [N]", "orders 1+2 [N]"]
    header += ["exact [N]", "F min [N]", "F RMS [N]", "|Fx| max [N]", "|Fy| max [N]"]
    one = f", one of its {document['cylinders']} cylinders" if document["cylinders"] > 1 else ""
    rows = [_row(name, case) for name, case in document["cases"].items()]
    emit_table(f"Shaking force of {document['engine']}{one}", header, rows)
    best = document["best_fraction"]
    click.echo(
        f"Least largest force: fraction {best['exact']['fraction']:.6f} of the reciprocating mass (exact), "
        f"{best['order2']['fraction']:.6f} (orders 1 and 2), {best['order1']['fraction']:.6f} (order 1); least RMS: "
        f"{document['least_rms_fraction']:.6f}."
    )
    click.echo(
        f"Orders 1 and 2 are off the exact force by at most {document['second_order_error_largest_N']:.4g} N, "
        f"{document['second_order_error_of_first_order_percent']:.3g} % of m r omega^2."
    )


def _rod(document: dict[str, Any]) -> None:
    rows = [
        [r["replacement"], "; ".join(f"{m['mass_kg']:.5g} kg at {m['at_mm']:.5g} mm" for m in r["masses"]),
         f"{r['missing_inertia_kgm2']:+.4g}"]
        for r in document["rod"]
    ]  # fmt: skip
    if rows:
        note = (
            "places from the crank pin; an inertia of zero keeps the third condition, so force and moment are both true"
        )
        emit_table("Connecting rod as point masses", ["replacement", "masses", "inertia left out [kg m2]"], rows, note)


def _row(name: str, case: dict[str, Any]) -> list[str]:
    """One counterweight, and the force that it leaves."""
    exact, mass, radius = case["exact"], case["counterweight_mass_kg"], case["counterweight_radius_mm"]
    return [
        name,
        f"{1e3 * case['counterweight_kgm']:.5g}",
        "-" if mass is None else f"{mass:.5g}",
        "-" if radius is None else f"{radius:.5g}",
        f"{case['order1']['F_max_N']:.5g}",
        f"{case['order2']['F_max_N']:.5g}",
        f"{exact['F_max_N']:.5g}",
        f"{exact['F_min_N'] if exact['F_min_N'] > 1e-9 else 0.0:.4g}",
        f"{exact['F_rms_N']:.5g}",
        f"{max(map(abs, exact['Fx_N'])):.5g}",
        f"{max(map(abs, exact['Fy_N'])):.5g}",
    ]
