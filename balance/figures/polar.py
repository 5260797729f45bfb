"""Polar diagrams of the shaking force of a slider-crank over one turn."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ..engines import partial, peak
from ..engines.slidercrank import SliderCrank

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = ("#555555", "#8d99ae", "#3b6ea5", "#2a9d8f", "#e07a3f", "#b5446e")


def draw_polar(crank: SliderCrank, counterweights: Mapping[str, float], omega: float) -> "Figure":
    """The exact force's tip over a turn for each counterweight m_b r_b [kg m], orders 1 and 2 dotted; omega [rad/s]."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 5.4), layout="constrained")
    axes = figure.add_subplot()
    theta = np.append(peak.turn(720), 0.0)
    for i, (name, weight) in enumerate(counterweights.items()):
        colour = COLOURS[i % len(COLOURS)]
        exact = partial.remaining(crank, weight, theta, omega)
        rough = partial.remaining(crank, weight, theta, omega, "order2")
        axes.plot(exact.imag, exact.real, color=colour, lw=1.8, label=name)
        axes.plot(rough.imag, rough.real, ":", color=colour, lw=1.0)
    axes.plot(0.0, 0.0, "+", color="#555555", ms=12)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("across the cylinder [N]")
    axes.set_ylabel("along the cylinder, away from the crank [N]")
    axes.set_title("Shaking force over a turn; dotted: orders 1 and 2")
    axes.legend(title="counterweight", fontsize=9)
    axes.grid(alpha=0.25)
    return figure
