"""Results of drives as plain values for JSON: every number of tables and figures, units in the keys."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..results import document
from .drive_files import Drive, PublishedSpeeds
from .equivalent_inertia import inertia_extremes
from .harmonic_balance import DEFINITIONS, SAME, Flywheel, SteadyRotation, flywheel_estimate
from .machine import READINGS, DirectCurrent, Machine, MeasuredMotor
from .time_integration import StartUp, by_harmonics, by_tolerance, periodicity, solver_scatter

RPM = math.pi / 30.0
"""One revolution per minute [rad/s]."""
PERIODICITY = 1e-8
"""Relative change of speed over an integrated turn above which a steady solution is flagged."""
FAR = 3.0
"""Factor beyond the speeds of a drive's file from which a nominal speed is a finding."""
_ROUNDING = 1e-9
_DEGREES = np.arange(361.0)


def inertia_document(machine: Machine) -> dict[str, Any]:
    """Reduced inertia and potential energy over a turn, and where they are extreme."""
    r = machine.reduced
    u = r.direction * np.radians(_DEGREES)
    extremes = [
        {"angle_deg": math.degrees(r.direction * at) % 360.0, "inertia_kgm2": value, "kind": kind}
        for at, value, kind in inertia_extremes(r)
    ]
    return document(r) | {
        "constant_inertia_kgm2": machine.constant_inertia,
        "mechanism_inertia_extremes": extremes,
        "potential_swing_J": float(np.ptp(r.potential(u))),
        "harmonics": r.functions.harmonics,
        "turn": {
            "angle_deg": _DEGREES.tolist(),
            "inertia_kgm2": machine.inertia(u).tolist(),
            "inertia_slope_kgm2_per_rad": (r.direction * r.inertia_slope(u)).tolist(),
            "potential_J": r.potential(u).tolist(),
            "potential_slope_Nm": (r.direction * r.potential_slope(u)).tolist(),
        },
    }


def steady_document(
    solution: SteadyRotation, published: PublishedSpeeds | None, balanced: bool, is_reached: bool
) -> dict[str, Any]:
    """A steady rotation; whether the counter-masses are mounted, and whether a start from standstill ends in it."""
    machine = solution.machine
    u = machine.reduced.direction * np.radians(_DEGREES)
    rate = solution.rate(u)
    return {
        **_setting(machine, balanced),
        **document(solution),
        "fastest_rpm": solution.fastest[1] / RPM,
        "fastest_at_deg": math.degrees(solution.angle(solution.fastest[0])),
        "slowest_rpm": solution.slowest[1] / RPM,
        "slowest_at_deg": math.degrees(solution.angle(solution.slowest[0])),
        "fluctuation": {name: solution.fluctuation(name) for name in DEFINITIONS},
        "turns_to_1e-8": solution.turns_to(1e-8) if solution.is_stable else None,
        "reached_from_rest": is_reached,
        "periodicity": periodicity(solution) if solution.is_stable else None,
        "equation_residual": solution.residual(),
        "printed": None
        if published is None
        else {
            "fluctuation": published.fluctuation,
            "fastest_rpm": published.fastest and published.fastest / RPM,
            "slowest_rpm": published.slowest and published.slowest / RPM,
        },
        "turn": {
            "angle_deg": _DEGREES.tolist(),
            "speed_rpm": (rate / RPM).tolist(),
            "motor_torque_at_crank_Nm": np.asarray(machine.motor_torque(rate)).tolist(),
        },
    }


def reach_findings(
    solutions: Sequence[SteadyRotation], reached: SteadyRotation | None, refusal: str | None, wheel: str = ""
) -> list[str]:
    """Steady rotations that the motor does not bring the crank to from standstill, or does not keep."""
    machine, stable = solutions[0].machine, [each for each in solutions if each.is_stable]
    where = f"{machine.nominal / RPM:g} rpm, {machine.reading}{wheel}"
    missed = " and ".join(f"{machine.ratio * each.mean_speed / RPM:.5g}" for each in stable if each is not reached)
    if not stable:
        return [f"{where}: unstable, a disturbance grows by {solutions[0].floquet:.3g} a turn"]
    if refusal is not None:
        return [f"{where}: the motor does not reach its steady {missed} rpm from standstill: {refusal}"]
    if reached is None:
        return [
            f"{where}: a start from standstill ends below the steady {missed} rpm of the motor, which it only keeps"
        ]
    settles = machine.ratio * reached.mean_speed / RPM
    if missed:
        return [
            f"{where}: a start from standstill ends at {settles:.5g} rpm of the motor; it keeps {missed} rpm too, once "
            "brought there: above the unstable speed between them"
        ]
    if not machine.nominal / FAR < machine.ratio * reached.mean_speed < FAR * machine.nominal:
        return [f"{where}: the motor turns at {settles:.5g} rpm; the fluctuation is a share of the nominal speed"]
    return []


