"""Acceleration of the base, with and without counter-masses."""

from math import nan
from typing import TYPE_CHECKING

from balance.quantities import G0

from ..motion.segments import moving
from ..pairing import Key, Pair
from ..reductions import Reduction, reduce
from ..runs.si_run import SIRun
from ..vibration import Measure, base_accelerations
from . import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..store import Run


def base_acceleration(with_run: "Run", without_run: "Run", measure: Measure | None = None) -> "Figure":
    """Acceleration of the base along each axis, as the reductions are taken of it: mean removed, band-limited.

    The grey band is what noise alone shows.
    """
    measure = measure or Measure()
    runs = SIRun.of(without_run), SIRun.of(with_run)
    found = [base_accelerations(run) for run in runs]
    columns = {(c.sensor, c.component): c for c in runs[1].rig.base_columns}
    fell = {(r.sensor, r.axis): r for r in reduce(_pair(with_run, without_run), measure)}
    with style.styled():
        figure, panels = style.grid(len(columns), 1, 1.7, sharex=True)
        for axes, (place, column) in zip(panels[:, 0], columns.items(), strict=True):
            shapes = [measure.shape(*signals[place]) / G0 for signals in found]
            times = [run.instants(column) for run in runs]
            style.two_runs(axes, (times[0], shapes[0]), (times[1], shapes[1]))
            axes.set_ylabel(f"{column.component} [g0]")
            axes.set_title(f"{place[0]}, {column.component} axis: {_said(fell[place])}")
            _noise(axes, fell[place])
        first, column = next(iter(columns.items()))
        strongest = max(found[0].values(), key=lambda signal: float(abs(measure.shape(*signal)).max()))
        span = moving(measure.shape(*strongest), strongest[1], margin_s=0.1)
        time = runs[0].instants(column)[span]
        panels[-1, 0].set_xlim(time[0], time[-1])
        panels[-1, 0].set_xlabel(f"time of the logger of {first[0]} [s]")
        style.legend(figure, panels[0, 0])
        style.title(figure, f"Acceleration of the base, band {measure.band or 'not limited'}", runs)
    return figure


def _pair(with_run: "Run", without_run: "Run") -> Pair:
    c = with_run.conditions
    key = Key(c.get("payload_kg", nan), c.get("motion", ""), c.get("peak_acceleration_g", nan), with_run.origin)
    return Pair(key, c.get("counter_masses", {}), (with_run,), (without_run,))


def _said(found: Reduction) -> str:
    """``peak-to-peak falls by 94.2 % [93.1, 95.0]``."""
    name = found.measure.metric.replace("_", "-")
    if found.percent is None:
        return "nothing moves above the noise"
    if found.at_least is not None:
        return f"{name} falls by at least {found.at_least:.1f} %"
    between = f" [{found.interval[0]:.1f}, {found.interval[1]:.1f}]" if found.interval else ""
    return f"{name} falls by {found.percent:.1f} %{between}"


def _noise(axes: "Axes", found: Reduction) -> None:
    """What the metric shows of noise alone, about zero."""
    floor = max((f for f in found.noise_floor if f is not None), default=0.0) / G0
    half = floor / 2.0 if found.measure.metric == "peak_to_peak" else floor
    axes.axhspan(-half, half, color="#999999", alpha=0.35, lw=0.0)
