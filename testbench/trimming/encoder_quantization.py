"""What the encoders' resolution leaves open in what the base's vibration says: no block of a record shows it.

The readings r of an encoder move the columns, A(r) x = y, so that dx = -A^+ dA x: the gain of the least squares times
the readings of a wrench that changes by dw = w_q dq + w_v dv + w_a da with the driven coordinates. That sum is taken
from its end (adjoint): base and low-pass answer backwards in time as they do forwards, for M, C, K are symmetric, and
the tilt phi x g in a reading answers by the displacement under moments g x f. What remains is by how much each value
moves per reading, and so its covariance, for a reading is as good as q^2 / 12.
"""

from collections.abc import Sequence

import numpy as np

from balance.arrays import Floats
from balance.closure import Closure
from balance.motion import Samples

from ..kinematics.smoothing_and_derivatives import smoothed_derivatives
from ..rig import Column
from .vibration_regression import POSITION_BANDWIDTH, ShakenBase

DIFFERENCE = 1e-4
"""Of driven positions and speeds, for derivatives of the wrench [rad, rad/s, m, m/s]."""


def step_covariance(run: ShakenBase, encoders: Sequence[Column], gain: Floats, pi: Floats) -> Floats:
    """Of the conditions' values, (rank, rank) [kg2 m2], from what one run's encoders leave open.

    ``gain`` is what the values rise by per reading that counts, (n, channels, rank); ``pi`` the parameters found.
    """
    moves = per_reading(run, [column.component for column in encoders], gain, pi)
    variances = np.array([column.resolution**2 / 12.0 + column.noise**2 for column in encoders])
    return np.asarray(np.einsum("j,njk,njl->kl", variances, moves, moves))


def per_reading(run: ShakenBase, joints: Sequence[str], gain: Floats, pi: Floats) -> Floats:
    """What the values rise by per unit of each encoder's reading, (n, joints, rank) [kg m / rad or m]."""
    weight = backwards(run, gain)
    by_place, by_speed, by_rate = (np.einsum("nij,nik->njk", slope, weight) for slope in wrench_slopes(run, joints, pi))
    bandwidth, rate = POSITION_BANDWIDTH * run.cutoff, run.grid.rate
    flat = [smoothed_derivatives(b.reshape(len(b), -1), bandwidth, rate) for b in (by_place, by_speed, by_rate)]
    return np.asarray((flat[0].q - flat[1].v + flat[2].a).reshape(by_place.shape))


def backwards(run: ShakenBase, gain: Floats) -> Floats:
    """What the values rise by per wrench on the base, (n, 6, rank)."""
    whole = np.zeros((run.grid.count, *gain.shape[1:]))
    whole[run.used] = gain
    smooth = run.valid.low_pass(whole, run.cutoff)
    pushed = np.ascontiguousarray(np.einsum("nck,ci->nki", smooth, run.sensors.rows)[::-1])
    back = run.moved(pushed).acceleration
    if run.gravity.any():
        turned = np.cross(run.gravity, pushed[..., :3])
        back = back + run.moved(np.concatenate([np.zeros_like(turned), turned], axis=2)).displacement
    return np.moveaxis(back[::-1], 1, 2) * run.valid.kept[:, None, None]


def wrench_slopes(run: ShakenBase, joints: Sequence[str], pi: Floats) -> tuple[Floats, Floats, Floats]:
    """How the wrench on the base changes with position, speed, acceleration of driven joints, (n, 6, joints) each."""
    path, closure = run.path, Closure(run.model)
    places = [run.model.coordinate_index(joint) for joint in joints]
    start = [x[:, places] for x in (path.q, path.v, path.a)]

    def wrench(driven: Sequence[Floats]) -> Floats:
        moved = closure.follow(Samples(path.time, driven[0], driven[1], driven[2], tuple(joints)), near=path)
        return run.wrench_regressor(moved) @ pi

    still = wrench(start)

    def slope(order: int) -> Floats:
        changed = []
        for j in range(len(joints)):
            driven = [x.copy() for x in start]
            driven[order][:, j] += DIFFERENCE
            changed.append((wrench(driven) - still) / DIFFERENCE)
        return np.stack(changed, axis=2)

    return slope(0), slope(1), slope(2)
