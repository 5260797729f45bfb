"""``balance rotor``: rigid rotors balanced from known masses; permissible unbalance, trial masses."""

from typing import TYPE_CHECKING, Any

import click

from ..results import document as document_of
from . import options
from .framework import emit_json, emit_result, emit_table, json_option
from .options import NamedQuantity, Quantity, speed_option
from .rotor_splitting import split
from .rotor_trial_runs import influence, vector_text

if TYPE_CHECKING:
    from ..rotors.rotor import Rotor


@click.group(commands=[influence, split])
def rotor() -> None:
    """Balance rigid rotors: from known masses, or from trial runs in the field."""


@rotor.command(
    short_help="Corrections in one plane, two or more, from the rotor's masses; bearing reactions before and after.",
    epilog="""\b
Examples:
  balance rotor correct three-masses
  balance rotor correct three-masses --plane middle=400mm
  balance rotor correct masses.csv --plane L=0mm --plane R=800mm --bearing -100mm --bearing 900mm --speed 3000rpm
\b
A rotor file (TOML):
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
A table (CSV): name, mass (kg), radius (mm), angle (deg), at (mm); or unbalance (kg mm) for mass and radius.""",
)
@click.argument("rotor", metavar="ROTOR")
@click.option(
    "--plane",
    "planes",
    type=NamedQuantity("NAME", "length", "0mm"),
    multiple=True,
    metavar="NAME=Z",
    help="Correct in this plane instead.",
)
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
    """Corrections that balance ROTOR, a file (TOML), a table of masses (CSV) or a shipped one.

    One plane balances the force and leaves the couple; in two the solution is unique; of more the least sum of squares
    is taken. Angles are those of added mass, from the rotor's mark, in the sense in which the file counts.
    """
    from ..rotors.correction_planes import correct_planes
    from ..rotors.results import correction_document

    model = _model(rotor, planes, bearings, speed)
    correction = correct_planes(model.unbalances, model.planes)
    if figure:
        from ..figures.mechanism import save

        save(correction.plot(), figure)
    document = correction_document(model, correction)
    couple_remains = len(correction.planes) == 1 and not correction.is_balanced(1e-9)
    emit_result(document, as_json, lambda: _print_correction(document, couple_remains))


def _model(
    name: str, planes: tuple[tuple[str, float], ...], bearings: tuple[float, ...], speed: float | None
) -> "Rotor":
    """The rotor with what the command line adds or replaces."""
    from dataclasses import replace

    from ..rotors.rotor import Plane
    from ..rotors.rotor_files import load_rotor

    model = load_rotor(name)
    if planes:
        stated = tuple(Plane(n, at) for n, at in options.distinct(planes, "--plane").items())
        model = replace(model, planes=stated, published={})
    if bearings:
        if len(bearings) != 2 or bearings[0] == bearings[1]:
            raise click.UsageError("--bearing: give two, in two places")
        model = replace(model, bearings=bearings)
    return replace(model, speed=speed) if speed is not None else model


def _print_correction(document: dict[str, Any], couple_remains: bool) -> None:
    rows = [
        [p["plane"], f"{p['at_mm']:g}", f"{p['magnitude_kgmm']:.6g}", f"{p['angle_deg']:.3f}",
         "-" if p["mass_kg"] is None else f"{p['mass_kg']:.5g}",
         "-" if p["radius_mm"] is None else f"{p['radius_mm']:.5g}", vector_text(p["published"], "kgmm")]
        for p in document["corrections"]
    ]  # fmt: skip
    header = ["plane", "at [mm]", "m r [kg mm]", "angle [deg]", "mass [kg]", "radius [mm]", "published [kg mm]"]
    emit_table(f"Corrections of {document['rotor']}", header, rows, document["source"] or "")
    plane = document["corrections"][0]["plane"]
    rows = [
        [name, vector_text(state["force"], "kgmm"), vector_text(state[f"couple_about_plane_{plane}"], "kgmm2")]
        for name in ("before", "after")
        for state in [document[name]]
    ]
    emit_table("Unbalance", ["", "sum [kg mm]", f"couple about plane {plane} [kg mm2]"], rows)
    if loads := document["bearing_loads"]:
        rows = [[name, *(vector_text(load, "N") for load in pair)] for name, pair in loads.items()]
        header = ["", *(f"bearing at {z:g} mm [N]" for z in document["bearings_mm"])]
        note = f"at {document['speed_rad_per_s']:g} rad/s; angles turn with the rotor"
        emit_table("Rotating bearing loads", header, rows, note)
    elif document["bearings_mm"]:
        click.echo("Bearing loads need a speed: --speed.")
    if weight := document["weight_on_bearings_N"]:
        click.echo(f"Weight on the bearings at rest: {weight[0]:.4g} N and {weight[1]:.4g} N (g0 = 9.81 m/s2).")
    if couple_remains:
        click.echo("One plane balances the force only: the couple remains. Give a second plane to remove it.")


