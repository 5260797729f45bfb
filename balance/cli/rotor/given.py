"""Options of ``balance rotor``: quantities and places, read at the edge."""

from collections.abc import Callable
from typing import Any, TypeVar

import click

from ...errors import UnitError

F = TypeVar("F", bound=Callable[..., Any])


class Quantity(click.ParamType[float]):
    """A text with a unit, in SI."""

    def __init__(self, *dimensions: str, positive: bool = False) -> None:
        self.dimensions, self.positive = dimensions, positive
        self.name = " or ".join(dimensions)

    def convert(self, value: str | float, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Read the text; a wrong one fails as a wrong command line."""
        if not isinstance(value, str):
            return value
        from ...quantities import dimension_of, parse

        try:
            found = parse(value, dimension_of(value, *self.dimensions))
        except UnitError as error:
            self.fail(str(error), param, ctx)
        if self.positive and not found > 0.0:
            self.fail(f"{value!r}: expected more than zero", param, ctx)
        return found


class Place(click.ParamType[tuple[str, float]]):
    """``NAME=Z`` with a unit, such as ``left=0mm``, as (name, place in m)."""

    name = "name=place"

    def convert(
        self, value: str | tuple[str, float], param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, float]:
        """Read the text; a wrong one fails as a wrong command line."""
        if isinstance(value, tuple):
            return value
        name, separator, text = value.partition("=")
        if not separator or not name.strip():
            self.fail(f"{value!r}: expected NAME=PLACE, such as left=0mm", param, ctx)
        return name.strip(), Quantity("length").convert(text, param, ctx)


speed_option = click.option(
    "--speed", type=Quantity("angular velocity", positive=True), metavar="SPEED", help="Speed, such as 3000rpm."
)
