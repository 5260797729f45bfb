"""One style for all figures: colours that colour-blind eyes distinguish, units on axes, origin in the title."""

from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any

from balance.arrays import Floats
from balance.figures import panels

from ..recording import payload_text, peak_text
from ..runs.si_run import SIRun
from ..store import Run

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WITHOUT, WITH = "#d55e00", "#0072b2"
TARGET, ENCODERS, ACCELEROMETER = "#000000", "#009e73", "#cc79a7"
PUBLISHED, SIMULATED, ANALYSED = "#000000", "#56b4e9", "#0072b2"
WIDTH = 9.0
"""Width of a figure with up to three panels in a row [inch]."""
_RC: Any = {
    "font.size": 9.5,
    "axes.titlesize": 10.0,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.25,
    "lines.linewidth": 1.2,
    "legend.frameon": False,
    "figure.titlesize": 11.0,
    "svg.hashsalt": "counterpoise",
}


def styled() -> "AbstractContextManager[None]":
    """The style, as a context."""
    from matplotlib import rc_context

    return rc_context(_RC)


def light_grid(rows: int, columns: int, height: float, **shared: Any) -> "tuple[Figure, Any]":  # noqa: ANN401
    """A figure and its axes (rows, columns), each row ``height`` inch high."""
    return panels(WIDTH * max(1.0, columns / 3), height * rows + 1.0, rows, columns, grid=False, **shared)


def figure_title(figure: "Figure", text: str, runs: Sequence[Run | SIRun]) -> None:
    """Title of a figure: what it shows, in which condition, and that it is simulated where it is."""
    headline(figure, f"{origin_of(runs)}{text}\n{condition_of(runs[0])}")


def headline(figure: "Figure", text: str) -> None:
    """Draw a title above a figure, at its left."""
    figure.suptitle(text, x=0.01, ha="left", fontweight="bold")


def origin_of(runs: Sequence[Run | SIRun]) -> str:
    """``Simulated: `` and the like as a prefix; empty for measured runs."""
    return origin_prefix(run.origin for run in runs)


def origin_prefix(origins: Iterable[str]) -> str:
    """The same by the origins of runs."""
    known = sorted({str(origin) for origin in origins})
    words = {"simulated": "Simulated", "unstated": "Origin unstated", "measured": "Measured"}
    return "" if known == ["measured"] else " and ".join(words[origin] for origin in known) + ": "


def condition_of(run: Run | SIRun) -> str:
    """Payload, motion and acceleration of a run in words; its name where none is known."""
    stated = run.conditions
    texts = {"payload": payload_text(stated), "motion": stated.get("motion"), "peak": peak_text(stated)}
    return ", ".join(f"{name} {text}" for name, text in texts.items() if text) or run.name


def two_runs(axes: "Axes", without: tuple[Floats, Floats], balanced: tuple[Floats, Floats]) -> None:
    """Draw time (n,) [s] and values (n,) [unit of the axis] of a run without counter-masses, and of one with."""
    axes.plot(*without, color=WITHOUT, label="without counter-masses")
    axes.plot(*balanced, color=WITH, label="with counter-masses")


def legend(figure: "Figure", axes: "Axes") -> None:
    """One legend for all axes, below them."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(handles))
