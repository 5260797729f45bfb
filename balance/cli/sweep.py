"""``balance sweep`` and ``balance tolerance``: designs, and errors, of masses and places on one motion."""

import re
import sys
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import click

from . import options
from .framework import EXIT_WITH_FINDINGS, emit_json, emit_table, json_option
from .options import Quantity

if TYPE_CHECKING:
    from ..arrays import Floats
    from ..balancing.sweep import Variable
    from ..balancing.tolerance import Tolerance

_MOST_DESIGNS = 10_000_000
_MOST_IN_MEMORY = 1_000_000


class Varied(click.ParamType["Variable"]):
    """``NAME.PART=FIRST:LAST:COUNT`` or ``NAME.PART=A,B,C``, with units."""

    name = "NAME.PART=VALUES"

    def convert(self, value: "str | Variable", param: click.Parameter | None, ctx: click.Context | None) -> "Variable":
        """Read the text; a wrong one fails as a wrong command line."""
        import numpy as np

        from ..balancing.sweep import Variable

        if not isinstance(value, str):
            return value
        match = re.fullmatch(r"(.+)\.(mass|x|y|z)=(.+)", value)
        if match is None:
            self.fail(f"{value!r}: expected such as counter_A0A.mass=0kg:30kg:1000 or A.x=90mm,100mm", param, ctx)
        name, part, text = match.groups()
        read = Quantity("mass" if part == "mass" else "length")
        if text.count(":") == 2:
            first, last, count = text.split(":")
            if not re.fullmatch(r"[1-9]\d{0,6}", count.strip()):
                self.fail(f"{value!r}: {count!r} is no number of values: expected such as 1000", param, ctx)
            values = np.linspace(read.convert(first, param, ctx), read.convert(last, param, ctx), int(count))
        else:
            values = np.array([read.convert(one, param, ctx) for one in text.split(",")])
        if part == "mass" and (values < 0.0).any():
            self.fail(f"{value!r}: expected masses of zero or more", param, ctx)
        return Variable(name, part, values)


@click.command(
    epilog="""\b
Examples:
  balance sweep parallelogram-6bar --motion x -p platform=5kg \\
    --vary counter_A0A.mass=0kg:30kg:100 --vary counter_B0B.mass=0kg:30kg:100
  balance sweep four-bar --motion four-bar --vary counter_A0A.mass=0kg:4kg:200 --vary counter_A0A.x=-80mm,-50mm
  balance sweep four-bar --motion four-bar --vary B_AB.x=250mm:270mm:21 -o sweep --scheduler local

\b
NAME.mass is the counter-mass at a site, or the mass of a body; NAME.x, .y, .z the place of a site or a body in the body
that carries it, as its MJCF file writes it. Values: first:last:count, or a list. All designs have the same motion.
\b
Columns: each variable; rms_F_N, peak_F_N of the force vector; rms_M_Nm, peak_M_Nm of the moment about the base's
origin; the same of each component and drive; added_mass_kg. A folder (-o) holds them as Parquet; a sweep goes on there
where it was interrupted."""
)
@options.mechanism_argument
@click.option("--motion", required=True, metavar="TOML", help="The motion of all designs.")
@click.option("--vary", "variables", type=Varied(), multiple=True, required=True, metavar="NAME.PART=VALUES",
              help="A mass or a place, and its values, such as counter_A0A.mass=0kg:30kg:1000.")  # fmt: skip
@options.payload_option
@options.counter_option
@click.option("--rate", type=Quantity("frequency", positive=True), metavar="HZ",
              help="Sampling of the motion, such as 1kHz [default: 10 kHz].")  # fmt: skip
@click.option("--quantity", "quantities", type=click.Choice(["force", "moment", "torque"]), multiple=True,
              help="Only this, several times for more [default: all].")  # fmt: skip
@click.option("--rms-only", is_flag=True, help="No peak values: some hundred times quicker on long motions.")
@click.option("--best", "ranked_by", default="rms_F_N", show_default=True, metavar="COLUMN",
              help="Column by which designs are ranked.")  # fmt: skip
