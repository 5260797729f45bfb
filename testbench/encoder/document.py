"""What a log of encoder edges has to say, as one document with units in the keys."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from .course import Course
from .edges import Edges
from .model import Held
from .pitch import Pitch
from .turn import Estimate, Turn
from .turncount import repetition

if TYPE_CHECKING:
    from balance.drives.startup import StartUp

RPM = math.pi / 30.0
"""One revolution per minute [rad/s]."""
_DEGREES = np.arange(361.0)
FAR_FROM_NOMINAL = 1.5
"""Factor between mean and nominal speed above which it is said: slip of a motor is less, a gearbox left out is more."""
COARSE_CLOCK = 0.01
"""Share of an interval between edges above which a clock step is named."""


def edges(record: Edges) -> dict[str, Any]:
    """The log itself: edges, clock, gaps."""
    step = record.clock_step
    return {
        "log": record.name,
        "edges": len(record.time),
        "pulses_per_disc_turn": record.disc.pulses,
        "disc_turns_per_crank_turn": record.disc.ratio,
        "crank_turns": float(record.angle[-1] / (2.0 * np.pi)),
        "motion_repeats_every_edges": repetition(record),
        "clock_step_us": None if step is None else step * 1e6,
        "lost_edges": [
            {"after_edge": g.after, "time_s": g.time, "missing": g.missing, "interval_ratio": g.ratio}
            for g in record.gaps
        ],
    }


def turn(found: Turn, nominal: float | None) -> dict[str, Any]:
    """The steady turn with its 95 % intervals."""
    phi = np.radians(_DEGREES)
    return {
        "turns_used": found.turns,
        "turns_left_out": found.left_out,
        "harmonics": found.harmonics,
        "jitter_us": found.jitter * 1e6,
        "repeated_percent_of_pitch": 100.0 * found.repeated,
        "nominal_rpm": None if nominal is None else nominal / RPM,
        "fastest_rpm": _interval(found.fastest, RPM),
        "fastest_at_deg_from_first_edge": math.degrees(found.fastest_at),
        "slowest_rpm": _interval(found.slowest, RPM),
        "slowest_at_deg_from_first_edge": math.degrees(found.slowest_at),
        "mean_rpm": _interval(found.mean, RPM),
        "fluctuation": _interval(found.fluctuation(nominal), 1.0),
        "fluctuation_by": "mean speed over time" if nominal is None else "nominal speed",
        "turn": {
            "angle_deg_from_first_edge": _DEGREES.tolist(),
            "speed_rpm": (found.speed(phi) / RPM).tolist(),
            "half_width_rpm": (found.speed_error(phi) / RPM).tolist(),
        },
    }


def model(held: Held, nominal: float) -> dict[str, Any]:
    """The measured turn beside the computed one."""
    solution, found = held.solution, held.turn
    return {
        "mechanism": solution.machine.reduced.mechanism.name,
        "reading": solution.machine.reading,
        "motor_nominal_rpm": solution.machine.nominal / RPM,
        "first_edge_at_deg": math.degrees(held.first_edge),
        "first_edge_found_by_alignment": held.aligned,
        "fluctuation": solution.fluctuation(),
        "fluctuation_in_interval": found.fluctuation(nominal).holds(solution.fluctuation()),
        "fastest_rpm": solution.fastest[1] / RPM,
        "slowest_rpm": solution.slowest[1] / RPM,
        "mean_rpm": solution.mean_speed / RPM,
        "rms_difference_rpm": held.rms_difference() / RPM,
        "turn": {
            "angle_deg_from_first_edge": _DEGREES.tolist(),
            "speed_rpm": (held.computed(np.radians(_DEGREES)) / RPM).tolist(),
        },
    }


def course(found: Course) -> dict[str, Any]:
    """Speed edge by edge."""
    return {
        "time_s": found.time.tolist(),
        "angle_deg_from_first_edge": np.degrees(found.angle).tolist(),
        "speed_rpm": (found.speed / RPM).tolist(),
        "half_width_rpm": (found.error / RPM).tolist(),
    }


def start(computed: "StartUp", later: float) -> dict[str, Any]:
    """The computed start, moved in time so that its first turn ends with the measured one."""
    thin = slice(None, None, 6)
    return {
        "moved_by_s": later,
        "time_s": (computed.time[thin] + later).tolist(),
        "speed_rpm": (computed.speed[thin] / RPM).tolist(),
        "turns": [
            {"turn": t.number, "end_s": t.end + later, "fastest_rpm": t.fastest / RPM, "slowest_rpm": t.slowest / RPM}
            for t in computed.turns
        ],
    }


def pitch(found: Pitch) -> dict[str, Any]:
    """Errors of the disc."""
    return {
        "rms_percent_of_pitch": 100.0 * found.rms,
        "ahead_deg": np.degrees(found.ahead).tolist(),
        "half_width_deg": np.degrees(found.error).tolist(),
    }


def findings(record: Edges, found: Turn | None) -> list[str]:
    """What is odd in a log; nothing where all is well."""
    odd = [f"lost edges bridged: {gap.text()}" for gap in record.gaps]
    interval, step = float(np.median(np.diff(record.time))), record.clock_step
    if step is not None and step > COARSE_CLOCK * interval:
        odd.append(
            f"the clock's step of {step * 1e6:g} us is {100 * step / interval:.1f} % of an interval between edges"
        )
    again = repetition(record) if found is not None else None
    if again is not None and (times := round(record.disc.per_turn / again)) > 1:
        odd.append(
            f"the motion repeats every {again} edges already, {times} times a turn of {record.disc.per_turn:g}: so it "
            f"does where the disc has {record.disc.pulses / times:g} edges a turn, not {record.disc.pulses}; all "
            f"speeds are then {times} times as high"
        )
    if found is not None and found.repeated > 0.0:
        odd.append(
            f"slots of the disc are {100 * found.repeated:.2g} % of the pitch out of place: edge by edge that shows as "
            "fluctuation of speed, the harmonics hold it down; --pitch takes a calibration"
        )
    return odd


def off_nominal(found: Turn, nominal: float | None) -> list[str]:
    """That the mean speed is far from the ``nominal`` one [rad/s], to which the fluctuation is related."""
    times = 1.0 if nominal is None else found.mean.value / nominal
    if nominal is None or 1.0 / FAR_FROM_NOMINAL <= times <= FAR_FROM_NOMINAL:
        return []
    return [
        f"the mean speed of {found.mean.value / RPM:.4g} rpm is {times:.3g} times the nominal {nominal / RPM:.4g} rpm: "
        "is that the crank's, not the motor's? the fluctuation is related to it; see --nominal, --ratio, --pulses"
    ]


def _interval(estimate: Estimate, unit: float) -> dict[str, float]:
    return {"value": estimate.value / unit, "low": estimate.low / unit, "high": estimate.high / unit}
