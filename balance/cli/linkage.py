"""``balance linkage``: planar linkages balanced completely, and their tables for people."""

from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..results import table
from . import options
from .framework import FILE, Answer, Quantity, argument, command, option
from .printing import cells, emit_findings, emit_table, say

if TYPE_CHECKING:
    from ..linkages.equivalence_method import LinkageBalance
    from ..linkages.linkage import Linkage
    from ..linkages.results import Comparison
    from ..linkages.verification import Verification

_STAGE = {"before": "before", "force": "counter-masses", "complete": "counter-masses and gears", "built": "as built"}
_RUNS = (f"simulated.{run}_speed.{part}" for run in ("constant", "varying")
         for part in ("rms", "share_of_before", "bearing_forces"))  # fmt: skip
_FURTHER = (
    "reduction", "simulated.", *_RUNS, "simulated.moving_mass_kg", "simulated.multiple_of_before", "printed.values",
    "printed.rms",
)  # fmt: skip
"""What else of the document is printed for who asks for everything."""
_COUNTER_MASSES = {
    "counter-mass": "symbol", "body": "body", "against": "against", "mass [kg]": "mass_kg:.4f", "x [mm]": "x:.2f",
    "y [mm]": "y:.2f", "inertia [kg m2]": "inertia_kgm2:.4g",
}  # fmt: skip


@command(
    epilog="""\b
Examples:
  balance linkage two-levels                    a shipped example; balance files --copy two-levels: to be changed
  balance linkage pantograph --equations --figure pantograph.png
  balance linkage mine.toml --speed 300rpm --variation 0.5 --csv mine.csv
  balance linkage mine.toml --force-only --json
  balance linkage mine.toml --built "m3*=10.2kg" --built "I_z2=0.5kgm2" --built z2=40:21 --drawing mine.svg
\b
Exit code 3: balanced, but not simulated, a published value differs, or a finding: a counter-mass or inertia that
no workshop makes or no rod has.""",
    file=("linkage", "two-levels"),
)
def linkage(
    linkage: str = argument("LINKAGE"),
    speed: float | None = option(
        "Mean speed of the driven joint, with unit [default: as described].",
        Quantity("angular velocity"),
        metavar="SPEED",
    ),
    variation: float = option(
        "Amplitude of the varying speed, as a share of its mean.",
        click.FloatRange(0.0, 0.95, min_open=True),
        default=0.3,
    ),
    force_only: bool = option("Counter-masses only, no gears."),
    with_equations: bool = option("Also print the equations in symbols.", None, "--equations"),
    csv: str | None = option("Write the time series as CSV.", FILE, metavar="FILE"),
    mjcf: str | None = option(
        "Write it as MJCF, balanced or as built, gears as joint equalities.", FILE, metavar="FILE"
    ),
    built: tuple[str, ...] = option("A mass, inertia or pair of teeth (z3=40:21) as built.", metavar="SYMBOL=VALUE"),
    figure: str | None = options.FIGURE,
    drawing: str | None = option("Draw the linkage with its gears, to scale.", FILE, metavar="FILE"),
) -> Answer:
    """Balance a planar linkage completely: counter-masses for the force, gears for the moment.

    LINKAGE is a TOML file or a shipped one: dwell, knife, pantograph, sewing-machine, dwell-short,
    dwell-short-two-point (the six of the source), two-levels. Verified by dynamics at constant and varying input speed.
    """
    from ..linkages.equivalence_method import as_built, balance_linkage
    from ..linkages.linkage_files import load_linkage
    from ..linkages.results import compare_published, linkage_document, linkage_findings
    from ..linkages.verification import verify_linkage

    if speed == 0.0 or isnan(variation):
        raise click.UsageError(f"--{'speed' if speed == 0.0 else 'variation'}: expected a number other than zero")
    described = load_linkage(linkage)
    result = balance_linkage(described, gears=False if force_only else None)
    stated = {**described.built, **_built(built)}
    made = as_built(result, stated) if stated else None
    check = verify_linkage(result, speed, variation, built=made) if described.is_placed else None
    comparison = None if force_only else compare_published(result)
    _write_files(made or result, check, csv, mjcf, figure)
    options.draw(drawing, "balance.figures.linkage:draw_linkage", made or result)
    findings = linkage_findings(made or result)
    document = linkage_document(result, check, comparison, stated, findings, made)
    differs = comparison is not None and any(row.verdict == "differs" for row in comparison.rows)

    def show() -> None:
        say(_verdict(made or result, check))
        _print_balance(document, with_equations)
        if check is not None:
            _print_bearings(check)
        if comparison:
            _print_comparison(comparison)
        if check is None:
            emit_findings([("Not simulated", _unplaced(described))])

    return Answer(document, show, check is None or differs, findings, further=_FURTHER)


def _verdict(result: "LinkageBalance", check: "Verification | None") -> str:
    """What of force and moment remains by dynamics, and what that costs."""
    from ..linkages.verification import counter_gears_without_mass

    kinds = ("force", "moment") if result.moment else ("force",)
    if check is None:
        return f"{result.linkage.title}: {' and '.join(kinds)} balanced by the equations; not simulated."
    stage = list(check.mass)[-1]
    left, cost = check.varying.residual(stage), check.penalty(stage)
    shares = " and ".join(f"{left[kind]:.2g} of the shaking {kind}" for kind in kinds)
    without = counter_gears_without_mass(result)
    are = "counter-gear is" if len(without) == 1 else "counter-gears are"
    left_out = f"; {len(without)} {are} not counted ({', '.join(without)}: no mass given)" if without else ""
    return (
        f"{result.linkage.title}: {shares} remains {'' if stage == 'built' else 'with '}{_STAGE[stage]}; "
        f"moving mass {check.mass['before']:.3f} -> {check.mass[stage]:.3f} kg ({cost['mass']:.3g} times){left_out}."
    )


