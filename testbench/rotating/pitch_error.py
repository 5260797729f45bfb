"""Errors of the disc: slots that are not where they should be."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from balance.arrays import Floats
from balance.errors import DataError
from balance.estimation.estimate import coverage_factor

from ..errors import AnalysisError
from .encoder_edges import Edges
from .speed_fit import SteadySpeedFit, periodic_turn

COLUMNS = ("slot", "ahead_deg")
_ROUNDS = 8


@dataclass(frozen=True)
class Pitch:
    """Errors of a disc, slot 0 being that of the first edge."""

    ahead: Floats
    """Angle by which each slot comes ahead of its even place, mean zero, (pulses,) [rad of the encoder's shaft]."""
    error: Floats
    """Half width of the 95 % interval of each, (pulses,) [rad]."""

    @property
    def rms(self) -> float:
        """Root mean square of the errors, in shares of the pitch."""
        return float(np.sqrt(np.mean(self.ahead**2)) * len(self.ahead) / (2.0 * np.pi))


def of_free_run(edges: Edges) -> Pitch:
    """Errors of the disc from a log of its shaft turning freely, at nearly constant speed.

    Each instant is held against the mean of the turn of the disc about it, in which its errors cancel. A fluctuation
    that repeats every turn of this shaft cannot be told from an error: the shaft must be free of the mechanism.
    """
    pulses = edges.disc.pulses
    if edges.gaps:
        raise AnalysisError(f"{edges.name}: edges are lost: calibrate with a log that has all")
    if len(edges.time) < 3 * pulses:
        raise AnalysisError(f"{edges.name}: {len(edges.time) / pulses:.1f} turns of the disc; expected 3 or more")
    window = np.full(pulses + 1, 1.0 / pulses)
    window[[0, -1]] = 0.5 / pulses
    if pulses % 2:
        window = np.full(pulses, 1.0 / pulses)
    half = len(window) // 2
    middle = slice(half, len(edges.time) - half)
    late = edges.time[middle] - np.convolve(edges.time, window, "valid")
    rate = 2.0 * np.pi / np.gradient(np.convolve(edges.time, window, "valid")) / pulses
    return _by_slot(rate * late, edges.pulse[middle] % pulses, pulses)


def of_record(edges: Edges, harmonics: int | None = None, steady_within: float = 1e-3) -> tuple[Pitch, SteadySpeedFit]:
    """Errors of a disc that turns with another period than the crank, and the steady turn freed of them.

    Turn and errors are estimated in turn until they agree. Raises AnalysisError where both have one period.
    """
    disc = edges.disc
    if not disc.pitch_is_apart:
        raise AnalysisError(
            f"{edges.name}: the disc turns {disc.ratio:g} times a turn of the crank: its errors repeat with the "
            "fluctuation and cannot be told from it; calibrate it with a log of a free run"
        )
    turn = periodic_turn(edges, harmonics, steady_within)
    ahead = np.zeros(disc.pulses)
    for _ in range(_ROUNDS):
        slot = turn.edges.pulse % disc.pulses
        rate = disc.ratio / turn.slope(turn.edges.angle)
        change = _by_slot(rate * turn.residual, slot, disc.pulses)
        ahead = ahead + change.ahead
        turn = periodic_turn(replace(edges, offset=ahead), turn.harmonics, steady_within)
    return Pitch(ahead, change.error), periodic_turn(replace(edges, offset=ahead), harmonics, steady_within)


def _by_slot(late: Floats, slot: "np.ndarray[Any, np.dtype[np.signedinteger[Any]]]", pulses: int) -> Pitch:
    """Mean of angles [rad] by slot, a slot that comes late lying ahead; its interval from their scatter."""
    have = np.bincount(slot, minlength=pulses)
    if (have == 0).any():
        raise AnalysisError(f"slot {int(np.argmin(have))} of the disc does not appear in the log")
    mean = np.bincount(slot, late, pulses) / have
    spread = late - mean[slot]
    spare = max(len(late) - pulses, 1)
    error = coverage_factor(spare) * np.sqrt((spread**2).sum() / spare / have)
    return Pitch(mean - mean.mean(), error)


def write_pitch_errors(pitch: Pitch, path: Path) -> None:
    """Write the errors of a disc as CSV."""
    rows = [f"{k},{np.degrees(angle):.9g}" for k, angle in enumerate(pitch.ahead)]
    path.write_text("\n".join([",".join(COLUMNS), *rows, ""]), encoding="utf-8")


def read_pitch_errors(path: Path, pulses: int) -> Floats:
    """Read the errors of a disc with so many slots, (pulses,) [rad]. Raises DataError for another table."""
    import csv

    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = list(csv.DictReader(file, strict=True))
        slots, ahead = [int(row["slot"]) for row in rows], [float(row["ahead_deg"]) for row in rows]
    except (csv.Error, UnicodeDecodeError, KeyError, ValueError, TypeError) as error:
        raise DataError(f"{path.name}: expected the columns {','.join(COLUMNS)} of numbers") from error
    if slots != list(range(pulses)) or not np.isfinite(ahead).all():
        raise DataError(f"{path.name}: {len(slots)} slots; expected slots 0 to {pulses - 1} in order, finite angles")
    return np.radians(ahead)
