"""Readings and correction weights as vectors in polar diagrams."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..influence import Solution
    from ..rotors.runs import Runs

BEFORE, AFTER = "#3b6ea5", "#e07a3f"


def draw_readings(
    sheet: "Runs",
    solution: "Solution",
    reading: tuple[str, float] = ("SI", 1.0),
    weight: tuple[str, float] = ("SI", 1.0),
) -> "Figure":
    """Readings before and predicted after, and the correction weights, angles as the sheet counts them.

    ``reading`` and ``weight`` are the units in which they are drawn and their factors from SI.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.6, 5.0), layout="constrained")
    readings, weights = figure.subplots(1, 2, subplot_kw={"projection": "polar"})
    names = [sensor if speed == "unstated" else f"{sensor}, {speed}" for sensor, speed in sheet.rows]
    before, after = sheet.as_sheet_phase(solution.coefficients.initial), sheet.as_sheet_phase(solution.residual)
    _arrows(readings, before * reading[1], names, BEFORE)
    _arrows(readings, after * reading[1], [""] * len(names), AFTER)
    readings.set_title(
        f"Readings [{reading[0]}], phase as {sheet.phase}\nblue before, orange predicted after", fontsize=9
    )
    total = sheet.in_sheet_sense(solution.weights) * weight[1]
    _arrows(weights, total, [plane.name for plane in sheet.planes], AFTER)
    weights.set_title(f"Correction weights [{weight[0]}]\nangles {sheet.angles}", fontsize=9)
    return figure


def _arrows(axes: Any, vectors: Any, names: Sequence[str], colour: str) -> None:  # noqa: ANN401
    for vector, name in zip(vectors, names, strict=True):
        angle, length = float(np.angle(vector)), float(abs(vector))
        axes.plot([angle, angle], [0.0, length], "-o", color=colour, ms=4, markevery=[1])
        axes.annotate(name, (angle, length), xytext=(5, 5), textcoords="offset points", fontsize=9)
    axes.set_rlim(0.0, None)
    axes.tick_params(labelsize=8)
