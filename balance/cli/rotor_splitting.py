"""``balance rotor split``: a correction split over holes, of any weight or from stock weights."""

import math
from typing import TYPE_CHECKING, Any

import click

from ..results import counted
from .framework import Answer, emit_table, say
from .options import Quantity, argument, command, option

if TYPE_CHECKING:
    from ..balancing.stock_plates import Plate
    from ..rotors.weight_splitting import Hole, Split, SplitRules

_WIDER = 0.01
"""Residual, of the correction, that is allowed where the least one takes too long to prove."""


@command(
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
    radius: float | None = option(
        "Radius of the holes, for a mass times radius.", Quantity("length", positive=True), metavar="R"
    ),
    limit: float | None = option("Largest weight of any size in a hole.", Quantity("mass", positive=True), metavar="M"),
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
    from ..errors import UnitError
    from ..rotors.results import split_document
    from ..rotors.weight_splitting import SplitRules, split_freely
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
        rules = SplitRules(in_hole, most_holes, _share(within))
        weighted = _from_stock(masses, free, plates, rules, within is None, findings)
    else:
        weighted = split_freely(masses, free, float("inf") if limit is None else limit)
    document = split_document(weighted, radius) | {"findings": findings}
    purpose = "to remove" if remove else "to mount"
    return Answer(document, lambda: _print(document, weighted, bool(plates), purpose), findings=findings)


def _from_stock(
    masses: complex,
    free: "tuple[Hole, ...]",
    plates: "list[Plate]",
    rules: "SplitRules",
    may_widen: bool,
    findings: list[str],
) -> "Split":
    """The least residual; where that cannot be proven in time, the lightest set within 1 %, with a finding."""
    from dataclasses import replace

    from ..rotors import weight_splitting

    try:
        return weight_splitting.split_from_stock(masses, free, plates, rules)
    except weight_splitting.NotProvenError:
        if not may_widen:
            raise
    widened = weight_splitting.split_from_stock(masses, free, plates, replace(rules, resolution=_WIDER))
    findings.append(
        f"the least residual of all sets could not be proven in {weight_splitting.TIME_LIMIT_S:g} s; "
        f"this is the lightest set with a residual of at most {100 * _WIDER:g} %, proven: see --within, --most-holes"
    )
    return widened


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


def _print(document: dict[str, Any], weighted: "Split", stocked: bool, purpose: str) -> None:
    from ..rotors.rotor import polar_form

    percent, least = document["residual_percent"], document["least_possible_residual_g"]
    say(
        f"Makes {polar_form(weighted.made, 1e3, unit='g')} of {polar_form(weighted.target, 1e3, unit='g')}; residual "
        f"{document['residual_g']:.4g} g ({'-' if percent is None else f'{percent:.4g} %'}), "
        f"{document['total_weight_g']:.6g} g in all."
    )
    rows = [
        [hole["hole"], f"{hole['angle_deg']:.3f}", f"{hole['weight_g']:.6g}", counted(hole["pieces"])]
        for hole in document["holes"]
    ]
    at = "" if document["radius_mm"] is None else f" at radius {document['radius_mm']:g} mm"
    emit_table(f"Weights {purpose}{at}", ["hole", "angle [deg]", "weight [g]", "pieces"], rows)
    if stocked and weighted.bound > weighted.residual() + 1e-6 * abs(weighted.target):
        say(f"Lightest set with a residual of at most {least:.4g} g: proven.")
    elif stocked:
        say(f"No set of these weights has a residual below {least:.4g} g, none with it is lighter: proven.")
