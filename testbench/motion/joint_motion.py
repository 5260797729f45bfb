"""The motion of a mechanism's joints from the encoders of a stored run, by its loops."""

from typing import TYPE_CHECKING

import numpy as np

from balance.closure import Closure, Trajectory
from balance.loading.loading import load_mechanism
from balance.mechanism import Mechanism
from balance.motion import Samples

from ..channels import in_si, instants
from ..errors import AnalysisError
from ..rig.sensors import Encoder
from . import derivatives
from .derivatives import HIGHEST_CUTOFF, Grid, grid_of, on_grid
from .gaps import Gaps

if TYPE_CHECKING:
    from ..rig import Column, Rig
    from ..store import Run


def encoders(rig: "Rig") -> "list[Column]":
    """The channels of all encoders."""
    return [column for name, sensor in rig.of_kind(Encoder).items() for column in sensor.columns(name)]


def group_of_encoders(run: "Run", rig: "Rig") -> str:
    """The group that holds all encoders of a run. Raises AnalysisError if there is none, or they are on several."""
    columns = encoders(rig)
    if not columns:
        raise AnalysisError(f"{run.name}: its rig has no encoder: nothing says how the mechanism moved")
    groups = {run.find(column.channel)[0].name for column in columns}
    if len(groups) > 1:
        raise AnalysisError(
            f"{run.name}: its encoders are on several loggers, {', '.join(sorted(groups))}: expected one"
        )
    return groups.pop()


def encoder_gaps(run: "Run", rig: "Rig") -> Gaps:
    """Where the record of the encoders has gaps, on its clock."""
    return Gaps.of({group_of_encoders(run, rig): instants(run, encoders(rig)[0])})


def followed(
    run: "Run", rig: "Rig", mechanism: Mechanism, bandwidth_hz: float, bridged: bool = False
) -> tuple[Grid, Trajectory]:
    """The trajectory on an even grid of the encoders' clock; positions smoothed below ``bandwidth_hz``.

    Gaps are refused, or ``bridged`` by straight lines for those who leave them out; what is between is smoothed apart.
    Raises AnalysisError where an encoder is missing or on another clock, ClosureError where the loops do not close.
    """
    group_of_encoders(run, rig)
    columns = encoders(rig)
    grid = grid_of(instants(run, columns[0]), f"{run.name}: encoders", bridged)
    if bandwidth_hz > HIGHEST_CUTOFF * grid.rate:
        raise AnalysisError(
            f"{run.name}: encoders at {grid.rate:.4g} samples per second do not show {bandwidth_hz:g} Hz: expected at "
            f"most {HIGHEST_CUTOFF * grid.rate:.4g} Hz; ask for a lower --cutoff, or --bandwidth"
        )
    position = np.column_stack([in_si(run, column)[0] for column in columns])
    time = instants(run, columns[0])
    if bridged:
        time, position = derivatives.bridged(time, position, grid.step)
    moved = encoder_gaps(run, rig).rates(on_grid(time, position, grid), bandwidth_hz, grid)
    samples = Samples(grid.time, moved.q, moved.v, moved.a, tuple(column.component for column in columns))
    return grid, Closure(mechanism).follow(samples)


def loaded(run: "Run", mechanism: Mechanism) -> Mechanism:
    """The mechanism with the payload and counter-masses that the sheet of conditions gives for a run."""
    conditions = run.conditions
    if "payload_kg" in conditions:
        if len(mechanism.payload_bodies) != 1:
            raise AnalysisError(
                f"{run.name}: its payload is {conditions['payload_kg']:g} kg, but {mechanism.name} names "
                f"{len(mechanism.payload_bodies)} payload bodies: expected one"
            )
        mechanism = mechanism.with_payload({mechanism.payload_bodies[0]: conditions["payload_kg"]})
    return mechanism.with_counter_mass(conditions.get("counter_masses", {}))


def mechanism_of(run: "Run", rig: "Rig", given: str | None) -> Mechanism:
    """The mechanism that a person names, else the shipped one that the stored rig names: a stored run opens no file."""
    from balance import datasets

    if given is None and rig.mechanism not in datasets.names("mechanisms", ".xml"):
        raise AnalysisError(
            f"{run.name}: its rig is for {rig.mechanism!r}, which is not shipped: give its file, --mechanism FILE"
        )
    return load_mechanism(given or datasets.ROOT / "mechanisms" / f"{rig.mechanism}.xml")
