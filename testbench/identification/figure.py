"""Measured torque, and the torque that the identified model predicts for blocks it was not identified from."""

from typing import TYPE_CHECKING

import numpy as np

from balance.estimation.estimate import LEVEL_TEXT

from ..figures import style
from .cross_validation import BLOCKS
from .result import Identification, unit_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_RECORDED = "#bbbbbb"


def draw(result: Identification) -> "Figure":
    """A panel a joint: torque as recorded, low-passed, and predicted for each held-out block from all others.

    Without torques, the first moments.
    """
    if not result.joints:
        return _first_moments(result)
    equations, chosen = result.choice.equations, result.chosen
    time = np.arange(len(equations.time)) * equations.records[0].grid.step + equations.time[0]
    shown = (equations.torque(chosen.delay), equations.low_passed_torque(chosen.delay), result.choice.predicted_smooth)
    raw, smooth, predicted = (np.where(equations.valid > 0.0, values, np.nan) for values in shown)
    with style.styled():
        figure, panels = style.light_grid(len(result.joints), 1, 2.2, sharex=True)
        for j, (axes, joint) in enumerate(zip(panels[:, 0], result.joints, strict=True)):
            axes.plot(time, raw[:, j], color=_RECORDED, lw=0.7, label="as recorded")
            axes.plot(time, smooth[:, j], color=style.TARGET, label=f"below {chosen.cutoff:.3g} Hz")
            axes.plot(time, predicted[:, j], color=style.WITH, ls="--",
                      label="model, each block predicted from the others")  # fmt: skip
            for k in range(1, BLOCKS):
                axes.axvline(time[len(time) * k // BLOCKS], color="k", lw=0.4, alpha=0.3)
            axes.set_ylabel(f"torque of {joint} [{unit_of(result.mechanism, f'offset[{joint}]')}]")
            axes.set_title(
                f"unexplained: {result.rms_ratio_in_band[j]:.0%} below {chosen.cutoff:.3g} Hz, "
                f"{result.rms_ratio[j]:.0%} of the torque as recorded"
            )
        panels[-1, 0].set_xlabel("time [s]")
        style.headline(figure, _headline(result))
        style.legend(figure, panels[0, 0])
    return figure


def _headline(result: Identification) -> str:
    return f"{style.origin_prefix([result.origin])}{result.mechanism.name}, {', '.join(result.runs)}"


def _first_moments(result: Identification) -> "Figure":
    """The left-hand side of each balance condition with its interval, and that of the mechanism's file."""
    found = result.first_moments()
    with style.styled():
        figure, panels = style.light_grid(1, 1, 0.4 * len(found) + 0.8)
        axes, places = panels[0, 0], range(len(found))
        axes.hlines(places, *zip(*(one.interval for one in found), strict=True), color=style.WITH, lw=4, alpha=0.5)
        axes.plot([one.value for one in found], places, "o", color=style.WITH, label=f"identified, {LEVEL_TEXT}")
        axes.plot([one.in_file for one in found], places, "|", ms=16, color=style.TARGET, label="mechanism's file")
        axes.set(yticks=places, yticklabels=[one.name for one in found], xlabel="first moment [kg m]")
        axes.margins(y=0.2)
        style.headline(figure, _headline(result))
        style.legend(figure, axes)
    return figure
