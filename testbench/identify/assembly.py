"""Records of several runs of one mechanism: which sensors count, what was mounted, whether the rig is of this machine.

What is identified is the mechanism as mounted in the first run. What other runs mounted beyond it, payload and
counter-masses of their conditions, is known and taken off.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from balance.mechanism import Mechanism

from ..errors import AnalysisError
from ..rig.sensors import Torque
from ..runs.aligned_run import AlignedRun
from .loads import loads_of
from .record import JointRecord, joint_record

By = Literal["torque", "wrench", "both"]
DIFFERS = "mechanism_differs"
"""The finding that a person may accept: the rig is of another mechanism."""


@dataclass(frozen=True)
class Assembled:
    """What an identification starts from."""

    mechanism: Mechanism
    """As mounted in the first run."""
    records: tuple[JointRecord, ...]
    by: By
    notes: tuple[str, ...] = ()
    """What was left out, and why."""


def assemble(runs: Sequence[AlignedRun], by: By | None = None, accept: Sequence[str] = ()) -> Assembled:
    """Records of runs of a mechanism, as it was mounted in the first of them.

    ``by`` torque where the drives' torques are measured, else by wrench, unless named. Raises AnalysisError where a rig
    is of another mechanism, unless that is accepted, and where sensors lack.
    """
    for run in runs:
        if DIFFERS not in accept:
            refuse_other_mechanism(run)
    chosen = by or ("torque" if runs[0].rig.of_kind(Torque) else "wrench")
    first = runs[0].mechanism
    records, notes = [], []
    for run in runs:
        record = joint_record(run, torque=chosen != "wrench")
        if chosen != "torque":
            loads, missing = loads_of(run)
            record = replace(record, loads=loads, gaps=loads.gaps)
            notes += [note for note in missing if note not in notes]
        beyond = run.mechanism.pi - first.pi
        records.append(replace(record, mounted=beyond) if np.any(beyond) else record)
    _refuse_unlike(records)
    return Assembled(first, tuple(records), chosen, tuple(notes))


def refuse_other_mechanism(run: AlignedRun) -> None:
    """Raise AnalysisError where a run's rig says that it was another mechanism."""
    if Path(run.rig.mechanism).stem != run.unloaded.name:
        raise AnalysisError(
            f"{run.name}: mechanism: its rig is of {run.rig.mechanism!r}, expected {run.unloaded.name!r}: give the "
            f"mechanism that was on the bench, or --accept {DIFFERS} if it is the same machine by another name"
        )


def _refuse_unlike(records: Sequence[JointRecord]) -> None:
    names = {() if record.loads is None else record.loads.names for record in records}
    if len(names) > 1:
        listed = "; ".join(f"{r.name}: {', '.join(r.loads.names)}" for r in records if r.loads is not None)
        raise AnalysisError(f"runs whose force sensors determine different components: {listed}: identify them apart")
