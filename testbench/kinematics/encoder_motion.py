"""Trajectory of a mechanism's joints from the encoders of a run: positions smoothed, loops closed at each sample."""

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np

from balance.arrays import Floats
from balance.closure import Closure, Trajectory
from balance.errors import ModelError
from balance.mechanism.forward_kinematics import poses
from balance.mechanism.mechanism import Mechanism
from balance.mechanism.mjcf_parser import load_mechanism, mechanism_from_text
from balance.motion import Samples

from ..errors import AnalysisError
from ..rig.rig import NONE
from ..rig.sensors import Encoder
from ..runs.si_run import SIRun
from . import smoothing_and_derivatives
from .gaps import Gaps
from .smoothing_and_derivatives import ALMOST, HIGHEST_CUTOFF, Grid, grid_of, on_grid

MOVING_DEVIATIONS = 8.0
"""Robust standard deviations by which a moving signal leaves its level at rest."""
CLEAR_DEVIATIONS = 30.0
"""Robust standard deviations by which a signal leaves its level where it shows that it rested before."""
_SIGMA_PER_MAD = 1.4826


def moving_interval(values: Floats, rate_hz: float, margin_s: float = 0.05) -> slice:
    """Samples of a signal (n,) [any unit] from its first to its last movement, with a margin; all if it never moves.

    Level and scatter at rest are those of the first and the last twentieth of the record.
    """
    edge = max(len(values) // 20, 1)
    resting = np.concatenate([values[:edge], values[-edge:]])
    level = float(np.median(resting))
    scatter = _SIGMA_PER_MAD * float(np.median(np.abs(resting - level)))
    away = np.abs(values - level)
    moved = np.flatnonzero(away > MOVING_DEVIATIONS * scatter + 1e-3 * float(away.max(initial=0.0)))
    if not moved.size:
        return slice(0, len(values))
    margin = round(margin_s * rate_hz)
    return slice(max(int(moved[0]) - margin, 0), min(int(moved[-1]) + margin + 1, len(values)))


def rest_before(signals: Sequence[Floats], rate_hz: float, margin_s: float = 0.02) -> slice | None:
    """Samples before the first movement in any signal, (n,) each [any unit], of one clock; None if not determined.

    Level and scatter at rest are those of the first twentieth. A record that starts in motion scatters there as it does
    later: at least one signal must move clearly after the rest.
    """
    onsets, shown = [], False
    for values in signals:
        edge = values[: max(len(values) // 20, 1)]
        level = float(np.median(edge))
        away = np.abs(values - level)
        scatter, largest = _SIGMA_PER_MAD * float(np.median(away[: len(edge)])), float(away.max(initial=0.0))
        moved = np.flatnonzero(away > MOVING_DEVIATIONS * scatter + 1e-3 * largest)
        onsets += [int(moved[0])] if moved.size else []
        shown |= largest > CLEAR_DEVIATIONS * scatter
    end = min(onsets, default=0) - round(margin_s * rate_hz)
    return slice(0, end) if shown and end > 0 else None


def group_of_encoders(run: SIRun) -> str:
    """The group that holds all encoders of a run. Raises AnalysisError if there is none, or they are on several."""
    columns = run.rig.columns_of(Encoder)
    if not columns:
        raise AnalysisError(f"{run.name}: its rig has no encoder: nothing says how the mechanism moved")
    groups = run.groups_of(columns)
    if len(groups) > 1:
        raise AnalysisError(f"{run.name}: its encoders are on several loggers, {', '.join(groups)}: expected one")
    return groups[0]


def encoder_gaps(run: SIRun) -> Gaps:
    """Gaps in the encoders' record, on its clock."""
    return Gaps.of({group_of_encoders(run): run.instants(run.rig.columns_of(Encoder)[0])})


def encoder_trajectory(
    run: SIRun, mechanism: Mechanism, bandwidth_hz: float, bridged: bool = True
) -> tuple[Grid, Trajectory]:
    """The trajectory on an even grid of the encoders' clock; positions smoothed below ``bandwidth_hz``.

    Gaps are ``bridged`` by straight lines, which the caller masks, or refused; segments between them are smoothed one
    by one. Raises AnalysisError where an encoder is missing or on another clock, ClosureError where the loops do not
    close.
    """
    gaps, columns = encoder_gaps(run), run.rig.columns_of(Encoder)
    time = run.instants(columns[0])
    grid = grid_of(time, f"{run.name}: encoders", bridged)
    if ALMOST * bandwidth_hz > HIGHEST_CUTOFF * grid.rate:
        raise AnalysisError(
            f"{run.name}: encoders at {grid.rate:.4g} samples per second do not show {bandwidth_hz:g} Hz: expected at "
            f"most {HIGHEST_CUTOFF * grid.rate:.4g} Hz; ask for a lower --cutoff, or --bandwidth"
        )
    position = run.stacked(columns)
    if bridged:
        time, position = smoothing_and_derivatives.bridge_gaps(time, position, grid.step)
    moved = gaps.derivatives(on_grid(time, position, grid), bandwidth_hz, grid)
    samples = Samples(grid.time, moved.q, moved.v, moved.a, tuple(column.component for column in columns))
    return grid, Closure(mechanism).follow(samples)


def point_path(mechanism: Mechanism, path: Trajectory, body: int, position: Floats) -> Floats:
    """Path of a body's point, ``position`` (3,) [m] in the frame of the body of this index; base axes, (n, 3) [m]."""
    return poses(mechanism.tree, path.q).point(mechanism.tree.bodies[body], position)


def loaded_mechanism(run: SIRun, mechanism: Mechanism) -> Mechanism:
    """The mechanism with the payload and counter-masses that the run table states for a run.

    Raises AnalysisError where the mechanism has no place for one of them.
    """
    stated = run.conditions
    try:
        carrying = mechanism.with_payload(stated.get("payloads", {}), stated.get("payload_kg"))
        return carrying.with_counter_mass(stated.get("counter_masses", {}))
    except ModelError as error:
        raise AnalysisError(
            f"{run.name}: {error}; a corrected mechanism file takes the place of the stored one"
        ) from error


def mechanism_of(run: SIRun, given: str | None) -> Mechanism:
    """The mechanism ``given`` by the user, else the one stored with the run, else the shipped one that its rig names.

    Raises AnalysisError where there is none.
    """
    from balance import datasets

    named, stored = run.rig.mechanism, run.recorded.inputs.get("mechanism")
    if given is None and stored is not None:
        return stored_mechanism(*stored)
    if given is None and named == NONE:
        raise AnalysisError(
            f"{run.name}: its rig says mechanism = 'none': nothing can be simulated but with --mechanism FILE"
        )
    if given is None and named not in datasets.dataset_names("mechanisms", ".xml"):
        raise AnalysisError(
            f"{run.name}: its rig is for {named!r}, which was not stored with it: give it by MECH or --mechanism FILE"
        )
    return load_mechanism(given or datasets.ROOT / "mechanisms" / f"{named}.xml")


@lru_cache(maxsize=8)
def stored_mechanism(file: str, text: str) -> Mechanism:
    """A mechanism from its stored text; the runs of a campaign share it."""
    return mechanism_from_text(text, Path(file).stem)
