"""Parameters of a mechanism from the positions, torques and forces of runs."""

from collections.abc import Sequence

from balance.estimation.base_parameters import BaseParameters, base_parameters
from balance.estimation.identifiability import Identifiability, identifiability
from balance.estimation.regression import RegressionRecord
from balance.mechanism.mechanism import Mechanism

from ..recording import Origin
from ..runs.aligned_run import AlignedRun
from .cross_validation import Choice, choose, possible_cutoffs
from .estimators import BLOCK_PERIODS, Method, Methods, allowed
from .records import JointRecord, assemble, joint_record
from .regression_equations import one_sided as one_sided_equations
from .regression_equations import regression_equations
from .result import CounterMassValue, Identification, Value

__all__ = ["CounterMassValue", "Identification", "JointRecord", "Value", "identify", "identify_run", "joint_record"]


def identify_run(run: AlignedRun) -> Identification:
    """Identify a mechanism from one run."""
    assembled = assemble([run])
    return identify(assembled.records, assembled.mechanism)


def identify(
    records: Sequence[JointRecord], mechanism: Mechanism, method: Method | None = None, *, others: bool = True
) -> Identification:
    """Identify a mechanism from records of its driven joints.

    What is observable is found first, then the cut-off and the delay by held-out torque error, then the parameters by
    ``method``; at half and at double that cut-off, without delay, and by the other methods, once more. The method is
    ``iv`` unless named, and ``ls`` where there are forces alone; without ``others`` no interval is
    widened by the other methods, which take long through loops. Raises NotIdentifiable where nothing is observable.
    """
    torques = bool(records[0].torque.shape[1])
    method = method or ("iv" if torques else "ls")
    identifiable = observed(records, mechanism)
    choice = choose(records, mechanism, identifiable, method)
    delay, cutoff = choice.chosen.delay, choice.chosen.cutoff
    at = choice.held_out.at(delay)
    variants = {
        f"{label} ({factor * cutoff:.3g} Hz)": Methods(
            regression_equations(records, mechanism, factor * cutoff), mechanism, identifiable, delay
        ).identified(method)
        for label, factor in (("half cut-off", 0.5), ("double cut-off", 2.0))
    }
    if delay:
        variants["no delay"] = choice.held_out.at(0.0).identified(method)
    variants |= {other: at.identified(other) for other in allowed(choice.evidence) if others and other != method}
    return Identification(
        mechanism,
        tuple(record.name for record in records),
        _origin(records),
        choice,
        at.identified(method),
        variants,
        _one_sided(records, mechanism, identifiable, choice),
    )


def observed(records: Sequence[JointRecord], mechanism: Mechanism) -> Identifiability:
    """What the records determine, before anything is solved. Raises NotIdentifiable where that is nothing."""
    possible = possible_cutoffs(records)
    middle = regression_equations(records, mechanism, possible[len(possible) // 2])
    return identifiability(middle.columns * middle.moving[:, :, None], middle.names)


def _one_sided(
    records: Sequence[JointRecord], mechanism: Mechanism, identifiable: Identifiability, choice: Choice
) -> dict[str, BaseParameters]:
    """As often done: torque and rates smoothed, positions not. Of torques alone: forces do not feel positions so."""
    found = {}
    for factor in (1.0, 2.0**0.5, 2.0):
        cutoff = factor * choice.chosen.cutoff
        evidence = one_sided_equations(records, mechanism, cutoff)
        blocks = evidence.blocks(BLOCK_PERIODS["ls"] / cutoff)
        columns = evidence.columns[:, :, list(identifiable.pivots)]
        record = RegressionRecord.of(columns, evidence.low_passed_torque(0.0), blocks, used=evidence.moving)
        found[f"{cutoff:.3g} Hz"] = base_parameters(record, identifiable)
    return found


def _origin(records: Sequence[JointRecord]) -> Origin:
    """Measured only if every record is; simulated if any is."""
    origins = {record.origin for record in records}
    if len(origins) == 1:
        return origins.pop()
    return "simulated" if "simulated" in origins else "unstated"