@rotor.command(
    short_help="Permissible residual unbalance of a rigid rotor after ISO 21940-11, and the grade reached.",
    epilog="""\b
Examples:
  balance rotor tolerance --grade G6.3 --mass 40kg --speed 3000rpm
  balance rotor tolerance --grade G2.5 --mass 250kg --speed 1500rpm --to-bearings 300mm 500mm --residual 2000gmm
  balance rotor tolerance fan.toml --grade G6.3         # mass, centre, speed and bearings from its file
\b
Scope: rotors that are rigid up to their service speed. A linkage or a flexible rotor is refused.""",
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
    from ..rotors.iso21940 import GRADES, SCOPE, permissible
    from ..rotors.rotor_files import load_rotor

    if residual is not None and residual < 0.0:
        raise click.UsageError("--residual: expected zero or more")
    if rotor is not None:
        model = load_rotor(rotor)
        mass, speed = (model.mass if mass is None else mass), (model.speed if speed is None else speed)
        if to_bearings is None and model.centre is not None and len(model.bearings) == 2:
            first, second = sorted(model.bearings)
            to_bearings = (model.centre - first, second - model.centre)
    if mass is None or speed is None:
        raise click.UsageError("the permissible unbalance needs --mass and --speed (or a rotor file that has them)")
    allowed = permissible(_grade(grade), mass, speed, critical_speed)
    shares = allowed.in_planes(*to_bearings) if to_bearings else None
    document: dict[str, Any] = {
        "scope": SCOPE,
        **document_of(allowed),
        "standard_grade": any(abs(1e3 * allowed.grade - known) < 1e-9 * known for known in GRADES),
        "U_per_bearing_planes_gmm": None if shares is None else [1e6 * share for share in shares],
        "residual_gmm": None if residual is None else 1e6 * residual,
        "grade_reached_mm_per_s": None if residual is None else 1e3 * allowed.reached(residual),
        "within_tolerance": None if residual is None else residual <= allowed.unbalance,
    }
    if as_json:
        emit_json(document)
        return
    _print_tolerance(document)


def _grade(text: str) -> float:
    """``G6.3``, ``6.3`` or ``6.3 mm/s`` as e omega [m/s]."""
    from ..errors import UnitError
    from ..units import parse

    bare = text.strip().removeprefix("G").strip()
    try:
        value = parse(bare, "velocity") if bare.endswith("/s") else float(bare) / 1e3
    except (ValueError, UnitError) as error:
        raise click.UsageError(f"--grade {text!r}: expected a grade such as G6.3 or '6.3 mm/s'") from error
    if not 0.0 < value < 1e6:
        raise click.UsageError(f"--grade {text!r}: expected more than zero")
    return value


def _print_tolerance(document: dict[str, Any]) -> None:
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


@rotor.command(
    short_help="A trial mass by the rule of practice.",
    epilog="""\b
Examples:
  balance rotor trial --mass 40kg --speed 3000rpm --radius 100mm
  balance rotor trial --mass 250kg --speed 1500rpm --radius 300mm --planes 2 --share 5""",
)
@click.option("--mass", type=Quantity("mass", positive=True), required=True, metavar="M", help="Mass of the rotor.")
@speed_option
@click.option(
    "--radius", type=Quantity("length", positive=True), required=True, metavar="R", help="Radius of the trial mass."
)
@click.option("--planes", type=click.IntRange(1), default=1, show_default=True, help="Planes that share the weight.")
@click.option("--share", type=float, default=10.0, show_default=True, help="Centrifugal force, per cent of the weight.")
@json_option
def trial(mass: float, speed: float | None, radius: float, planes: int, share: float, as_json: bool) -> None:
    """A trial mass whose centrifugal force is a share of the weight on its plane: m_t r omega^2 = p m g0 / planes."""
    from ..rotors.iso21940 import trial_mass
    from ..units import G0

    if speed is None:
        raise click.UsageError("the trial mass needs --speed")
    if not 0.0 < share <= 100.0:
        raise click.UsageError(f"--share {share:g}: expected per cent of the weight, more than 0 and at most 100")
    found = trial_mass(mass, speed, radius, planes, share / 100.0)
    if as_json:
        document = {
            "trial_mass_g": 1e3 * found,
            "trial_unbalance_gmm": 1e6 * found * radius,
            "force_N": found * radius * speed**2,
            "share_of_weight_percent": share,
            "g0_m_per_s2": G0,
        }
        emit_json(document)
        return
    click.echo(
        f"Trial mass {1e3 * found:.4g} g at {1e3 * radius:g} mm ({1e6 * found * radius:.4g} g mm): {share:g} % of the "
        f"weight on its plane at {speed:.5g} rad/s (g0 = {G0} m/s2)."
    )
