"""``balance rotor correct``."""

from typing import TYPE_CHECKING, Any

import click

from .. import options
from ..console import emit_json, emit_table, json_option
from .given import Place, Quantity, speed_option

if TYPE_CHECKING:
    from ...rotors.planes import Correction
    from ...rotors.rotor import Rotor

TO_KGMM = 1e3


@click.command(
    epilog="""\b
Examples:
  balance rotor correct three-masses
  balance rotor correct three-masses --plane middle=400mm
  balance rotor correct masses.csv --plane L=0mm --plane R=800mm --bearing -100mm --bearing 900mm --speed 3000rpm
\b
A rotor sheet (TOML):
  speed = "955 rpm"                   # optional; with two bearings it gives their reactions
  bearings = ["-100 mm", "900 mm"]    # optional
  [[planes]]                          # where corrections go; radius or mass gives the other
  name = "L"
  at = "0 mm"
  radius = "100 mm"
  [[masses]]                          # or masses = "masses.csv"
  name = "A"
  mass = "3 kg"                       # with radius; or unbalance = "240 kg mm"
  radius = "80 mm"
  angle = "60 deg"
  at = "600 mm"
\b
A table (CSV): name, mass (kg), radius (mm), angle (deg), at (mm); or unbalance (kg mm) for mass and radius."""
)
@click.argument("rotor", metavar="ROTOR")
@click.option("--plane", "planes", type=Place(), multiple=True, metavar="NAME=Z", help="Correct in this plane instead.")
@click.option(
    "--bearing", "bearings", type=Quantity("length"), multiple=True, metavar="Z", help="A bearing (give two)."
)
@speed_option
@options.figure_option
@json_option
def correct(
    rotor: str,
    planes: tuple[tuple[str, float], ...],
    bearings: tuple[float, ...],
    speed: float | None,
    figure: str | None,
    as_json: bool,
) -> None:
    """Corrections that balance ROTOR, a sheet (TOML), a table of masses (CSV) or a shipped one.

    One plane balances the force and leaves a couple; two do it in one way; of more the least sum of squares is taken.
    Angles are those of added mass, from the rotor's mark, in the sense in which the sheet counts.
    """
    from ...rotors.planes import correct as solve
    from ...rotors.polygons import polygons

    model = _given(rotor, planes, bearings, speed)
    result = solve(model.unbalances, model.planes)
    if figure:
        from ...figures.drawing import save
        from ...figures.polygons import draw_polygons

        save(draw_polygons(polygons(result)), figure)
    if as_json:
        emit_json(_document(model, result))
        return
    _print(model, result)


def _given(
    name: str, planes: tuple[tuple[str, float], ...], bearings: tuple[float, ...], speed: float | None
) -> "Rotor":
    """The rotor with what the command line adds or replaces."""
    from dataclasses import replace

    from ...rotors.rotor import Plane
    from ...rotors.rotor_files import load_rotor

    model = load_rotor(name)
    if planes:
        given = tuple(Plane(n, at) for n, at in options.once(planes, "--plane").items())
        model = replace(model, planes=given, published={})
    if bearings:
        if len(bearings) != 2 or bearings[0] == bearings[1]:
            raise click.UsageError("--bearing: give two, in two places")
        model = replace(model, bearings=bearings)
    return replace(model, speed=speed) if speed is not None else model


def _reactions(model: "Rotor", result: "Correction") -> dict[str, tuple[complex, complex]]:
    """Rotating bearing loads before, after a static balance alone in each plane, and after [N]."""
    from ...rotors.bearings import loads
    from ...rotors.planes import correct as solve

    if not model.bearings or model.speed is None:
        return {}
    found = {"before": loads(model.unbalances, model.bearings, model.speed)}
    for plane in model.planes if len(model.planes) > 1 else ():
        static = solve(model.unbalances, [plane])
        found[f"static balance alone, in {plane.name}"] = loads(static.after, model.bearings, model.speed)
    found["after"] = loads(result.after, model.bearings, model.speed)
    return found


