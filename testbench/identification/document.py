"""The result of an identification as the one JSON document of ``testbench identify``, units in keys or with values."""

from typing import Any

from balance.arrays import Floats
from balance.errors import DataError
from balance.estimation.estimate import LEVEL
from balance.results import document, plain

from ..kinematics.gaps import GAP_FINDING
from ..recording import Finding
from .cross_validation import RULE
from .diagnostics import Explanation, scale_document
from .estimators import NAMES
from .result import Identification, Validation


def identification_document(result: Identification, validation: Validation | None = None) -> dict[str, Any]:
    """All that was found."""
    determined = bool(result.mechanism.counter_sites) and not result.undetermined_moments()
    explained = Explanation(result)
    doubts = result.doubts() + (validation.doubts() if validation else [])
    lost = (*result.left_out, *(validation.equations.left_out if validation else ()))
    found = {
        "mechanism": result.mechanism.name,
        "runs": list(result.runs),
        "origin": result.origin,
        "rows": list(result.rows),
        "method": {"name": result.method, "what": NAMES[result.method], "compared": result.comparison},
        "parameters": [
            {"name": name, "value": one and one.value, "interval": one and one.interval, "observable": one is not None}
            for name, one in result.parameters()
        ],
        "base_parameters": [*result.base_values(), *result.joint_values()],
        "first_moments": result.first_moments(),
        "counter_masses": result.counter_masses() if determined else None,
        "consistent": _consistent(result),
        "identifiability": {**document(result.identified.identifiability), "excitation": result.excitation},
        "cutoff": {"chosen_Hz": result.chosen.cutoff, "rule": RULE, "held_out_error": result.choice.best_of_each},
        "torque_delay_s": result.chosen.delay,
        "interval": {
            "confidence": LEVEL,
            "statistical": f"delete-block jackknife over {result.identified.fit.blocks} blocks",
            "method": f"widened to contain: {', '.join(result.variants)}",
        },
        "evidence": {**document(explained), "scale_of_all": scale_document(explained.scale_of_all)},
        "validation": _validation(result, validation),
        "verdict": "doubtful" if doubts else "usable",
        "findings": [Finding(GAP_FINDING, None, text.partition(":")[0], text).as_dict() for text in lost],
        "doubts": doubts,
    }
    return dict(plain(found))


def _consistent(result: Identification) -> dict[str, Any]:
    """The nearest bodies that can exist, a member of the set that the record determines; or why there are none."""
    try:
        found = result.consistent
    except DataError as error:
        return {"free_estimate_feasible": None, "reason": str(error)}
    seen = result.identified.identifiability
    return {
        "free_estimate_feasible": found.free_is_feasible,
        "distance_in_standard_errors": found.distance,
        "what": "one of those that the record leaves, nearest to the mechanism's file where it does not tell",
        "parameters": [
            {"name": name, "value": float(value), "determined": name not in seen.undetermined}
            for name, value in zip(seen.names, found.parameters, strict=True)
        ],
    }


def _validation(result: Identification, validation: Validation | None) -> dict[str, Any]:
    def by_row(shares: Floats) -> dict[str, float]:
        return dict(zip(result.rows, shares.tolist(), strict=True))

    def ratios(of: Identification | Validation, prefix: str = "") -> dict[str, Any]:
        below = by_row(of.rms_ratio_in_band)
        return {f"{prefix}rms_ratio": by_row(of.rms_ratio), f"{prefix}rms_ratio_below_cutoff": below}

    if validation is None:
        return {"on": "held-out blocks", **ratios(result)}
    angles = None if validation.angles is None else document(validation.angles)
    return {
        "on": "separate runs",
        "runs": list(validation.runs),
        **ratios(validation),
        "simulated_angle_error_rad": angles and {key: angles[key] for key in angles if key != "all_rms"},
        **ratios(result, "held_out_"),
    }
