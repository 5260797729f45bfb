"""From records to an identification: what is observable, the cut-off and delay, the parameters, other choices."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace

from balance.estimation.base_parameters import BaseParameters, base_parameters
from balance.estimation.identifiability import Identifiability, identifiability
from balance.estimation.regression import RegressionRecord
from balance.mechanism.mechanism import Mechanism

from ..recording import common_origin
from .cross_validation import CUTOFFS_HZ, Choice, choose, possible_cutoffs
from .estimators import BLOCK_PERIODS, Method, Methods, NotSimulated, allowed
from .records import JointRecord
from .regression_equations import acted_on_by_root, one_sided, regression_equations
from .result import Identification

_MOST_VARIANTS = 5
"""Half and double the cut-off, no delay, two other methods."""
STEPS = len(CUTOFFS_HZ) + _MOST_VARIANTS
"""Of an identification, about as long each."""


def identify(
    records: Sequence[JointRecord],
    mechanism: Mechanism,
    method: Method | None = None,
    *,
    others: bool = True,
    done: Callable[[int], None] = lambda steps: None,
) -> Identification:
    """Identify a mechanism from records of its driven joints.

    What is observable is found first, then the cut-off and the delay by held-out torque error, then the parameters by
    ``method``; at half and at double that cut-off, without delay, and by the other methods, once more. The method is
    ``iv`` unless named, and ``ls`` where there are forces alone; without ``others`` no interval is
    widened by the other methods, which take long through loops. Friction of another form than Coulomb + viscous is
    identified with the rest, unless all stays doubtful with it. ``done`` is told of STEPS in all, as they are done.
    Raises NotIdentifiable where nothing is observable.
    """
    method = method or ("iv" if records[0].torque.shape[1] else "ls")
    possible = possible_cutoffs(records)
    middle = regression_equations(records, mechanism, possible[len(possible) // 2])
    identifiable = identifiability(middle.columns * middle.moving[:, :, None], middle.names)
    if any(record.root is not None for record in records):
        of_root = acted_on_by_root(identifiable, mechanism)
        records = [replace(record, of_root=of_root) for record in records]
    done(len(CUTOFFS_HZ) - len(possible))
    choice = choose(records, mechanism, identifiable, method, done)
    delay, cutoff = choice.chosen.delay, choice.chosen.cutoff
    at = choice.held_out.at(delay)
    tried: dict[str, tuple[Methods, Method]] = {}
    for label, factor in (("half cut-off", 0.5), ("double cut-off", 2.0)):
        equations = regression_equations(records, mechanism, factor * cutoff)
        other = Methods(equations, mechanism, identifiable, delay)
        tried[f"{label} ({factor * cutoff:.3g} Hz)"] = other, choice.method
    if delay:
        tried["no delay"] = choice.held_out.at(0.0), choice.method
    tried |= {name: (at, name) for name in allowed(choice.equations) if others and name != choice.method}
    variants = {}
    done(_MOST_VARIANTS - len(tried))
    for label, (methods, name) in tried.items():
        with suppress(NotSimulated):
            if (one := methods.identified(name)).determines_all:
                variants[label] = one
        done(1)
    failed = [label for label in tried if label not in variants]
    found = Identification(
        mechanism,
        tuple(record.name for record in records),
        common_origin(record.origin for record in records),
        choice,
        choice.identified,
        variants,
        (*([method] if choice.method != method else []), *failed),
        _one_sided(records, mechanism, identifiable, choice),
    )
    if records[0].laws or not found.tests.friction:
        return found
    laws = tuple(term for test in found.tests.friction if test.law is not None for term in test.law.terms)
    again = identify([replace(record, laws=laws) for record in records], mechanism, method, others=others)
    return replace(found if again.doubts and found.doubts else again, friction=tuple(found.tests.friction))


def _one_sided(
    records: Sequence[JointRecord], mechanism: Mechanism, identifiable: Identifiability, choice: Choice
) -> dict[str, BaseParameters]:
    """As often done: torque and rates smoothed, positions not. Of torques alone: forces do not feel positions so."""
    found = {}
    for factor in (1.0, 2.0**0.5, 2.0):
        cutoff = factor * choice.chosen.cutoff
        equations = one_sided(records, mechanism, cutoff)
        blocks = equations.blocks(BLOCK_PERIODS["ls"] / cutoff)
        record = RegressionRecord.of(equations.columns, equations.low_passed_torque(0.0), blocks, used=equations.moving)
        found[f"{cutoff:.3g} Hz"] = base_parameters(record, identifiable)
    return found
