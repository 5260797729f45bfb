"""Readings and correction weights as vectors in polar diagrams."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..influence import Solution
    from ..rotors.runs import Runs

BEFORE, AFTER = "#3b6ea5", "#e07a3f"


def draw_readings(sheet: "Runs", solution: "Solution") -> "Figure":
    """Readings before and predicted after, and the correction weights, angles as the sheet counts them."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.6, 4.8), layout="constrained")
    readings, weights = figure.subplots(1, 2, subplot_kw={"projection": "polar"})
    names = [f"{sensor}, {speed}" for sensor, speed in sheet.rows]
    before, after = sheet.as_sheet_phase(solution.coefficients.initial), sheet.as_sheet_phase(solution.residual)
    _arrows(readings, before, names, BEFORE)
    _arrows(readings, after, [""] * len(names), AFTER)
    readings.set_title(f"Readings, phase as {sheet.phase}: blue before, orange predicted after [SI]", fontsize=9)
    _arrows(weights, sheet.in_sheet_sense(solution.weights), [plane.name for plane in sheet.planes], AFTER)
    weights.set_title(f"Correction weights, angles {sheet.angles} [SI]", fontsize=9)
    return figure


def _arrows(axes: Any, vectors: Any, names: Sequence[str], colour: str) -> None:  # noqa: ANN401
    for vector, name in zip(vectors, names, strict=True):
        angle, length = float(np.angle(vector)), float(abs(vector))
        axes.plot([angle, angle], [0.0, length], "-o", color=colour, ms=4, markevery=[1])
        axes.annotate(name, (angle, length), xytext=(5, 5), textcoords="offset points", fontsize=8)
    axes.set_rlim(0.0, None)
