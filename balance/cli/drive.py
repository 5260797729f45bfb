"""``balance drive``."""

from typing import TYPE_CHECKING, Any

import click

from . import options
from .console import EXIT_WITH_FINDINGS, emit_json, json_option

if TYPE_CHECKING:
    from ..drives.drive_files import Drive
    from ..drives.machine import Machine
    from ..drives.steady import Steady


class Share(click.ParamType[float]):
    """A share without unit, such as 0.05 or 5%."""

    name = "share"

    def convert(self, value: str | float, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Read the text; a wrong one fails as a wrong command line."""
        if isinstance(value, float):
            return value
        try:
            share = float(value.removesuffix("%")) / (100.0 if value.endswith("%") else 1.0)
        except ValueError:
            share = -1.0
        if not 0.0 < share < 2.0:
            self.fail(f"{value!r}: expected a share above zero, such as 0.05 or 5%", param, ctx)
        return share


@click.command(
    epilog="""\b
A drive file (TOML; unknown keys are refused, quantities carry units):
  mechanism = "four-bar"            # shipped name, or a file beside this one
  crank = "A0"                      # joint that turns; default: the one with the motor
  direction = 1                     # -1: clockwise
  start_angle = "0 deg"             # of start-up
  speeds = ["900 rpm"]              # nominal speeds of the motor
  [motor]                           # kind = induction | dc | constant | table
  kind = "dc"                       #   dc: stall_torque, no_load_speed; nominal sets the voltage
  stall_torque = "1.2 N m"          #   induction: peak_torque, peak_slip, a, b, synchronous_speed,
  no_load_speed = "3000 rpm"        #     slip_base, braking; constant: torque; table: speed, torque
  [gearbox]
  ratio = 6.0                       # motor turns per crank turn
  reading = "geared"                # or "ungeared"; left out: both are shown
  [[inertia]]                       # side = crank | motor
  inertia = "0.4 kg cm2"
  side = "motor"
  [[load]]                          # kind = constant | dry | viscous | quadratic | table
  kind = "quadratic"                #   joint (default: crank); torque or force; at_speed; angle
  joint = "B0"
  torque = "0.4 N m"
  at_speed = "10 rad/s"
  [[load]]
  kind = "table"                    #   against the joint's positive direction, by the crank's angle:
  joint = "piston_1"                #   angle = ["0 deg", ...] and force = ["3 kN", ...], one turn, or
  file = "gas.csv"                  #   a CSV beside this file, header: angle (deg),force (N)
  [[printed]]                       # what a source prints, shown beside: speed, fluctuation,
                                    #   fastest, slowest

\b
Examples:
  balance drive inverted-slider-crank
  balance drive inverted-slider-crank --start-up 8 --convergence --figure drive.png
  balance drive inverted-slider-crank -c counter_A0A=1.80288kg --flywheel-for 0.05 --json"""
)
@click.argument("drive", metavar="DRIVE")
@options.payload_option
@options.counter_option
@click.option("--speed", multiple=True, metavar="N", help="Nominal speed of the motor, such as 828rpm [default: file].")
@click.option("--reading", type=click.Choice(["geared", "ungeared"]), help="Whether the gearbox multiplies the torque.")
@click.option("--flywheel-for", type=Share(), multiple=True, metavar="SHARE", help="Flywheel for this fluctuation.")
@click.option("--flywheel-side", type=click.Choice(["crank", "motor"]), default="crank", help="Its shaft.")
@click.option("--start-up", type=click.IntRange(1, 200), metavar="TURNS", help="Also start from standstill.")
@click.option("--convergence", is_flag=True, help="Also the answer of looser and tighter solvers.")
@options.figure_option
@json_option
@click.pass_context
def drive(
    ctx: click.Context,
    drive: str,
    payload: tuple[tuple[str, float], ...],
    counter: tuple[tuple[str, float], ...],
    speed: tuple[str, ...],
    reading: str | None,
    flywheel_for: tuple[float, ...],
    flywheel_side: str,
    start_up: int | None,
    convergence: bool,
    figure: str | None,
    as_json: bool,
) -> None:
    """Steady rotation of a machine of one degree of freedom, and how much its speed fluctuates over a turn.

    The equation of motion I(phi) phi'' + I'(phi) phi'^2 / 2 + V'(phi) = Q comes from the mechanism's file. DRIVE is a
    drive file or a shipped one: inverted-slider-crank, four-bar-dc. The coefficient of speed fluctuation is
    (n_max - n_min) / n_nominal.
    """
    from ..drives import document as documents
    from .drive_tables import show

    study, stated = _asked(drive, speed, reading)
    machines = _machines(study, options.once(payload, "--payload"), options.once(counter, "--counter"))
    result = documents.head(study, [machine for machine, _ in machines])
    result["reduced"] = documents.reduced(machines[0][0])
    if counter:
        result["reduced_with_counter_masses"] = documents.reduced(machines[-1][0])
    _fill(result, study, machines, flywheel_for, flywheel_side, start_up, convergence)
    result["findings"] += [
        text for machine, balanced in machines if not balanced for text in documents.beyond_file(machine, stated)
    ]
    if figure:
        from ..figures.drawing import save
        from ..figures.drives import draw_drive

        save(draw_drive(result), figure)
    emit_json(result) if as_json else show(result)
    if result["findings"]:
        ctx.exit(EXIT_WITH_FINDINGS)


def _asked(drive: str, speeds: tuple[str, ...], reading: str | None) -> tuple["Drive", tuple[float, ...]]:
    """The study that is asked for, and the nominal speeds that its file states [rad/s]."""
    from dataclasses import replace

    from ..drives.drive_files import load_drive
    from ..quantities import parse

    study = load_drive(drive)
    stated = study.speeds
    if reading:
        study = replace(study, reading=reading)
    if speeds:
        asked = tuple(parse(text, "angular velocity") for text in speeds)
        if not min(asked) > 0.0:
            raise click.UsageError(f"--speed is {', '.join(speeds)}: expected more than zero")
        study = replace(study, speeds=asked)
    return study, stated


def _machines(study: "Drive", payload: dict[str, float], counter: dict[str, float]) -> list[tuple["Machine", bool]]:
    """Machines without, then with the counter-masses."""
    mechanism = study.load_mechanism().with_payload(payload)
    plain = [(machine, False) for machine in study.machines(mechanism)]
    if not counter:
        return plain
    return plain + [(machine, True) for machine in study.machines(mechanism.with_counter_mass(counter))]


def _fill(
    result: dict[str, Any],
    study: "Drive",
    machines: list[tuple["Machine", bool]],
    wanted: tuple[float, ...],
    side: str,
    turns: int | None,
    convergence: bool,
) -> None:
    from ..drives import document as documents
    from ..drives.errors import DriveError
    from ..drives.flywheel import flywheel_for
    from ..drives.startup import start_up
    from ..drives.steady import steady

    result |= {"steady": [], "findings": [], "start_up": [], "flywheel": [], "convergence": []}
    for machine, balanced in machines:
        solution: Steady = steady(machine)
        row = documents.steady(solution, study.printed_at(machine.nominal), balanced)
        result["steady"].append(row)
        result["findings"] += documents.findings(solution, row)
        for share in wanted:
            wheel = flywheel_for(machine, share, side=side)
            result["flywheel"].append(documents.flywheel(machine, wheel, balanced))
        try:
            if turns:
                run = start_up(machine, turns, machine.reduced.direction * study.start_angle)
                result["start_up"].append(documents.start_up(machine, run, solution, balanced))
            if convergence:
                needed = int(min(60, max(4, -(-solution.turns_to(1e-4) // 1) + 2)))
                result["convergence"].append(documents.solver_trials(solution, needed, balanced))
        except DriveError as error:
            result["findings"].append(f"{row['nominal_rpm']:g} rpm, {row['reading']}: {error}")
