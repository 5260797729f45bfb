"""Tables of ``balance linkage`` for people."""

from collections.abc import Mapping
from math import isfinite

import click

from ..linkages import equations as symbols
from ..linkages.method import Balance
from ..linkages.printed import COLUMNS, Comparison, Row
from ..linkages.verification import Run, Verification
from .console import emit_table

TORQUES = ("torque_constant_speed", "torque_varying_speed")
STAGE = {"before": "before", "force": "counter-masses", "complete": "counter-masses and gears"}


def counter_masses(result: Balance) -> None:
    """The reduction tree, and the counter-masses."""
    rows = [
        [name, result.tree[name], " + ".join(f"{share:.4f} at {joint}" for joint, share in balance.shares.items())]
        for name, balance in result.force.items()
    ]
    click.echo(f"{result.linkage.title}\n")
    emit_table("Reduction, leaves first", ["body", "joint", "point mass [kg]"], rows)
    count = len(result.counters("force"))
    rows = [
        [
            counter.symbol,
            body,
            "gears" if k >= count else "links",
            f"{counter.mass:.4f}",
            *(f"{x * 1e3:.2f}" for x in counter.position),
            f"{counter.inertia:.4g}",
        ]
        for k, (body, counter) in enumerate(result.counters())
    ]
    header = ["counter-mass", "body", "against", "mass [kg]", "x [mm]", "y [mm]", "inertia [kg m2]"]
    emit_table("Counter-masses, from the reduction joint of their body", header, rows)


def gears(result: Balance) -> None:
    """Gear pairs, and the inertia that two-point bodies must have."""
    if result.moment is None:
        click.echo("No gears: the force is balanced, the moment is not.")
        return
    rows = [
        [
            name,
            gear.gear.body,
            gear.joint,
            gear.carrier,
            f"{gear.gear.teeth[0]}:{gear.gear.teeth[1]}",
            f"{gear.inertia:.4g}",
            "-" if gear.counter_mass is None else f"{gear.counter_mass:.4f}",
            f"{gear.wheel_mass:.4f}" if gear.wheel_mass else "-",
            f"{gear.wheel_inertia:.4g}" if gear.wheel_mass else "-",
        ]
        for name, gear in result.moment.gears.items()
    ]
    header = ["gear", "body", "at", "carrier", "Z:Z*", "I_z [kg m2]", "m_z* [kg]", "m_z [kg]", "I_m_z [kg m2]"]
    emit_table("Gears: counter-gear I_z and m_z*, real gear on the body m_z and I_m_z", header, rows)
    for link, inertia in result.moment.reshaped.items():
        click.echo(
            f"Link {link} must be shaped to an inertia of {inertia:.4g} kg m2: then two point masses stand for it."
        )


def equations(result: Balance) -> None:
    """The equations in symbols, with their values."""
    for equation in symbols.equations(result):
        unit = "kg" if equation.text.startswith("m") else "kg m2"
        value = "" if equation.value is None else f"   = {equation.value:.5g} {unit}"
        click.echo(f"  [{equation.body}]  {equation.text}{value}")


def dynamics(check: Verification) -> None:
    """RMS values by stage at both speeds, what is left, what it costs."""
    for label, run in zip(check.labels, (check.constant, check.varying), strict=True):
        rows = [
            [STAGE[stage], *(f"{value:.4g}" for value in run.rms(stage).values()), *_left(run, stage)]
            for stage in run.responses
        ]
        header = ["stage", "FX [N]", "FY [N]", "M [N m]", "torque [N m]", "force left", "moment left"]
        emit_table(f"Simulated, {label}: RMS", header, rows, _how_fast(check, run))
    for stage in list(check.mass)[1:]:
        cost = check.penalty(stage)
        torque = [f"{cost[k]:.3g} times ({label})" for k, label in zip(TORQUES, check.labels, strict=True) if k in cost]
        click.echo(
            f"Cost of {STAGE[stage]}: moving mass {check.mass['before']:.3f} -> {check.mass[stage]:.3f} kg "
            f"({cost['mass']:.3g} times); RMS drive torque {', '.join(torque) or 'not compared'}."
        )
    click.echo(
        "Weight excluded from force and moment; M about the origin of the base. Mass of counter-gears as far as given."
    )


def printed(comparison: Comparison, check: Verification | None) -> None:
    """What the source prints beside what its printed inputs give."""
    rows = [
        [row.name, *(f"{x:.5g}" for x in (row.printed.value, row.computed, *row.interval)), _verdict(row)]
        for row in comparison.rows
    ]
    header = ["symbol", "printed", "computed", "from", "to", "verdict"]
    emit_table("Printed by the source, and computed from its printed inputs as rounded [kg, kg m2]", header, rows)
    for row in comparison.rows:
        if row.why and row.explained is not None:
            fits = "as printed, within the rounding" if row.is_explained else "not as printed either"
            click.echo(f"{row.name}: printed {row.printed.value:g}, computed {row.computed:.5g}: {row.why}. "
                       f"Computed like that it is {row.explained:.5g}, {fits}.")  # fmt: skip
    names = {row.name for row in comparison.rows if row.explained is not None}
    for entry in comparison.contradictions:
        if entry.about not in names:
            click.echo(f"{STAGE.get(entry.about, entry.about)}: {entry.why}.")
    _rms(comparison.rms, check)
    for name, what in comparison.restored.items():
        click.echo(f"Restored in the printed copy, {name}: {what}.")


def _rms(rms: Mapping[str, Mapping[str, float]], check: Verification | None) -> None:
    if not rms:
        return
    rows = []
    for stage, values in rms.items():
        rows.append([f"{STAGE[stage]}, printed", *(f"{values[c]:.4g}" for c in COLUMNS)])
        if check is not None and stage in check.constant.responses:
            ours = check.constant.rms(stage)
            rows.append([f"{STAGE[stage]}, simulated", *(f"{ours[c]:.4g}" for c in COLUMNS)])
            rows.append(["  simulated / printed", *(_ratio(ours[c], values[c]) for c in COLUMNS)])
    emit_table("RMS at constant speed", ["stage", "FX [N]", "FY [N]", "M [N m]", "torque [N m]"], rows)


def _ratio(ours: float, theirs: float) -> str:
    return f"{100 * (ours / theirs - 1):+.2f} %" if theirs > 0.05 else "-"


def _how_fast(check: Verification, run: Run) -> str:
    """What moves the driven joint."""
    what = "cycles of" if check.swings else "at"
    varied = f" (1 + {check.variation:g} sin wt)" if run is check.varying else ""
    return f"driven joint {run.drive} {what} {check.speed:.5g}{varied} rad/s; left: largest as a share of before"


def _left(run: Run, stage: str) -> list[str]:
    """Shares of before; a dash where there was nothing before."""
    return [f"{share:.2g}" if isfinite(share) else "-" for share in run.residual(stage).values()]


def _verdict(row: Row) -> str:
    return row.verdict + (", see below" if row.why else "")
