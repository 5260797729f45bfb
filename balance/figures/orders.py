"""Order plots: free forces and moments of an engine by orders of its crankshaft's speed."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ..engines.orders import Free, Turning

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORWARD, BACKWARD = "#3b6ea5", "#e07a3f"


def draw_orders(free: Sequence[Free], title: str, factor: float, units: tuple[str, str]) -> "Figure":
    """Bars of the forward and backward parts of force and moment; ``factor`` times the values per omega^2."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.4, 3.8), layout="constrained")
    forces, moments = figure.subplots(1, 2)
    _bars(forces, [f.force for f in free], factor, f"force [{units[0]}]")
    _bars(moments, [f.moment for f in free], factor, f"moment [{units[1]}]")
    figure.suptitle(title)
    return figure


def _bars(axes: Any, parts: Sequence[Turning], factor: float, label: str) -> None:  # noqa: ANN401
    orders = [part.order for part in parts]
    forward = [factor * abs(part.forward) for part in parts]
    backward = [factor * abs(part.backward) for part in parts]
    axes.bar(orders, forward, color=FORWARD, label="turning with the crankshaft")
    axes.bar(orders, backward, bottom=forward, color=BACKWARD, label="turning against it")
    axes.set_xticks(orders)
    axes.set_xlabel("order")
    axes.set_ylabel(label)
    if not any([*forward, *backward]):
        axes.set_ylim(0.0, 1.0)
        axes.annotate("none", (0.5, 0.5), xycoords="axes fraction", ha="center")
    axes.legend(fontsize=8)
    axes.grid(alpha=0.25, axis="y")
