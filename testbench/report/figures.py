"""Figures of a report: each run by itself, and runs with counter-masses beside those without."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from balance.errors import CounterpoiseError

from .. import figures
from ..motion.joint_motion import mechanism_of
from ..pairing import Pair, pairs
from ..runs.si_run import SIRun

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..store import Run


def draw(runs: "Sequence[Run]", folder: Path, mechanism: str | None, bandwidth_hz: float) -> list[Path]:
    """Write what can be drawn as SVG; what a rig lacks is not drawn, as the report says why."""
    written = []
    for run in runs:
        written += _one(folder / f"{run.name}-command.svg", partial(_command, run, mechanism, bandwidth_hz))
        written += _one(folder / f"{run.name}-spectrum.svg", partial(figures.base_spectrum, run))
    for pair in pairs(runs)[0]:
        for name, path in _names(pair, folder).items():
            written += _one(path, partial(getattr(figures, name), pair.balanced[0], pair.unbalanced[0]))
    return written


def _command(run: "Run", mechanism: str | None, bandwidth_hz: float) -> "Figure":
    return figures.command_performance(run, mechanism_of(SIRun.of(run), mechanism), bandwidth_hz)


def _names(pair: Pair, folder: Path) -> dict[str, Path]:
    both = f"{pair.balanced[0].name}-{pair.unbalanced[0].name}"
    ends = {"base_acceleration": "base", "motor_torques": "torques", "force_sensors": "forces"}
    return {name: folder / f"{both}-{end}.svg" for name, end in ends.items()}


def _one(path: Path, work: "Callable[[], Figure]") -> list[Path]:
    try:
        figure = work()
    except CounterpoiseError:
        return []
    figure.savefig(path)
    return [path]
