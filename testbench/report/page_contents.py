"""What the page of a campaign draws: every channel of its rig with peaks kept, spectra, the mechanism along the log."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from balance.errors import CounterpoiseError
from balance.report.moving import designs_of, moving
from balance.report.page import inline_svg
from balance.report.plotted import PlottedChannel, PlottedRun, Spans, spans_for, spectrum
from balance.units import SI_UNITS

from .. import figures
from ..errors import AnalysisError
from ..figures.runs import HIGHEST, LOWEST
from ..figures.style import condition_of
from ..kinematics.encoder_motion import mechanism_of
from ..loads.command_tracking import BANDWIDTH_HZ
from ..recording import mounted_masses
from ..rig.sensors import Accelerometer, Encoder, Target, Torque, Trigger
from ..runs.aligned_run import AlignedRun
from ..runs.si_run import SIRun
from ..vibration.run_pairs import pairs

if TYPE_CHECKING:
    from markupsafe import Markup
    from matplotlib.figure import Figure

    from ..rig import Column
    from ..store import Run
    from ..vibration.channel_levels import ChannelLevels
    from ..vibration.comparison import Comparison

COMMAND, POSITIONS, TRIGGER = "Command", "Positions of the joints", "Trigger"
MOST_MOTIONS = 60
"""Motions of the mechanism on a page; of a campaign with more, those of the first conditions."""
KINDS: tuple[tuple[type, str], ...] = (
    (Accelerometer, "Acceleration of what moves"),
    (Torque, "Torque of the drives"),
    (Encoder, POSITIONS),
    (Target, COMMAND),
    (Trigger, TRIGGER),
)
"""Under which heading the channels of a kind of sensor are listed."""
BASE, SUPPORTS = "Acceleration of the base", "Forces between mechanism and base"


def spans_of(runs: "Sequence[Run]") -> int:
    """Spans of a curve such that all runs that have a rig fit on one page."""
    bound = (SIRun.of(run) for run in runs if run.rig)
    return spans_for([run.group(run.group_of(column)).samples for run in bound for _, column in columns_of(run)])


def plotted_run(run: SIRun, levels: "Sequence[ChannelLevels]", spans: int) -> PlottedRun:
    """A run with all channels that its rig names and the log holds, in SI; spectra are those of ``levels``."""
    spectra = []
    for level in levels:
        if level.spectrum is not None:
            frequency, power = level.spectrum.frequency, level.spectrum.power()
            used = (frequency >= LOWEST) & (frequency <= HIGHEST)
            name = f"{level.column.sensor} {level.column.component}"
            spectra.append(spectrum(BASE, name, "m/s²", frequency[used], power[used]))
    return PlottedRun(run.name, *run_label(run), tuple(_channels(run, spans)), tuple(spectra))


def run_label(run: "Run | SIRun") -> tuple[str, bool]:
    """How a run is called in a list, by what the run table states of it, and whether it has counter-masses."""
    masses = any(run.conditions.get("counter_masses", {}).values())
    mounted = [f"{'with' if masses else 'without'} counter-masses"] if "counter_masses" in run.conditions else []
    stated = [condition_of(run), *mounted] if condition_of(run) != run.name else mounted
    return ": ".join([run.name, *([", ".join(stated)] if stated else [])]), masses


def unit_of(run: SIRun, column: "Column") -> str:
    """SI unit of a channel as it is shown. Raises CounterpoiseError where its log's unit is of something else."""
    return SI_UNITS[run.dimension(column)].replace("^2", "²")


def columns_of(run: SIRun) -> "Iterator[tuple[str, Column]]":
    """The rig's channels that were recorded, the base's acceleration first, and what each is listed under."""
    base = {column.channel for column in run.rig.base_columns}
    supports = {c.channel for name, sensor in run.rig.supports.items() for c in sensor.columns(name)}
    found = []
    for column in filter(run.holds, run.rig.columns()):
        sensor = run.rig.sensors[column.sensor]
        kind = next((heading for of, heading in KINDS if isinstance(sensor, of)), SUPPORTS)
        found.append((BASE if column.channel in base else SUPPORTS if column.channel in supports else kind, column))
    yield from sorted(found, key=lambda one: (one[0] != BASE, one[0] != SUPPORTS))


