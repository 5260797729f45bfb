"""Parts of a report: base vibration, modes from the decay after the motion, response, wrench, torques of the drives.

The response is the acceleration of the base coherent with the shaking force (H1). In one motion force and moment come
together, and a run is too short to separate them line by line, so each line names the other components that explain
more of the acceleration than the force does. Where there are some, their effect is in the gain, which is then no
property of the base.
"""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from balance.arrays import Floats
from balance.errors import CounterpoiseError
from balance.estimation.estimate import LEVEL_TEXT, coverage_factor

from ..errors import AnalysisError
from ..signal.filters import Band
from ..signal.free_decay_modes import free_decay_modes
from ..signal.frequency_response import response_of
from ..signal.welch import Spectra, welch
from ..synchronization.known_clocks import on_clock_of
from ..vibration.metrics import METRICS

if TYPE_CHECKING:
    from ..kinematics.motion_recognition import RecognizedMotion, Source
    from ..loads.command_tracking import CommandPerformance
    from ..loads.shaking_wrench import MeasuredWrench
    from ..rig import Column
    from ..runs.aligned_run import AlignedRun
    from ..runs.si_run import SIRun

Part = dict[str, Any]
HIGHEST_HZ = 100.0
"""Highest frequency of modes that are searched: a base on its mounts, and what a motion excites [Hz]."""
ENCODERS_HZ = 80.0
"""Bandwidth of the encoders that tell when the mechanism moves [Hz]."""
SETTLED_S = 0.02
"""Time after the motion from which the base decays freely: the zero-phase band smears as far [s]."""
SEGMENT_S = 0.25
"""Segments of the response: several in a motion of a second, 4 Hz apart [s]."""
PROMINENCE = 3.0
"""Least standard deviation of a component over that in the quietest twentieth of the record [-]."""
LEAST_GAP_S = 1e-6
"""Time missing from a record, beyond rounding [s]."""


def attempt_part(work: Callable[[], Part]) -> Part:
    """The part, or ``{"reason": ...}`` where the run lacks what it needs."""
    try:
        return work()
    except CounterpoiseError as error:
        return {"reason": str(error)}


def base_columns(run: "SIRun") -> "list[Column]":
    """The channels of the accelerometers on the base. Raises AnalysisError if there is none."""
    columns = run.rig.base_columns
    if not columns:
        raise AnalysisError(f"{run.name}: its rig has no accelerometer on the base (attached_to)")
    return columns


def base_modes(run: "SIRun", moved: tuple[float, float]) -> Part:
    """Modes from the decay after the motion, ``moved`` its start and end on the base accelerometers' clock [s]."""
    start, end = moved
    columns = base_columns(run)
    group = run.group_of(columns[0])
    columns = [c for c in columns if run.group_of(c) == group]
    time, rate = run.even_instants(columns[0]), run.rate(columns[0])
    band = Band(0.0, min(HIGHEST_HZ, 0.2 * rate))
    values = band.filtered(np.array([run.signal(column)[0] for column in columns]), rate).T
    after = time > end + SETTLED_S
    found = free_decay_modes(values[after], rate, band.high_hz, ambient=values[time < start - SETTLED_S])
    return {
        "modes": [
            {"amplitudes_m_s2" if name == "amplitudes" else name: value for name, value in mode.as_dict().items()}
            for mode in found
        ],
        "channels": [c.channel for c in columns],
        "from_s": end + SETTLED_S,
        "to_s": float(time[-1]),
        "group": group,
        "band_hz": band.limits(),
        "definition": "free decay after the motion as damped sines that all channels share; intervals of "
        f"{LEVEL_TEXT}, with the vibration of the base before the motion",
    }


def motion_on_base_clock(
    run: "SIRun",
    found: "Mapping[Source, list[RecognizedMotion]]",
    shown: "CommandPerformance | None",
    aligned: "Callable[[], AlignedRun]",
) -> tuple[float, float]:
    """Start of the first and end of the last motion on the clock of the base's accelerometers [s].

    By what recognizes motions on that clock, else by the encoders on one that a recorded alignment or a trigger relates
    to it, as wide as that is sure. Raises AnalysisError, saying why, where neither tells.
    """
    group = run.group_of(base_columns(run)[0])
    for motions in found.values():
        if motions and motions[-1].group == group and motions[-1].source != "acceleration":
            return motions[0].start, motions[-1].end
    if shown is not None and shown.group == group and found.get("command"):
        shift = shown.lag_s + shown.first - float(shown.time[0])
        return found["command"][0].start + shift, found["command"][-1].end + shift
    if (measured := found.get("acceleration")) and measured[-1].group == group:
        return measured[0].start, measured[-1].end
    unknown = (
        f"{run.name}: when the motion ends, on the clock of the base's accelerometers, {group}, is unknown, and so "
    )
    unknown += "is the free decay of the base"
    try:
        encoders = aligned()
        moves = encoders.grid.time[encoders.motion_span(ENCODERS_HZ, 0.0)][[0, -1]]
        related, why = on_clock_of(run, moves, encoders.reference, group)
    except CounterpoiseError as error:
        raise AnalysisError(f"{unknown}: the encoders do not tell: {error}") from error
    if related is None:
        told = f" (that which it names does not relate them: {why})" if why else ""
        raise AnalysisError(
            f"{unknown}: the encoders are on that of {encoders.reference}, which nothing relates to it: testbench "
            f"align {run.path.parent}, or a trigger of both in the rig{told}"
        )
    (start, end), half = related
    return float(start) - half, float(end) + half


