"""``balance rotor``: rigid rotors balanced from known masses or trial runs; permissible unbalance, trial masses."""

import math
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from ..errors import UnitError
from ..results import NO_VALUE, counted
from ..results import document as document_of
from . import options
from .framework import Answer, NamedQuantity, Quantity, Word, argument, command, option
from .options import ANGULAR_VELOCITY, LENGTH, MASS, SPEED
from .printing import cells, emit_parts, emit_table, say, with_interval

if TYPE_CHECKING:
    from ..balancing.stock_plates import Plate
    from ..rotors.trial_runs import TrialRuns
    from ..rotors.weight_splitting import Hole, Split

_CORRECTIONS = {
    "plane": "plane", "at [mm]": "at_mm:g", "m r [kg mm]": "magnitude_kgmm:.6g", "angle [deg]": "angle_deg:.3f",
    "mass [kg]": "mass_kg:.5g", "radius [mm]": "radius_mm:.5g", "published [kg mm]": "stated",
}  # fmt: skip
_PLANES = option(
    "Correct in this plane instead.", NamedQuantity("NAME", "length", "0mm"), "--plane", metavar="NAME=Z",
    multiple=True, callback=options.distinct,
)  # fmt: skip
_HOLES = {"hole": "hole", "angle [deg]": "angle_deg:.3f", "weight [g]": "weight_g:.6g", "pieces": "counted"}


@click.group()
def rotor() -> None:
    """Balance rigid rotors: from known masses, or from trial runs in the field."""


@command(
    group=rotor,
    short_help="Corrections in one plane, two or more, from the rotor's masses; bearing reactions before and after.",
    epilog="""\b
Examples:
  balance rotor correct three-masses
  balance rotor correct three-masses --plane middle=400mm
  balance rotor correct masses.csv --plane L=0mm --plane R=800mm --bearing -100mm --bearing 900mm --speed 3000rpm
\b
A table (CSV): name, mass (kg), radius (mm), angle (deg), at (mm); or unbalance (kg mm) for mass and radius.""",
    file=("rotor", "three-masses"),
)
def correct(
    rotor: str = argument("ROTOR"),
    planes: dict[str, float] = _PLANES,
    bearings: tuple[float, ...] = option("A bearing (give two).", Quantity("length"), "--bearing", metavar="Z"),
    speed: float | None = SPEED,
    figure: str | None = options.FIGURE,
) -> Answer:
    """Corrections that balance ROTOR, a file (TOML), a table of masses (CSV) or a shipped one.

    One plane balances the force and leaves the couple; in two the solution is unique; of more the least sum of squares
    is taken. Angles are those of added mass, from the rotor's mark, in the sense in which the file counts.
    """
    from ..rotors.results import correction_document
    from ..rotors.rotor import Plane, correct_planes
    from ..rotors.rotor_files import load_rotor

    model = load_rotor(rotor)
    if planes:
        model = replace(model, planes=tuple(Plane(name, at) for name, at in planes.items()), published={})
    if bearings:
        if len(bearings) != 2 or bearings[0] == bearings[1]:
            raise click.UsageError("--bearing: give two, in two places")
        model = replace(model, bearings=bearings)
    model = replace(model, speed=model.speed if speed is None else speed)
    correction = correct_planes(model.unbalances, model.planes)
    options.draw(figure, correction.plot)
    document = correction_document(model, correction)
    couple_remains = len(correction.planes) == 1 and not correction.is_balanced(1e-9)
    further = ("", "unbalances", "before", "after", "bearing_loads")
    show = partial(_print_correction, document, couple_remains)
    return Answer(document, show, findings=document["findings"], further=further)


def _print_correction(document: dict[str, Any], couple_remains: bool) -> None:
    added = " and ".join(
        f"{p['magnitude_kgmm']:.6g} kg mm at {p['angle_deg']:.2f} deg in plane {p['plane']}"
        for p in document["corrections"]
    )
    what = "One plane balances the force only: the couple remains" if couple_remains else "Balanced"
    say(f"{what}, by {added}.{' Give a second plane to remove it.' if couple_remains else ''}")
    rows = [{**one, "stated": _vector_text(one["published"], "kgmm")} for one in document["corrections"]]
    emit_table(f"Corrections of {document['rotor']}", *cells(rows, _CORRECTIONS), document["source"] or "")
    if document["bearings_mm"] and not document["bearing_loads"]:
        say("Bearing loads need a speed: --speed.")
    if weight := document["weight_on_bearings_N"]:
        say(f"Weight on the bearings at rest: {weight[0]:.4g} N and {weight[1]:.4g} N (g0 = 9.81 m/s2).")


