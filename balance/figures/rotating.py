"""Figures of rotors, engines and drives, from what was computed.

Polar diagrams of readings and correction weights with their 95 % regions; vector polygons, the graphical solution of a
rotor; orders of free forces and the shaking force of a slider-crank over a turn; equivalent inertia, speed over a turn
and start-up of a drive.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Complexes
from ..engines import partial_balance
from ..engines.balance_shafts import STAGES, ResidualOverTurn
from ..engines.free_forces import FreeForces, RotatingVector
from ..engines.slider_crank import SliderCrank
from ..estimation.estimate import LEVEL_TEXT
from ..rotors.rotor import Correction, Polygon, polygons
from . import panels

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..rotors.correction_uncertainty import CorrectionUncertainty
    from ..rotors.influence_coefficients import Solution
    from ..rotors.trial_runs import TrialRuns

BLUE, ORANGE, GREY = "#3b6ea5", "#e07a3f", "#555555"
"""Before, given or forward; after, computed or backward; neither."""
_ASIDE = 0.3
"""Cosine of a vector's angle beyond which its name is to the side of its tip, not above or below."""


def draw_readings(
    runs: "TrialRuns",
    solution: "Solution",
    reading: tuple[str, float] = ("SI", 1.0),
    weight: tuple[str, float] = ("SI", 1.0),
    uncertainty: "CorrectionUncertainty | None" = None,
) -> "Figure":
    """Readings before and predicted after, and the correction weights, angles in the sense of the file of the runs.

    ``reading`` and ``weight`` are the units in which they are drawn and their factors from SI. With
    ``uncertainty``, shaded regions hold the true vectors with 95 %.
    """
    figure, ((readings, weights),) = panels(9.6, 5.0, 1, 2, grid=False, subplot_kw={"projection": "polar"})
    names = [sensor if speed == "unstated" else f"{sensor}, {speed}" for sensor, speed in runs.rows]
    before, after = runs.in_file_phase(solution.coefficients.initial), runs.in_file_phase(solution.residual)
    total = runs.in_file_sense(solution.weights)
    if uncertainty is not None:
        circle = np.exp(2j * np.pi * np.linspace(0.0, 1.0, 181))
        _regions(
            readings, [(v + within * circle) * reading[1] for v, within in zip(after, uncertainty.after, strict=True)]
        )
        outlines = [runs.in_file_sense(region.outline()) for region in uncertainty.regions]
        _regions(weights, [(v + outline) * weight[1] for v, outline in zip(total, outlines, strict=True)])
    _arrows(readings, before * reading[1], names, BLUE)
    _arrows(readings, after * reading[1], [""] * len(names), ORANGE)
    _arrows(weights, total * weight[1], [plane.name for plane in runs.planes], ORANGE)
    _grid(readings, before)
    _grid(weights, total)
    shaded = "" if uncertainty is None else f"; shaded: {LEVEL_TEXT}"
    readings.set_title(
        f"Readings [{reading[0]}], phase as {runs.phase}\nblue before, orange predicted after{shaded}", fontsize=9
    )
    weights.set_title(f"Correction weights [{weight[0]}]\nangles {runs.angles}{shaded}", fontsize=9)
    return figure


def _regions(axes: Any, outlines: Sequence[Any]) -> None:  # noqa: ANN401
    """Closed curves of vectors, filled; near the origin the angle of a curve must not jump by a turn."""
    for outline in outlines:
        angle = np.unwrap(np.angle(outline))
        axes.fill(angle, np.abs(outline), facecolor=ORANGE, alpha=0.25, edgecolor=ORANGE, lw=0.8)


def _arrows(axes: Any, vectors: Any, names: Sequence[str], colour: str) -> None:  # noqa: ANN401
    for vector, name in zip(vectors, names, strict=True):
        angle, length = float(np.angle(vector)), float(abs(vector))
        axes.plot([angle, angle], [0.0, length], "-o", color=colour, ms=4, markevery=[1])
        across, up = float(np.cos(angle)), float(np.sin(angle))
        side = "left" if across > _ASIDE else "right" if across < -_ASIDE else "center"
        beyond = (7.0 * across, 11.0 * up)
        axes.annotate(name, (angle, length), beyond, textcoords="offset points", ha=side, va="center", fontsize=9)


