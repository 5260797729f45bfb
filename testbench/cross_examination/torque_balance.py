"""Payload and scale of the torques, from the torques of all runs of a campaign together.

Of drive j in run r:  tau = s_j (model + p_r payload + sum c_r site) + k_j base + J_j a + b_j v + f_j sign(v) + o_jr.

Scale s, share k of the base's motion, drive inertia J and friction b, f are those of the campaign, payload p and
offset o those of the run. No stated payload is used: the masses of the links and the counter-masses, which the run
table states and in which a pair of runs differs, close the scale. Without them scale and payload are nearly confounded,
and the interval is wide. Gauss-Newton on products of columns; intervals by a jackknife over blocks of time.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats

from .observation import BLOCKS, DRIVE_TERMS, TorqueEquations

ROUNDS = 12
"""Of Gauss-Newton; from stated payloads five suffice."""
COMMON = ("model", "base", *DRIVE_TERMS[1:])
"""Columns whose factors are the campaign's; the factor of ``model`` is the scale."""


@dataclass(frozen=True)
class TorqueBalance:
    """What the torques of a campaign say."""

    runs: tuple[str, ...]
    payload: Floats
    """By run, (r,) [kg]."""
    deviation: Floats
    """Standard uncertainty of each, (r,) [kg]."""
    joints: tuple[str, ...]
    scale: Floats
    """Readings per torque, by joint, (j,) [-]."""
    scale_deviation: Floats
    residual: Floats
    """Share of the torques' variance that is not explained, by run, (r,) [-]."""


def torque_balance(
    equations: Mapping[str, TorqueEquations], payloads: Mapping[str, float], masses: Mapping[str, Mapping[str, float]]
) -> TorqueBalance:
    """Solve the runs of ``equations`` with counter-masses ``masses`` [kg] by run, starting at ``payloads`` [kg]."""
    runs = tuple(equations)
    joints = equations[runs[0]].joints
    system = _System([equations[r] for r in runs], [masses[r] for r in runs])
    start = np.array([payloads[r] for r in runs])
    whole = np.ones(BLOCKS, dtype=bool)
    payload, scale, residual = system.solve(whole, start, np.ones(len(joints)))
    without = [system.solve(np.arange(BLOCKS) != b, payload, scale) for b in range(BLOCKS)]
    return TorqueBalance(
        runs,
        payload,
        _jackknife(np.array([one[0] for one in without])),
        joints,
        scale,
        _jackknife(np.array([one[1] for one in without])),
        residual,
    )


def _jackknife(estimates: Floats) -> Floats:
    """Standard uncertainty from estimates (b, ...) that each leave out one block."""
    count = len(estimates)
    return np.sqrt((count - 1.0) / count * np.sum((estimates - estimates.mean(axis=0)) ** 2, axis=0))


class _System:
    """Normal equations of all runs, from products of columns."""

    def __init__(self, equations: Sequence[TorqueEquations], masses: Sequence[Mapping[str, float]]) -> None:
        self.names = equations[0].names
        self.products = np.stack([one.products for one in equations], axis=1)
        mean = self.products.sum(axis=0)
        count, torque, ones = self._at("offset"), self._at("torque"), self._at("offset")
        total = mean[:, :, count, count]
        self.power = mean[:, :, torque, torque] - mean[:, :, torque, ones] ** 2 / total
        self.products = self.products / self.power[None, :, :, None, None]
        self.mounted = np.zeros((len(equations), len(self.names)))
        self.mounted[:, self._at("model")] = 1.0
        for row, some in zip(self.mounted, masses, strict=True):
            for site, mass in some.items():
                row[self._at(site)] = mass

    def _at(self, name: str) -> int:
        return self.names.index(name)

    def solve(self, used: np.ndarray, payload: Floats, scale: Floats) -> tuple[Floats, Floats, Floats]:
        """Payloads (r,), scales (j,), unexplained shares (r,) from ``used`` blocks (b,)."""
        products = self.products[used].sum(axis=0)
        runs, joints, k = products.shape[:3]
        common = len(COMMON)
        payload, factors = payload.copy(), np.zeros((joints, common))
        factors[:, 0] = scale
        offset = np.zeros((runs, joints))
        size = joints * common + runs + runs * joints
        for _ in range(ROUNDS):
            normal, right, cost = np.zeros((size, size)), np.zeros(size), np.zeros(runs)
            for r in range(runs):
                for j in range(joints):
                    body = self.mounted[r].copy()
                    body[self._at("payload")] = payload[r]
                    columns, places = np.zeros((k, common + 2)), np.zeros(common + 2, dtype=int)
                    columns[:, 0] = body
                    for i, name in enumerate(COMMON[1:], 1):
                        columns[self._at(name), i] = 1.0
                    columns[self._at("payload"), common] = factors[j, 0]
                    columns[self._at("offset"), common + 1] = 1.0
                    places[:common] = np.arange(j * common, (j + 1) * common)
                    places[common], places[common + 1] = joints * common + r, joints * common + runs + r * joints + j
                    rest = -(columns[:, :common] @ factors[j])
                    rest[self._at("offset")] -= offset[r, j]
                    rest[self._at("torque")] += 1.0
                    gram = products[r, j]
                    normal[np.ix_(places, places)] += columns.T @ gram @ columns
                    right[places] += columns.T @ gram @ rest
                    cost[r] += rest @ gram @ rest / joints
            width = np.sqrt(np.maximum(np.diag(normal), 1e-300))
            step = np.linalg.lstsq(normal / np.outer(width, width), right / width, rcond=1e-12)[0] / width
            factors += step[: joints * common].reshape(joints, common)
            moved = step[joints * common : joints * common + runs]
            payload += moved
            offset += step[joints * common + runs :].reshape(runs, joints)
            if np.abs(moved).max() < 1e-6 * max(float(np.abs(payload).max()), 1.0):
                break
        return payload, factors[:, 0], cost
