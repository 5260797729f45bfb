"""Which calibrations a command applied: said by every command that computes physical values."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from ..calibration.holding import Holding
    from ..rig import Rig
    from ..store import Run


def held(runs: "Iterable[Run]", rig: "Rig | None" = None) -> "list[Holding]":
    """The calibrations that hold in runs; none where the logs are in physical units already."""
    from ..calibration.holding import of_runs

    return of_runs(runs, rig)


def document(runs: "Iterable[Run]", rig: "Rig | None" = None) -> list[dict[str, Any]]:
    """The same, for ``--json``."""
    return [holding.as_dict() for holding in held(runs, rig)]


def say(holdings: "Sequence[Holding]") -> None:
    """A line for each calibration, with the runs in which it holds."""
    for holding in holdings:
        runs = ", ".join(holding.runs[:4]) + (f" and {len(holding.runs) - 4} more" if len(holding.runs) > 4 else "")
        click.echo(f"Calibrated {holding}, in {runs}.")
