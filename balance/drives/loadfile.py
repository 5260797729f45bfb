"""The tables [[load]] of a drive file."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import DataError
from ..mechanism import Mechanism
from . import fields, tablefile
from .loads import KINDS, Load


def read(table: Mapping[str, Any], mechanism: Mechanism, crank: str) -> Load:
    """The load that a table describes; without ``joint`` it acts on the crank. Raises DataError, naming the key."""
    kind = fields.one_of(fields.required(table, "kind"), tuple(KINDS), "load.kind")
    joint = mechanism.coordinate_index(str(table.get("joint", crank)))
    turns = mechanism.tree.joints[joint].revolute
    key, dimension = ("torque", "moment") if turns else ("force", "force")
    extra = {"at_speed"} if kind in {"viscous", "quadratic"} else {"angle", "file"} if kind == "table" else set()
    name = str(table.get("name", kind))
    try:
        fields.refuse_unknown(table, {"name", "kind", "joint", key, *extra})
        if kind == "table":
            return Load(name, kind, joint, 0.0, _curve(table, key, dimension))
        value = fields.quantity(table, key, dimension)
        if kind != "constant" and not value >= 0.0:
            raise DataError(f"{key} is {table[key]!r}: expected zero or more, it opposes the motion")
        return Load(name, kind, joint, value / _per_speed(table, kind, turns))
    except DataError as error:
        raise DataError(f"load {name!r}: {error}") from error


def _per_speed(table: Mapping[str, Any], kind: str, turns: bool) -> float:
    """What the force at ``at_speed`` is divided by: the speed or its square."""
    power = {"viscous": 1, "quadratic": 2}.get(kind, 0)
    if not power:
        return 1.0
    text = fields.text(table, "at_speed")
    speed = fields.speed(text, "at_speed") if turns else fields.quantity(table, "at_speed", "velocity")
    if not speed > 0.0:
        raise DataError(f"at_speed is {text!r}: expected one above zero")
    return speed**power


def _curve(table: Mapping[str, Any], key: str, dimension: str) -> Any:  # noqa: ANN401
    """Force over the crank's angle, periodic, a monotone cubic between the points."""
    from scipy.interpolate import PchipInterpolator

    angles, forces = _points(table, key, dimension)
    turn = 2.0 * np.pi
    if (
        len(angles) == len(forces) > 1
        and abs(angles[-1] - turn) < 1e-9
        and angles[0] == 0.0
        and forces[-1] == forces[0]
    ):
        angles, forces = angles[:-1], forces[:-1]
    if len(angles) != len(forces) or len(angles) < 3 or not (np.diff(angles) > 0.0).all():
        raise DataError(f"angle has {len(angles)}, {key} {len(forces)} values: expected as many, angles increasing")
    if not (angles[0] >= 0.0 and angles[-1] < turn - 1e-9):
        span = f"{np.degrees(angles[0]):.6g} to {np.degrees(angles[-1]):.6g} deg"
        raise DataError(
            f"angle goes from {span}: expected one turn, from 0 deg to less than 360 deg, or to 360 deg with the value "
            "of 0 deg"
        )
    ends = slice(-2, None), slice(0, 2)
    return PchipInterpolator(
        np.r_[angles[ends[0]] - turn, angles, angles[ends[1]] + turn], np.r_[forces[ends[0]], forces, forces[ends[1]]]
    )


def _points(table: Mapping[str, Any], key: str, dimension: str) -> tuple[Any, Any]:
    """Angles and forces, from the lists or from the file, in SI."""
    if "file" in table:
        if both := [name for name in ("angle", key) if name in table]:
            raise DataError(f"gives both file and {both[0]}: one of them")
        angles, forces = tablefile.read(Path(fields.text(table, "file")), key, dimension)
    else:
        angles, forces = fields.quantities(table, "angle", "angle"), fields.quantities(table, key, dimension)
    return np.array(angles), np.array(forces)
