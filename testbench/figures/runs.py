"""Figures of runs: motor torques, forces and base acceleration with and without counter-masses; command; spectrum."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from balance.mechanism.mechanism import Mechanism
from balance.mechanism.mjcf_parser import load_mechanism
from balance.units import SI_UNITS

from ..errors import AnalysisError
from ..kinematics.encoder_motion import moving_interval
from ..loads.command_tracking import BANDWIDTH_HZ
from ..loads.command_tracking import command_performance as performance
from ..rig import Column
from ..rig.sensors import Torque
from ..runs.aligned_run import AlignedRun
from ..runs.si_run import SIRun
from ..store import Run
from ..vibration.channel_levels import channel_levels
from ..vibration.metrics import DEFAULT_BAND, Measure, base_accelerations
from ..vibration.reduction import Reduction, reduction_of_pair, upper_bound
from ..vibration.run_pairs import ConditionKey, Pair
from . import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLUMNS = 3
"""Panels in a row, for x, y and z."""
LOWEST, HIGHEST = 1.0, 500.0
"""Frequencies of a spectrum [Hz]."""


_MOST_PANELS = 12
"""Panels of a picture of a whole run."""


def draw_run(run: Run) -> "Figure":
    """All channels of a run on their loggers' clocks, a panel for each unit of a logger, as recorded."""
    panels: dict[tuple[str, str], list[int]] = {}
    for group in run.groups:
        for index in group.measured:
            panels.setdefault((group.name, group.channels[index].unit or ""), []).append(index)
    shown = list(panels.items())[:_MOST_PANELS]
    with style.styled():
        figure, axes = style.light_grid(len(shown), 1, 1.5)
        for panel, ((name, unit), indices) in zip(axes[:, 0], shown, strict=True):
            group = run.group(name)
            time = run.time(name) if group.has_time else np.arange(group.samples, dtype=float)
            for index in indices:
                panel.plot(time, run.channel_at(name, index), lw=0.8, label=group.channels[index].label)
            panel.set(ylabel=f"{name}\n[{unit or 'no unit'}]", xlabel="time [s]" if group.has_time else "sample")
            panel.legend(loc="upper right", fontsize=6, ncols=2)
        more = f", {len(panels) - len(shown)} more panels not drawn" if len(panels) > len(shown) else ""
        style.figure_title(figure, f"Run {run.name}, as recorded{more}", [run])
    return figure


def motor_torques(with_run: Run, without_run: Run) -> "Figure":
    """Torque of each motor (of slides force) as its drive reports it, gravity included; AnalysisError without any."""
    runs = SIRun.of(without_run), SIRun.of(with_run)
    columns = runs[1].rig.columns_of(Torque)
    if not columns:
        raise AnalysisError(f"{with_run.name}: its rig has no sensor of kind torque")
    with style.styled():
        figure, panels = style.light_grid(len(columns), 1, 2.0, sharex=True)
        for axes, column in zip(panels[:, 0], columns, strict=True):
            unit = SI_UNITS[runs[1].dimension(column)]
            without, balanced = (f"{peak:.1f} {unit}" for peak in _draw(axes, column, runs))
            axes.set_ylabel(f"{'force' if unit == 'N' else 'torque'} [{unit}]")
            axes.set_title(f"{column.sensor}, joint {column.component}: peak {without} without, {balanced} with")
        _limit(panels[-1], columns, runs[0])
        style.legend(figure, panels[0, 0])
        style.figure_title(figure, f"Motor torques, band {DEFAULT_BAND}", runs)
    return figure


def force_sensors(with_run: Run, without_run: Run) -> "Figure":
    """Every force and moment between mechanism and base, band-limited. Raises AnalysisError without any."""
    runs = SIRun.of(without_run), SIRun.of(with_run)
    # Channels by row of panels: three components of a sensor, then sensors with one axis.
    sensors = [list(sensor.columns(name)) for name, sensor in runs[1].rig.supports.items()]
    several = [s for s in sensors if len(s) > 1]
    single = [column for s in sensors if len(s) == 1 for column in s]
    rows = [list(s[i : i + _COLUMNS]) for s in [*several, single] for i in range(0, len(s), _COLUMNS)]
    if not rows:
        raise AnalysisError(f"{with_run.name}: its rig has no force sensor between mechanism and base")
    with style.styled():
        figure, panels = style.light_grid(len(rows), _COLUMNS, 1.6, sharex=True)
        for row, columns in zip(panels, rows, strict=True):
            for axes, column in zip(row, columns, strict=False):
                _draw(axes, column, runs)
                axes.set_title(f"{column.sensor} {column.component} [{'N' if column.component[0] == 'F' else 'N m'}]")
            for axes in row[len(columns) :]:
                axes.set_visible(False)
        _limit(panels[-1], [column for columns in rows for column in columns], runs[0])
        style.legend(figure, panels[0, 0])
        style.figure_title(figure, f"Forces between mechanism and base, band {DEFAULT_BAND}", runs)
    return figure


