"""Vector polygons drawn to scale: the graphical solution of a rotor."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..rotors.polygons import Polygon

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

GIVEN, CLOSING = "#3b6ea5", "#e07a3f"
_LEVEL = 0.35
"""Component of the unit normal below which a name stands centred in that direction."""
_SHORT = 0.15
"""Length of a side, of the polygon's size, below which its name would lie on its neighbours."""
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
    corners = [factor * v for v in polygon.vertices]
    names = [*polygon.names, *polygon.closing_names]
    middle = sum(corners) / len(corners)
    size = max(abs(v - middle) for v in corners)
    for i, (name, start, end) in enumerate(zip(names, corners, corners[1:], strict=False)):
        colour = GIVEN if i < len(polygon.names) else CLOSING
        axes.annotate("", _xy(end), _xy(start), arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 2.0,
                                                            "shrinkA": 0.0, "shrinkB": 0.0})  # fmt: skip
        out = _outwards(start, end, middle, size)
        axes.annotate(
            name, _xy(0.5 * (start + end)), _xy(9.0 * out), textcoords="offset points", color=colour, fontsize=11,
            ha=_side(out.real, "left", "right"), va=_side(out.imag, "bottom", "top"),
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.5},
        )  # fmt: skip
    axes.plot(*zip(*map(_xy, corners), strict=True), ".", color="#555555", ms=4)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_title(polygon.title, fontsize=10)
    axes.set_xlabel(f"x [{unit}]")
    axes.set_ylabel(f"y [{unit}]")
    axes.margins(0.25)
    axes.locator_params(nbins=5)
    axes.grid(alpha=0.25)


def _xy(vector: complex) -> tuple[float, float]:
    return vector.real, vector.imag


def _outwards(start: complex, end: complex, middle: complex, size: float) -> complex:
    """Where a side's name goes: along its normal away from the polygon's middle, of a short side straight away."""
    side, from_middle = end - start, 0.5 * (start + end) - middle
    if abs(side) < _SHORT * size or side == 0.0:
        return from_middle / abs(from_middle) if from_middle else 1.0 + 0.0j
    normal = 1j * side / abs(side)
    return normal if (from_middle * normal.conjugate()).real >= 0.0 else -normal


def _side(part: float, positive: str, negative: str) -> str:
    """Alignment of a name whose offset has this component."""
    return "center" if abs(part) < _LEVEL else positive if part > 0.0 else negative
