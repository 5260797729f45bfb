"""Figures of rotors, engines and drives, from what was computed.

Polar diagrams of readings and correction weights with their 95 % regions; vector polygons, the graphical solution of a
rotor; orders of free forces and the shaking force of a slider-crank over a turn; equivalent inertia, speed over a turn
and start-up of a drive.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Complexes
from ..engines import slider_crank
from ..engines.free_forces import STAGES, FreeForces, ResidualOverTurn, RotatingVector
from ..engines.slider_crank import SliderCrank
from ..estimation.estimate import LEVEL_TEXT
from ..rotors.rotor import Correction, Polygon, polygons
from . import panels

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..rotors.results import Influence

BLUE, ORANGE, GREEN, GREY = "#3b6ea5", "#e07a3f", "#2a9d8f", "#555555"
"""Before, given or forward; after, computed or backward; neither."""
_ASIDE = 0.3
"""Cosine of a vector's angle beyond which its name, above or below its tip, reaches from there inwards."""


def draw_readings(found: "Influence") -> "Figure":
    """Readings before and predicted after, and the correction weights, angles in the sense of the file of the runs.

    Shaded regions hold the true vectors with 95 %, where readings have intervals.
    """
    from ..rotors.results import READING, WEIGHT

    runs, solution = found.runs, found.solution
    uncertainty = runs.uncertainty(solution)
    (reading, _, r), (weight, _, w) = READING[runs.reading], WEIGHT[runs.weight]
    figure, ((readings, weights),) = panels(9.6, 5.0, 1, 2, grid=False, subplot_kw={"projection": "polar"})
    names = [sensor if speed == "unstated" else f"{sensor}, {speed}" for sensor, speed in runs.rows]
    before, after = runs.in_file_phase(solution.coefficients.initial), runs.in_file_phase(solution.residual)
    total = runs.in_file_sense(solution.weights)
    if uncertainty is not None:
        circle = np.exp(2j * np.pi * np.linspace(0.0, 1.0, 181))
        _regions(readings, r * (after[:, None] + np.outer(uncertainty.after, circle)))
        outlines = np.array([runs.in_file_sense(region.outline()) for region in uncertainty.regions])
        _regions(weights, w * (total[:, None] + outlines))
    _arrows(readings, before * r, names, BLUE)
    _arrows(readings, after * r, [""] * len(names), ORANGE)
    _arrows(weights, total * w, [plane.name for plane in runs.planes], ORANGE)
    _grid(readings, before)
    _grid(weights, total)
    shaded = "" if uncertainty is None else f"; shaded: {LEVEL_TEXT}"
    readings.set_title(
        f"Readings [{reading}], phase as {runs.phase}\nblue before, orange predicted after{shaded}", fontsize=9
    )
    weights.set_title(f"Correction weights [{weight}]\nangles {runs.angles}{shaded}", fontsize=9)
    return figure


def _regions(axes: Any, outlines: Complexes) -> None:  # noqa: ANN401
    """Closed curves of vectors (k, points), filled; near the origin the angle of a curve must not jump by a turn."""
    for outline in outlines:
        angle = np.unwrap(np.angle(outline))
        axes.fill(angle, np.abs(outline), facecolor=ORANGE, alpha=0.25, edgecolor=ORANGE, lw=0.8)


def _arrows(axes: Any, vectors: Any, names: Sequence[str], colour: str) -> None:  # noqa: ANN401
    for vector, name in zip(vectors, names, strict=True):
        angle, length = float(np.angle(vector)), float(abs(vector))
        axes.plot([angle, angle], [0.0, length], "-o", color=colour, ms=4, markevery=[1])
        across, up = float(np.cos(angle)), float(np.sin(angle))
        side = "right" if across > _ASIDE else "left" if across < -_ASIDE else "center"
        off = (0.0, 11.0 if up >= 0.0 else -11.0)
        axes.annotate(name, (angle, length), off, textcoords="offset points", ha=side, va="center", fontsize=9)


def _grid(axes: Any, vectors: Any) -> None:  # noqa: ANN401
    """A light grid, its lengths written where the widest gap between the vectors is."""
    angles = np.sort(np.angle(vectors))
    gaps = np.diff(angles, append=angles[0] + 2.0 * np.pi)
    widest = int(np.argmax(gaps))
    axes.set_rlim(0.0, 1.25 * axes.get_rmax())
    axes.set_rlabel_position(np.degrees(angles[widest] + 0.5 * gaps[widest]))
    axes.yaxis.get_major_locator().base.set_params(nbins=5)
    axes.set_rticks([r for r in axes.get_yticks() if 0.0 < r < 0.9 * axes.get_rmax()])
    axes.grid(alpha=0.4)
    axes.tick_params(labelsize=8)