def _draw(axes: "Axes", column: Column, runs: tuple[SIRun, SIRun]) -> list[float]:
    """Draw a channel of both runs, without counter-masses first, and return their peaks [SI]."""
    signals = [(run.even_instants(column), DEFAULT_BAND.filtered(*run.signal(column))) for run in runs]
    style.two_runs(axes, *signals)
    return [float(np.abs(values).max()) for _, values in signals]


def _limit(bottom: "Sequence[Axes]", columns: Sequence[Column], run: SIRun) -> None:
    """Limit the shared time axis to the motion, by the channel that moves most."""
    strongest = max(columns, key=lambda column: float(np.ptp(run.values(column))))
    span = moving_interval(*run.signal(strongest))
    time = run.even_instants(strongest)[span]
    bottom[0].set_xlim(time[0], time[-1])
    for axes in bottom:
        axes.set_xlabel("time of the logger [s]")


def command_performance(run: Run, mechanism: Mechanism | None = None, bandwidth_hz: float = BANDWIDTH_HZ) -> "Figure":
    """Acceleration of the platform by accelerometer, by encoders and as commanded, and the deviations from the command.

    ``mechanism`` turns joint angles into the platform's motion; by default the one that the rig names.
    """
    si = SIRun.of(run)
    shown = performance(AlignedRun(si, mechanism or load_mechanism(si.rig.mechanism)), bandwidth_hz)
    axes_moved = [axis for axis, values in shown.target.items() if np.ptp(values) > 0.0] or list(shown.target)
    with style.styled():
        figure, panels = style.light_grid(2 * len(axes_moved), 1, 1.9, sharex=True)
        for i, axis in enumerate(axes_moved):
            above, below = panels[2 * i, 0], panels[2 * i + 1, 0]
            lines = (
                (f"accelerometer, below {bandwidth_hz:g} Hz", shown.accelerometer[axis], style.ACCELEROMETER),
                (f"encoders, differentiated below {bandwidth_hz:g} Hz", shown.encoders[axis], style.ENCODERS),
            )
            for label, every, colour in lines:
                values = np.where(shown.valid, every, np.nan)
                above.plot(shown.time, values, color=colour, label=label)
                below.plot(shown.time, values - shown.target[axis], color=colour)
            target = np.where(shown.valid, shown.target[axis], np.nan)
            above.plot(shown.time, target, color=style.TARGET, lw=0.9, ls="--", label="target")
            above.set_ylabel(f"{axis} [m/s2]")
            below.set_ylabel(f"{axis} less target [m/s2]")
        span = moving_interval(shown.target[axes_moved[0]], 1.0 / float(shown.time[1] - shown.time[0]))
        panels[-1, 0].set_xlim(shown.time[span][0], shown.time[span][-1])
        panels[-1, 0].set_xlabel(
            f"time of the controller [s]; accelerometer shifted by {1e3 * shown.lag_s:.1f} ms, found by correlation"
        )
        style.legend(figure, panels[0, 0])
        style.figure_title(figure, "Acceleration command", [run])
    return figure


