"""Torques of the motors and forces between mechanism and base, with and without counter-masses."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..errors import AnalysisError
from ..motion.segments import moving
from ..rig import Column
from ..rig.sensors import Torque
from ..runs.si_run import SIRun
from ..vibration import DEFAULT_BAND
from . import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..store import Run

_ACROSS = 3
"""Panels side by side: one for each of x, y, z."""


def motor_torques(with_run: "Run", without_run: "Run") -> "Figure":
    """Torque of each motor as its drive reports it, gravity included; band-limited."""
    runs = SIRun.of(without_run), SIRun.of(with_run)
    columns = runs[1].rig.columns_of(Torque)
    if not columns:
        raise AnalysisError(f"{with_run.name}: its rig has no sensor of kind torque")
    with style.styled():
        figure, panels = style.grid(len(columns), 1, 2.0, sharex=True)
        for axes, column in zip(panels[:, 0], columns, strict=True):
            peaks = _draw(axes, column, runs)
            axes.set_ylabel("torque [N m]")
            axes.set_title(
                f"{column.sensor}, joint {column.component}: peak {peaks[0]:.1f} N m without, {peaks[1]:.1f} N m with"
            )
        _limit(panels[-1], columns, runs[0])
        style.legend(figure, panels[0, 0])
        style.title(figure, f"Motor torques, band {DEFAULT_BAND}", runs)
    return figure


def force_sensors(with_run: "Run", without_run: "Run") -> "Figure":
    """Every force and moment between mechanism and base, band-limited; a sensor's components side by side."""
    runs = SIRun.of(without_run), SIRun.of(with_run)
    rows = _rows([list(sensor.columns(name)) for name, sensor in runs[1].rig.supports.items()])
    if not rows:
        raise AnalysisError(f"{with_run.name}: its rig has no force sensor between mechanism and base")
    with style.styled():
        figure, panels = style.grid(len(rows), _ACROSS, 1.6, sharex=True)
        for row, columns in zip(panels, rows, strict=True):
            for axes, column in zip(row, columns, strict=False):
                _draw(axes, column, runs)
                axes.set_title(f"{column.sensor} {column.component} [{'N' if column.component[0] == 'F' else 'N m'}]")
            for axes in row[len(columns) :]:
                axes.set_visible(False)
        _limit(panels[-1], [column for columns in rows for column in columns], runs[0])
        style.legend(figure, panels[0, 0])
        style.title(figure, f"Forces between mechanism and base, band {DEFAULT_BAND}", runs)
    return figure


def _draw(axes: "Axes", column: Column, runs: tuple[SIRun, SIRun]) -> list[float]:
    """Draw a channel of both runs, the one without counter-masses first; their peaks [SI]."""
    signals = [(run.instants(column), DEFAULT_BAND.of(*run.signal(column))) for run in runs]
    style.two_runs(axes, *signals)
    return [float(np.abs(values).max()) for _, values in signals]


def _limit(bottom: "Sequence[Axes]", columns: Sequence[Column], run: SIRun) -> None:
    """Show the part in which something moves, by the channel that moves most; panels share their axis of time."""
    strongest = max(columns, key=lambda column: float(np.ptp(run.values(column))))
    span = moving(*run.signal(strongest))
    time = run.instants(strongest)[span]
    bottom[0].set_xlim(time[0], time[-1])
    for axes in bottom:
        axes.set_xlabel("time of the logger [s]")


def _rows(sensors: Sequence[Sequence[Column]]) -> list[list[Column]]:
    """Panels by row: three components of a sensor a row, the sensors with one axis together."""
    several = [s for s in sensors if len(s) > 1]
    single = [column for s in sensors if len(s) == 1 for column in s]
    return [list(s[i : i + _ACROSS]) for s in [*several, single] for i in range(0, len(s), _ACROSS)]