_DASHES = {"ungeared": "-", "geared": "--"}
_DRIVE_COLOURS = (BLUE, ORANGE, GREEN, "#8a5aa5")


def draw_drive(document: dict[str, Any]) -> "Figure":
    """What the document of ``balance drive`` holds: inertia and relative speed over a turn, start-up over time."""
    count = 3 if document.get("start_up") else 2
    figure, (axes,) = panels(4.4 * count, 3.9, 1, count)
    _draw_inertia(axes[0], document["reduced"])
    for row, look in _settings(document["steady"]):
        axes[1].plot(row["turn"]["angle_deg"], np.array(row["turn"]["speed_rpm"]) / row["nominal_crank_rpm"], **look)
    axes[1].set(xlabel="crank angle [deg]", ylabel="n / nominal", title="Speed over a turn, steady")
    axes[1].set_xticks(range(0, 361, 90))
    axes[1].legend(fontsize=7)
    if count == 3:
        for row, look in _settings(document["start_up"]):
            axes[2].plot(row["course"]["time_s"], row["course"]["speed_rpm"], **look)
        axes[2].set(xlabel="time [s]", ylabel="rev/min", title="Start-up of the crank")
        axes[2].legend(fontsize=7, loc="lower right")
    figure.suptitle(f"{document['mechanism']}: computed")
    return figure


def _draw_inertia(axes: "Axes", reduced: dict[str, Any]) -> None:
    """I(phi), its extremes marked and labelled with their angles, off the curve and within the frame."""
    axes.plot(reduced["turn"]["angle_deg"], reduced["turn"]["inertia_kgm2"], color=_DRIVE_COLOURS[0])
    for extreme in reduced["mechanism_inertia_extremes"]:
        angle, value = extreme["angle_deg"], extreme["inertia_kgm2"] + reduced["constant_inertia_kgm2"]
        axes.plot(angle, value, "o", ms=4, color=_DRIVE_COLOURS[1])
        side = "left" if angle < 20.0 else "right" if angle > 340.0 else "center"
        offset, vertical = ((0, 5), "bottom") if extreme["kind"] == "maximum" else ((0, -6), "top")
        axes.annotate(
            f"{angle:.1f}°", (angle, value), offset, textcoords="offset points", ha=side, va=vertical, fontsize=9
        )
    axes.set(xlabel="crank angle [deg]", ylabel="kg m²", title="Equivalent inertia I(φ)", xticks=range(0, 361, 90))
    axes.margins(y=0.15)


def _settings(rows: list[dict[str, Any]]) -> Iterator[tuple[dict[str, Any], dict[str, Any]]]:
    """Each row with the look of its line: dashes distinguish readings, where there are two, colours all else."""
    two_readings = len({row["reading"] for row in rows}) > 1
    kinds = list(dict.fromkeys((row["nominal_rpm"], row["counter_masses"]) for row in rows))
    for row in rows:
        kind = kinds.index((row["nominal_rpm"], row["counter_masses"]))
        masses = ", counter-masses" if row["counter_masses"] else ""
        yield row, {
            "ls": _DASHES[row["reading"]] if two_readings else "-", "color": _DRIVE_COLOURS[kind % len(_DRIVE_COLOURS)],
            "label": f"{row['nominal_rpm']:.4g} rpm, {row['reading']}{masses}",
        }  # fmt: skip


_HEADROOM = 1.35
"""Of the largest value, so that the legend lies on nothing."""
_ORDER_COLOURS = {"before": GREY, "counterweights": BLUE, "first_order_shafts": GREEN, "shafts": ORANGE}


def draw_orders(
    free: Sequence[FreeForces],
    title: str,
    factor: float,
    units: tuple[str, str],
    residual: ResidualOverTurn | None = None,
) -> "Figure":
    """Bars of the forward and backward parts of force and moment; ``factor`` times the values per omega^2.

    Below them, where ``residual`` is given, the residuals of both over a turn.
    """
    rows = 1 if residual is None else 2
    figure, drawn = panels(8.4, 3.8 * rows, rows, 2, grid=False)
    for column, (kind, unit) in enumerate(zip(("force", "moment"), units, strict=True)):
        label = f"{kind} [{unit.replace('omega^2', 'ω²')}]"
        _bars(drawn[0, column], [getattr(each, kind) for each in free], factor, label)
        if residual is not None:
            vectors = {stage: getattr(each, kind) for stage, each in residual.stages.items()}
            _turn(drawn[1, column], residual, vectors, f"size of the {label}")
    figure.suptitle(title)
    return figure


