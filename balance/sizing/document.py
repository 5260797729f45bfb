"""Counter-masses as a document, units in the keys."""

from typing import Any

from .result import Sizing


def document(result: Sizing) -> dict[str, Any]:
    """Counter-masses and what they leave, for JSON."""
    return {
        "mechanism": result.before.name,
        "counter_masses": [
            {
                "site": c.site,
                "mass_kg": c.mass,
                "position_m": [float(x) for x in c.position],
                "first_moment_kgm": [float(x) for x in c.first_moment],
                "plates": list(c.plates),
            }
            for c in result.counter_masses
        ],
        "residual_first_moment_kgm": result.residual(),
        "residual_percent": result.residual_percent(),
        "balanced_payload_kg": result.balanced_payloads(),
        "added_mass_kg": result.added_mass,
        "added_inertia_kgm2": result.added_inertia,
    }
