"""Which calibrations a command applied: said by every command that computes physical values."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from ..calibration.stored import CalibrationInForce
    from ..runs.si_run import SIRun
    from ..store import Run


def in_force(runs: "Iterable[Run | SIRun]") -> "list[CalibrationInForce]":
    """The calibrations in force in runs; none where the logs are in physical units already, or there is no rig."""
    from ..runs.si_run import SIRun, calibrations_in_force

    bound = (run if isinstance(run, SIRun) else run.rig and SIRun.of(run) for run in runs)
    return calibrations_in_force(run for run in bound if run)


def document(runs: "Iterable[Run | SIRun]") -> list[dict[str, Any]]:
    """The same, for ``--json``."""
    return [found.as_dict() for found in in_force(runs)]


def say(runs: "Iterable[Run | SIRun]") -> None:
    """A line for each calibration, with the runs in which it is in force."""
    say_each(in_force(runs))


def say_each(found: "Sequence[CalibrationInForce]") -> None:
    """The same of calibrations that are known."""
    for one in found:
        runs = ", ".join(one.runs[:4]) + (f" and {len(one.runs) - 4} more" if len(one.runs) > 4 else "")
        click.echo(f"Calibrated {one}, in {runs}.")
