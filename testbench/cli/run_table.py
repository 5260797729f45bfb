"""A stored run as a line of a table, and as a JSON object."""

from typing import TYPE_CHECKING, Any

from .reading import plain

if TYPE_CHECKING:
    from ..store import Run

HEADER = ["run", "origin", "payload kg", "counter-masses kg", "motion", "peak g0", "repeat", "samples", "findings"]


def document(run: "Run") -> dict[str, Any]:
    """The run without its data."""
    return {
        "run": run.name,
        "file": run.path.name,
        "origin": run.origin,
        "conditions": dict(run.conditions),
        "sources": [source["name"] for source in run.provenance["sources"]],
        "groups": [
            {"name": g.name, "samples": g.samples, "rate_hz": g.rate_hz, "rate_source": g.rate_source,
             "channels": [{"name": c.name, "unit": c.unit} for c in g.channels]}
            for g in run.groups
        ],
        "findings": [finding.as_dict() for finding in run.findings],
    }  # fmt: skip


def row(run: "Run") -> list[str]:
    """The run under :data:`HEADER`."""
    conditions = run.conditions
    masses = conditions.get("counter_masses")
    return [
        plain(run.name),
        run.origin,
        f"{conditions['payload_kg']:g}" if "payload_kg" in conditions else "-",
        "-" if masses is None else ", ".join(f"{plain(s)} {m:g}" for s, m in masses.items()) or "none",
        plain(conditions.get("motion", "-")),
        f"{conditions['peak_acceleration_g']:g}" if "peak_acceleration_g" in conditions else "-",
        str(conditions.get("repeat", "-")),
        ", ".join(str(group.samples) for group in run.groups),
        str(sum(finding.severity > 0 for finding in run.findings)),
    ]
