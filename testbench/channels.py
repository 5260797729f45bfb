"""Channels of a stored run as the rig understands them: in SI, finite, with a rate."""

from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats
from balance.errors import UnitError

from . import units
from .errors import AnalysisError

if TYPE_CHECKING:
    from .rig import Column
    from .store import Run


def in_si(run: "Run", column: "Column") -> tuple[Floats, float]:
    """A channel (n,) [SI] and its rate [Hz]. In an acceleration, ``g`` is g0 = 9.81 m/s2.

    Raises AnalysisError if it has no unit, two different ones, no regular clock, or samples that are no number.
    """
    group, index = run.find(column.channel)
    factor = _factor(run.name, column, group.channels[index].unit)
    if group.rate_hz is None:
        raise AnalysisError(f"{run.name}: channel {column.channel!r} has no sampling rate: expected a regular clock")
    values = run.channel(column.channel)
    odd = np.flatnonzero(~np.isfinite(values))
    if odd.size:
        raise AnalysisError(
            f"{run.name}: channel {column.channel!r} holds no number at sample {odd[0]}; repair it first"
        )
    return values * factor, group.rate_hz


def instants(run: "Run", column: "Column") -> Floats:
    """Time of a channel's samples on its logger's clock, (n,) [s]."""
    return run.time(run.find(column.channel)[0].name)


def _factor(run: str, column: "Column", written: str | None) -> float:
    """SI per unit; the log's unit and the rig's must agree where both are given."""
    from .rig.fields import unit_factor

    where = f"{run}: channel {column.channel!r}"
    if written and column.unit and not units.same(written, column.unit):
        raise AnalysisError(f"{where} is in {written!r} by its log and in {column.unit!r} by the rig: correct one")
    unit = written or column.unit
    if not unit:
        raise AnalysisError(f"{where} has no unit, neither in its log nor in the rig: say sensors.{column.sensor}.unit")
    try:
        return unit_factor(unit, *column.dimensions)
    except UnitError as error:
        raise AnalysisError(f"{where}: {error}") from error
