"""What sensors would have shown on a base that stands still, as far as accelerometers on the base tell its motion.

A sensor row sees the base's accelerations x'' = (u'', phi'') as S x'', an accelerometer on the base as A x''. One
accelerometer does not tell the rotation. But whatever x'' is, the rows of P = I - [S; A] [S; A]^+ do not see it: with
one accelerometer of three axes these are the components along the line from it to the sensor, or, for the force on the
supports, to the mechanism's centre of mass. No property of the base is needed.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats
from balance.closure import Trajectory
from balance.dynamics.moving_base import displacement_at
from balance.mechanism import forward_kinematics
from balance.mechanism.mechanism import Mechanism
from balance.mechanism.sparse_components import dense

if TYPE_CHECKING:
    from ..rig import Column
    from ..runs.si_run import SIRun

NEAR = 1e-3
"""A lever at which the base's rotation does not matter [m]."""


@dataclass(frozen=True)
class BaseAcceleration:
    """What the accelerometers on the base recorded in one group."""

    group: str
    rows: Floats
    """What each channel sees of the base's accelerations, (k, 6)."""
    time: Floats
    """On the group's clock, (m,) [s]."""
    values: Floats
    """(m, k) [m/s2]"""
    columns: "tuple[Column, ...]"
    """The channels, (k,)."""


def recorded(run: "SIRun", group: str | None = None) -> BaseAcceleration | None:
    """The accelerometers on the base that a group holds; of any group, the one with most channels. None: no such."""
    found = [_in_group(run, g.name) for g in run.groups if group in {None, g.name}]
    return max((f for f in found if f is not None), key=lambda f: len(f.rows), default=None)


def _in_group(run: "SIRun", group: str) -> BaseAcceleration | None:
    columns = [
        (sensor.position, column)
        for name, sensor in run.rig.base_accelerometers.items()
        for column in sensor.columns(name)
        if run.holds(column, group)
    ]
    if not columns:
        return None
    rows = np.array([displacement_at(np.array(p))["xyz".index(c.component)] for p, c in columns])
    channels = tuple(c for _, c in columns)
    return BaseAcceleration(group, rows, run.instants(channels[0]), run.stacked(channels), channels)


def projector(rows: Floats, accelerometers: Floats) -> Floats:
    """The first k rows of P for k sensor rows (n, k, 6) and j accelerometer rows (j, 6), (n, k, k + j).

    Rotation that acts at a lever below NEAR is left in, so that P stays smooth where the line has no direction.
    """
    count, k, _ = rows.shape
    seen = np.concatenate([rows, np.broadcast_to(accelerometers, (count, *accelerometers.shape))], axis=1)
    inner = np.einsum("nij,nik->njk", seen, seen) + NEAR**2 * np.eye(6)
    whole = np.eye(seen.shape[1]) - np.einsum("nij,njk->nik", seen, np.linalg.solve(inner, seen.transpose(0, 2, 1)))
    return np.asarray(whole[:, :k])


def sensor_rows(mechanism: Mechanism, path: Trajectory, body: str, position: Floats, axes: Iterable[str]) -> Floats:
    """What an accelerometer on a moving body sees of the base's accelerations, axis by axis, (n, k, 6)."""
    at = forward_kinematics.pose(mechanism.tree, np.ascontiguousarray(path.q.T))
    joint = mechanism.tree.bodies[mechanism.body_index(body)]
    point = dense(at.point(joint, position), at.count).T
    units = [dense(at.arm(joint, np.eye(3)["xyz".index(axis)]), at.count).T for axis in axes]
    return np.stack([np.hstack([unit, np.cross(point, unit)]) for unit in units], axis=1)


def force_rows(mechanism: Mechanism, path: Trajectory) -> Floats:
    """What the force on the supports, per kilogram of the mechanism, sees of them: -(u'' + phi'' x c), (n, 3, 6)."""
    centre = mass_centre(mechanism, path)
    return np.stack(
        [-np.hstack([np.tile(unit, (len(centre), 1)), np.cross(centre, unit)]) for unit in np.eye(3)], axis=1
    )


def mass_centre(mechanism: Mechanism, path: Trajectory) -> Floats:
    """Centre of mass of all that moves, base frame, (n, 3) [m]."""
    at = forward_kinematics.pose(mechanism.tree, np.ascontiguousarray(path.q.T))
    moment = np.zeros((at.count, 3))
    for row, joint in zip(mechanism.parameters, mechanism.tree.bodies, strict=True):
        if row[0] > 0.0:
            moment += row[0] * dense(at.point(joint, row[1:4] / row[0]), at.count).T
    return moment / mechanism.total_mass
