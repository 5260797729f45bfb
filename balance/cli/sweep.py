"""``balance sweep``, ``tolerance`` and ``tradeoff``: designs, errors and the best compromises, on one motion."""

import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import prod
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, TypeVar

import click

from ..results import document, table
from . import options
from .framework import Answer, Quantity, Read, Word, command, option
from .printing import Detail, emit_findings, emit_table, say

if TYPE_CHECKING:
    from ..arrays import Floats
    from ..balancing.sweep import Variable
    from ..balancing.tolerance import Tolerance
    from ..balancing.tradeoff import Front, FrontPoint

T = TypeVar("T")
_MOST_DESIGNS = 10_000_000
_MOST_IN_MEMORY = 1_000_000
_FOLDER = click.Path(path_type=Path, file_okay=False)


class OfAPart(Read[T]):
    """``NAME.PART=VALUES``: of the mass or a coordinate of a site or body, with units; ``read`` takes all three."""

    def __init__(self, name: str, examples: str, read: Callable[[str, str, str], T], form: str = "(.+)") -> None:
        """For values that match ``form``."""
        super().__init__(name, self._parsed)
        self.examples, self.read, self.form = examples, read, form

    def _parsed(self, text: str) -> T:
        match = re.fullmatch(rf"(.+)\.(mass|x|y|z)={self.form}", text)
        if match is None:
            raise ValueError(f"{text!r}: expected such as {self.examples}; a PART is mass, x, y or z")
        try:
            return self.read(*match.groups())
        except ValueError as error:
            raise ValueError(f"{text!r}: {error}") from error


def _quantity(part: str, text: str) -> float:
    return Quantity("mass" if part == "mass" else "length").convert(text, None, None)


def _varied(name: str, part: str, text: str) -> "Variable":
    """All values of a mass or a place: ``FIRST:LAST:COUNT`` or ``A,B,C``, with units."""
    import numpy as np

    from ..balancing.sweep import Variable

    if text.count(":") == 2:
        first, last, count = text.split(":")
        if not re.fullmatch(r"[1-9]\d{0,6}", count.strip()):
            raise ValueError(f"{count!r} is no number of values: expected such as 1000")
        values = np.linspace(_quantity(part, first), _quantity(part, last), int(count))
    else:
        values = np.array([_quantity(part, one) for one in text.split(",")])
    if part == "mass" and (values < 0.0).any():
        raise ValueError("expected masses of zero or more")
    return Variable(name, part, values)


def _tolerance(name: str, part: str, text: str) -> "Tolerance":
    """The largest error of a mass or a place, to either side, such as ``5g``, ``0.1mm`` or ``2%`` of it."""
    from ..balancing.tolerance import Tolerance

    found = Tolerance.of(name, part, text)
    if not found.half_width > 0.0:
        raise ValueError("expected more than zero")
    return found


_VARIED = option(
    "A mass or a place, and its values, such as counter_A0A.mass=0kg:30kg:1000.",
    OfAPart("NAME.PART=VALUES", "counter_A0A.mass=0kg:30kg:1000 or A.x=90mm,100mm", _varied),
    "--vary", multiple=True, required=True, metavar="NAME.PART=VALUES",
)  # fmt: skip
_TOLERATED = "counter_A0A.mass=5g, counter_A0A.mass=2% or A.x=0.1mm"
TOLERANCES, _TOLERANCES = (
    option(
        "A mass or a place and its largest error, to either side: with a unit, or in % of the mass or coordinate.",
        OfAPart("NAME.PART=ERROR", _TOLERATED, _tolerance, r"(?:±|\+-|\+/-)?(.+)"),
        "--tolerance", multiple=True, required=required, metavar="NAME.PART=ERROR",
    )
    for required in (False, True)
)  # fmt: skip