@command(
    group=rotor,
    short_help="Permissible residual unbalance of a rigid rotor after ISO 21940-11, and the grade reached.",
    epilog="""\b
Examples:
  balance rotor tolerance --grade G6.3 --mass 40kg --speed 3000rpm
  balance rotor tolerance --grade G2.5 --mass 250kg --speed 1500rpm --to-bearings 300mm 500mm --residual 2000gmm
  balance rotor tolerance fan.toml --grade G6.3         # mass, centre, speed and bearings from its file
\b
Scope: rotors that are rigid up to their service speed. A linkage or a flexible rotor is refused.
Exit codes: 0 done, 3 done and the residual unbalance is outside the tolerance, 1 refused.""",
)
def tolerance(
    rotor: str | None = argument("[ROTOR]", required=False),
    grade: str = option("Balance quality grade, such as G6.3: e_per omega in mm/s.", required=True, metavar="G"),
    mass: float | None = option("Mass of the rotor.", MASS, metavar="M"),
    speed: float | None = SPEED,
    to_bearings: tuple[float, float] | None = option(
        "Distances of the centre of mass from the two bearing planes.", Quantity("length"), nargs=2, metavar="LA LB"
    ),
    critical_speed: float | None = option("First critical speed.", ANGULAR_VELOCITY, metavar="SPEED"),
    residual: tuple[float, ...] = option(
        "Residual unbalance, such as 300gmm: of the rotor, or given twice, in the bearing planes A and B.",
        Quantity("first moment"),
        metavar="U",
    ),
) -> Answer:
    """Permissible residual unbalance after ISO 21940-11, for rigid rotors only."""
    from ..rotors.iso21940 import GRADES, SCOPE, permissible
    from ..rotors.rotor_files import load_rotor

    if min(residual, default=0.0) < 0.0 or len(residual) > 2:
        raise click.UsageError("--residual: expected zero or more, of the rotor, or one for each of two bearing planes")
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
    if len(residual) == 2 and shares is None:
        raise click.UsageError("a --residual for each bearing plane needs --to-bearings, by which U_per is shared")
    limits = shares if shares is not None and len(residual) == 2 else (allowed.unbalance,)
    used = max((one / limit for one, limit in zip(residual, limits, strict=False)), default=None)
    document: dict[str, Any] = {
        "scope": SCOPE,
        **document_of(allowed),
        "standard_grade": any(abs(1e3 * allowed.grade - known) < 1e-9 * known for known in GRADES),
        "U_per_bearing_planes_gmm": None if shares is None else [1e6 * share for share in shares],
        "residual_gmm": 1e6 * residual[0] if len(residual) == 1 else None,
        "residual_per_bearing_planes_gmm": [1e6 * one for one in residual] if len(residual) == 2 else None,
        "grade_reached_mm_per_s": None if used is None else 1e3 * used * allowed.reached(allowed.unbalance),
        "within_tolerance": None if used is None else used <= 1.0,
    }

    def show() -> None:
        planes = "" if shares is None else f", {1e6 * shares[0]:.6g} in plane A and {1e6 * shares[1]:.6g} in plane B"
        held = f"{'its' if len(residual) == 1 else 'each'} residual unbalance is within it"
        said = "" if used is None else f"; {held}" if used <= 1.0 else "; the residual unbalance is outside it"
        say(f"Permissible unbalance {document['U_per_gmm']:.6g} g mm{planes}{said}.")
        emit_parts(document, ("",))

    return Answer(document, show, has_finding=used is not None and used > 1.0)


def _grade(text: str) -> float:
    """``G6.3``, ``6.3`` or ``6.3 mm/s`` as e omega [m/s]."""
    from ..units import parse

    bare = text.strip().removeprefix("G").strip()
    try:
        value = parse(bare, "velocity") if bare.endswith("/s") else float(bare) / 1e3
    except (ValueError, UnitError) as error:
        raise click.UsageError(f"--grade {text!r}: expected a grade such as G6.3 or '6.3 mm/s'") from error
    if not 0.0 < value < 1e6:
        raise click.UsageError(f"--grade {text!r}: expected more than zero")
    return value


