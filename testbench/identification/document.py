"""The result of an identification as the one JSON document of ``testbench identify``."""

from collections.abc import Mapping
from typing import Any

from balance.errors import DataError

from ..kinematics.gaps import GAP_FINDING
from ..recording import Finding
from .cross_validation import BLOCKS, CUTOFFS_HZ
from .diagnostics import Explanation
from .estimators import NAMES
from .records import LONGEST_DELAY_S
from .result import CounterMassValue, Identification, Validation, Value

RULE = (
    f"least torque error of least squares, as recorded, on {BLOCKS} held-out blocks, of cut-offs "
    f"{CUTOFFS_HZ[0]:g} to {CUTOFFS_HZ[-1]:g} Hz and delays up to {LONGEST_DELAY_S * 1e3:g} ms"
)


def identification_document(result: Identification, validation: Validation | None = None) -> dict[str, Any]:
    """All that was found, units in the keys or beside the values."""
    return {
        "mechanism": result.mechanism.name,
        "runs": list(result.runs),
        "origin": result.origin,
        "rows": list(result.rows),
        "method": {"name": result.method, "what": NAMES[result.method], "compared": _compared(result)},
        "parameters": [_parameter(name, value) for name, value in result.parameters()],
        "base_parameters": [_value(value) for value in [*result.base_values(), *result.joint_values()]],
        "first_moments": [_value(value) for value in result.first_moments()],
        "counter_masses": _counter_masses(result),
        "consistent": _consistent(result),
        "identifiability": _identifiability(result),
        "cutoff": {
            "chosen_Hz": result.chosen.cutoff,
            "rule": RULE,
            "held_out_error": [
                {"cutoff_Hz": one.cutoff, "delay_s": one.delay, "rms_ratio": one.error}
                for one in result.choice.best_of_each
            ],
        },
        "torque_delay_s": result.chosen.delay,
        "interval": {
            "confidence": 0.95,
            "statistical": f"delete-block jackknife over {result.identified.fit.blocks} blocks",
            "method": f"widened to contain: {', '.join(result.variants)}",
        },
        "evidence": Explanation(result).document(),
        "validation": _validation(result, validation),
        "verdict": "doubtful" if result.doubts() or (validation and validation.doubts()) else "usable",
        "findings": _findings(result, validation),
        "doubts": result.doubts() + (validation.doubts() if validation else []),
    }


def _findings(result: Identification, validation: Validation | None) -> list[dict[str, str | None]]:
    """What gaps of records took away."""
    texts = (*result.left_out, *(validation.evidence.left_out if validation else ()))
    return [Finding(GAP_FINDING, None, text.partition(":")[0], text).as_dict() for text in texts]


def _compared(result: Identification) -> list[Mapping[str, object]]:
    return [one.document(result.rows, result.mechanism.driven) for one in result.comparison]


def _identifiability(result: Identification) -> dict[str, Any]:
    """What was found before anything was solved."""
    seen = result.identified.identifiability
    return {
        "rank": seen.rank,
        "condition": seen.condition,
        "excitation": result.excitation,
        "weakest": seen.weakest,
        "singular_value_gap": list(seen.singular_values),
        "base_parameters": [
            {"name": seen.text(k), "standard_error_per_unit_noise": float(error)}
            for k, error in enumerate(seen.per_unit)
        ],
        "not_observable": list(seen.undetermined),
    }


def _consistent(result: Identification) -> dict[str, Any]:
    """The nearest bodies that can exist, a member of the set that the record leaves; or why there are none."""
    try:
        found = result.consistent
    except DataError as error:
        return {"free_estimate_feasible": None, "reason": str(error)}
    undetermined = set(result.identified.identifiability.undetermined)
    return {
        "free_estimate_feasible": found.free_is_feasible,
        "distance_in_standard_errors": found.distance,
        "what": "one of those that the record leaves, nearest to the mechanism's file where it does not tell",
        "parameters": [
            {"name": name, "value": float(value), "determined": name not in undetermined}
            for name, value in zip(result.identified.identifiability.names, found.parameters, strict=True)
        ],
    }


def _validation(result: Identification, validation: Validation | None) -> dict[str, Any]:
    if validation is None:
        return {
            "on": "held-out blocks",
            "rms_ratio": _by_row(result, result.rms_ratio),
            "rms_ratio_below_cutoff": _by_row(result, result.rms_ratio_in_band),
        }
    angles = validation.angles
    return {
        "on": "separate runs",
        "runs": list(validation.runs),
        "rms_ratio": _by_row(result, validation.rms_ratio),
        "rms_ratio_below_cutoff": _by_row(result, validation.rms_ratio_in_band),
        "simulated_angle_error_rad": None if angles is None else dict(angles.document(result.joints)),
        "held_out_rms_ratio": _by_row(result, result.rms_ratio),
        "held_out_rms_ratio_below_cutoff": _by_row(result, result.rms_ratio_in_band),
    }


def _value(value: Value) -> dict[str, Any]:
    return {
        "name": value.name,
        "unit": value.unit,
        "value": value.value,
        "interval": list(value.interval),
        "statistical_interval": list(value.estimate.interval()),
        "variants": dict(value.variants),
        "torque_alone_smoothed": dict(value.one_sided),
        "in_file": value.in_file,
    }


def _parameter(name: str, value: Value | None) -> dict[str, Any]:
    if value is None:
        return {"name": name, "value": None, "interval": None, "observable": False}
    return {"name": name, "value": value.value, "interval": list(value.interval), "observable": True}


def _counter_masses(result: Identification) -> list[dict[str, Any]] | None:
    """None where the record does not determine them, or there is nowhere to mount any."""
    if not result.mechanism.counter_sites or result.undetermined_moments():
        return None
    return [_counter_mass(found) for found in result.counter_masses()]


def _counter_mass(found: CounterMassValue) -> dict[str, Any]:
    return {
        "site": found.site,
        "position_m": [float(x) for x in found.position],
        "mass_kg": found.mass.value,
        "mass_interval_kg": list(found.mass.interval),
        "first_moment_kgm": found.first_moment.value,
        "first_moment_interval_kgm": list(found.first_moment.interval),
    }


def _by_row(result: Identification, values: Any) -> Mapping[str, float]:  # noqa: ANN401
    return {row: float(value) for row, value in zip(result.rows, values, strict=True)}