@command(
    epilog="""\b
Examples:
  balance sweep parallelogram-6bar --motion x -p platform=5kg \\
    --vary counter_A0A.mass=0kg:30kg:100 --vary counter_B0B.mass=0kg:30kg:100
  balance sweep four-bar --motion four-bar --vary counter_A0A.mass=0kg:4kg:200 --vary counter_A0A.x=-80mm,-50mm
  balance sweep four-bar --motion four-bar --vary B_AB.x=250mm:270mm:21 -o sweep --scheduler local

\b
NAME.mass is the counter-mass at a site, or the mass of a body; NAME.x, .y, .z the place of a site or a body (not of a
joint) in the body that carries it, as its MJCF file writes it. Values: first:last:count, or a list. The driven joints
move alike in all designs, the loops closed anew.
\b
Columns: each variable; rms_F_N, peak_F_N of the force vector; rms_M_Nm, peak_M_Nm of the moment about the base's
origin; the same of each component and drive; added_mass_kg. A folder (-o) holds them as Parquet; a sweep goes on there
where it was interrupted."""
)
def sweep(
    mechanism: str = options.MECHANISM,
    motion: str = options.MOTION,
    variables: "tuple[Variable, ...]" = _VARIED,
    payload: options.Masses = options.PAYLOADS,
    counter: options.Masses = options.COUNTERS,
    rate: float | None = option(
        "Sampling of the motion, such as 1kHz [default: 10 kHz].", Quantity("frequency", positive=True), metavar="HZ"
    ),
    quantities: tuple[str, ...] = option(
        "Only this, several times for more [default: all].", Word(["force", "moment", "torque"]), "--quantity"
    ),
    rms_only: bool = option("No peak values: some hundred times quicker on long motions."),
    ranked_by: str = option("Column by which designs are ranked.", None, "--best", default="rms_F_N", metavar="COLUMN"),
    top: int = option("Designs that are printed.", click.IntRange(1, 1000), default=5),
    output: Path | None = option("Keep all results here, as Parquet.", _FOLDER, "-o", "--output", metavar="FOLDER"),
    scheduler: str | None = options.SCHEDULER,
    figure: str | None = options.FIGURE,
) -> Answer:
    """Shaking force, moment and torque of all combinations of masses and places, on one motion."""
    from ..balancing.sweep import QUANTITIES, Designs, Problem, Sweep, joined
    from ..motion.motion_files import load_motion
    from ..task_pool import task_pool

    size = prod(len(variable.values) for variable in variables)
    limit = _MOST_IN_MEMORY if output is None else _MOST_DESIGNS
    if size > limit:
        raise click.UsageError(
            f"{size} designs: expected at most {limit}" + ("; with -o FOLDER more" if output is None else "")
        )
    model = options.load_mechanism_option(mechanism, payload)
    samples = load_motion(motion).sample_as_asked(rate)
    problem = Problem(model, samples, counter, not rms_only, frozenset(quantities or QUANTITIES))
    started = perf_counter()
    found: list[dict[str, Floats]] = []
    with task_pool(scheduler) as pool, options.progress("designs", size, in_bytes=False) as advance:
        chosen = partial(_best, ranked_by=ranked_by, top=None if figure else top)
        for count, columns in Sweep(problem, variables, output and output.absolute(), chosen).run(pool):
            if ranked_by not in columns:
                raise click.UsageError(f"--best {ranked_by}: no such column; there are {', '.join(columns)}")
            found.append(columns)
            advance(count)
    designs = Designs(joined(found), tuple(v.column for v in variables), ranked_by)
    best = _best(designs.columns, ranked_by, top)
    rows = [{name: float(values[i]) for name, values in best.items()} for i in range(len(best[ranked_by]))]
    options.draw(figure, designs.plot)
    seconds = perf_counter() - started

    def show() -> None:
        names = dict.fromkeys([*(v.column for v in variables), ranked_by, *_SHOWN])
        shown = [name for name in names if name in best]
        say(f"Least {ranked_by} of {size} designs: {rows[0][ranked_by]:.4g} ({seconds:.3g} s)")
        emit_table(f"{model.name}, motion {motion}", shown, [[f"{row[name]:.6g}" for name in shown] for row in rows])

    return Answer({"mechanism": model.name, "designs": size, "ranked_by": ranked_by, "best": rows}, show)


_SHOWN = ("rms_F_N", "peak_F_N", "rms_M_Nm", "peak_M_Nm", "added_mass_kg")


def _best(columns: "Mapping[str, Floats]", ranked_by: str, top: int | None) -> "dict[str, Floats]":
    """The ``top`` rows of least ``ranked_by``, the lightest of equals first; as they are where there is none such."""
    import numpy as np

    if ranked_by not in columns:
        return dict(columns)
    order = np.lexsort([columns["added_mass_kg"], columns[ranked_by]])[:top]
    return {name: values[order] for name, values in columns.items()}