def _turn(axes: Any, residual: ResidualOverTurn, values: Mapping[str, Complexes], label: str) -> None:  # noqa: ANN401
    """Size of a vector over a turn, by stage; later stages are dashed, so that an equal earlier one shows."""
    angle = np.degrees(residual.theta)
    for line, (stage, vectors) in zip(("-", "--", "-.", ":"), values.items(), strict=True):
        axes.plot(angle, np.abs(vectors), line, color=_ORDER_COLOURS[stage], label=STAGES[stage], lw=1.6)
    largest = max(float(np.abs(vectors).max()) for vectors in values.values())
    axes.set(xlabel="crank angle [deg]", ylabel=label, xticks=range(0, 361, 90))
    axes.set_ylim(0.0, _HEADROOM * largest or 1.0)
    axes.legend(fontsize=8)
    axes.grid(alpha=0.25)


def _bars(axes: Any, parts: Sequence[RotatingVector], factor: float, label: str) -> None:  # noqa: ANN401
    orders = [part.order for part in parts]
    forward = [factor * abs(part.forward) for part in parts]
    backward = [factor * abs(part.backward) for part in parts]
    axes.bar(orders, forward, color=BLUE, label="turning with the crankshaft")
    axes.bar(orders, backward, bottom=forward, color=ORANGE, label="turning against it")
    axes.set(xticks=orders, xlabel="order", ylabel=label)
    axes.set_ylim(0.0, _HEADROOM * max(map(sum, zip(forward, backward, strict=True)), default=0.0) or 1.0)
    if not any([*forward, *backward]):
        axes.annotate("none", (0.5, 0.5), xycoords="axes fraction", ha="center")
    axes.legend(fontsize=8)
    axes.grid(alpha=0.25, axis="y")


_WEIGHT_COLOURS = (GREY, "#8d99ae", BLUE, GREEN, ORANGE, "#b5446e")


def draw_polar(crank: SliderCrank, counterweights: Mapping[str, float], omega: float) -> "Figure":
    """The exact force's tip over a turn for each counterweight m_b r_b [kg m], orders 1 and 2 dotted; omega [rad/s]."""
    figure, ((axes,),) = panels(6.4, 5.4)
    theta = np.append(slider_crank.crank_angles(720), 0.0)
    for i, (name, weight) in enumerate(counterweights.items()):
        colour = _WEIGHT_COLOURS[i % len(_WEIGHT_COLOURS)]
        exact = slider_crank.residual_force(crank, weight, theta, omega)
        rough = slider_crank.residual_force(crank, weight, theta, omega, "order2")
        axes.plot(exact.imag, exact.real, color=colour, lw=1.8, label=name)
        axes.plot(rough.imag, rough.real, ":", color=colour, lw=1.0)
    axes.plot(0.0, 0.0, "+", color=GREY, ms=12)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="across the cylinder [N]", ylabel="along the cylinder, away from the crank [N]")
    axes.set_title("Shaking force over a turn; dotted: orders 1 and 2")
    axes.legend(title="counterweight", fontsize=9)
    return figure


_LEVEL = 0.35
"""Component of the unit normal below which a name is centred in that direction."""
_SHORT = 0.15
"""Length of a side, of the polygon's size, below which its name would lie on its neighbours."""
_UNITS = {"kg m": ("kg mm", 1e3), "kg m2": ("kg mm²", 1e6)}


def draw_polygons(correction: Correction) -> "Figure":
    """Draw the vector polygons side by side; given and closing sides differ in colour, each side is named."""
    drawn = polygons(correction)
    figure, (each,) = panels(4.6 * len(drawn), 4.6, 1, len(drawn))
    for axes, polygon in zip(each, drawn, strict=True):
        _draw(axes, polygon)
    return figure


def _draw(axes: "Axes", polygon: Polygon) -> None:
    unit, factor = _UNITS[polygon.unit]
    corners = [factor * v for v in polygon.vertices]
    names = [*polygon.names, *polygon.closing_names]
    middle = sum(corners) / len(corners)
    size = max(abs(v - middle) for v in corners)
    for i, (name, start, end) in enumerate(zip(names, corners, corners[1:], strict=False)):
        colour = BLUE if i < len(polygon.names) else ORANGE
        axes.annotate("", _xy(end), _xy(start), arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 2.0,
                                                            "shrinkA": 0.0, "shrinkB": 0.0})  # fmt: skip
        out = _outwards(start, end, middle, size)
        axes.annotate(
            name, _xy(0.5 * (start + end)), _xy(9.0 * out), textcoords="offset points", color=colour, fontsize=11,
            ha=_side(out.real, "left", "right"), va=_side(out.imag, "bottom", "top"),
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.5},
        )  # fmt: skip
    axes.plot(*zip(*map(_xy, corners), strict=True), ".", color=GREY, ms=4)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_title(polygon.title, fontsize=10)
    axes.set(xlabel=f"x [{unit}]", ylabel=f"y [{unit}]")
    axes.margins(0.25)
    axes.locator_params(nbins=5)


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
