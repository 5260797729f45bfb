"""Parameters of a mechanism from the positions and torques of runs."""

from collections.abc import Sequence

from balance.identification import Identified, solve
from balance.mechanism import Mechanism
from balance.observability import Observability, observe

from .. import rig as rigs
from ..recording import Origin
from ..store import Run
from .choice import choose, possible_cutoffs
from .evidence import Evidence, gather
from .evidence import one_sided as one_sided_evidence
from .record import JointRecord, joint_record
from .result import CounterMassValue, Identification, Value

__all__ = ["CounterMassValue", "Identification", "JointRecord", "Value", "identify", "identify_run", "joint_record"]

STRETCH_PERIODS = 1.0
"""Length of the stretches that are left out in turn for an interval, in periods of the cut-off: beyond half a period
what a low-pass leaves of white noise is no longer correlated."""


def identify_run(run: Run, mechanism: Mechanism, rig: "rigs.Rig | None" = None) -> Identification:
    """Identify a mechanism from one stored run; the rig is the one stored with it unless given."""
    return identify([joint_record(run, mechanism, rig)], mechanism)


def identify(records: Sequence[JointRecord], mechanism: Mechanism) -> Identification:
    """Identify a mechanism from records of its driven joints.

    What is observable is found first, then the cut-off and the delay by held-out torque error, then the parameters; at
    half and at double that cut-off, and without delay, once more.
    """
    possible = possible_cutoffs(records)
    middle = gather(records, mechanism, possible[len(possible) // 2])
    choice = choose(records, mechanism, observe(middle.columns, middle.names))
    chosen, evidence = choice.chosen, choice.evidence
    observability = observe(evidence.columns, evidence.names)
    variants = {
        f"{label} ({factor * chosen.cutoff:.3g} Hz)": _solved(
            gather(records, mechanism, factor * chosen.cutoff), observability, chosen.delay
        )
        for label, factor in (("half cut-off", 0.5), ("double cut-off", 2.0))
    }
    if chosen.delay:
        variants["no delay"] = _solved(evidence, observability, 0.0)
    one_sided = {
        f"{factor * chosen.cutoff:.3g} Hz": _one_sided(records, mechanism, observability, factor * chosen.cutoff)
        for factor in (1.0, 2.0**0.5, 2.0)
    }
    return Identification(
        mechanism,
        tuple(record.name for record in records),
        _origin(records),
        choice,
        _solved(evidence, observability, chosen.delay),
        variants,
        one_sided,
    )


def _solved(evidence: Evidence, observability: Observability, delay: float) -> Identified:
    columns = evidence.low_passed_columns(range(len(evidence.names)))
    blocks = evidence.stretches(STRETCH_PERIODS / evidence.cutoff)
    return solve(columns, evidence.low_passed_torque(delay), observability, blocks, evidence.moving)


def _one_sided(
    records: Sequence[JointRecord], mechanism: Mechanism, observability: Observability, cutoff: float
) -> Identified:
    evidence = one_sided_evidence(records, mechanism, cutoff)
    blocks = evidence.stretches(STRETCH_PERIODS / cutoff)
    return solve(evidence.columns, evidence.low_passed_torque(0.0), observability, blocks, evidence.moving)


def _origin(records: Sequence[JointRecord]) -> Origin:
    """Measured only if every record is; simulated if any is."""
    origins = {record.origin for record in records}
    if len(origins) == 1:
        return origins.pop()
    return "simulated" if "simulated" in origins else "unstated"