@command(
    group=rotor,
    short_help="A trial mass by the rule of practice.",
    epilog="""\b
Examples:
  balance rotor trial --mass 40kg --speed 3000rpm --radius 100mm
  balance rotor trial --mass 250kg --speed 1500rpm --radius 300mm --planes 2 --share 5""",
)
def trial(
    mass: float = option("Mass of the rotor.", MASS, required=True, metavar="M"),
    speed: float | None = SPEED,
    radius: float = option("Radius of the trial mass.", LENGTH, required=True, metavar="R"),
    planes: int = option("Planes that share the weight.", click.IntRange(1), default=1),
    share: float = option("Centrifugal force, per cent of the weight.", default=10.0),
) -> Answer:
    """A trial mass whose centrifugal force is a share of the weight on its plane: m_t r omega^2 = p m g0 / planes."""
    from ..rotors.iso21940 import trial_mass
    from ..units import G0

    if speed is None:
        raise click.UsageError("the trial mass needs --speed")
    if not 0.0 < share <= 100.0:
        raise click.UsageError(f"--share {share:g}: expected per cent of the weight, more than 0 and at most 100")
    found = trial_mass(mass, speed, radius, planes, share / 100.0)
    document = {
        "trial_mass_g": 1e3 * found,
        "trial_unbalance_gmm": 1e6 * found * radius,
        "force_N": found * radius * speed**2,
        "share_of_weight_percent": share,
        "g0_m_per_s2": G0,
    }
    text = (
        f"Trial mass {1e3 * found:.4g} g at {1e3 * radius:g} mm ({1e6 * found * radius:.4g} g mm): {share:g} % of the "
        f"weight on its plane at {speed:.5g} rad/s (g0 = {G0} m/s2)."
    )
    return Answer(document, lambda: say(text))


@command(
    group=rotor,
    short_help="Correction weights from trial runs: influence coefficients, any planes, sensors and speeds.",
    epilog="""\b
Examples:
  balance rotor influence two-plane-maker
  balance rotor influence runs.toml --method min-max --json""",
    file=("trial-runs", "two-plane-maker"),
)
def influence(
    runs: str = argument("RUNS"),
    method: str = option(
        "Make small the sum of squares, the sum, or the largest of the readings.",
        Word(["least-squares", "robust", "min-max"]),
        default="least-squares",
    ),
    figure: str | None = options.FIGURE,
) -> Answer:
    """Correction weights from trial runs in RUNS, a file (TOML) or a shipped one.

    A trial weight that changed no reading enough is refused by name. Whether each trial weight stayed on must be
    recorded; the weights are shown as totals, and as the weights to add to those still on.
    """
    from .. import front_door

    found = front_door.influence(runs, method)
    document = found.document
    options.draw(figure, "balance.figures.rotating:draw_readings", found)
    show = partial(_print_trial_runs, found.runs, document)
    return Answer(document, show, findings=document["findings"], further=("", "readings", "trial_weights"))


def _print_trial_runs(runs: "TrialRuns", document: dict[str, Any]) -> None:
    from ..rotors.results import READING, WEIGHT

    (reading, r, _), (weight, w, _) = READING[runs.reading], WEIGHT[runs.weight]
    intervals = document["intervals"]
    within = max((one[f"after_within_{r}"] or 0.0 for one in document["readings"]), default=0.0)
    sure = f", each reading within {within:.3g} {reading} of its own" * (intervals is not None)
    say(
        f"RMS {document[f'rms_before_{r}']:.4g} -> {document[f'rms_after_{r}']:.4g} {reading} is predicted{sure}; "
        f"condition number {document['condition']:.3g}; phase counts as {runs.phase}, weight angles {runs.angles}, "
        f"amplitude {runs.amplitude}."
    )
    rows = [[p["plane"], *(_vector_text(p[key], w) for key in ("total", "on_now", "add", "published"))]
            for p in document["planes"]]  # fmt: skip
    header = ["plane", f"all weights [{weight}]", "still on", "to add now", "published"]
    known = document["source"] or ""
    if intervals is not None:
        how = "the stated intervals of readings"
        if intervals["from"] == "repeats":
            how = f"the residual of the runs ({intervals['degrees_of_freedom_a_row']:.0f} degrees of freedom a row)"
        drawn = "" if intervals["draws"] is None else f", {intervals['draws']} solutions drawn"
        known = f"Intervals of {intervals['level']}, from {how}{drawn}."
    emit_table(f"Correction weights, {document['name']}, {document['method']}", header, rows, known)
    if intervals is None:
        say("No intervals: state those of the readings (170 um ± 2 um @ 112 deg ± 1 deg), or repeat a run.")
    if document["note"]:
        say(f"Note: {document['note']}")


