"""``balance engine single``."""

from math import isnan
from typing import TYPE_CHECKING, Any

import click

from .. import options
from ..console import emit_json, emit_table, json_option
from ..rotor.given import Quantity, speed_option

if TYPE_CHECKING:
    from ...engines.slidercrank import SliderCrank

_POLAR = 24


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
    from ...engines.reading import load

    if radius is not None and mass is not None:
        raise click.UsageError("give either --radius or --mass: m_b r_b is fixed")
    model = load(engine)
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
    document = {"cylinders": len(model.cylinders)} | _document(model.name, crank, cases, omega, radius, mass)
    if as_json:
        emit_json(document)
    else:
        _print(document)
        if model.counterweights:
            names = ", ".join(weight.name for weight in model.counterweights)
            click.echo(f"The sheet's own counterweights ({names}) are left aside here: see balance engine free.")


def _document(
    name: str, crank: "SliderCrank", cases: dict[str, float], omega: float, radius: float | None, mass: float | None
) -> dict[str, Any]:
    from dataclasses import asdict

    from ...engines import partial, series

    inline = crank.reciprocating_mass * crank.radius * omega**2
    best = {model: partial.best_fraction(crank, model) for model in partial.MODELS}
    return {
        "engine": name,
        "speed_rad_per_s": omega,
        "ratio_r_over_l": crank.ratio,
        "slider_crank": {f"{k}_{_unit(k)}": v for k, v in asdict(crank).items()},
        "rotating_mass_at_r_kg": crank.rotating / crank.radius,
        "rotating_unbalance_kgm": crank.rotating,
        "reciprocating_mass_kg": crank.reciprocating_mass,
        "rotating_force_N": crank.rotating * omega**2,
        "first_order_force_N": inline * abs(series.second_order(crank)[1]),
        "second_order_force_N": inline * abs(series.second_order(crank)[2]),
        "exact_orders_of_reciprocating_force": {
            str(k): [c.real, c.imag] for k, c in series.exact(crank).items() if abs(c) > 1e-12
        },
        "rod": _rod(crank),
        "cases": {name: _case(crank, weight, omega, radius, mass) for name, weight in cases.items()},
        "best_fraction": {
            model: {"fraction": b.fraction, "largest_force_N": b.largest * inline} for model, b in best.items()
        },
        "least_rms_fraction": partial.least_rms_fraction(crank),
        "second_order_error_largest_N": _truncation(crank) * inline,
        "second_order_error_of_first_order_percent": 100.0 * _truncation(crank),
    }


def _unit(key: str) -> str:
    return "kg" if key.endswith("mass") else "kgm2" if key.endswith("inertia") else "m"


def _rod(crank: "SliderCrank") -> list[dict[str, Any]]:
    from ...engines.rod import replacements

    if not 0.0 < crank.rod_centre < crank.rod_length or crank.rod_mass == 0.0:
        return []
    return [
        {
            "replacement": found.name,
            "masses": [{"place": m.place, "mass_kg": m.mass, "at_mm": 1e3 * m.at} for m in found.masses],
            "missing_inertia_kgm2": found.missing_inertia,
        }
        for found in replacements(crank)
    ]


def _case(
    crank: "SliderCrank", weight: float, omega: float, radius: float | None, mass: float | None
) -> dict[str, Any]:
    from ...engines import partial, peak, survey

    found: dict[str, Any] = {
        "counterweight_kgm": weight,
        "counterweight_at_crank_radius_kg": weight / crank.radius,
        "counterweight_mass_kg": weight / radius if radius else mass if mass and weight else None,
        "counterweight_radius_mm": 1e3 * radius if radius else 1e3 * weight / mass if mass and weight else None,
    }
    for model in partial.MODELS:
        turn = survey.over_a_turn(crank, weight, omega, model)
        found[model] = {
            "F_max_N": turn.largest,
            "F_max_at_deg": turn.at_deg,
            "F_min_N": turn.least,
            "F_rms_N": turn.rms,
            "Fx_N": list(turn.x),
            "Fy_N": list(turn.y),
        }
    theta = peak.turn(_POLAR)
    found["polar"] = {
        model: [
            {"theta_deg": 360.0 * i / _POLAR, "Fx_N": float(f.real), "Fy_N": float(f.imag)}
            for i, f in enumerate(partial.remaining(crank, weight, theta, omega, model))
        ]
        for model in partial.MODELS
    }
    return found


def _truncation(crank: "SliderCrank") -> float:
    """Largest difference of the exact motion and first with second order, of m r omega^2."""
    import numpy as np

    from ...engines import partial, peak

    theta = peak.turn(3600)
    difference = partial.reciprocation(crank, theta, "exact") - partial.reciprocation(crank, theta, "order2")
    return float(np.abs(difference).max())


def _print(document: dict[str, Any]) -> None:
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
    click.echo(
        f"Rotating {document['rotating_mass_at_r_kg']:.5g} kg at the crank radius, reciprocating "
        f"{document['reciprocating_mass_kg']:.5g} kg; at {document['speed_rad_per_s']:.5g} rad/s: rotating "
        f"{document['rotating_force_N']:.5g} N, first order {document['first_order_force_N']:.5g} N, second order "
        f"{document['second_order_force_N']:.5g} N.\n"
    )
    rows = []
    for name, case in document["cases"].items():
        exact = case["exact"]
        mass, radius = case["counterweight_mass_kg"], case["counterweight_radius_mm"]
        rows.append(
            [
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
        )
    header = ["counterweight", "m_b r_b [kg mm]", "m_b [kg]", "r_b [mm]", "F max, order 1 [N]", "orders 1+2 [N]"]
    header += ["exact [N]", "F min [N]", "F RMS [N]", "|Fx| max [N]", "|Fy| max [N]"]
    one = f", one of its {document['cylinders']} cylinders" if document["cylinders"] > 1 else ""
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
