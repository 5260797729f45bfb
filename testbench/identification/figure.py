"""Measured torque, and the torque that the identified model predicts for blocks it was not identified from."""

from typing import TYPE_CHECKING

import numpy as np

from ..figures import style
from .cross_validation import BLOCKS
from .result import Identification, unit_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_RECORDED = "#bbbbbb"
_ORIGIN = {"measured": "", "simulated": "Simulated: ", "unstated": "Origin unstated: "}


def draw(result: Identification) -> "Figure":
    """A panel a joint: torque as recorded, low-passed, and predicted for each held-out block from all others."""
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
        style.headline(figure, f"{_ORIGIN[result.origin]}{result.mechanism.name}, {', '.join(result.runs)}")
        style.legend(figure, panels[0, 0])
    return figure