def _document(model: "Rotor", result: "Correction") -> dict[str, Any]:
    from ...rotors.planes import mounted
    from ...rotors.polar import document
    from ...rotors.polygons import polygons
    from ...rotors.rotor import couple, force

    corrections = []
    for plane, vector in zip(result.planes, result.vectors, strict=True):
        fitted, printed = mounted(plane, vector), model.published.get(plane.name)
        entry: dict[str, Any] = {"plane": plane.name, "at_mm": 1e3 * plane.at}
        entry |= document(vector, "kgmm", TO_KGMM)
        entry |= {"mass_kg": fitted and fitted[0], "radius_mm": fitted and 1e3 * fitted[1]}
        corrections.append(entry | {"published": None if printed is None else document(printed, "kgmm", TO_KGMM)})
    first = result.planes[0]
    return {
        "rotor": model.name,
        "source": model.source or None,
        "unbalances": [
            {"name": u.name, "at_mm": 1e3 * u.at} | document(u.vector, "kgmm", TO_KGMM) for u in model.unbalances
        ],
        "before": {
            "force": document(force(model.unbalances), "kgmm", TO_KGMM),
            f"couple_about_plane_{first.name}": document(couple(model.unbalances, first.at), "kgmm2", 1e6),
        },
        "corrections": corrections,
        "after": {
            "force": document(result.force(), "kgmm", TO_KGMM),
            f"couple_about_plane_{first.name}": document(result.couple(), "kgmm2", 1e6),
        },
        "residual_kgmm": TO_KGMM * result.residual(),
        "speed_rad_per_s": model.speed,
        "bearings_mm": [1e3 * z for z in model.bearings],
        "bearing_loads": {
            name: [document(value, "N") for value in pair] for name, pair in _reactions(model, result).items()
        },
        "weight_on_bearings_N": _weight(model),
        "polygons": [_polygon(p) for p in polygons(result)],
    }


def _polygon(polygon: Any) -> dict[str, Any]:  # noqa: ANN401
    unit, factor = ("kgmm", 1e3) if polygon.unit == "kg m" else ("kgmm2", 1e6)
    return {
        "title": polygon.title,
        "sides": [*polygon.names, *polygon.closing_names],
        f"vertices_{unit}": [[factor * v.real, factor * v.imag] for v in polygon.vertices],
        f"gap_{unit}": factor * polygon.gap(),
    }


def _weight(model: "Rotor") -> list[float] | None:
    from ...quantities import G0
    from ...rotors.bearings import weights

    if model.mass is None or model.centre is None or len(model.bearings) != 2:
        return None
    return list(weights(model.mass, model.centre, model.bearings, G0))


def _print(model: "Rotor", result: "Correction") -> None:
    from ...rotors.planes import mounted
    from ...rotors.polar import angle_deg, polar
    from ...rotors.rotor import couple, force

    rows = []
    for plane, vector in zip(result.planes, result.vectors, strict=True):
        fitted, printed = mounted(plane, vector), model.published.get(plane.name)
        rows.append(
            [
                plane.name,
                f"{1e3 * plane.at:g}",
                f"{TO_KGMM * abs(vector):.6g}",
                f"{angle_deg(vector):.3f}",
                f"{fitted[0]:.5g}" if fitted else "-",
                f"{1e3 * fitted[1]:.5g}" if fitted else "-",
                "-" if printed is None else polar(printed, TO_KGMM),
            ]
        )
    header = ["plane", "at [mm]", "m r [kg mm]", "angle [deg]", "mass [kg]", "radius [mm]", "published [kg mm]"]
    emit_table(f"Corrections of {model.name}", header, rows, model.source)
    about = result.planes[0]
    rows = [
        ["before", polar(force(model.unbalances), 1e3), polar(couple(model.unbalances, about.at), 1e6)],
        ["after", polar(result.force(), 1e3), polar(result.couple(), 1e6)],
    ]
    emit_table("Unbalance", ["", "sum [kg mm]", f"couple about plane {about.name} [kg mm2]"], rows)
    if len(result.planes) == 1 and not result.is_balanced(1e-9):
        click.echo("One plane balances the force only: the couple stays. Give a second plane to remove it.")
    if reactions := _reactions(model, result):
        rows = [[name, *(polar(value) for value in pair)] for name, pair in reactions.items()]
        header = ["", *(f"bearing at {1e3 * z:g} mm [N]" for z in model.bearings)]
        emit_table("Rotating bearing loads", header, rows, f"at {model.speed:g} rad/s; angles turn with the rotor")
    elif model.bearings:
        click.echo("Bearing loads need a speed: --speed.")
    if weight := _weight(model):
        click.echo(f"Weight on the bearings at rest: {weight[0]:.4g} N and {weight[1]:.4g} N (g0 = 9.81 m/s2).")