@command(
    epilog="""\b
Example:
  balance tolerance parallelogram-6bar --motion x -p platform=5kg -c counter_A0A=24.28kg -c counter_B0B=24.28kg \\
    --tolerance counter_A0A.mass=20g --tolerance counter_A0A.x=0.2mm --tolerance platform.mass=2% \\
    --tolerance BD.x=0.05mm

\b
Errors are drawn evenly within the tolerances (rectangular distributions, JCGM 101) and act on the force linearly;
where one that counts is too wide for that, its curvature is above 0.05 and the exit code is 3. The driven joints move
alike in all, the loops closed anew. The costliest is first: that which alone leaves the largest force in 95 %."""
)
def tolerance(
    mechanism: str = options.MECHANISM,
    motion: str = options.MOTION,
    tolerances: "tuple[Tolerance, ...]" = _TOLERANCES,
    payload: options.Masses = options.PAYLOADS,
    counter: options.Masses = options.COUNTERS,
    draws: int = option("Mechanisms that are drawn.", click.IntRange(1000, 1_000_000), default=20_000),
    seed: int = option("Seed of the draws.", default=1),
    scheduler: str | None = options.SCHEDULER,
) -> Answer:
    """What errors of masses and places cost: the RMS shaking force that mechanisms made within tolerances keep.

    NAME.PART: mass of a body, or of a site's counter-mass; x, y, z of the place of a site, or of a body with its joint,
    in the body that carries it, as the MJCF file writes it. NAME is that of the site or body, not of the joint.
    """
    from ..balancing.tolerance import ToleranceEffect
    from ..front_door import tolerance as toleranced
    from ..task_pool import task_pool

    model = options.load_mechanism_option(mechanism, payload)
    with task_pool(scheduler) as pool:
        found = toleranced(model, motion, tolerances, counter, draws, seed, pool)

    def show() -> None:
        say(
            f"95 % of {model.name} made within these tolerances keep at most {found.percentiles['95']:.4g} N RMS of "
            f"shaking force; without errors {found.nominal:.4g} N."
        )
        levels = ", ".join(f"{level} %: {value:.4g} N" for level, value in found.percentiles.items())
        meaning = "share: part of the mean square force that all errors together add; curvature: departure from a "
        meaning += "straight line within the tolerance."
        emit_table("Tolerances, the costliest first", *table(ToleranceEffect, found.effects), meaning)
        say(f"RMS force at most: {levels}")
        emit_findings(("not_linear", said) for said in found.doubts)

    shown = {"mechanism": model.name, "draws": draws, "seed": seed, **document(found)}
    return Answer(shown, show, bool(found.doubtful))


_POINTS = 12
"""Points of the front that are printed unless all are asked for."""


@command(
    epilog="""\b
Examples:
  balance tradeoff parallelogram-6bar --motion x -p platform=5kg
  balance tradeoff four-bar --motion four-bar --added 2kg
  balance tradeoff four-bar --motion four-bar --limit counter_A0A=3kg --points 300 --figure front.svg --json

\b
Root mean squares over the motion, of force and moment as vectors, of the torques of all motors that turn together; the
moment is about the base frame's origin. No point of the front is bettered in one of the four without a loss in
another."""
)
def tradeoff(
    mechanism: str = options.MECHANISM,
    motion: str = options.MOTION,
    payload: options.Masses = options.PAYLOADS,
    site: tuple[str, ...] = options.SITES,
    limit: options.Masses = options.LIMITS,
    points: int = option("Points that are sought, at most.", click.IntRange(4, 3000), default=300),
    added: float | None = options.ADDED,
    figure: str | None = options.FIGURE,
) -> Answer:
    """What less shaking force costs in shaking moment, drive torque and mass: the front of MECH on one motion."""
    from ..front_door import tradeoff as found_front

    model = options.load_mechanism_option(mechanism, payload)
    found = found_front(model, motion, site, limit, points, added)
    options.draw(figure, found.plot)
    return Answer(document(found), lambda: _print_front(found))


def _print_front(found: "Front") -> None:
    """From the least force to the least mass, and points of the least force for their mass; all with --all."""
    from ..balancing.tradeoff import FrontPoint

    front = found.points
    first, lightest = front[0], min(front, key=lambda one: one.added_mass)
    count = f"{len(front)} point{'s' * (len(front) != 1)} of the front"
    if first is lightest:
        costs = [("moment", first.moment, min(one.moment for one in front))]
        costs += [("torque", first.torque or 0.0, min(one.torque or 0.0 for one in front))]
        less = [f"the {name} from {most:.4g} to {least:.4g} N m" for name, most, least in costs if least < most]
        with_more = f"more mass lessens {' and '.join(less)}" if less else "more mass lessens nothing"
        say(f"The least force, {first.force:.4g} N, is with {first.added_mass:.4g} kg; {with_more}: {count}.")
    else:
        say(
            f"From {first.force:.4g} N of force with {first.added_mass:.4g} kg to {lightest.force:.4g} N with "
            f"{lightest.added_mass:.4g} kg: {count}."
        )
    shown = list(front) if Detail.everything else _spread([one for one in front if one.on_curve])
    what = "point of the least force for its mass" if len(shown) == 1 else "points of the least force for their mass"
    remark = f"{len(shown)} {what}; --all and --json have all {len(front)}." if len(shown) < len(front) else ""
    title = f"{found.mechanism}, motion {found.motion}: masses at {', '.join(front[0].masses)}"
    emit_table(title, *table(FrontPoint, shown), remark)


def _spread(curve: "Sequence[FrontPoint]") -> "list[FrontPoint]":
    """At most _POINTS points along a curve of force against added mass, evenly."""
    import numpy as np

    if len(curve) <= _POINTS:
        return list(curve)
    places = np.array([[one.force, one.added_mass] for one in curve])
    steps = np.diff(places, axis=0) / np.maximum(np.ptp(places, axis=0), 1e-300)
    along = np.append(0.0, np.cumsum(np.hypot(*steps.T)))
    chosen = np.searchsorted(along, np.linspace(0.0, along[-1] * (1.0 - 1e-12), _POINTS))
    return [curve[k] for k in np.unique(chosen)]
