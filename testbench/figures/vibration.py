"""Acceleration of the base, with and without counter-masses."""

from typing import TYPE_CHECKING

from balance.quantities import G0

from ..channels import instants
from ..pairing import rig_of
from ..reductions import percent
from ..segments import moving
from ..vibration import Measure, base_accelerations
from . import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..store import Run


def base_acceleration(with_run: "Run", without_run: "Run", measure: Measure | None = None) -> "Figure":
    """Acceleration of the base along each axis, as the reductions are taken of it: mean removed, band-limited."""
    measure = measure or Measure()
    runs = (without_run, with_run)
    found = [base_accelerations(run, rig_of(run)) for run in runs]
    columns = {
        (c.sensor, c.component): c for n, s in rig_of(with_run).base_accelerometers.items() for c in s.columns(n)
    }
    with style.styled():
        figure, panels = style.grid(len(columns), 1, 1.7, sharex=True)
        for axes, (place, column) in zip(panels[:, 0], columns.items(), strict=True):
            shapes = [measure.shape(*signals[place]) / G0 for signals in found]
            times = [instants(run, column) for run in runs]
            style.two_runs(axes, (times[0], shapes[0]), (times[1], shapes[1]))
            axes.set_ylabel(f"{column.component} [g0]")
            fell = percent(*([measure.of(*signals[place])] for signals in reversed(found)))
            said = "nothing moves" if fell is None else f"{measure.metric.replace('_', '-')} falls by {fell:.1f} %"
            axes.set_title(f"{place[0]}, {column.component} axis: {said}")
        first, column = next(iter(columns.items()))
        strongest = max(found[0].values(), key=lambda signal: float(abs(measure.shape(*signal)).max()))
        span = moving(measure.shape(*strongest), strongest[1], margin_s=0.1)
        time = instants(without_run, column)[span]
        panels[-1, 0].set_xlim(time[0], time[-1])
        panels[-1, 0].set_xlabel(f"time of the logger of {first[0]} [s]")
        style.legend(figure, panels[0, 0])
        style.title(figure, f"Acceleration of the base, band {measure.band or 'not limited'}", runs)
    return figure
