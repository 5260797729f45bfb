"""``balance rotor tolerance``."""

from typing import Any

import click

from ..console import emit_json, emit_table, json_option
from .given import Quantity, speed_option

MM_PER_M = 1e3


@click.command(
    epilog="""\b
Examples:
  balance rotor tolerance --grade G6.3 --mass 40kg --speed 3000rpm
  balance rotor tolerance --grade G2.5 --mass 250kg --speed 1500rpm --to-bearings 300mm 500mm --residual 2000gmm
  balance rotor tolerance fan.toml --grade G6.3         # mass, centre, speed and bearings from its sheet
\b
Scope: rotors that are rigid up to their service speed. A linkage or a flexible rotor is refused."""
)
@click.argument("rotor", metavar="[ROTOR]", required=False)
@click.option("--grade", required=True, metavar="G", help="Balance quality grade, such as G6.3: e_per omega in mm/s.")
@click.option("--mass", type=Quantity("mass", positive=True), metavar="M", help="Mass of the rotor.")
@speed_option
@click.option(
    "--to-bearings",
    type=Quantity("length"),
    nargs=2,
    metavar="LA LB",
    help="Distances of the centre of mass from the two bearing planes.",
)
@click.option(
    "--critical-speed", type=Quantity("angular velocity", positive=True), metavar="SPEED", help="First critical speed."
)
@click.option("--residual", type=Quantity("first moment"), metavar="U", help="Residual unbalance, such as 300gmm.")
@json_option
def tolerance(
    rotor: str | None,
    grade: str,
    mass: float | None,
    speed: float | None,
    to_bearings: tuple[float, float] | None,
    critical_speed: float | None,
    residual: float | None,
    as_json: bool,
) -> None:
    """Permissible residual unbalance after ISO 21940-11, for rigid rotors only."""
    from ...rotors.grade import SCOPE, permissible

    if residual is not None and residual < 0.0:
        raise click.UsageError("--residual: expected zero or more")
    if rotor is not None:
        mass, speed, to_bearings = _from_sheet(rotor, mass, speed, to_bearings)
    if mass is None or speed is None:
        raise click.UsageError("the permissible unbalance needs --mass and --speed (or a sheet that has them)")
    allowed = permissible(_grade(grade), mass, speed, critical_speed)
    shares = allowed.in_planes(*to_bearings) if to_bearings else None
    document: dict[str, Any] = {
        "scope": SCOPE,
        "grade_mm_per_s": MM_PER_M * allowed.grade,
        "standard_grade": _standard(allowed.grade),
        "mass_kg": mass,
        "speed_rad_per_s": speed,
        "e_per_um": 1e6 * allowed.eccentricity,
        "U_per_gmm": 1e6 * allowed.unbalance,
        "U_per_bearing_planes_gmm": None if shares is None else [1e6 * share for share in shares],
        "residual_gmm": None if residual is None else 1e6 * residual,
        "grade_reached_mm_per_s": None if residual is None else MM_PER_M * allowed.reached(residual),
        "within_tolerance": None if residual is None else residual <= allowed.unbalance,
    }
    if as_json:
        emit_json(document)
        return
    _print(document)


def _grade(text: str) -> float:
    """``G6.3``, ``6.3`` or ``6.3 mm/s`` as e omega [m/s]."""
    from ...errors import UnitError
    from ...quantities import parse

    bare = text.strip().removeprefix("G").strip()
    try:
        value = parse(bare, "velocity") if bare.endswith("/s") else float(bare) / MM_PER_M
    except (ValueError, UnitError) as error:
        raise click.UsageError(f"--grade {text!r}: expected a grade such as G6.3 or '6.3 mm/s'") from error
    if not 0.0 < value < 1e6:
        raise click.UsageError(f"--grade {text!r}: expected more than zero")
    return value


def _standard(grade: float) -> bool:
    from ...rotors.grade import GRADES

    return any(abs(MM_PER_M * grade - known) < 1e-9 * known for known in GRADES)


def _from_sheet(
    name: str, mass: float | None, speed: float | None, to_bearings: tuple[float, float] | None
) -> tuple[float | None, float | None, tuple[float, float] | None]:
    """What the sheet says where the command line does not; a mechanism is refused."""
    from ...rotors.rotor_files import load_rotor

    model = load_rotor(name)
    if to_bearings is None and model.centre is not None and len(model.bearings) == 2:
        first, second = sorted(model.bearings)
        to_bearings = (model.centre - first, second - model.centre)
    return (mass if mass is not None else model.mass, speed if speed is not None else model.speed, to_bearings)


def _print(document: dict[str, Any]) -> None:
    rows = [
        ["specific unbalance e_per [um]", f"{document['e_per_um']:.5g}"],
        ["permissible unbalance U_per [g mm]", f"{document['U_per_gmm']:.6g}"],
    ]
    for name, share in zip("AB", document["U_per_bearing_planes_gmm"] or (), strict=False):
        rows.append([f"share of bearing plane {name} [g mm]", f"{share:.6g}"])
    if document["residual_gmm"] is not None:
        rows.append(["residual unbalance [g mm]", f"{document['residual_gmm']:.6g}"])
        rows.append(["grade reached [mm/s]", f"{document['grade_reached_mm_per_s']:.4g}"])
    title = f"G {document['grade_mm_per_s']:g}, {document['mass_kg']:g} kg, {document['speed_rad_per_s']:.6g} rad/s"
    note = "" if document["standard_grade"] else "not one of the standard's grades"
    emit_table(title, ["", "value"], rows, note)
    if document["within_tolerance"] is not None:
        click.echo("Within the tolerance." if document["within_tolerance"] else "Outside the tolerance.")
    click.echo(f"Scope: {document['scope']}.")
