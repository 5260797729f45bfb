"""The one JSON document of ``testbench trim``."""

from typing import TYPE_CHECKING, Any

from balance.estimation.covariance_weighting import CombinedImbalance

if TYPE_CHECKING:
    from .result import Trim


def document(result: "Trim") -> dict[str, Any]:
    """What is missing and what to add, units in the keys."""
    return {
        "mechanism": result.mechanism.name,
        "runs": list(result.runs),
        "origin": result.origin,
        "source": result.source,
        "sources": [share.as_dict() for share in result.shares],
        "agreement": None if result.consensus is None else _agreement(result.consensus),
        "missing": [m.as_dict() for m in result.missing],
        "interval_level": result.interval_level,
        "add": [
            {
                "site": c.site,
                "mass_kg": c.mass,
                "plates": list(c.plates),
                "position_m": [float(x) for x in c.position],
            }
            for c in result.addition.counter_masses
        ],
        "remove": [{"site": m.site, "mass_kg": -m.mass, "first_moment_kgm": -m.first_moment} for m in result.removal],
        "predicted_residual_kgm": result.predicted_residual,
        "predicted_residual_interval_kgm": list(result.predicted_residual_interval),
        "verdict": result.verdict,
        "doubts": result.doubts(),
        "findings": [finding.as_dict() for finding in result.findings],
        "conditions": [
            {
                "condition": text,
                "value_kgm": None if e is None else e.value,
                "interval": None if e is None else list(e.interval()),
            }
            for text, e in result.values
        ],
        "unexplained": result.unexplained,
        "about": list(result.about),
    }


def _agreement(found: CombinedImbalance) -> dict[str, Any]:
    return {
        "chi_square": found.chi_square,
        "freedom": found.degrees_of_freedom,
        "probability": found.probability,
        "agrees": found.agrees,
    }
