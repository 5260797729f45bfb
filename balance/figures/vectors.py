"""Readings and correction weights as vectors in polar diagrams, with the regions that hold the true ones."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..influence import Solution
    from ..rotors.correction_uncertainty import CorrectionUncertainty
    from ..rotors.runs import Runs

BEFORE, AFTER = "#3b6ea5", "#e07a3f"
_ASIDE = 0.3
"""Cosine of a vector's angle beyond which its name stands beside its tip, not above or below."""


def draw_readings(
    sheet: "Runs",
    solution: "Solution",
    reading: tuple[str, float] = ("SI", 1.0),
    weight: tuple[str, float] = ("SI", 1.0),
    sure: "CorrectionUncertainty | None" = None,
) -> "Figure":
    """Readings before and predicted after, and the correction weights, angles as the sheet counts them.

    ``reading`` and ``weight`` are the units in which they are drawn and their factors from SI. Where ``sure`` is given,
    shaded regions hold the true vectors with 95 %.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.6, 5.0), layout="constrained")
    readings, weights = figure.subplots(1, 2, subplot_kw={"projection": "polar"})
    names = [sensor if speed == "unstated" else f"{sensor}, {speed}" for sensor, speed in sheet.rows]
    before, after = sheet.as_sheet_phase(solution.coefficients.initial), sheet.as_sheet_phase(solution.residual)
    total = sheet.in_sheet_sense(solution.weights)
    if sure is not None:
        circle = np.exp(2j * np.pi * np.linspace(0.0, 1.0, 181))
        _regions(readings, [(v + within * circle) * reading[1] for v, within in zip(after, sure.after, strict=True)])
        outlines = [sheet.in_sheet_sense(region.outline()) for region in sure.regions]
        _regions(weights, [(v + outline) * weight[1] for v, outline in zip(total, outlines, strict=True)])
    _arrows(readings, before * reading[1], names, BEFORE)
    _arrows(readings, after * reading[1], [""] * len(names), AFTER)
    _arrows(weights, total * weight[1], [plane.name for plane in sheet.planes], AFTER)
    _ruled(readings, before)
    _ruled(weights, total)
    shaded = "" if sure is None else "; shaded: 95 %"
    readings.set_title(
        f"Readings [{reading[0]}], phase as {sheet.phase}\nblue before, orange predicted after{shaded}", fontsize=9
    )
    weights.set_title(f"Correction weights [{weight[0]}]\nangles {sheet.angles}{shaded}", fontsize=9)
    return figure


def _regions(axes: Any, outlines: Sequence[Any]) -> None:  # noqa: ANN401
    """Closed curves of vectors, filled; beside the origin the angle of a curve must not jump by a turn."""
    for outline in outlines:
        angle = np.unwrap(np.angle(outline))
        axes.fill(angle, np.abs(outline), facecolor=AFTER, alpha=0.25, edgecolor=AFTER, lw=0.8)


def _arrows(axes: Any, vectors: Any, names: Sequence[str], colour: str) -> None:  # noqa: ANN401
    for vector, name in zip(vectors, names, strict=True):
        angle, length = float(np.angle(vector)), float(abs(vector))
        axes.plot([angle, angle], [0.0, length], "-o", color=colour, ms=4, markevery=[1])
        across, up = float(np.cos(angle)), float(np.sin(angle))
        side = "left" if across > _ASIDE else "right" if across < -_ASIDE else "center"
        beyond = (7.0 * across, 11.0 * up)
        axes.annotate(name, (angle, length), beyond, textcoords="offset points", ha=side, va="center", fontsize=9)


def _ruled(axes: Any, vectors: Any) -> None:  # noqa: ANN401
    """A light grid, its lengths written where the widest gap between the vectors is."""
    angles = np.sort(np.angle(vectors))
    gaps = np.diff(angles, append=angles[0] + 2.0 * np.pi)
    widest = int(np.argmax(gaps))
    axes.set_rlim(0.0, 1.1 * axes.get_rmax())
    axes.set_rlabel_position(np.degrees(angles[widest] + 0.5 * gaps[widest]))
    axes.yaxis.get_major_locator().base.set_params(nbins=5)
    axes.grid(alpha=0.4)
    axes.tick_params(labelsize=8)