def _vector_text(value: dict[str, float] | None, unit: str) -> str:
    """A vector of a document for people, with its intervals where it has any; a dash for none."""
    if value is None:
        return NO_VALUE
    size, angle = value[f"magnitude_{unit}"], round(value["angle_deg"], 3) % 360.0
    within = value.get(f"magnitude_{unit}_within")
    if within is None:
        return f"{size:.6g} @ {angle:.3f} deg" if size >= 1e-9 else "0"
    about = value["angle_deg_within"]
    turned = "any angle" if about >= 180.0 else f"{with_interval(angle, about)} deg"
    return f"{with_interval(size, within)} @ {turned}"


_WIDER = 0.01
"""Residual, of the correction, that is allowed where the least one takes too long to prove."""


@command(
    group=rotor,
    short_help="Split a correction over holes, of any weight or from stock weights to a proven optimum.",
    epilog="""\b
Examples:
  balance rotor split "30 g @ 100 deg" --holes 12
  balance rotor split "30 g @ 100 deg" --holes 12 --weight 5g --weight 10g --weight 20g --most-holes 3
  balance rotor split "133.75 kg mm @ 348.04 deg" --holes 8 --radius 100mm
  balance rotor split "45 g @ 10 deg" --angle 0deg --angle 40deg --angle 95deg --stock weights.csv --in-hole 2
\b
Stock weights: --stock CSV with the columns name,mass_kg,quantity, or --weight M, as many as wanted of each.""",
)
def split(
    correction: str = argument("CORRECTION"),
    holes: int | None = option("Holes at equal distance, numbered from 1.", click.IntRange(1), metavar="N"),
    first: float = option(
        "Angle of hole 1 [default: 0].", Quantity("angle"), default="0 deg", metavar="ANGLE", show_default=False
    ),
    angles: tuple[float, ...] = option("A hole at this angle.", Quantity("angle"), "--angle", metavar="ANGLE"),
    taken: tuple[int, ...] = option("Hole I is not free.", metavar="I"),
    radius: float | None = option("Radius of the holes, for a mass times radius.", LENGTH, metavar="R"),
    limit: float | None = option("Largest weight of any size in a hole.", MASS, metavar="M"),
    weights: tuple[str, ...] = option("A stock weight, such as 5g.", None, "--weight", metavar="M"),
    stock: str | None = option("Stock weights and how many there are.", metavar="CSV"),
    in_hole: int = option("Most stock weights in one hole.", click.IntRange(1), default=1),
    most_holes: int | None = option("Most holes used.", click.IntRange(1), metavar="N"),
    within: str | None = option("Residual that is small enough; the lightest such set is taken.", metavar="PERCENT"),
    remove: bool = option("Correct by removing material: opposite the added mass."),
) -> Answer:
    """Split CORRECTION, such as "30 g @ 100 deg" or "12 g mm @ 30 deg", over holes.

    Without stock weights: of any size, least in all. With them: the set with the least residual, proven; of such sets
    the lightest. A problem too large for that is solved to the lightest set within 1 %, as a finding.
    """
    from ..rotors import weight_splitting
    from ..rotors.results import split_document
    from ..units import dimension_of, parse_vector

    try:
        dimension = dimension_of(correction, "mass", "first moment")
        target = parse_vector(correction, dimension) * (-1 if remove else 1)
    except UnitError as error:
        raise click.UsageError(str(error)) from error
    if dimension == "first moment" and radius is None:
        raise click.UsageError(f"{correction!r} is mass times radius: give the radius of the holes, --radius R")
    masses = target / radius if dimension == "first moment" and radius else target
    free = _free_holes(holes, first, angles, taken)
    plates = _stock(weights, stock)
    if plates and limit is not None:
        raise click.UsageError("--limit is for weights of any size; stock weights have --in-hole")
    for_stock = {"--most-holes": most_holes is not None, "--within": within is not None, "--in-hole": in_hole != 1}
    if not plates and (unused := [option for option, is_given in for_stock.items() if is_given]):
        raise click.UsageError(f"{unused[0]} is for stock weights: give them, --weight M or --stock FILE")
    findings: list[str] = []
    if plates:
        rules = weight_splitting.SplitRules(in_hole, most_holes, _share(within))
        try:
            weighted = weight_splitting.split_from_stock(masses, free, plates, rules)
        except weight_splitting.NotProvenError:
            if within is not None:
                raise
            weighted = weight_splitting.split_from_stock(masses, free, plates, replace(rules, resolution=_WIDER))
            findings.append(
                f"the least residual of all sets could not be proven in {weight_splitting.TIME_LIMIT_S:g} s; this is "
                f"the lightest set with a residual of at most {100 * _WIDER:g} %, proven: see --within, --most-holes"
            )
    else:
        weighted = weight_splitting.split_freely(masses, free, float("inf") if limit is None else limit)
    document = split_document(weighted, radius) | {"findings": findings}
    purpose = "to remove" if remove else "to mount"
    return Answer(document, lambda: _print_split(document, weighted, bool(plates), purpose), findings=findings)