def _channels(run: SIRun, spans: int) -> "Iterator[PlottedChannel]":
    """Each channel as its sensor gives it; one that cannot be read in SI is left out, for the findings say why."""
    clocks: dict[tuple[str, float], Spans | None] = {}
    for kind, column in columns_of(run):
        try:
            unit, clock = unit_of(run, column), (run.group_of(column), column.delay)
            if clock not in clocks:
                time = run.instants(column)
                clocks[clock] = Spans(time, spans) if np.isfinite(time).any() else None
            values = run.readings(column)
        except CounterpoiseError:
            continue
        if (drawn := clocks[clock]) is not None:
            yield drawn.plotted(kind, f"{column.sensor} {column.component}", unit, values)


def conditions_of(runs: "Sequence[Run]", names: Sequence[str]) -> list[dict[str, Any]]:
    """Of each condition a run without counter-masses and one with them, by their places among ``names``."""
    return [
        {"label": str(pair.key), "first": names.index(pair.unbalanced[0].name), "second": names.index(with_masses.name)}
        for pair in pairs(runs)[0]
        for with_masses in pair.balanced[:1]
        if {pair.unbalanced[0].name, with_masses.name} <= set(names)
    ]


def motions_of(runs: "Sequence[Run]", given: str | None) -> list[dict[str, Any]]:
    """The mechanism of each condition along the encoders of a run, with its counter-masses and without.

    A run whose encoders or mechanism do not allow it is left out; ``given`` is a mechanism in place of the rig's.
    """
    found, _ = pairs(runs)
    paired = {run.name for pair in found for run in pair.runs}
    shown = [(pair.balanced[0], str(pair.key)) for pair in found]
    shown += [(run, condition_of(run)) for run in runs if run.name not in paired]
    motions: list[dict[str, Any]] = []
    for run, condition in shown:
        if len(motions) == MOST_MOTIONS:
            break
        with suppress(CounterpoiseError):
            motions.append(_motion(SIRun.of(run), condition, given))
    return motions


def _motion(run: SIRun, condition: str, given: str | None) -> dict[str, Any]:
    bare, stated = mechanism_of(run, given), run.conditions
    masses = mounted_masses(stated, "counter_masses")
    trajectory = AlignedRun(run, bare).trajectory(BANDWIDTH_HZ)
    if not np.ptp(trajectory.q, axis=0).any():
        raise AnalysisError(f"{run.name}: nothing moves")
    designs = designs_of(bare.with_payload(stated.get("payloads", {}), stated.get("payload_kg")), masses)
    return moving(f"{condition}, encoders of {run.name}", trajectory, designs)


def reductions_svg(found: "Comparison") -> "Markup":
    """Reductions by payload, acceleration and axis, by every source."""
    name = "Reductions by payload, acceleration and axis, with intervals; the table below has the same numbers"
    return inline_svg(figures.reductions(found), name)


def strongest_condition(found: "Comparison", runs: "Sequence[Run]") -> "list[Callable[[], Markup | None]]":
    """What draws each figure of the condition whose base vibrates most without counter-masses; None of one that cannot
    be drawn.
    """
    row = max(found.rows, key=lambda row: row.analyzed.amplitudes[1])
    by_name = {run.name: run for run in runs}
    names, (count, _) = row.analyzed.runs, row.analyzed.n
    balanced, unbalanced = by_name[names[0]], by_name[names[count]]
    stated = [one.analyzed for one in found.rows if one.analyzed.runs == names]
    draws: dict[str, Callable[[], Figure]] = {
        "Acceleration of the base": partial(figures.base_acceleration, balanced, unbalanced, found.measure, stated),
        "Torques of the drives": partial(figures.motor_torques, balanced, unbalanced),
        "Spectrum of the base's acceleration without counter-masses": partial(figures.base_spectrum, unbalanced),
    }

    def drawn(name: str, draw: "Callable[[], Figure]") -> "Markup | None":
        try:
            return inline_svg(draw(), f"{name}, {row.analyzed.key}")
        except CounterpoiseError:
            return None

    return [partial(drawn, *one) for one in draws.items()]
