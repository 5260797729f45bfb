"""Drives drawn from their document: reduced inertia over a turn, speed over a turn, start-up."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_DASHES = {"ungeared": "-", "geared": "--"}
_COLOURS = ("#3b6ea5", "#e07a3f", "#2a9d8f", "#8a5aa5")


def draw_drive(document: dict[str, Any]) -> "Figure":
    """Panels for what the document of ``balance drive`` holds."""
    from matplotlib.figure import Figure

    panels = 3 if document.get("start_up") else 2
    figure = Figure(figsize=(4.4 * panels, 3.9), layout="constrained")
    axes = figure.subplots(1, panels)
    draw_inertia(axes[0], document["reduced"])
    draw_speed(axes[1], document["steady"])
    if panels == 3:
        draw_start_up(axes[2], document["start_up"])
    figure.suptitle(f"{document['mechanism']}: computed")
    return figure


def draw_inertia(axes: "Axes", reduced: dict[str, Any]) -> None:
    """I(phi), with its extremes marked."""
    turn = reduced["turn"]
    axes.plot(turn["angle_deg"], turn["inertia_kgm2"], color=_COLOURS[0])
    for extreme in reduced["mechanism_inertia_extremes"]:
        value = extreme["inertia_kgm2"] + reduced["constant_inertia_kgm2"]
        axes.plot(extreme["angle_deg"], value, "o", ms=4, color=_COLOURS[1])
        _name(axes, extreme["angle_deg"], value, extreme["kind"] == "maximum")
    axes.set(xlabel="crank angle [deg]", ylabel="kg m²", title="Reduced inertia I(φ)", xticks=range(0, 361, 90))
    axes.margins(y=0.15)
    axes.grid(alpha=0.25)


def _name(axes: "Axes", angle: float, value: float, above: bool) -> None:
    """The angle of an extreme, off the curve and within the frame."""
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
    axes.grid(alpha=0.25)


def draw_start_up(axes: "Axes", rows: list[dict[str, Any]]) -> None:
    """Speed over time from standstill."""
    for row in rows:
        course = row["course"]
        axes.plot(course["time_s"], course["speed_rpm"], _dash(rows, row), color=_colour(rows, row), label=_label(row))
    axes.set(xlabel="time [s]", ylabel="rev/min", title="Start-up of the crank")
    axes.legend(fontsize=7, loc="lower right")
    axes.grid(alpha=0.25)


def _dash(rows: list[dict[str, Any]], row: dict[str, Any]) -> str:
    """Lines are dashed to tell readings apart, where there are two."""
    return _DASHES[row["reading"]] if len({r["reading"] for r in rows}) > 1 else "-"


def _colour(rows: list[dict[str, Any]], row: dict[str, Any]) -> str:
    kinds = list(dict.fromkeys((r["nominal_rpm"], r["counter_masses"]) for r in rows))
    return _COLOURS[kinds.index((row["nominal_rpm"], row["counter_masses"])) % len(_COLOURS)]


def _label(row: dict[str, Any]) -> str:
    with_masses = ", counter-masses" if row["counter_masses"] else ""
    return f"{row['nominal_rpm']:.4g} rpm, {row['reading']}{with_masses}"
