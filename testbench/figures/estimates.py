"""Figures of estimates: torques and what the identified model predicts of them; what is missing on each arm."""

from typing import TYPE_CHECKING

import numpy as np

from balance.estimation.estimate import LEVEL_TEXT
from balance.estimation.first_moment_imbalance import MissingMass
from balance.results import counted, first_of

from ..identification.cross_validation import BLOCKS
from ..identification.result import Identification, unit_of
from ..trimming.result import Trim
from . import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_RECORDED = "#bbbbbb"


def draw_identification(result: Identification) -> "Figure":
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


_COLOURS = {
    "wrench": style.WITH, "torque": style.ENCODERS, "vibration": style.ACCELEROMETER, "trials": style.ACCELEROMETER,
}  # fmt: skip


def draw_trim(result: Trim) -> "Figure":
    """A panel a site: first moments [kg m] with their intervals, the plates as an arrow from before to after."""
    with style.styled():
        figure, panels = style.light_grid(1, len(result.missing), 3.0, sharey=True)
        for k, axes in enumerate(panels[0]):
            before, after = result.missing[k], result.remaining()[k]
            shown: list[tuple[str, MissingMass, str]] = [
                (s.source, s.missing[k], _COLOURS[s.source]) for s in result.shares
            ]
            if len(result.shares) > 1:
                shown.append(("all", before, style.TARGET))
            shown.append(("with the changes" if result.removal else "with what is added", after, style.WITHOUT))
            for place, (_, one, colour) in enumerate(shown):
                (low, high), value = one.interval, one.first_moment.value
                axes.errorbar(place, value, [[value - low], [high - value]], fmt="o", capsize=5, color=colour)
            slant = {"rotation": 30, "ha": "right"} if len(shown) > 2 else {}
            axes.set_xticks(range(len(shown)), [name for name, *_ in shown], **slant)
            axes.set_xlim(-0.6, len(shown) - 0.4)
            axes.axhline(0.0, color="k", lw=0.8)
            added = next((c for c in result.addition.counter_masses if c.site == before.site), None)
            change = result.changes.get(before.site, 0.0)
            plates = f"add {change:.3f} kg" if change > 0.0 else "add nothing"
            if change < 0.0:
                plates = f"take off {-change:.3f} kg"
            if added is not None and added.plates:
                plates += f"\n({counted(added.plates)})"
            axes.set_title(f"{before.site}: {plates}")
        panels[0, 0].set_ylabel("missing first moment [kg m]")
        level = f"intervals{'' if result.interval_level else ', not'} of {LEVEL_TEXT}"
        style.headline(
            figure,
            f"{style.origin_prefix([result.origin])}{result.mechanism.name}, {first_of(result.runs, 4)}\n"
            f"{level}; residual predicted {result.predicted_residual:.4f} kg m",
        )
    return figure
