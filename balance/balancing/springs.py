"""Springs of zero free length: force in proportion to length, energy k |a - b|^2 / 2, linear in the stiffness k.

A spring file (``datasets/springs``) has their places in the bodies' frames, and stiffnesses unless these are sought.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from .. import datasets
from ..arrays import Floats
from ..errors import DataError
from ..input_files import Distinct, Quantity, Table, Text, in_file, load_model
from ..mechanism.forward_kinematics import Pose, point_jacobian, poses
from ..mechanism.mechanism import Mechanism


@dataclass(frozen=True)
class End:
    """An end of a spring, fixed in a body or in the base."""

    body: int
    """Index of the body, -1 for the base."""
    position: Floats
    """In the frame of the body's joint, (3,) [m]."""

    def joint(self, mechanism: Mechanism) -> int:
        """Elementary joint whose frame it is fixed in, -1 for the base."""
        return -1 if self.body < 0 else mechanism.tree.bodies[self.body]

    def place(self, mechanism: Mechanism) -> Floats:
        """In the body's frame as in the file, (3,) [m]."""
        return self.position if self.body < 0 else mechanism.in_file(mechanism.bodies[self.body], self.position)

    def text(self, mechanism: Mechanism) -> str:
        """The place for people, in the body's frame as in the file."""
        where = "base" if self.body < 0 else mechanism.bodies[self.body]
        x, y, z = self.place(mechanism) + 0.0  # -0 is 0
        return f"{where} ({x:.4g}, {y:.4g}{'' if z == 0 else f', {z:.4g}'})"


@dataclass(frozen=True)
class Spring:
    """A spring of zero free length between two ends."""

    first: End
    second: End
    stiffness: float = 1.0
    """[N/m]"""
    name: str = ""

    def gap(self, mechanism: Mechanism, at: Pose) -> Floats:
        """From the second end to the first, base axes, (n, 3) [m]."""
        first, second = (at.point(end.joint(mechanism), end.position) for end in (self.first, self.second))
        return first - second


def spring_lengths(mechanism: Mechanism, springs: Sequence[Spring], q: Floats) -> Floats:
    """Lengths at (n, nv) states, (n, springs) [m]."""
    return np.sqrt(2.0 * unit_energies(mechanism, springs, q))


def unit_energies(mechanism: Mechanism, springs: Sequence[Spring], q: Floats) -> Floats:
    """Energies per stiffness, |a - b|^2 / 2, at (n, nv) states, (n, springs) [m2]."""
    at = poses(mechanism.tree, q)
    energies = [0.5 * (spring.gap(mechanism, at) ** 2).sum(axis=1) for spring in springs]
    return np.array(energies).reshape(len(springs), len(q)).T


def spring_energy(mechanism: Mechanism, springs: Sequence[Spring], q: Floats) -> Floats:
    """Energy of all springs at (n, nv) states, (n,) [J]."""
    return unit_energies(mechanism, springs, q) @ np.array([spring.stiffness for spring in springs])


def joint_torques(mechanism: Mechanism, springs: Sequence[Spring], q: Floats) -> Floats:
    """Torque that motors of the open tree's joints need against the springs, (n, nv) [N m, N]: dV/dq."""
    tree, at = mechanism.tree, poses(mechanism.tree, q)
    total = np.zeros((len(q), tree.size))
    for spring in springs:
        first, second = (
            point_jacobian(tree, at, end.joint(mechanism), end.position) for end in (spring.first, spring.second)
        )
        total += spring.stiffness * np.einsum("ni,nij->nj", spring.gap(mechanism, at), first - second)
    return total


Length = Annotated[float, Quantity("length")]


class EndTable(Table):
    """An end of a spring, such as ``{ body = 'base', at = ['0 m', '0.1 m', '0 m'] }``."""

    body: Text
    """Body that it is fixed in, or ``base``."""
    at: tuple[Length, Length, Length] = (0.0, 0.0, 0.0)
    """Place in the body's frame, as in the mechanism's file [m]."""

    def end(self, mechanism: Mechanism) -> End:
        """The end. Raises ModelError for a body that the mechanism does not have."""
        if self.body == "base":
            return End(-1, np.array(self.at))
        return End(mechanism.body_index(self.body), mechanism.anchor(self.body, np.array(self.at)).position)


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