@click.option("--top", type=click.IntRange(1, 1000), default=5, show_default=True, help="Designs that are printed.")
@click.option("-o", "--output", type=click.Path(path_type=Path, file_okay=False), metavar="FOLDER",
              help="Keep all results here, as Parquet.")  # fmt: skip
@options.scheduler_option
@options.figure_option
@json_option
def sweep(
    mechanism: str,
    motion: str,
    variables: "tuple[Variable, ...]",
    payload: tuple[tuple[str, float], ...],
    counter: tuple[tuple[str, float], ...],
    rate: float | None,
    quantities: tuple[str, ...],
    rms_only: bool,
    ranked_by: str,
    top: int,
    output: Path | None,
    scheduler: str | None,
    figure: str | None,
    as_json: bool,
) -> None:
    """Shaking force, moment and torque of all combinations of masses and places, on one motion."""
    from rich.console import Console
    from rich.progress import Progress

    from ..balancing.sweep import QUANTITIES, Grid, Problem, Sweep
    from ..motion import DEFAULT_RATE_HZ
    from ..motion.motion_files import load_motion
    from ..task_pool import task_pool

    grid = Grid(variables)
    limit = _MOST_IN_MEMORY if output is None else _MOST_DESIGNS
    if grid.size > limit:
        raise click.UsageError(
            f"{grid.size} designs: expected at most {limit}" + ("; with -o FOLDER more" if output is None else "")
        )
    if figure and len(variables) > 2:
        raise click.UsageError("--figure draws one or two variables")
    model = options.load_mechanism_option(mechanism, payload)
    samples = load_motion(motion).sample(rate or DEFAULT_RATE_HZ)
    counters, asked = options.distinct(counter, "--counter"), frozenset(quantities or QUANTITIES)
    problem = Problem(model, samples, counters, not rms_only, asked)
    started = perf_counter()
    found: list[dict[str, Floats]] = []
    bar = Progress(console=Console(stderr=True), disable=not sys.stderr.isatty(), transient=True)
    with task_pool(scheduler) as pool, bar:
        task = bar.add_task("designs", total=grid.size)
        for count, columns in Sweep(problem, variables, output).run(pool):
            if ranked_by not in columns:
                raise click.UsageError(f"--best {ranked_by}: no such column; there are {', '.join(columns)}")
            found.append(columns if figure else _best(columns, ranked_by, top))
            bar.advance(task, count)
    best = _best(_joined(found), ranked_by, top)
    rows = [{name: float(values[i]) for name, values in best.items()} for i in range(len(best[ranked_by]))]
    if figure:
        from ..balancing.sweep import Designs
        from ..figures.mechanism import save

        save(Designs(_joined(found), tuple(v.column for v in variables), ranked_by).plot(), figure)
    if as_json:
        emit_json({"mechanism": model.name, "designs": grid.size, "ranked_by": ranked_by, "best": rows})
        return
    shown = list(dict.fromkeys([*(v.column for v in variables), ranked_by, *_SHOWN]))
    shown = [name for name in shown if name in best]
    cells = [[f"{row[name]:.6g}" for name in shown] for row in rows]
    seconds = perf_counter() - started
    click.echo(f"Least {ranked_by} of {grid.size} designs: {rows[0][ranked_by]:.4g} ({seconds:.3g} s)")
    emit_table(f"{model.name}, motion {motion}", shown, cells)


_SHOWN = ("rms_F_N", "peak_F_N", "rms_M_Nm", "peak_M_Nm", "added_mass_kg")


def _best(columns: "dict[str, Floats]", ranked_by: str, top: int) -> "dict[str, Floats]":
    """The ``top`` rows of least ``ranked_by``, the lightest of equals first."""
    import numpy as np

    order = np.lexsort([columns["added_mass_kg"], columns[ranked_by]])[:top]
    return {name: values[order] for name, values in columns.items()}


def _joined(parts: "list[dict[str, Floats]]") -> "dict[str, Floats]":
    import numpy as np

    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


