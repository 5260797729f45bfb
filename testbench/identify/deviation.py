"""How far a mechanism with given parameters would depart from its recorded motion, were it driven by the torques.

The recorded motion q_m is simulated anew: M(q) q'' + h(q, q') = tau, with a weak pull back to it of natural frequency
w and damping z, M (w^2 (q_m - q) + 2 z w (q_m' - q')). To first order in the deviation e = q - q_m that is a linear
equation with time-varying coefficients,

    M e'' + (C + 2 z w M) e' + (K + w^2 M) e = tau - W pi,    C = d(W pi)/dv, K = d(W pi)/dq,

linear in pi as well. Above w the recorded accelerations drop out: e'' takes back what noise they carry. So q_m + e is a
motion that torque and model make, fit for instruments, and e is the output error (compare Gautier, Janot, Vandanjon,
IEEE Trans. Control Syst. Technol. 21, 2013, whose pull is the machine's own controller).
"""

from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats
from balance.mechanism import Mechanism

from ..motion.derivatives import Rates
from .equations import model_torque, path_of
from .evidence import Part

DAMPING = 0.7
"""Of the pull."""
_STEP = 1e-5
"""Of differences [rad, m, and their rates]."""


@dataclass(frozen=True)
class Deviation:
    """The linear equation of one record's deviation, about its motion and some parameters."""

    inertia: Floats
    """M, (samples, joints, joints)."""
    damping: Floats
    """C, alike."""
    stiffness: Floats
    """K, alike."""
    step: float
    """Between samples [s]."""

    @classmethod
    def of(cls, part: Part, mechanism: Mechanism, parameters: Floats) -> "Deviation":
        """About the motion of a record; ``parameters`` over all of them, (p,).

        Dry friction is taken as a function of the recorded speed: its jump has no slope.
        """
        smooth = np.where([name.startswith("coulomb[") for name in part.names], 0.0, parameters)
        inertia, damping, stiffness = (_slope(part, mechanism, smooth, k) for k in (2, 1, 0))
        return cls(inertia, damping, stiffness, part.record.grid.step)

    @property
    def least_pull_hz(self) -> float:
        """Frequency of the pull that holds the mechanism nine tenths of the time, where its weight would topple it."""
        lowest = np.linalg.eigvals(np.linalg.solve(self.inertia, self.stiffness)).real.min(axis=1)
        return float(np.sqrt(max(-np.percentile(lowest, 10.0), 0.0)) / (2.0 * np.pi))

    def simulate(self, load: Floats, pull_hz: float) -> Rates:
        """Deviations (samples, joints, k) and their rates for the right-hand sides ``load`` (samples, joints, k).

        From rest, by the trapezoidal rule. ``pull_hz`` is the frequency of the pull [Hz].
        """
        w = 2.0 * np.pi * pull_hz
        joints, count = load.shape[1], load.shape[2]
        inverse = np.linalg.inv(self.inertia)
        system = np.zeros((len(load), 2 * joints, 2 * joints))
        system[:, :joints, joints:] = np.eye(joints)
        system[:, joints:, :joints] = -inverse @ self.stiffness - w * w * np.eye(joints)
        system[:, joints:, joints:] = -inverse @ self.damping - 2.0 * DAMPING * w * np.eye(joints)
        pushed = np.zeros((len(load), 2 * joints, count))
        pushed[:, joints:] = inverse @ load
        state = _integrated(system, pushed, self.step)
        rates = system @ state + pushed
        return Rates(state[:, :joints], state[:, joints:], rates[:, joints:])


def _slope(part: Part, mechanism: Mechanism, parameters: Floats, of: int) -> Floats:
    """d(W pi)/d(q, v or a) by central differences, (samples, joints, joints)."""
    joints = part.record.torque.shape[1]
    known = np.zeros_like(parameters)
    known[: len(part.record.mounted)] = part.record.mounted
    columns = []
    for unit in np.eye(joints):
        ends = [_moved(part.motion, of, sign * _STEP * unit) for sign in (1.0, -1.0)]
        high, low = (
            model_torque(mechanism, end, path_of(part.record, mechanism, end, part.path), parameters + known)
            for end in ends
        )
        columns.append((high - low) / (2.0 * _STEP))
    return np.stack(columns, axis=2)


def _moved(motion: Rates, of: int, change: Floats) -> Rates:
    values = [motion.q, motion.v, motion.a]
    values[of] = values[of] + change
    return Rates(*values)


def _integrated(system: Floats, pushed: Floats, step: float) -> Floats:
    """x' = A x + b from x = 0: (1 - h A1 / 2) x1 = (1 + h A0 / 2) x0 + h (b0 + b1) / 2."""
    unit = np.eye(system.shape[1])
    inverse = np.linalg.inv(unit - 0.5 * step * system[1:])
    carried = inverse @ (unit + 0.5 * step * system[:-1])
    added = 0.5 * step * inverse @ (pushed[1:] + pushed[:-1])
    state = np.zeros_like(pushed)
    for i in range(len(carried)):
        state[i + 1] = carried[i] @ state[i] + added[i]
    return state
