"""The named methods as one document: every number of their tables and figure, units in the keys."""

from collections.abc import Sequence
from typing import Any

from .outcome import Outcome
from .printed import Comparison


def document(name: str, motion: str, outcomes: Sequence[Outcome], comparisons: Sequence[Comparison]) -> dict[str, Any]:
    """Outcomes side by side, and printed conditions beside the derived ones."""
    return {
        "mechanism": name,
        "motion": motion,
        "methods": [_outcome(outcome) for outcome in outcomes],
        "printed_conditions": [_comparison(comparison) for comparison in comparisons],
    }


def _outcome(outcome: Outcome) -> dict[str, Any]:
    return {
        "method": outcome.name,
        "added_mass_kg": outcome.added_mass,
        "added_inertia_kgm2": outcome.added_inertia,
        "force_rms_N": outcome.force_rms,
        "force_peak_N": outcome.force_peak,
        "moment_rms_Nm": outcome.moment_rms,
        "moment_peak_Nm": outcome.moment_peak,
        "torque_rms_Nm": outcome.torque_rms(),
        "torque_peak_Nm": outcome.torque_peak(),
        "needs": dict(outcome.needs),
        "note": outcome.note,
    }


def _comparison(comparison: Comparison) -> dict[str, Any]:
    return {
        "method": comparison.method,
        "verdict": comparison.verdict(),
        "printed_rank": comparison.rank[0],
        "derived_rank": comparison.rank[1],
        "distance_of_derived_from_printed": comparison.sufficient,
        "distance_of_printed_from_derived": comparison.necessary,
        "distance_once_given": comparison.equal_given,
        "printed": [dict(row) for row in comparison.printed],
        "given": [dict(row) for row in comparison.given],
    }