def _built(pairs: tuple[str, ...]) -> dict[str, str | tuple[int, int]]:
    """``m3*=10kg`` and ``z3=40:21`` by symbol."""
    found: dict[str, str | tuple[int, int]] = {}
    for pair in pairs:
        name, separator, text = (part.strip() for part in pair.partition("="))
        if not separator or not name or not text:
            raise click.UsageError(f"--built {pair!r}: expected SYMBOL=VALUE, such as m3*=10.2kg or z3=40:21")
        z, colon, z_star = text.partition(":")
        if colon and not (z.isdecimal() and z_star.isdecimal() and int(z) and int(z_star)):
            raise click.UsageError(f"--built {pair!r}: expected teeth as two whole numbers, such as z3=40:21")
        found[name] = (int(z), int(z_star)) if colon else text
    return found


def _write_files(
    result: "LinkageBalance", check: "Verification | None", csv: str | None, mjcf: str | None, figure: str | None
) -> None:
    """Write CSV, MJCF and figure. Raises ModelError where there is nothing simulated to write."""
    from ..errors import ModelError
    from ..table_files import write_csv_file

    if check is None:
        if csv or mjcf or figure:
            raise ModelError(
                f"{result.linkage.name}: {_unplaced(result.linkage)}, so there is nothing to draw or write"
            )
        return
    if mjcf:
        from ..linkages.mjcf_writer import linkage_mjcf

        text = linkage_mjcf(result, "complete" if result.moment else "force", couplings=True)
        Path(mjcf).write_text(text + "\n", encoding="utf-8")
    if csv:
        columns = {}
        for name, run in (("constant", check.constant), ("varying", check.varying)):
            columns[f"time_{name}_s"] = run.trajectory.time
            for stage in run.responses:
                columns |= {f"{name}_{stage}_{column}": values for column, values in run.series(stage).items()}
        write_csv_file(csv, columns)
    options.draw(figure, "balance.figures.balancing:draw_stages", check, result.linkage.title)


def _unplaced(linkage: "Linkage") -> str:
    """Which joints have no place on the ground."""
    names = [j.name for j in linkage.joints.values() if any(end.point is None for end in j.ends)]
    return f"where {', '.join(names)} {'is' if len(names) == 1 else 'are'} on the ground is not given"


def _print_balance(document: dict[str, Any], with_equations: bool) -> None:
    """The reduction tree, counter-masses, gears, and the inertia that two-point bodies must have."""
    from ..linkages.moment_balance import GearResult

    made = document["as_built"]
    for part, how in ((document, " as computed" if made else ""), *([(made, " as built")] if made else ())):
        rows = [
            {**one, **{axis: 1e3 * x for axis, x in zip("xy", one["position_from_reduction_joint_m"], strict=True)}}
            for one in part["counter_masses"]
        ]
        emit_table(f"Counter-masses{how}, from the reduction joint of their body", *cells(rows, _COUNTER_MASSES))
        if document["inertias"]:
            own, sized = (
                ("name", "body", "joint", "carrier", "pivot", "teeth"),
                ("inertia", "counter_mass", "wheel_mass"),
            )
            title = f"Gears{how}: counter-gear I_z and m_z*, real gear on the body m_z and I_m_z"
            remark = (
                "Pivot: of the counter-gear, where `at` is left out a joint of its carrier; on the ground anywhere, "
                "since its place changes neither force nor moment."
            )
            emit_table(title, *table(GearResult, part["gears"], *own, *sized, "wheel_inertia"), remark)
    if not document["inertias"]:
        say("No gears: the force is balanced, the moment is not.")
    for link, inertia in document["reshaped_inertia_kgm2"].items():
        say(f"Link {link} must be shaped to an inertia of {inertia:.4g} kg m2: then two point masses replace it.")
    for equation in document["equations"] if with_equations else ():
        unit = "kg" if equation.unit == "kg" else "kg m2"
        value = "" if equation.value is None else f"   = {equation.value:.5g} {unit}"
        say(f"  [{equation.body}]  {equation.text}{value}")


def _print_bearings(check: "Verification") -> None:
    """What of the forces in bearings and on teeth is not determined."""
    known = [forces for forces in check.varying.bearings.values() if forces is not None]
    if not any(forces.peaks()["joints"] for forces in known):
        say("Bearing forces are not determined: the linkage is statically indeterminate.")
    for gear in sorted({name for forces in known for name in forces.undetermined}):
        say(
            f"{gear}: its teeth's force and the bearing that it loads are not determined: where its counter-gear is "
            "pivoted is not given: counter = { at = [...], on = '...' }."
        )


def _print_comparison(comparison: "Comparison") -> None:
    """What the source publishes, and what its published inputs give."""
    for row in comparison.rows:
        if row.why and row.explained is not None:
            fits = "as published, within the rounding" if row.is_explained else "not as published either"
            say(
                f"{row.name}: published {row.published.value:g}, computed {row.computed:.5g}: {row.why}. "
                f"Computed like that it is {row.explained:.5g}, {fits}."
            )
    names = {row.name for row in comparison.rows if row.explained is not None}
    for entry in comparison.contradictions:
        if entry.about not in names:
            say(f"{_STAGE.get(entry.about, entry.about)}: {entry.why}.")
    for name, what in comparison.restored.items():
        say(f"Restored in the published copy, {name}: {what}.")
