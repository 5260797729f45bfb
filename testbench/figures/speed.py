"""Speed of a crank from encoder edges: over a turn and over time, measured and computed."""

from typing import TYPE_CHECKING, Any

import numpy as np

from . import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def draw_speed(document: dict[str, Any]) -> "Figure":
    """The steady turn with its interval, the speed edge by edge, and the model beside both where it was asked for."""
    parts = [name for name in ("steady", "course") if document.get(name)]
    with style.styled():
        figure, panels = style.grid(1, max(len(parts), 1), 3.4)
        for axes, part in zip(panels[0], parts, strict=False):
            {"steady": _turn, "course": _course}[part](axes, document)
        style.headline(figure, f"{document['log']}: speed of the crank (origin {document['origin']})")
    return figure


def _turn(axes: "Axes", document: dict[str, Any]) -> None:
    turn, model = document["steady"]["turn"], document.get("model")
    angle, speed, half = (np.array(turn[key]) for key in ("angle_deg_from_first_edge", "speed_rpm", "half_width_rpm"))
    axes.plot(angle, speed, color=style.ANALYSED, label="from edges")
    axes.fill_between(angle, speed - half, speed + half, color=style.ANALYSED, alpha=0.25, lw=0, label="95 %")
    if model:
        course = model["turn"]
        axes.plot(course["angle_deg_from_first_edge"], course["speed_rpm"], "--", color=style.PUBLISHED,
                  label=f"computed, {model['reading']}")  # fmt: skip
    axes.set(xlabel="angle from the first edge [deg]", ylabel="rev/min", title="Steady turn", xticks=range(0, 361, 90))
    axes.legend()


def _course(axes: "Axes", document: dict[str, Any]) -> None:
    course, start = document["course"], document.get("start_up")
    axes.plot(course["time_s"], course["speed_rpm"], ".", ms=2, color=style.ANALYSED, label="from edges")
    if start:
        axes.plot(start["time_s"], start["speed_rpm"], color=style.PUBLISHED, lw=0.8, label="computed start")
        axes.legend()
    axes.set(xlabel="time [s]", ylabel="rev/min", title="Edge by edge")
