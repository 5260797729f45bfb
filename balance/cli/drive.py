"""``balance drive``: steady rotation, start-up, flywheels of a machine that a motor turns."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import click

from ..results import NO_VALUE, table
from . import options
from .framework import Answer, Read, Word, argument, command, option
from .printing import emit_table, say


def _share(text: str) -> float:
    """A share without unit, such as 0.05 or 5%."""
    try:
        share = float(text.removesuffix("%")) / (100.0 if text.endswith("%") else 1.0)
    except ValueError:
        share = -1.0
    if not 0.0 < share < 2.0:
        raise ValueError(f"{text!r}: expected a share above zero, such as 0.05 or 5%")
    return share


@command(
    epilog="""\b
Examples:
  balance drive inverted-slider-crank
  balance drive inverted-slider-crank --start-up 8 --convergence --figure drive.png
  balance drive inverted-slider-crank -c counter_A0A=1.80288kg --flywheel-for 0.05 --json""",
    file=("drive", "four-bar-dc"),
)
def drive(
    drive: str = argument("DRIVE"),
    payload: options.Masses = options.PAYLOADS,
    counter: options.Masses = options.COUNTERS,
    speeds: tuple[float, ...] = option(
        "Nominal speed of the motor, such as 828rpm [default: file].", options.ANGULAR_VELOCITY, "--speed", metavar="N"
    ),
    reading: str | None = option("Whether the gearbox multiplies the torque.", Word(["geared", "ungeared"])),
    flywheel_for: tuple[float, ...] = option(
        "Size a flywheel for this coefficient of speed fluctuation, such as 0.05.",
        Read("share", _share),
        metavar="SHARE",
    ),
    flywheel_side: str = option(
        "The shaft that the flywheel turns with.", Word(["crank", "motor"]), default="crank", show_default=False
    ),
    start_up: int | None = option("Also the first turns from standstill.", click.IntRange(1, 200), metavar="TURNS"),
    convergence: bool = option("Also the answers of the solver with looser and tighter tolerances."),
    figure: str | None = options.FIGURE,
) -> Answer:
    """Steady rotation of a machine of one degree of freedom, and how much its speed fluctuates over a turn.

    The equation of motion I(phi) phi'' + I'(phi) phi'^2 / 2 + V'(phi) = Q comes from the mechanism's file. DRIVE is a
    drive file or a shipped one: inverted-slider-crank, four-bar-dc. The coefficient of speed fluctuation is
    (n_max - n_min) / n_nominal.
    """
    from ..drives import DriveError
    from ..drives import results as documents
    from ..drives.drive_files import load_drive
    from ..drives.harmonic_balance import flywheel_for as sized_flywheel
    from ..drives.time_integration import rotations_from_rest
    from ..drives.time_integration import start_up as started

    study = load_drive(drive)
    mechanism = study.load_mechanism().with_payload(payload)
    machines = [(machine, False) for machine in study.machines(mechanism, speeds, reading)]
    if counter:
        balanced = mechanism.with_counter_mass(counter)
        machines += [(machine, True) for machine in study.machines(balanced, speeds, reading)]
    result = documents.document_head(study, [machine for machine, _ in machines])
    result["reduced"] = documents.inertia_document(machines[0][0])
    if counter:
        result["reduced_with_counter_masses"] = documents.inertia_document(machines[-1][0])
    result |= {"steady": [], "findings": [], "start_up": [], "flywheel": [], "convergence": []}
    refused: list[str] = []
    for machine, has_masses in machines:
        begin = machine.reduced.direction * study.table.start_angle
        where = f"{machine.nominal / documents.RPM:g} rpm, {machine.reading}"
        solutions, reached, refusal = rotations_from_rest(machine, begin)
        refused += [] if solutions else [f"{where}: {refusal}"]
        result["findings"] += documents.reach_findings(solutions, reached, refusal) if solutions else refused[-1:]
        published = study.published_at(machine.nominal)
        for each in solutions:
            row = documents.steady_document(each, published, has_masses, each is reached)
            result["steady"].append(row)
            if each.is_stable:
                result["findings"] += documents.drive_findings(each, row)
        solution = reached or next(iter(solutions), None)
        near = None if solution is None else solution.mean_speed
        with _noted(result["findings"], where):
            if start_up and (refusal is None or not solutions):
                run = started(machine, start_up, begin)
                result["start_up"].append(documents.start_up_document(machine, run, reached, has_masses))
        for share in flywheel_for:
            with _noted(result["findings"], where):
                wheel = sized_flywheel(machine, share, side=flywheel_side, near=near)
                heavier, from_rest = machine.with_flywheel(wheel.inertia, flywheel_side), reached
                if wheel.inertia:
                    kept, from_rest, why = rotations_from_rest(heavier, begin)
                    named = f", flywheel of {wheel.inertia:.5g} kg m2"
                    result["findings"] += documents.reach_findings(kept, from_rest, why, named) if kept else []
                    if start_up and from_rest:
                        run = started(heavier, start_up, begin)
                        result["start_up"].append(
                            documents.start_up_document(heavier, run, from_rest, has_masses, wheel.inertia)
                        )
                result["flywheel"].append(documents.flywheel_document(machine, wheel, has_masses, from_rest))
        with _noted(result["findings"], where):
            if convergence and solution:
                needed = int(min(60, max(4, -(-solution.turns_to(1e-4) // 1) + 2)))
                result["convergence"].append(documents.solvers_document(solution, needed, has_masses))
    if refused and not (result["steady"] or result["flywheel"] or result["start_up"]):
        raise DriveError(refused[0])
    for machine, has_masses in machines:
        result["findings"] += [] if has_masses else documents.beyond_file(machine, study.table.speeds)
    options.draw(figure, "balance.figures.rotating:draw_drive", result)
    further = ("reduced", "reduced_with_counter_masses", "steady", "readings", "convergence", "convergence.trials")
    return Answer(result, lambda: _print(result), findings=result["findings"], further=further)


@contextmanager
def _noted(findings: list[str], where: str) -> Iterator[None]:
    """What cannot be computed is a finding."""
    from ..drives import DriveError

    try:
        yield
    except DriveError as error:
        findings.append(f"{where}: {error}")


_SETTING = ["nominal [rpm]", "torque", "counter-masses"]


def _setting(row: dict[str, Any]) -> list[str]:
    return [f"{row['nominal_rpm']:.4g}", row["reading"], "with" if row["counter_masses"] else "without"]


def _kept(row: dict[str, Any]) -> str:
    return "from rest" if row["reached_from_rest"] else "once there" if row.get("stable", True) else "unstable"


def _print(result: dict[str, Any]) -> None:
    """Each steady rotation, the flywheels, the start-up."""
    from ..drives.time_integration import Turn

    steady = [row for row in result["steady"] if row["reached_from_rest"]] or result["steady"]
    parts = [f"{row['fluctuation']['nominal']:.4f} at {' rpm, '.join(_setting(row)[:2])}" for row in steady[:3]]
    more = f" and {len(steady) - 3} more" if len(steady) > 3 else ""
    meaning = "speed fluctuates over a turn, (n_max - n_min) / n_nominal, by"
    none = "no steady rotation as it is, as the findings say"
    say(f"{result['mechanism']}: {f'{meaning} ' + '; '.join(parts) + more if parts else none}.")
    rows = []
    for row in result["steady"]:
        published = str((row["printed"] or {}).get("fluctuation") or NO_VALUE)
        rows.append([*_setting(row), f"{row['fluctuation']['nominal']:.4f}", published, _kept(row)])
    header = [*_SETTING, "fluctuation", "published", "kept"]
    if rows:
        emit_table("Steady rotation of the crank", header, rows, "From rest: where a start from standstill ends.")
    rows = [
        [*_setting(row), f"{row['wanted_fluctuation']:g}", row["side"], f"{row['inertia_kgm2']:.5f}",
         f"{row['fluctuation']:.4f}", f"{row['mean_rpm']:.4g}", _kept(row),
         f"{row['estimate_of_whole_inertia_kgm2']:.4f}"]
        for row in result["flywheel"]
    ]  # fmt: skip
    if rows:
        header = [
            *_SETTING,
            "at most",
            "shaft",
            "flywheel [kg m2]",
            "fluctuation",
            "crank [rpm]",
            "kept",
            "estimate, whole [kg m2]",
        ]
        remark = "The smallest; where it does better than asked for, a smaller one leaves no steady rotation. "
        remark += "The estimate dE / (omega^2 delta) is of the whole inertia, under a constant torque."
        emit_table("Flywheel for a wanted fluctuation", header, rows, remark)
    for run in result["start_up"]:
        settled = run["settled_in_turn"]
        remark = f"Steady within 0.1 rpm from turn {settled}." if settled else "Not yet steady within 0.1 rpm."
        title = f"Start-up, {', '.join(_setting(run)[:2])}, {_setting(run)[2]} counter-masses"
        title += f", flywheel of {run['flywheel_kgm2']:.5g} kg m2" if run["flywheel_kgm2"] else ""
        emit_table(title, *table(Turn, run["turns"]), remark)