def _free_holes(
    count: int | None, first: float, angles: tuple[float, ...], taken: tuple[int, ...]
) -> "tuple[Hole, ...]":
    from ..rotors.weight_splitting import Hole, evenly_spaced

    if (count is None) == (not angles):
        raise click.UsageError("where are the holes? Give either --holes N or --angle for each")
    if count is None:
        turned = [round(math.degrees(angle) % 360.0, 6) % 360.0 for angle in angles]
        if same := [i for i, angle in enumerate(turned, 1) if angle in turned[: i - 1]]:
            raise click.UsageError(f"--angle: hole {same[0]} is at the angle of another one: give each angle once")
        holes = tuple(Hole(str(i), angle) for i, angle in enumerate(angles, 1))
    else:
        holes = evenly_spaced(count, first)
    for i in taken:
        if not 1 <= i <= len(holes):
            raise click.UsageError(f"--taken {i}: there are holes 1 to {len(holes)}")
    return tuple(hole for i, hole in enumerate(holes, 1) if i not in taken)


def _stock(weights: tuple[str, ...], stock: str | None) -> "list[Plate]":
    from ..balancing.stock_plates import Plate, load_stock
    from ..units import parse

    if weights and stock:
        raise click.UsageError("give either --weight or --stock")
    if stock:
        return load_stock(stock)
    try:
        plates = [Plate(text, parse(text, "mass"), 9999) for text in dict.fromkeys(weights)]
    except UnitError as error:
        raise click.UsageError(f"--weight: {error}") from error
    for plate in plates:
        if not plate.mass > 0.0:
            raise click.UsageError(f"--weight {plate.name}: expected more than zero")
    return plates


def _share(within: str | None) -> float:
    from ..rotors.weight_splitting import RESOLUTION

    if within is None:
        return RESOLUTION
    try:
        share = float(within.strip().removesuffix("%")) / 100.0
    except ValueError as error:
        raise click.UsageError(f"--within {within!r}: expected per cent of the correction, such as 1%") from error
    if not RESOLUTION <= share < 1.0:
        raise click.UsageError(f"--within {within!r}: expected more than {100 * RESOLUTION:g} % and less than 100 %")
    return share


def _print_split(document: dict[str, Any], weighted: "Split", stocked: bool, purpose: str) -> None:
    from ..rotors.rotor import polar_form

    percent, least = document["residual_percent"], document["least_possible_residual_g"]
    say(
        f"Makes {polar_form(weighted.made, 1e3, unit='g')} of {polar_form(weighted.target, 1e3, unit='g')}; residual "
        f"{document['residual_g']:.4g} g ({NO_VALUE if percent is None else f'{percent:.4g} %'}), "
        f"{document['total_weight_g']:.6g} g in all."
    )
    holes = [{**hole, "counted": counted(hole["pieces"])} for hole in document["holes"]]
    at = "" if document["radius_mm"] is None else f" at radius {document['radius_mm']:g} mm"
    emit_table(f"Weights {purpose}{at}", *cells(holes, _HOLES))
    if stocked and weighted.bound > weighted.residual() + 1e-6 * abs(weighted.target):
        say(f"Lightest set with a residual of at most {least:.4g} g: proven.")
    elif stocked:
        say(f"No set of these weights has a residual below {least:.4g} g, none with it is lighter: proven.")
