"""Vector polygons drawn to scale: the graphical solution of a rotor."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..rotors.polygons import Polygon

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

GIVEN, CLOSING = "#3b6ea5", "#e07a3f"
_UNITS = {"kg m": ("kg mm", 1e3), "kg m2": ("kg mm²", 1e6)}


def draw_polygons(polygons: Sequence[Polygon]) -> "Figure":
    """Draw polygons side by side, given sides and closing sides apart by colour, each side named."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.6 * len(polygons), 4.6), layout="constrained")
    for axes, polygon in zip(figure.subplots(1, len(polygons), squeeze=False)[0], polygons, strict=True):
        _draw(axes, polygon)
    return figure


def _draw(axes: "Axes", polygon: Polygon) -> None:
    unit, factor = _UNITS[polygon.unit]
    corners = [(factor * v.real, factor * v.imag) for v in polygon.vertices]
    names = [*polygon.names, *polygon.closing_names]
    for i, (name, start, end) in enumerate(zip(names, corners, corners[1:], strict=False)):
        colour = GIVEN if i < len(polygon.names) else CLOSING
        axes.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 2.0, "shrinkA": 0.0,
                                                  "shrinkB": 0.0})  # fmt: skip
        middle = ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2)
        axes.annotate(name, middle, xytext=(7, 5), textcoords="offset points", color=colour, fontsize=11)
    axes.plot(*zip(*corners, strict=True), ".", color="#555555", ms=4)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_title(polygon.title, fontsize=10)
    axes.set_xlabel(f"x [{unit}]")
    axes.set_ylabel(f"y [{unit}]")
    axes.margins(0.12)
    axes.locator_params(nbins=5)
    axes.grid(alpha=0.25)
