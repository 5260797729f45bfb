"""The result of an identification as the one JSON document of ``testbench identify``."""

from collections.abc import Mapping
from typing import Any

from .choice import CUTOFFS_HZ, LONGEST_DELAY_S, STRETCHES
from .result import CounterMassValue, Identification, Value

RULE = (
    f"least torque error, as recorded, on {STRETCHES} held-out stretches, of cut-offs {CUTOFFS_HZ[0]:g} to "
    f"{CUTOFFS_HZ[-1]:g} Hz and delays up to {LONGEST_DELAY_S * 1e3:g} ms"
)


def document(result: Identification) -> dict[str, Any]:
    """All that was found, units in the keys or beside the values."""
    observability = result.identified.observability
    return {
        "mechanism": result.mechanism.name,
        "runs": list(result.runs),
        "origin": result.origin,
        "parameters": [_parameter(name, value) for name, value in result.parameters()],
        "base_parameters": [_value(value) for value in [*result.base_values(), *result.joint_values()]],
        "first_moments": [_value(value) for value in result.first_moments()],
        "counter_masses": _counter_masses(result),
        "identifiability": {
            "rank": observability.rank,
            "condition": observability.condition,
            "singular_value_gap": list(observability.singular_values),
        },
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
            "statistical": f"delete-block jackknife over {result.identified.blocks} stretches",
            "method": "widened to contain half and double the cut-off, and no delay",
        },
        "validation": {
            "rms_ratio": _by_joint(result, result.rms_ratio),
            "rms_ratio_below_cutoff": _by_joint(result, result.rms_ratio_in_band),
        },
        "verdict": result.verdict,
        "doubts": result.doubts(),
    }


def _value(value: Value) -> dict[str, Any]:
    return {
        "name": value.name,
        "unit": value.unit,
        "value": value.value,
        "interval": list(value.interval),
        "statistical_interval": list(value.estimate.interval),
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


def _by_joint(result: Identification, values: Any) -> Mapping[str, float]:  # noqa: ANN401
    return {joint: float(value) for joint, value in zip(result.joints, values, strict=True)}