def base_response(run: "SIRun", wrench: "MeasuredWrench", highest_hz: float = HIGHEST_HZ) -> Part:
    """Acceleration of the base along each axis per shaking force along it, where the coherence is significant."""
    # The components that are determined throughout and exceed their noise, (n,) [N, N m].
    forces = {}
    for name, values in wrench.values.items():
        if values is not None and not np.isnan(values).any():
            part = max(len(values) // 20, 1)
            quiet = values[: len(values) // part * part].reshape(-1, part).std(axis=1).min()
            if values.std() > PROMINENCE * quiet:
                forces[name] = values
    columns = [column for column in base_columns(run) if f"F{column.component}" in forces]
    rows: list[Part] = []
    if columns:
        answers = [_at_force_instants(run, wrench, column) for column in columns]
        segment = 2 * round(0.5 * SEGMENT_S * wrench.rate)
        found = welch([*forces.values(), *answers], wrench.rate, segment, highest_hz)
        for place, column in enumerate(columns, len(forces)):
            rows += _rows(column, list(forces), found, place)
    return {
        "rows": rows,
        "definition": "acceleration of the base per shaking force along the same axis (H1), where coherence is over "
        f"what 95 of 100 records of noise show; segments of {SEGMENT_S:g} s smear narrower resonances; what follows "
        "the components named in also_follows is in the gain, moments about the point",
        "point_m": list(wrench.point),
        "of_the_force_alone": not any(row["also_follows"] for row in rows),
    }


def _rows(column: "Column", forces: list[str], spectra: Spectra, place: int) -> list[Part]:
    """The lines of one channel, which follows the forces in the spectra at its place."""
    along = forces.index(f"F{column.component}")
    found = response_of(spectra, [along], place)
    others = {  # lines in which a component explains the acceleration beyond the force
        name: response_of(spectra, [along, other], place).significant[1]
        for other, name in enumerate(forces)
        if other != along
    }
    rows = []
    for i in map(int, np.flatnonzero(found.significant[0] & (found.frequency > 0.0))):
        gain, share = float(np.abs(found.response[0, i])), coverage_factor() * float(found.relative_deviation[0, i])
        rows.append({
            "sensor": column.sensor, "axis": column.component, "frequency_hz": float(found.frequency[i]),
            "gain_1_kg": gain, "gain_interval_1_kg": [gain * max(1.0 - share, 0.0), gain * (1.0 + share)],
            "phase_rad": float(np.angle(found.response[0, i])), "coherence": float(found.coherence[0, i]),
            "also_follows": [name for name, more in others.items() if more[i]],
        })  # fmt: skip
    return rows


def _at_force_instants(run: "SIRun", wrench: "MeasuredWrench", column: "Column") -> Floats:
    """A channel at the instants of the forces, (n,) [SI]. Raises AnalysisError for clocks that are not aligned."""
    group, time = run.group_of(column), run.even_instants(column)
    related, why = on_clock_of(run, wrench.time, wrench.group, group)
    if related is None:
        told = f" (the trigger that the rig names does not relate them: {why})" if why else ""
        raise AnalysisError(
            f"{run.name}: the clocks of {group} and {wrench.group} are not aligned: testbench align "
            f"{run.path.parent} first"
            f"{told}"
        )
    return np.interp(related[0], time, run.signal(column)[0])


def wrench_part(wrench: "MeasuredWrench", band: Band | None) -> Part:
    """Every metric of every component; null with a reason where the sensors do not determine it."""
    components: dict[str, dict[str, float] | None] = dict.fromkeys(wrench.values)
    reasons = dict(wrench.reasons)
    for name, spans in wrench.clipped.items():
        where = ", ".join(f"{a:.4f}..{b:.4f} s" for a, b in spans[:5]) + (" ..." if len(spans) > 5 else "")
        reasons[name] = f"a sensor that it needs is at the end of its range in {where}"
    known = {name: v - v.mean() for name, v in wrench.values.items() if v is not None and name not in wrench.clipped}
    if known and band:
        known = dict(zip(known, band.filtered(np.array(list(known.values())), wrench.rate, in_place=True), strict=True))
    for name, shape in known.items():
        unit = "N" if name[0] == "F" else "Nm"
        components[name] = {f"{metric}_{unit}": measure(shape) for metric, (_, measure) in METRICS.items()}
    return {
        "point_m": list(wrench.point),
        "components": components,
        "reasons": reasons,
        "clipped_s": {name: [list(ends) for ends in spans] for name, spans in wrench.clipped.items()},
        "tare": wrench.tare,
        "band_hz": band.limits() if band else None,
        "definition": "wrench of the mechanism on the base, base axes, moments about the point; mean removed, "
        f"band {band or 'not limited'}",
        "group": wrench.group,
    }


def torque_changes(balanced: list[Part], unbalanced: list[Part]) -> list[Part]:
    """RMS torques with and without counter-masses, measured and by the model, means of repeats.

    From the parts ``torque`` of reports; without drives that are not in all of them, and without runs with a gap, whose
    RMS is over another span.
    """
    drives_of = [[part.get("drives", []) for part in some] for some in (balanced, unbalanced)]
    sides = [
        [{d["joint"]: d for d in part} for part in some if all(d["left_out_s"] <= LEAST_GAP_S for d in part)]
        for some in drives_of
    ]
    if not all(sides):
        return []
    joints = [j for j in sides[0][0] if all(j in drives for some in sides for drives in some)]
    rows = []
    for joint in joints:
        row: Part = {"joint": joint}
        unit = "Nm" if "measured_rms_Nm" in sides[0][0][joint] else "N"
        for kind in ("measured", "model"):
            means = [float(np.mean([drives[joint][f"{kind}_rms_{unit}"] for drives in some])) for some in sides]
            row |= {f"{kind}_rms_{unit}": {"with": means[0], "without": means[1]},
                    f"{kind}_times": means[0] / means[1] if means[1] > 0.0 else None}  # fmt: skip
        rows.append(row)
    return rows
