"""Spring files (``datasets/springs``): places for springs of zero free length, stiffnesses given or to be found."""

from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from .. import datasets
from ..errors import DataError
from ..input_files import Distinct, Quantity, Table, Text, in_file, load_model
from ..mechanism.mechanism import Mechanism
from .springs import End, Spring

Length = Annotated[float, Quantity("length")]


class EndTable(Table):
    """An end of a spring, such as ``{ body = 'base', at = ['0 m', '0.1 m', '0 m'] }``."""

    body: Text
    """Body that it is fixed in, or ``base``."""
    at: tuple[Length, Length, Length] = (0.0, 0.0, 0.0)
    """Place in the body's frame [m]."""

    def end(self, mechanism: Mechanism) -> End:
        """The end. Raises ModelError for a body that the mechanism does not have."""
        return End(-1 if self.body == "base" else mechanism.body_index(self.body), np.array(self.at))


class SpringTable(Table):
    """A spring of zero free length between two ends."""

    name: Text | None = None
    """Name of it."""
    first: EndTable
    """One end."""
    second: EndTable
    """The other end."""
    stiffness: Annotated[float, Quantity("stiffness", above=0.0)] | None = None
    """Stiffness, for all springs or for none: it is then found [N/m]."""


class SpringsTable(Table):
    """Springs that balance the weight of a mechanism."""

    spring: Annotated[list[SpringTable], Field(min_length=1), Distinct]
    """Springs."""

    def _check(self) -> None:
        given = [spring.stiffness is not None for spring in self.spring]
        if any(given) and not all(given):
            raise DataError(f"spring[{given.index(False)}] has no stiffness: give all or none")


def load_springs(name: str | Path, mechanism: Mechanism) -> tuple[list[Spring], bool]:
    """Springs of a file, and whether it gives their stiffnesses; otherwise they are 1 N/m, to be found.

    Raises DataError, naming the spring and key that is wrong.
    """
    path = datasets.find_dataset(name, "springs", ".toml")
    table = load_model(SpringsTable, path)
    springs = []
    for i, each in enumerate(table.spring):
        called = each.name or f"spring {i + 1}"
        with in_file(path.name, f"spring[{i}] ({called})"):
            springs.append(Spring(each.first.end(mechanism), each.second.end(mechanism), each.stiffness or 1.0, called))
    return springs, table.spring[0].stiffness is not None
