"""Order plots: free forces and moments of an engine by orders, and over a turn before and after balancing."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..engines.left import STAGES, OverATurn
from ..engines.orders import Free, Turning
from ..engines.slidercrank import Complexes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORWARD, BACKWARD = "#3b6ea5", "#e07a3f"
_HEADROOM = 1.35
"""Of the largest value, so that the legend lies on nothing."""
_COLOURS = {"before": "#555555", "counterweights": "#3b6ea5", "shafts": "#e07a3f"}


def draw_orders(
    free: Sequence[Free], title: str, factor: float, units: tuple[str, str], left: OverATurn | None = None
) -> "Figure":
    """Bars of the forward and backward parts of force and moment; ``factor`` times the values per omega^2.

    Below them, where ``left`` is given, what is left of both over a turn.
    """
    from matplotlib.figure import Figure

    rows = 1 if left is None else 2
    units = (units[0].replace("omega^2", "ω²"), units[1].replace("omega^2", "ω²"))
    figure = Figure(figsize=(8.4, 3.8 * rows), layout="constrained")
    panels = figure.subplots(rows, 2, squeeze=False)
    _bars(panels[0, 0], [f.force for f in free], factor, f"force [{units[0]}]")
    _bars(panels[0, 1], [f.moment for f in free], factor, f"moment [{units[1]}]")
    if left is not None:
        forces = {stage: each.force for stage, each in left.stages.items()}
        moments = {stage: each.moment for stage, each in left.stages.items()}
        _turn(panels[1, 0], left, forces, f"size of the force [{units[0]}]")
        _turn(panels[1, 1], left, moments, f"size of the moment [{units[1]}]")
    figure.suptitle(title)
    return figure


def _turn(axes: Any, left: OverATurn, values: Mapping[str, Complexes], label: str) -> None:  # noqa: ANN401
    """Size of a vector over a turn, by stage; a later stage is drawn dashed on what it leaves as it was."""
    for k, (stage, vectors) in enumerate(values.items()):
        line = ("-", "--", ":")[k]
        axes.plot(np.degrees(left.theta), np.abs(vectors), line, color=_COLOURS[stage], label=STAGES[stage], lw=1.6)
    largest = max(float(np.abs(vectors).max()) for vectors in values.values())
    axes.set(xlabel="crank angle [deg]", ylabel=label, xticks=range(0, 361, 90))
    axes.set_ylim(0.0, _HEADROOM * largest or 1.0)
    axes.legend(fontsize=8)
    axes.grid(alpha=0.25)


def _bars(axes: Any, parts: Sequence[Turning], factor: float, label: str) -> None:  # noqa: ANN401
    orders = [part.order for part in parts]
    forward = [factor * abs(part.forward) for part in parts]
    backward = [factor * abs(part.backward) for part in parts]
    axes.bar(orders, forward, color=FORWARD, label="turning with the crankshaft")
    axes.bar(orders, backward, bottom=forward, color=BACKWARD, label="turning against it")
    axes.set_xticks(orders)
    axes.set_xlabel("order")
    axes.set_ylabel(label)
    axes.set_ylim(0.0, _HEADROOM * max(map(sum, zip(forward, backward, strict=True)), default=0.0) or 1.0)
    if not any([*forward, *backward]):
        axes.annotate("none", (0.5, 0.5), xycoords="axes fraction", ha="center")
    axes.legend(fontsize=8)
    axes.grid(alpha=0.25, axis="y")