def drive_findings(solution: SteadyRotation, row: dict[str, Any]) -> list[str]:
    """What is odd in a steady rotation; empty where nothing is."""
    where = f"{row['nominal_rpm']:g} rpm, {row['reading']}"
    findings = []
    if row["periodicity"] is not None and not row["periodicity"] <= PERIODICITY:
        findings.append(f"{where}: after an integrated turn the speed is off by {row['periodicity']:.1e} of itself")
    if not solution.is_converged():
        findings.append(f"{where}: harmonics still at {solution.tail:.1e}; a load or friction with a kink")
    machine = solution.machine
    slowest, fastest = (machine.ratio * at[1] / RPM for at in (solution.slowest, solution.fastest))
    if isinstance(motor := machine.motor, MeasuredMotor) and not motor.covers(np.array([slowest, fastest]) * RPM):
        findings.append(
            f"{where}: the motor turns at {slowest:.4g} to {fastest:.4g} rpm, its table covers "
            f"{motor.speed[0] / RPM:.4g} to {motor.speed[-1] / RPM:.4g} rpm; it was extrapolated by its tangent"
        )
    if isinstance(motor, DirectCurrent) and machine.nominal > (1.0 + _ROUNDING) * motor.no_load_speed:
        findings.append(
            f"{where}: the nominal speed is {machine.nominal / motor.no_load_speed:.3g} times the motor's speed "
            f"without load at full voltage, {motor.no_load_speed / RPM:.4g} rpm: it would need as many times its "
            "voltage"
        )
    return findings


def beyond_file(machine: Machine, speeds: Sequence[float]) -> list[str]:
    """A nominal speed far from all ``speeds`` of the drive's file [rad/s], for a motor without a range of its own."""
    low, high = min(speeds), max(speeds)
    if isinstance(machine.motor, DirectCurrent | MeasuredMotor) or low / FAR <= machine.nominal <= high * FAR:
        return []
    what, than = ("largest", high) if machine.nominal > high else ("least", low)
    return [
        f"{machine.nominal / RPM:g} rpm, {machine.reading}: {machine.nominal / than:.4g} times the {what} speed of the "
        f"drive's file, {than / RPM:.4g} rpm: the data of motor and loads may not apply there"
    ]


def start_up_document(
    machine: Machine, run: StartUp, solution: SteadyRotation | None, balanced: bool, flywheel: float = 0.0
) -> dict[str, Any]:
    """A start from standstill, turn by turn, and every twelfth sample of its course."""
    settled = solution and run.settled(solution.fastest[1], solution.slowest[1], 0.1 * RPM)
    thin = slice(None, None, 12)
    return _setting(machine, balanced) | {
        "flywheel_kgm2": flywheel,
        "turns": run.turns,
        "settled_in_turn": settled,
        "course": {
            "time_s": run.time[thin].tolist(),
            "travel_deg": np.degrees(run.travel[thin]).tolist(),
            "speed_rpm": (run.speed[thin] / RPM).tolist(),
        },
    }


def flywheel_document(
    machine: Machine, wheel: Flywheel, balanced: bool, reached: SteadyRotation | None
) -> dict[str, Any]:
    """A flywheel for a wanted fluctuation, and the textbook's estimate of the whole inertia.

    ``reached`` is where a start from standstill with it ends.
    """
    return _setting(machine, balanced) | {
        **document(wheel),
        "reached_from_rest": reached is not None and abs(reached.mean_speed / wheel.mean_speed - 1.0) < SAME,
        "estimate_of_whole_inertia_kgm2": flywheel_estimate(machine, wheel.wanted),
    }


def solvers_document(solution: SteadyRotation, turns: int, balanced: bool) -> dict[str, Any]:
    """The answer against harmonics and against the tolerance of integrators."""
    machine, truth = solution.machine, solution.fluctuation()
    trials = [*by_harmonics(machine), *by_tolerance(machine, turns)]
    loose = [t for t in trials if t.setting in {"rtol 0.01", "rtol 0.001"}]
    return _setting(machine, balanced) | {
        "converged_fluctuation": truth,
        "turns_integrated": turns,
        "loose_solver_scatter_percent": 100.0 * solver_scatter(loose, truth),
        "trials": [document(t) | {"off_percent": 100.0 * (t.fluctuation / truth - 1.0)} for t in trials],
    }


def document_head(drive: Drive, machines: Sequence[Machine]) -> dict[str, Any]:
    """What the study is of."""
    machine = machines[0]
    return {
        "drive": drive.name,
        "mechanism": machine.reduced.mechanism.name,
        "gear_ratio": machine.ratio,
        "inertias": machine.inertias,
        "readings": {reading: READINGS[reading] for reading in dict.fromkeys(m.reading for m in machines)},
        "definitions": DEFINITIONS,
    }


def _setting(machine: Machine, balanced: bool) -> dict[str, Any]:
    return document(machine) | {"counter_masses": balanced}
