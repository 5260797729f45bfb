"""Held-out stretches simulated forward: torque in, angles out, beside the angles that were recorded.

Torque error favours least squares, which minimizes it; how far a simulation strays does not. A window is a held-out
stretch, or its first WINDOW_S; it starts from the recorded state and is left alone. Open chains only.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats, Indices
from balance.dynamics.forward_dynamics import Inverse, refuse_loops, simulate_forward
from balance.dynamics.joint_friction import TERMS, joint_terms
from balance.dynamics.regressor import torque_regressor
from balance.errors import ModelError
from balance.mechanism import Mechanism

from .choice import FOLDS, STRETCHES
from .evidence import Evidence, Part

WINDOW_S = 1.0
"""Longest window [s]."""


@dataclass(frozen=True)
class Strayed:
    """How far simulated angles strayed from recorded ones, of each window and joint."""

    rms: Floats
    """(windows, joints) [rad, m]"""
    seconds: float
    """Length of a window [s]."""

    def document(self, joints: tuple[str, ...]) -> Mapping[str, object]:
        """Median over the windows, which one that topples over does not decide, and rms, of each joint."""
        return {
            "windows": len(self.rms),
            "window_s": self.seconds,
            "median": dict(zip(joints, np.median(self.rms, axis=0).tolist(), strict=True)),
            "rms": dict(zip(joints, np.sqrt(np.mean(self.rms**2, axis=0)).tolist(), strict=True)),
        }

    @property
    def whole(self) -> float:
        """Rms over windows and joints [rad, m]."""
        return float(np.sqrt(np.mean(self.rms**2)))


def strayed(
    evidence: Evidence, mechanism: Mechanism, pivots: tuple[int, ...], parameters: Sequence[Floats], delay: float
) -> list[Strayed]:
    """Windows of all records, once for each of ``parameters``, base values (FOLDS, r) of the fold a window is in.

    Windows that a gap touches are left out. Raises ModelError for mechanisms with loops, and where no window is left.
    """
    refuse_loops(mechanism)
    count = len(evidence.time)
    stretch = np.arange(count) * STRETCHES // count
    rms: list[Floats] = []
    first = 0
    for part in evidence.parts:
        inside = slice(first, first + len(part.inside(part.moving)))
        first = inside.stop
        rms.append(_windows(part, mechanism, pivots, parameters, delay, stretch[inside]))
    if not sum(one.shape[1] for one in rms):
        raise ModelError("gaps touch every held-out stretch: there is none to simulate")
    step = evidence.parts[0].record.grid.step
    seconds = min(_length(int(n), step) for n in np.bincount(stretch)) * step
    return [Strayed(found, seconds) for found in np.concatenate(rms, axis=1)]


def _length(samples: int, step: float) -> int:
    """An even number of steps that fit into so many samples."""
    return min(samples - 1, int(WINDOW_S / step)) // 2 * 2


def _windows(
    part: Part,
    mechanism: Mechanism,
    pivots: tuple[int, ...],
    parameters: Sequence[Floats],
    delay: float,
    stretch: Indices,
) -> Floats:
    """How far each window of a record strays with each of the parameters, (sets, windows, joints)."""
    labels, firsts, sizes = np.unique(stretch, return_index=True, return_counts=True)
    count = _length(int(sizes.min()), part.record.grid.step) + 1
    whole = part.inside(part.sound)[firsts[:, None] + np.arange(count), 0].all(axis=1)
    labels, firsts = labels[whole], firsts[whole]
    place = firsts[:, None] + np.arange(count)
    joints = part.record.torque.shape[1]
    torque = part.inside(part.late(part.record.measured, delay))[place][:, :, :joints]
    full = np.zeros((len(parameters), len(labels), len(part.names)))
    full[:, :, list(pivots)] = np.array(parameters)[:, labels % FOLDS]
    full[:, :, : len(part.record.mounted)] += part.record.mounted
    inverse = _inverse(mechanism, full.reshape(-1, len(part.names)))
    q, v = (np.tile(part.inside(x)[firsts], (len(parameters), 1)) for x in (part.motion.q, part.motion.v))
    with np.errstate(over="ignore", invalid="ignore"):
        found = simulate_forward(inverse, q, v, np.tile(torque, (len(parameters), 1, 1)), part.record.grid.step)
    away = found.reshape(len(parameters), len(labels), -1, joints) - part.inside(part.record.q)[place[:, ::2]]
    bounded = np.minimum(np.abs(np.nan_to_num(away, nan=np.pi)), np.pi)
    return np.asarray(np.sqrt(np.mean(bounded**2, axis=2)))


def _inverse(mechanism: Mechanism, parameters: Floats) -> Inverse:
    """Torques of states, each with its own parameters (n, p), of which those of bodies and joints count."""
    inertial = len(mechanism.pi)
    own = len(TERMS) * len(mechanism.driven)

    def torque(q: Floats, v: Floats, a: Floats) -> Floats:
        terms, _ = joint_terms(mechanism.driven, v, a)
        columns = np.concatenate([torque_regressor(mechanism, q, v, a), terms], axis=2)
        return np.einsum("njp,np->nj", columns, parameters[:, : inertial + own])

    return torque