def base_spectrum(run: Run) -> "Figure":
    """Power spectral density of the base's acceleration along each axis, with its peaks."""
    si = SIRun.of(run)
    found = [(level, level.spectrum) for level in channel_levels(si, si.rig.base_columns)]
    shown = [(level, spectrum) for level, spectrum in found if spectrum is not None]
    if not shown:
        raise AnalysisError(f"{run.name}: no accelerometer on the base with a record long enough for a spectrum")
    with style.styled():
        figure, panels = style.light_grid(len(shown), 1, 1.7, sharex=True)
        for axes, (level, spectrum) in zip(panels[:, 0], shown, strict=True):
            inside = (spectrum.frequency >= LOWEST) & (spectrum.frequency <= HIGHEST)
            axes.loglog(spectrum.frequency[inside], spectrum.power()[inside], color=style.ANALYSED)
            for peak in level.peaks:
                at = peak["frequency_hz"], peak["density_si2_hz"]
                if LOWEST <= at[0] <= HIGHEST:
                    axes.plot(*at, "v", color=style.WITHOUT, ms=4.0)
                    axes.annotate(f"{at[0]:.1f}", at, fontsize=7)
            axes.set_ylabel(f"{level.column.component} [(m/s2)2/Hz]")
        panels[-1, 0].set_xlabel("frequency [Hz]")
        resolution = float(np.diff(shown[0][1].frequency[:2])[0])
        title = f"Spectrum of the base's acceleration, Welch, Hann window, {resolution:.3g} Hz apart"
        style.figure_title(figure, title, [run])
    return figure


def base_acceleration(
    with_run: Run, without_run: Run, measure: Measure | None = None, stated: Sequence[Reduction] = ()
) -> "Figure":
    """Acceleration of the base along each axis, filtered as for reductions; the grey band is that of noise alone.

    ``stated`` are reductions of the campaign to write above it, in place of those of the two runs by themselves.
    """
    measure = measure or Measure()
    runs = SIRun.of(without_run), SIRun.of(with_run)
    found = [base_accelerations(run) for run in runs]
    columns = {(c.sensor, c.component): c for c in runs[1].rig.base_columns}
    masses = with_run.conditions.get("counter_masses", {})
    pair = Pair(ConditionKey.of(with_run), masses, (with_run,), (without_run,))
    reductions = {(r.sensor, r.axis): r for r in stated or reduction_of_pair(pair, measure)}
    with style.styled():
        figure, panels = style.light_grid(len(columns), 1, 1.7, sharex=True)
        for axes, (place, column) in zip(panels[:, 0], columns.items(), strict=True):
            shapes = [measure.shape(*signals[place]) for signals in found]
            times = [run.even_instants(column) for run in runs]
            style.two_runs(axes, (times[0], shapes[0]), (times[1], shapes[1]))
            axes.set_ylabel(f"{column.component} [m/s2]")
            axes.set_title(f"{place[0]}, {column.component} axis: {_text(reductions[place])}")
            noise = max((floor for floor in reductions[place].noise_floor if floor is not None), default=0.0)
            half = noise / 2.0 if reductions[place].measure.metric == "peak_to_peak" else noise
            axes.axhspan(-half, half, color="#999999", alpha=0.35, lw=0.0)
        first, column = next(iter(columns.items()))
        strongest = max(found[0].values(), key=lambda signal: float(abs(measure.shape(*signal)).max()))
        span = moving_interval(measure.shape(*strongest), strongest[1], margin_s=0.1)
        time = runs[0].even_instants(column)[span]
        panels[-1, 0].set_xlim(time[0], time[-1])
        panels[-1, 0].set_xlabel(f"time of the logger of {first[0]} [s]")
        style.legend(figure, panels[0, 0])
        style.figure_title(figure, f"Acceleration of the base, band {measure.band or 'not limited'}", runs)
    return figure


def _text(found: Reduction) -> str:
    """``peak-to-peak reduced by 94.2 % [93.1, 95.0]``, or ``raised by``."""
    name = found.measure.metric.replace("_", "-")
    if found.percent is None:
        return "nothing moves above the noise"
    if found.hidden:
        return f"{name}: noise hides whether it fell or rose"
    if found.kind == "at_least":
        return f"{name} reduced by at least {found.at_least:.1f} %"
    if found.kind == "at_most":
        return f"{name} {upper_bound(found.percent)}"
    if found.kind == "withheld":
        return f"{name}: {found.text}, contradicted by {', '.join(found.doubts)}"
    word, sign = ("reduced", 1.0) if found.percent >= 0.0 else ("raised", -1.0)
    ends = sorted(sign * end for end in found.interval or ())
    between = f" [{ends[0]:.1f}, {ends[1]:.1f}]" if ends else ""
    return f"{name} {word} by {sign * found.percent:.1f} %{between}"