class ToleranceType(click.ParamType["Tolerance"]):
    """``NAME.PART=5g`` or ``NAME.PART=0.1mm``: the largest error to either side."""

    name = "NAME.PART=ERROR"

    def convert(
        self, value: "str | Tolerance", param: click.Parameter | None, ctx: click.Context | None
    ) -> "Tolerance":
        """Read the text; a wrong one fails as a wrong command line."""
        from ..balancing.tolerance import Tolerance

        if not isinstance(value, str):
            return value
        match = re.fullmatch(r"(.+)\.(mass|x|y|z)=(?:±|\+-|\+/-)?(.+)", value)
        if match is None:
            self.fail(f"{value!r}: expected such as counter_A0A.mass=5g or A.x=0.1mm", param, ctx)
        name, part, text = match.groups()
        size = Quantity("mass" if part == "mass" else "length", positive=True).convert(text, param, ctx)
        return Tolerance(name, part, size)


@click.command(
    epilog="""\b
Example:
  balance tolerance parallelogram-6bar --motion x -p platform=5kg -c counter_A0A=24.28kg -c counter_B0B=24.28kg \\
    --tolerance counter_A0A.mass=20g --tolerance counter_A0A.x=0.2mm --tolerance platform.mass=10g \\
    --tolerance BD.x=0.05mm

\b
Errors are drawn evenly within the tolerances (rectangular distributions, JCGM 101) and act on the force linearly;
where a tolerance is too wide for that, its curvature is above 0.05 and the exit code is 3. All have the same motion."""
)
@options.mechanism_argument
@click.option("--motion", required=True, metavar="TOML", help="The motion.")
@click.option("--tolerance", "tolerances", type=ToleranceType(), multiple=True, required=True,
              metavar="NAME.PART=ERROR", help="A mass or a place and its largest error, to either side.")  # fmt: skip
@options.payload_option
@options.counter_option
@click.option("--draws", type=click.IntRange(1000, 1_000_000), default=20_000, show_default=True,
              help="Mechanisms that are drawn.")  # fmt: skip
@click.option("--seed", type=int, default=1, show_default=True, help="Of the draws.")
@options.scheduler_option
@json_option
def tolerance(
    mechanism: str,
    motion: str,
    tolerances: "tuple[Tolerance, ...]",
    payload: tuple[tuple[str, float], ...],
    counter: tuple[tuple[str, float], ...],
    draws: int,
    seed: int,
    scheduler: str | None,
    as_json: bool,
) -> int:
    """What errors of masses, radii and lengths cost: the shaking force that mechanisms made within tolerances keep."""
    from ..balancing.sweep import Problem
    from ..balancing.tolerance import ToleranceEffect, analyze_tolerances
    from ..motion import DEFAULT_RATE_HZ
    from ..motion.motion_files import load_motion
    from ..results import document, table
    from ..task_pool import task_pool

    model = options.load_mechanism_option(mechanism, payload)
    samples = load_motion(motion).sample(DEFAULT_RATE_HZ)
    problem = Problem(model, samples, options.distinct(counter, "--counter"))
    with task_pool(scheduler) as pool:
        found = analyze_tolerances(problem, tolerances, draws, seed, pool)
    if as_json:
        emit_json({"mechanism": model.name, "draws": draws, "seed": seed, **document(found)})
    else:
        click.echo(
            f"95 % of {model.name} made within these tolerances keep at most {found.percentiles['95']:.4g} N RMS of "
            f"shaking force; without errors {found.nominal:.4g} N."
        )
        levels = ", ".join(f"{level} %: {value:.4g} N" for level, value in found.percentiles.items())
        emit_table(
            "Tolerances, largest share first", *table(ToleranceEffect, found.effects), f"RMS force at most: {levels}"
        )
    for effect in found.doubtful:
        click.echo(
            f"balance: {effect.tolerance.text}: its effect is not linear (curvature {effect.curvature:.2g}): "
            "narrow the tolerance, or vary it with balance sweep",
            err=True,
        )
    return EXIT_WITH_FINDINGS if found.doubtful else 0
