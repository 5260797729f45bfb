"""Records of arms with known parameters: a smooth motion, its exact torques, then what sensors make of them."""

from pathlib import Path

import numpy as np

from balance.closure import Closure
from balance.dynamics.regressor import driven_torque_regressor, joint_friction_regressor
from balance.mechanism.mechanism import Mechanism
from balance.motion import Samples
from testbench import public_recordings
from testbench.identification import JointRecord
from testbench.kinematics.smoothing_and_derivatives import Grid

RATE = 200.0
SECONDS = 6.0
QUANTUM = 25.0 / 2**16
"""Step of the encoders of the real arms [rad]."""
TERMS = {"coulomb": 0.12, "viscous": 0.01, "offset": 0.02, "armature": 0.004}
SWING = (2.0, 1.2)
"""Largest amplitude [rad] and frequency [Hz] of a joint's motion."""


def record(
    mechanism: Mechanism,
    seed: int = 0,
    noise: float = 0.05,
    delay: float = 0.0,
    rate: float = RATE,
    swing: tuple[float, float] = SWING,
    beyond: np.ndarray | float = 0.0,
) -> JointRecord:
    """A simulated record: torques with noise [N m], logged ``delay`` [s] after the motion; encoders with steps.

    ``beyond`` are inertial parameters (10 nb,) that are mounted on the mechanism.
    """
    rng = np.random.default_rng(seed)
    grid = Grid(0.0, 1.0 / rate, int(SECONDS * rate))
    home = [mechanism.home[mechanism.coordinate_index(joint)] for joint in mechanism.driven]
    waves = _waves(rng, len(mechanism.driven), *swing)
    torque = _torque(mechanism, home, waves, grid.time - delay, beyond) + noise * rng.normal(
        size=(grid.count, len(home))
    )
    q = _motion(home, waves, grid.time)[0]
    return JointRecord(f"arm {seed}", "simulated", grid, np.rint(q / QUANTUM) * QUANTUM, torque)


def truth(mechanism: Mechanism) -> np.ndarray:
    """The parameters that the torques of ``record`` were made with."""
    return np.concatenate([mechanism.pi, np.tile(list(TERMS.values()), len(mechanism.driven))])


def real(name: str) -> Path:
    """A real recording, for tests that are marked ``recordings``."""
    return public_recordings.local_recording(name) or public_recordings.fetch(public_recordings.recording_named(name))


def _waves(rng: np.random.Generator, joints: int, size: float, highest: float) -> np.ndarray:
    """Amplitude [rad], circular frequency [rad/s] and phase of four sines for each joint, (3, joints, 4)."""
    omega = 2 * np.pi * rng.uniform(0.2 * highest, highest, (joints, 4))
    return np.array([size * rng.uniform(0.1, 0.4, (joints, 4)), omega, rng.uniform(0, 2 * np.pi, (joints, 4))])


def _motion(home: list[float], waves: np.ndarray, time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    size, omega, phase = waves
    angle = omega * time[:, None, None] + phase
    q, v, a = size * np.sin(angle), size * omega * np.cos(angle), -size * omega**2 * np.sin(angle)
    return np.asarray(home) + q.sum(axis=2), v.sum(axis=2), a.sum(axis=2)


def _torque(
    mechanism: Mechanism, home: list[float], waves: np.ndarray, time: np.ndarray, beyond: np.ndarray | float
) -> np.ndarray:
    q, v, a = _motion(home, waves, time)
    path = Closure(mechanism).follow(Samples(time, q, v, a, joints=mechanism.driven))
    bodies = driven_torque_regressor(mechanism, path.q, path.v, path.a, path.per_drive)
    terms, _ = joint_friction_regressor(mechanism.driven, v, a)
    known = truth(mechanism)
    known[: len(mechanism.pi)] += beyond
    return np.concatenate([bodies, terms], axis=2) @ known
