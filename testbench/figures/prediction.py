"""Predicted with intervals against printed, by payload, motion and axis; baselines beside."""

from typing import TYPE_CHECKING, Any

import numpy as np

from balance.arrays import Floats
from balance.quantities import G0

from ..publication.baselines import BASELINES
from ..publication.cases import AXES
from ..publication.forecast import Forecast
from . import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PREDICTED: dict[str, Any] = {"marker": "o", "color": style.ANALYSED, "ms": 5.0, "ls": "none"}
_PRINTED: dict[str, Any] = {"marker": "D", "color": style.PUBLISHED, "ms": 5.5, "mfc": "none", "ls": "none"}
_BASELINES = ((style.WITHOUT, "--"), (style.ENCODERS, "-."), (style.ACCELEROMETER, ":"))


def prediction(forecast: Forecast) -> "Figure":
    """A row of panels for each payload and motion, a panel an axis."""
    asked = forecast.asked
    lines = [(p, m) for p in asked.payloads for m in dict.fromkeys(asked.motion.tolist())]
    beside = {name: baseline(forecast.known, asked) for name, baseline in BASELINES.items()}
    with style.styled():
        figure, panels = style.grid(len(lines), len(AXES), 1.9, sharey=True, sharex=True)
        for line, (payload, motion) in zip(panels, lines, strict=True):
            for panel, axis in zip(line, AXES, strict=True):
                at = (asked.payload_kg == payload) & (asked.motion == motion) & (asked.axis == axis)
                _panel(panel, forecast, at, beside)
                panel.set_title(f"{payload:g} kg, motion {motion}, along {axis}")
            line[0].set_ylabel("falls by [%]")
        for panel in panels[-1]:
            panel.set_xlabel("peak acceleration [g0]")
        style.legend(figure, panels[0, 0])
        model, *others = forecast.scores
        rivals = ", ".join(f"{s.name} {s.held_out:.1f}" for s in others if s.name in BASELINES)
        style.headline(
            figure,
            f"Printed reductions of base acceleration, predicted from those of {forecast.known.payloads[0]:g} kg\n"
            f"mean absolute error {model.held_out:.1f} points; {rivals}",
        )
    return figure


def _panel(panel: "Axes", forecast: Forecast, at: Floats, beside: dict[str, Floats]) -> None:
    x = forecast.asked.peak_acceleration[at] / G0
    order = np.argsort(x)
    low, high = forecast.interval[at][order].T
    panel.fill_between(x[order], low, high, color=style.ANALYSED, alpha=0.15, lw=0, label="95 % for a printed number")
    panel.plot(x, forecast.predicted[at], label="predicted", **_PREDICTED)
    panel.plot(x, forecast.asked.printed[at], label="printed", **_PRINTED)
    for (name, values), (color, dashes) in zip(beside.items(), _BASELINES, strict=True):
        panel.plot(x[order], values[at][order], color=color, ls=dashes, lw=1.0, label=name)
    panel.set_ylim(0.0, 100.0)
