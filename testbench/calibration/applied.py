"""Channels of a stored run in SI, by the calibration that holds. What does not fit is refused, and nothing guessed."""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats
from balance.errors import UnitError

from .. import units
from ..errors import AnalysisError
from . import amounts
from .document import Calibration
from .holding import of_column
from .law import Law, bind

if TYPE_CHECKING:
    from ..rig import Column
    from ..store import Run


def readings(run: "Run", column: "Column") -> Floats:
    """A channel (n,) [SI], by the calibration of its sensor. Raises AnalysisError if its unit is missing or wrong."""
    holding = of_column(run, column)
    if holding is None:
        return run.channel(column.channel) * _factor(run, column)
    law = _law(run, column, holding.calibration)
    return law.component(column.index, lambda i: run.channel(column.siblings[i].channel))


def loads(run: "Run", column: "Column") -> Floats:
    """What the sensor carries along a component (n,) [SI]: its readings, with the rig's crosstalk taken out."""
    if column.crosstalk is None or crosses(run, column):
        return readings(run, column)
    every = np.stack([readings(run, sibling) for sibling in column.siblings])
    return np.asarray(np.linalg.solve(np.array(column.crosstalk), every)[column.index])


def crosses(run: "Run", column: "Column") -> bool:
    """Whether the calibration that holds has a matrix, which takes the place of the rig's crosstalk."""
    holding = of_column(run, column)
    return holding is not None and holding.calibration.matrix is not None


def dimension(run: "Run", column: "Column") -> str:
    """What a channel measures, of all that it may: an encoder an angle or a length, by its unit."""
    for found in column.dimensions[:-1]:
        narrow = replace(column, dimensions=(found,))
        try:
            holding = of_column(run, column)
            if holding is None:
                _factor(run, narrow)
            else:
                _law(run, replace(narrow, siblings=(narrow,)), holding.calibration)
        except AnalysisError:
            continue
        return found
    return column.dimensions[-1]


def check(column: "Column", calibration: Calibration, written: Callable[[str], str | None]) -> Law:
    """The law of a sensor, where ``written`` gives the unit that the log writes for a channel.

    Raises UnitError where a unit is missing, contradicts the rig or does not lead to what the sensor measures.
    """
    return bind(calibration, column.siblings, [raw_unit(c, calibration, written(c.channel)) for c in column.siblings])


def raw_unit(column: "Column", calibration: Calibration, written: str | None) -> str:
    """The unit of a channel: of the log, the calibration or the rig, which must not contradict each other."""
    rig = column.unit if column.stated else None
    stated = {"its log": written, "the calibration": calibration.unit, "the rig": rig}
    given = [(who, unit) for who, unit in stated.items() if unit]
    for who, unit in given[1:]:
        if not units.same(given[0][1], unit):
            found = f"{given[0][1]!r} by {given[0][0]} and in {unit!r} by {who}"
            raise UnitError(f"channel {column.channel!r} is in {found}: correct one")
    if given:
        return given[0][1]
    if (
        column.unit
        and calibration.sensitivity is None
        and calibration.polynomial is None
        and calibration.matrix is None
    ):
        return column.unit  # an offset alone leaves the usual unit of the kind
    raise UnitError(
        f"channel {column.channel!r} has no unit, neither in its log nor in the rig: say sensors.{column.sensor}.unit, "
        "or the unit of the calibration"
    )


def _law(run: "Run", column: "Column", calibration: Calibration) -> Law:
    try:
        return check(column, calibration, lambda channel: written_unit(run, channel))
    except UnitError as error:
        raise AnalysisError(f"{run.name}: sensor {column.sensor}: {error}") from error


def written_unit(run: "Run", channel: str) -> str | None:
    """The unit that the log of a run writes for a channel; None where it writes none."""
    group, index = run.find(channel)
    return group.channels[index].unit


def _factor(run: "Run", column: "Column") -> float:
    """SI per unit without a calibration; the log's unit and the rig's must agree where both are given."""
    from ..rig.fields import unit_factor

    where, written = f"{run.name}: channel {column.channel!r}", written_unit(run, column.channel)
    if written and column.unit and column.stated and not units.same(written, column.unit):
        raise AnalysisError(f"{where} is in {written!r} by its log and in {column.unit!r} by the rig: correct one")
    unit = written or column.unit
    if not unit:
        raise AnalysisError(f"{where} has no unit, neither in its log nor in the rig: say sensors.{column.sensor}.unit")
    try:
        return unit_factor(unit, *column.dimensions)
    except UnitError as error:
        hint = ""
        if amounts.is_electrical(unit):
            hint = f": calibrate it: testbench calibrate {run.path} {column.sensor} --sensitivity ... --reason ..."
        raise AnalysisError(f"{where}: {error}{hint}") from error
