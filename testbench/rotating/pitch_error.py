"""Errors of an encoder disc: slots that are not at their even places.

They are estimated from a free run of the disc at nearly constant speed, or together with the steady turn where the disc
has another period than the crank.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from balance.arrays import Floats
from balance.errors import DataError
from balance.estimation.estimate import coverage_factor
from balance.results import Key, per_cent

from ..errors import AnalysisError
from .encoder_edges import Edges
from .speed_fit import STEADY, SteadySpeedFit, periodic_turn

COLUMNS = ("slot", "ahead_deg")
_ROUNDS = 8
"""Alternating estimates of the turn and the errors."""


@dataclass(frozen=True)
class PitchErrors:
    """Errors of a disc, slot 0 being that of the first edge."""

    ahead: Annotated[Floats, Key("ahead_deg", to=np.degrees)]
    """Angle by which each slot is ahead of its even place, mean zero, (pulses,) [rad of the encoder's shaft]."""
    error: Annotated[Floats, Key("half_width_deg", to=np.degrees)]
    """Half width of the 95 % interval of each, (pulses,) [rad]."""

    @property
    def rms(self) -> Annotated[float, Key("rms_percent_of_pitch", to=per_cent)]:
        """Root mean square of the errors over the pitch [-]."""
        return float(np.sqrt(np.mean(self.ahead**2)) * len(self.ahead) / (2.0 * np.pi))


def pitch_from_free_run(edges: Edges) -> PitchErrors:
    """Errors of the disc from a log of its shaft turning freely, at nearly constant speed.

    Each instant is compared with the mean of the turn of the disc about it, over which the errors cancel. A fluctuation
    that repeats every turn of this shaft would count as an error: the shaft must be uncoupled from the mechanism.
    Raises AnalysisError for lost edges or fewer than three turns.
    """
    pulses = edges.disc.pulses
    if edges.gaps:
        raise AnalysisError(f"{edges.name}: edges are lost: calibrate with a complete log")
    if len(edges.time) < 3 * pulses:
        raise AnalysisError(
            f"{edges.name}: {len(edges.time) / pulses:.1f} turns of the disc: expected 3 or more; take a longer log"
        )
    window = np.full(pulses + 1, 1.0 / pulses)
    window[[0, -1]] = 0.5 / pulses
    if pulses % 2:
        window = np.full(pulses, 1.0 / pulses)
    half = len(window) // 2
    middle = slice(half, len(edges.time) - half)
    late = edges.time[middle] - np.convolve(edges.time, window, "valid")
    rate = 2.0 * np.pi / np.gradient(np.convolve(edges.time, window, "valid")) / pulses
    return _by_slot(rate * late, edges.pulse[middle] % pulses, pulses)


def pitch_from_record(
    edges: Edges, harmonics: int | None = None, steady_within: float = STEADY
) -> tuple[PitchErrors, SteadySpeedFit]:
    """Errors of a disc that has another period than the crank, and the steady turn corrected for them.

    Both are estimated alternately. Raises AnalysisError where both have one period.
    """
    disc = edges.disc
    if not disc.pitch_is_separable:
        raise AnalysisError(
            f"{edges.name}: the disc turns {disc.ratio:g} times a turn of the crank: its errors repeat with the "
            "fluctuation and cannot be separated from it; calibrate the disc with a log of a free run (--calibrate)"
        )
    turn = periodic_turn(edges, harmonics, steady_within)
    ahead = np.zeros(disc.pulses)
    for _ in range(_ROUNDS):
        slot = turn.edges.pulse % disc.pulses
        rate = disc.ratio / turn.slope(turn.edges.angle)
        change = _by_slot(rate * turn.residual, slot, disc.pulses)
        ahead = ahead + change.ahead
        turn = periodic_turn(replace(edges, offset=ahead), turn.harmonics, steady_within)
    return PitchErrors(ahead, change.error), periodic_turn(replace(edges, offset=ahead), harmonics, steady_within)


def _by_slot(late: Floats, slot: "np.ndarray[Any, np.dtype[np.signedinteger[Any]]]", pulses: int) -> PitchErrors:
    """Mean of angles (n,) [rad] by slot, a late slot being ahead, and its interval from their scatter."""
    have = np.bincount(slot, minlength=pulses)
    if (have == 0).any():
        raise AnalysisError(f"slot {int(np.argmin(have))} of the disc does not appear in the log")
    mean = np.bincount(slot, late, pulses) / have
    spread = late - mean[slot]
    degrees_of_freedom = max(len(late) - pulses, 1)
    error = coverage_factor(degrees_of_freedom) * np.sqrt((spread**2).sum() / degrees_of_freedom / have)
    return PitchErrors(mean - mean.mean(), error)


def write_pitch_errors(pitch: PitchErrors, path: Path) -> None:
    """Write the errors of a disc as CSV, in the columns COLUMNS."""
    rows = [f"{k},{np.degrees(angle):.9g}" for k, angle in enumerate(pitch.ahead)]
    path.write_text("\n".join([",".join(COLUMNS), *rows, ""]), encoding="utf-8")


def read_pitch_errors(path: Path, pulses: int) -> Floats:
    """Errors of a disc with ``pulses`` slots from a CSV, (pulses,) [rad]. Raises DataError for another table."""
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
