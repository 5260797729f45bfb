"""Shaking force and moment at a point, and torques of the drives."""

from typing import TYPE_CHECKING

import numpy as np

from .. import torque
from ..signals import Band
from ..vibration import METRICS
from .part import Part

if TYPE_CHECKING:
    from ..runs.aligned_run import AlignedRun
    from ..wrench import MeasuredWrench


LEAST_GAP_S = 1e-6
"""What is left out of a record, beyond rounding [s]."""


def wrench_part(wrench: "MeasuredWrench", band: Band | None) -> Part:
    """Every metric of every component; null with the reason where the sensors do not determine it."""
    components: dict[str, dict[str, float] | None] = {}
    reasons = dict(wrench.reasons)
    for name, values in wrench.values.items():
        if values is None:
            components[name] = None
        elif stretches := wrench.clipped.get(name):
            components[name] = None
            where = ", ".join(f"{a:.4f}..{b:.4f} s" for a, b in stretches[:5]) + (" ..." if len(stretches) > 5 else "")
            reasons[name] = f"a sensor that it rests on is at the end of its range in {where}"
        else:
            shape = values - values.mean()
            shape = band.of(shape, wrench.rate) if band else shape
            unit = "N" if name[0] == "F" else "Nm"
            components[name] = {f"{metric}_{unit}": measure(shape) for metric, (_, measure) in METRICS.items()}
    return {
        "point_m": list(wrench.point),
        "components": components,
        "reasons": reasons,
        "clipped_s": {name: [list(ends) for ends in stretches] for name, stretches in wrench.clipped.items()},
        "tare": wrench.tare,
        "band_hz": [band.low_hz, band.high_hz] if band else None,
        "definition": "what the mechanism exerts on the base, base axes, moments about the point; mean removed, "
        f"band {band or 'not limited'}",
        "group": wrench.group,
    }


def torque_part(run: "AlignedRun", bandwidth_hz: float) -> Part:
    """Each drive against the model."""
    drives = torque.against_model(run, bandwidth_hz)
    return {"drives": [drive.as_dict() for drive in drives], "definitions": torque.DEFINITIONS}


def _gapped(part: Part) -> bool:
    return any(drive["left_out_s"] > LEAST_GAP_S for drive in part.get("drives", []))


def fallen(balanced: list[Part], unbalanced: list[Part]) -> list[Part]:
    """How torques changed with counter-masses: root mean square, measured and by the model, means of repeats.

    Of parts by :func:`torque_part`; drives that are not in all of them are left out, and so are runs with a gap, whose
    root mean square is of another span.
    """
    sides = [
        [{d["joint"]: d for d in part.get("drives", [])} for part in some if not _gapped(part)]
        for some in (balanced, unbalanced)
    ]
    if not all(sides):
        return []
    joints = [j for j in sides[0][0] if all(j in drives for some in sides for drives in some)]
    rows = []
    for joint in joints:
        row: Part = {"joint": joint}
        unit = "Nm" if "measured_rms_Nm" in sides[0][0][joint] else "N"
        for kind in ("measured", "model"):
            means = [float(np.mean([drives[joint][f"{kind}_rms_{unit}"] for drives in some])) for some in sides]
            row |= {f"{kind}_rms_{unit}": {"with": means[0], "without": means[1]},
                    f"{kind}_times": means[0] / means[1] if means[1] > 0.0 else None}  # fmt: skip
        rows.append(row)
    return rows
