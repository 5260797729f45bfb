"""``balance rotor split``."""

import math
from typing import TYPE_CHECKING, Any

import click

from .framework import EXIT_WITH_FINDINGS, emit_json, emit_table, json_option
from .options import Quantity

if TYPE_CHECKING:
    from ..balancing.stock_plates import Plate
    from ..rotors.weight_splitting import Hole, Split, SplitRules

_WIDER = 0.01
"""Residual, of the correction, to which a split falls back that is too large to be solved to the least one."""


@click.command(
    epilog="""\b
Examples:
  balance rotor split "30 g @ 100 deg" --holes 12
  balance rotor split "30 g @ 100 deg" --holes 12 --weight 5g --weight 10g --weight 20g --most-holes 3
  balance rotor split "133.75 kg mm @ 348.04 deg" --holes 8 --radius 100mm
  balance rotor split "45 g @ 10 deg" --angle 0deg --angle 40deg --angle 95deg --stock weights.csv --in-hole 2
\b
Stock weights: --stock CSV with the columns name,mass_kg,quantity, or --weight M, as many as wanted of each."""
)
@click.argument("correction", metavar="CORRECTION")
@click.option("--holes", type=click.IntRange(1), metavar="N", help="Holes at equal distance, numbered from 1.")
@click.option("--first", type=Quantity("angle"), default="0 deg", metavar="ANGLE", help="Angle of hole 1 [default: 0].")
@click.option("--angle", "angles", type=Quantity("angle"), multiple=True, metavar="ANGLE", help="A hole at this angle.")
@click.option("--taken", type=int, multiple=True, metavar="I", help="Hole I is not free.")
@click.option(
    "--radius",
    type=Quantity("length", positive=True),
    metavar="R",
    help="Radius of the holes, for a mass times radius.",
)
@click.option(
    "--limit", type=Quantity("mass", positive=True), metavar="M", help="Largest weight of any size in a hole."
)
@click.option("--weight", "weights", multiple=True, metavar="M", help="A stock weight, such as 5g.")
@click.option("--stock", metavar="CSV", help="Stock weights and how many there are.")
@click.option("--in-hole", type=click.IntRange(1), default=1, show_default=True, help="Most stock weights in one hole.")
@click.option("--most-holes", type=click.IntRange(1), metavar="N", help="Most holes used.")
@click.option("--within", metavar="PERCENT", help="Residual that is small enough; the lightest such set is taken.")
@click.option("--remove", is_flag=True, help="Correct by removing material: opposite the added mass.")
@json_option
@click.pass_context
def split(
    ctx: click.Context,
    correction: str,
    holes: int | None,
    first: float,
    angles: tuple[float, ...],
    taken: tuple[int, ...],
    radius: float | None,
    limit: float | None,
    weights: tuple[str, ...],
    stock: str | None,
    in_hole: int,
    most_holes: int | None,
    within: str | None,
    remove: bool,
    as_json: bool,
) -> None:
    """Split CORRECTION, such as "30 g @ 100 deg" or "12 g mm @ 30 deg", over holes.

    Without stock weights: of any size, least in all. With them: the set with the least residual, proven; of such sets
    the lightest. A problem too large for that is solved to the lightest set within 1 %, as a finding.
    """
    from ..errors import UnitError
    from ..rotors import weight_splitting
    from ..rotors import weight_splitting as rooms
    from ..units import dimension_of, parse_vector

    try:
        dimension = dimension_of(correction, "mass", "first moment")
        target = parse_vector(correction, dimension) * (-1 if remove else 1)
    except UnitError as error:
        raise click.UsageError(str(error)) from error
    if dimension == "first moment" and radius is None:
        raise click.UsageError(f"{correction!r} is mass times radius: give the radius of the holes, --radius R")
    masses = target / radius if dimension == "first moment" and radius else target
    free = _free(_holes(holes, first, angles), taken)
    kinds = _stock(weights, stock)
    if kinds and limit is not None:
        raise click.UsageError("--limit is for weights of any size; stock weights have --in-hole")
    if not kinds and (unused := _for_stock(most_holes, within, in_hole)):
        raise click.UsageError(f"{unused} is for stock weights: give them, --weight M or --stock FILE")
    findings: list[str] = []
    if kinds:
        rules = weight_splitting.SplitRules(in_hole, most_holes, _share(within))
        found = _from_stock(masses, free, kinds, rules, within is None, findings)
    else:
        found = rooms.split_freely(masses, free, float("inf") if limit is None else limit)
    if as_json:
        emit_json(_document(found, radius, bool(kinds)) | {"findings": findings})
    else:
        _print(found, radius, bool(kinds), remove)
        for finding in findings:
            click.echo(f"Finding: {finding}")
    if findings:
        ctx.exit(EXIT_WITH_FINDINGS)


