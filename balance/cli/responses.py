"""What a motion asks of base and motors, as numbers for JSON and rows for people."""

from typing import TYPE_CHECKING, Any

from .console import emit_table

if TYPE_CHECKING:
    from ..dynamics.inverse_dynamics import Response


def summary(response: "Response") -> dict[str, Any]:
    """RMS and peak values for JSON; torques [N m], and forces of drives that slide [N], apart by joint."""
    return {"rms": _grouped(response.rms()), "peak": _grouped(response.peak())}


def _grouped(values: dict[str, float]) -> dict[str, Any]:
    groups: dict[str, Any] = {"torque_Nm": {}}
    for name, value in values.items():
        if name.startswith("torque_"):
            groups["torque_Nm"][name.removeprefix("torque_").removesuffix("_Nm")] = value
        elif name.startswith("drive_force_"):
            groups.setdefault("drive_force_N", {})[name.removeprefix("drive_force_").removesuffix("_N")] = value
        else:
            groups[name] = value
    return groups


def print_responses(responses: "dict[str, Response]") -> None:
    """Print a motion before and after balancing, components that are not zero throughout."""
    before, after = responses["before"], responses["after"]
    rows = []
    for name, peak in before.peak().items():
        if max(peak, after.peak()[name]) > 1e-9:
            values = [before.rms()[name], after.rms()[name], peak, after.peak()[name]]
            rows.append([label(name), *(f"{value:.4g}" for value in values)])
    emit_table("Simulated motion", ["component", "RMS before", "RMS after", "peak before", "peak after"], rows)


def label(name: str) -> str:
    """The name of a component with its unit, such as ``Fx [N]`` of ``Fx_N``."""
    stem, _, unit = name.rpartition("_")
    return f"{stem.replace('_', ' ')} [{unit.replace('Nm', 'N m')}]"