def _grid(axes: Any, vectors: Any) -> None:  # noqa: ANN401
    """A light grid, its lengths written where the widest gap between the vectors is."""
    angles = np.sort(np.angle(vectors))
    gaps = np.diff(angles, append=angles[0] + 2.0 * np.pi)
    widest = int(np.argmax(gaps))
    axes.set_rlim(0.0, 1.1 * axes.get_rmax())
    axes.set_rlabel_position(np.degrees(angles[widest] + 0.5 * gaps[widest]))
    axes.yaxis.get_major_locator().base.set_params(nbins=5)
    axes.grid(alpha=0.4)
    axes.tick_params(labelsize=8)


_DASHES = {"ungeared": "-", "geared": "--"}
_DRIVE_COLOURS = (BLUE, ORANGE, "#2a9d8f", "#8a5aa5")


def draw_drive(document: dict[str, Any]) -> "Figure":
    """Panels for what the document of ``balance drive`` holds."""
    count = 3 if document.get("start_up") else 2
    figure, (axes,) = panels(4.4 * count, 3.9, 1, count)
    draw_inertia(axes[0], document["reduced"])
    draw_speed(axes[1], document["steady"])
    if count == 3:
        draw_start_up(axes[2], document["start_up"])
    figure.suptitle(f"{document['mechanism']}: computed")
    return figure


def draw_inertia(axes: "Axes", reduced: dict[str, Any]) -> None:
    """I(phi), with its extremes marked."""
    turn = reduced["turn"]
    axes.plot(turn["angle_deg"], turn["inertia_kgm2"], color=_DRIVE_COLOURS[0])
    for extreme in reduced["mechanism_inertia_extremes"]:
        value = extreme["inertia_kgm2"] + reduced["constant_inertia_kgm2"]
        axes.plot(extreme["angle_deg"], value, "o", ms=4, color=_DRIVE_COLOURS[1])
        _label_extreme(axes, extreme["angle_deg"], value, extreme["kind"] == "maximum")
    axes.set(xlabel="crank angle [deg]", ylabel="kg m²", title="Equivalent inertia I(φ)", xticks=range(0, 361, 90))
    axes.margins(y=0.15)


def _label_extreme(axes: "Axes", angle: float, value: float, above: bool) -> None:
    """Label an extreme with its angle, off the curve and within the frame."""
    side = "left" if angle < 20.0 else "right" if angle > 340.0 else "center"
    offset, vertical = ((0, 5), "bottom") if above else ((0, -6), "top")
    axes.annotate(f"{angle:.1f}°", (angle, value), offset, textcoords="offset points", ha=side, va=vertical, fontsize=9)


def draw_speed(axes: "Axes", rows: list[dict[str, Any]]) -> None:
    """Speed over a turn, relative to the nominal one, a line for each setting."""
    for row in rows:
        share = [n / row["nominal_crank_rpm"] for n in row["turn"]["speed_rpm"]]
        axes.plot(row["turn"]["angle_deg"], share, _dash(rows, row), color=_colour(rows, row), label=_label(row))
    axes.set(
        xlabel="crank angle [deg]", ylabel="n / nominal", title="Speed over a turn, steady", xticks=range(0, 361, 90)
    )
    axes.legend(fontsize=7)


def draw_start_up(axes: "Axes", rows: list[dict[str, Any]]) -> None:
    """Speed over time from standstill."""
    for row in rows:
        course = row["course"]
        axes.plot(course["time_s"], course["speed_rpm"], _dash(rows, row), color=_colour(rows, row), label=_label(row))
    axes.set(xlabel="time [s]", ylabel="rev/min", title="Start-up of the crank")
    axes.legend(fontsize=7, loc="lower right")