def _from_stock(
    masses: complex,
    free: "tuple[Hole, ...]",
    kinds: "list[Plate]",
    rules: "SplitRules",
    may_widen: bool,
    findings: list[str],
) -> "Split":
    """The least residual; where that cannot be proven in time, the lightest set within 1 %, which is said."""
    from dataclasses import replace

    from ..rotors import weight_splitting

    try:
        return weight_splitting.split_from_stock(masses, free, kinds, None, rules)
    except weight_splitting.NotProvenError:
        if not may_widen:
            raise
    found = weight_splitting.split_from_stock(masses, free, kinds, None, replace(rules, resolution=_WIDER))
    findings.append(
        f"the least residual of all sets could not be proven in {weight_splitting.TIME_LIMIT_S:g} s; "
        f"this is the lightest set that leaves at most {100 * _WIDER:g} %, proven: see --within, --most-holes"
    )
    return found


def _holes(count: int | None, first: float, angles: tuple[float, ...]) -> "tuple[Hole, ...]":
    from ..rotors.weight_splitting import Hole, evenly_spaced

    if (count is None) == (not angles):
        raise click.UsageError("say where the holes are: either --holes N or --angle for each")
    if count is not None:
        return evenly_spaced(count, first)
    turned = [round(math.degrees(angle) % 360.0, 6) % 360.0 for angle in angles]
    if same := [i for i, angle in enumerate(turned, 1) if angle in turned[: i - 1]]:
        raise click.UsageError(f"--angle: hole {same[0]} stands where another one does")
    return tuple(Hole(str(i), angle) for i, angle in enumerate(angles, 1))


def _for_stock(most_holes: int | None, within: str | None, in_hole: int) -> str | None:
    """An option that changes nothing where weights are of any size."""
    given = {"--most-holes": most_holes is not None, "--within": within is not None, "--in-hole": in_hole != 1}
    return next((option for option, is_given in given.items() if is_given), None)


def _free(holes: "tuple[Hole, ...]", taken: tuple[int, ...]) -> "tuple[Hole, ...]":
    for i in taken:
        if not 1 <= i <= len(holes):
            raise click.UsageError(f"--taken {i}: there are holes 1 to {len(holes)}")
    return tuple(hole for i, hole in enumerate(holes, 1) if i not in taken)


def _stock(weights: tuple[str, ...], stock: str | None) -> "list[Plate]":
    from ..balancing.stock_plates import Plate, load_stock
    from ..errors import UnitError
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


def _document(found: "Split", radius: float | None, stocked: bool) -> dict[str, Any]:
    from ..rotors.rotor import angle_deg, vector_document

    holes = [
        {
            "hole": hole.name,
            "angle_deg": angle_deg(complex(unit)),
            "weight_g": 1e3 * weight,
            "pieces": list(pieces),
        }
        for hole, unit, weight, pieces in _used(found)
    ]
    return {
        "correction": vector_document(found.target, "g", 1e3),
        "radius_mm": None if radius is None else 1e3 * radius,
        "holes": holes,
        "made": vector_document(found.made, "g", 1e3),
        "residual_g": 1e3 * found.residual(),
        "residual_percent": found.residual_percent(),
        "least_possible_residual_g": 1e3 * found.bound if stocked else 0.0,
        "total_weight_g": 1e3 * sum(found.weights),
    }


def _used(found: "Split") -> list[tuple[Any, Any, float, tuple[str, ...]]]:
    from ..rotors.weight_splitting import hole_directions

    rows = zip(found.holes, hole_directions(found.holes), found.weights, found.pieces, strict=True)
    return [row for row in rows if row[2] > 0.0]


def _print(found: "Split", radius: float | None, stocked: bool, remove: bool) -> None:
    from ..rotors.rotor import angle_deg, polar_form

    rows = [
        [hole.name, f"{angle_deg(complex(unit)):.3f}", f"{1e3 * weight:.6g}", " + ".join(pieces) or "-"]
        for hole, unit, weight, pieces in _used(found)
    ]
    what = "to remove" if remove else "to mount"
    at = "" if radius is None else f" at radius {1e3 * radius:g} mm"
    emit_table(f"Weights {what}{at}", ["hole", "angle [deg]", "weight [g]", "pieces"], rows)
    percent = found.residual_percent()
    click.echo(
        f"Makes {polar_form(found.made, 1e3, unit='g')} of {polar_form(found.target, 1e3, unit='g')}; residual "
        f"{1e3 * found.residual():.4g} g"
        f" ({'-' if percent is None else f'{percent:.4g} %'}), {1e3 * sum(found.weights):.6g} g in all."
    )
    if stocked and found.bound > found.residual() + 1e-6 * abs(found.target):
        click.echo(f"Lightest set with a residual of at most {1e3 * found.bound:.4g} g: proven.")
    elif stocked:
        click.echo(
            f"No set of these weights leaves less than {1e3 * found.bound:.4g} g, none that does is lighter: proven."
        )
