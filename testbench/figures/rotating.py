"""Figures of rotating machines: order vectors as polar diagrams, the speed of a crank over a turn and over time."""

from typing import TYPE_CHECKING, Any

import numpy as np

from balance.estimation.estimate import LEVEL_TEXT
from balance.figures import panels

from . import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..rotating.order_tracking import Vectors

_HEADROOM = 1.2
_UNITS = {"length": ("m", "m"), "velocity": ("m_s", "m/s"), "acceleration": ("m_s2", "m/s²")}
"""Ends of the keys and units by what a sensor reads."""
_COLOURS = (style.ANALYSED, style.WITHOUT, style.ENCODERS, style.ACCELEROMETER, style.SIMULATED, style.PUBLISHED)


def draw_vectors(found: "Vectors") -> "Figure":
    """A diagram for each quantity that sensors read.

    A shaded field is amplitude and phase within their intervals; a disc is a vector within its scatter.
    """
    document = found.document()
    rows = document["vectors"]
    kinds = [kind for kind in _UNITS if any(row["reading"] == kind for row in rows)]
    with style.styled():
        polar = {"projection": "polar"}
        figure, (drawn,) = panels(5.2 * len(kinds), 5.4, 1, len(kinds), grid=False, subplot_kw=polar)
        for axes, kind in zip(drawn, kinds, strict=True):
            _panel(axes, [row for row in rows if row["reading"] == kind], kind, document)
        style.headline(
            figure, f"{document['run']}: order {document['order']} at {document['given_at_rpm']:.5g} rev/min\n"
            f"(origin {document['origin']}; phase as {document['phase']} of the pulse; shaded: {LEVEL_TEXT})",
        )  # fmt: skip
    return figure


def _panel(axes: Any, rows: list[dict[str, Any]], kind: str, document: dict[str, Any]) -> None:  # noqa: ANN401
    key, unit = _UNITS[kind]
    reach = 0.0
    for row, colour in zip(rows, _COLOURS * len(rows), strict=False):
        size, within = row[f"amplitude_{key}"], row[f"amplitude_{key}_within"]
        angle, about = np.radians(row["phase_deg"]), np.radians(row["phase_deg_within"])
        low = max(0.0, size - within) if row["told"] else 0.0
        axes.bar(angle, size + within - low, 2.0 * about, low, color=colour, alpha=0.3, lw=0)
        axes.plot([angle, angle], [0.0, size], "-o", color=colour, ms=4, markevery=[1], label=row["sensor"])
        reach = max(reach, size + within)
    axes.set_rlim(0.0, _HEADROOM * reach)
    axes.set_title(f"{kind}, {document['amplitude'].replace('_', ' ')} [{unit}]")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, -0.2), ncols=min(len(rows), 4))


def draw_speed(document: dict[str, Any]) -> "Figure":
    """The steady turn with its interval, and the speed edge by edge; with the computed ones where there is a model."""
    drawn = {"steady": _turn, "course": _course}
    parts = [name for name in drawn if document.get(name)]
    with style.styled():
        figure, panels = style.light_grid(1, max(len(parts), 1), 3.4)
        for axes, part in zip(panels[0], parts, strict=False):
            drawn[part](axes, document)
        style.headline(figure, f"{document['log']}: speed of the crank (origin {document['origin']})")
    return figure


def _turn(axes: "Axes", document: dict[str, Any]) -> None:
    turn, model = document["steady"]["turn"], document.get("model")
    angle, speed, half = (np.array(turn[key]) for key in ("angle_deg_from_first_edge", "speed_rpm", "half_width_rpm"))
    axes.plot(angle, speed, color=style.ANALYSED, label="from edges")
    axes.fill_between(angle, speed - half, speed + half, color=style.ANALYSED, alpha=0.25, lw=0, label=LEVEL_TEXT)
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