def _dash(rows: list[dict[str, Any]], row: dict[str, Any]) -> str:
    """Lines are dashed to distinguish readings, where there are two."""
    return _DASHES[row["reading"]] if len({r["reading"] for r in rows}) > 1 else "-"


def _colour(rows: list[dict[str, Any]], row: dict[str, Any]) -> str:
    kinds = list(dict.fromkeys((r["nominal_rpm"], r["counter_masses"]) for r in rows))
    return _DRIVE_COLOURS[kinds.index((row["nominal_rpm"], row["counter_masses"])) % len(_DRIVE_COLOURS)]


def _label(row: dict[str, Any]) -> str:
    with_masses = ", counter-masses" if row["counter_masses"] else ""
    return f"{row['nominal_rpm']:.4g} rpm, {row['reading']}{with_masses}"


_HEADROOM = 1.35
"""Of the largest value, so that the legend lies on nothing."""
_ORDER_COLOURS = {"before": GREY, "counterweights": BLUE, "shafts": ORANGE}


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
    units = (units[0].replace("omega^2", "ω²"), units[1].replace("omega^2", "ω²"))
    figure, drawn = panels(8.4, 3.8 * rows, rows, 2, grid=False)
    _bars(drawn[0, 0], [f.force for f in free], factor, f"force [{units[0]}]")
    _bars(drawn[0, 1], [f.moment for f in free], factor, f"moment [{units[1]}]")
    if residual is not None:
        forces = {stage: each.force for stage, each in residual.stages.items()}
        moments = {stage: each.moment for stage, each in residual.stages.items()}
        _turn(drawn[1, 0], residual, forces, f"size of the force [{units[0]}]")
        _turn(drawn[1, 1], residual, moments, f"size of the moment [{units[1]}]")
    figure.suptitle(title)
    return figure


def _turn(axes: Any, residual: ResidualOverTurn, values: Mapping[str, Complexes], label: str) -> None:  # noqa: ANN401
    """Size of a vector over a turn, by stage; later stages are dashed, so that an equal earlier one shows."""
    for k, (stage, vectors) in enumerate(values.items()):
        line = ("-", "--", ":")[k]
        axes.plot(
            np.degrees(residual.theta), np.abs(vectors), line, color=_ORDER_COLOURS[stage], label=STAGES[stage], lw=1.6
        )
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
    axes.set_xticks(orders)
    axes.set_xlabel("order")
    axes.set_ylabel(label)
    axes.set_ylim(0.0, _HEADROOM * max(map(sum, zip(forward, backward, strict=True)), default=0.0) or 1.0)
    if not any([*forward, *backward]):
        axes.annotate("none", (0.5, 0.5), xycoords="axes fraction", ha="center")
    axes.legend(fontsize=8)
    axes.grid(alpha=0.25, axis="y")


_WEIGHT_COLOURS = (GREY, "#8d99ae", BLUE, "#2a9d8f", ORANGE, "#b5446e")


def draw_polar(crank: SliderCrank, counterweights: Mapping[str, float], omega: float) -> "Figure":
    """The exact force's tip over a turn for each counterweight m_b r_b [kg m], orders 1 and 2 dotted; omega [rad/s]."""
    figure, ((axes,),) = panels(6.4, 5.4)
    theta = np.append(partial_balance.crank_angles(720), 0.0)
    for i, (name, weight) in enumerate(counterweights.items()):
        colour = _WEIGHT_COLOURS[i % len(_WEIGHT_COLOURS)]
        exact = partial_balance.residual_force(crank, weight, theta, omega)
        rough = partial_balance.residual_force(crank, weight, theta, omega, "order2")
        axes.plot(exact.imag, exact.real, color=colour, lw=1.8, label=name)
        axes.plot(rough.imag, rough.real, ":", color=colour, lw=1.0)
    axes.plot(0.0, 0.0, "+", color=GREY, ms=12)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("across the cylinder [N]")
    axes.set_ylabel("along the cylinder, away from the crank [N]")
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
    axes.set_xlabel(f"x [{unit}]")
    axes.set_ylabel(f"y [{unit}]")
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
