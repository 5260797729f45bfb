"""Forward dynamics of open chains: MuJoCo's motion, energy, and torques that bring a motion back."""

import mujoco
import numpy as np
import pytest

from balance import datasets
from balance.dynamics.forward_dynamics import acceleration, refuse_loops, simulate_forward
from balance.dynamics.regressor import torque_regressor
from balance.errors import ModelError
from balance.mechanism.mjcf_parser import load_mechanism

ARM = load_mechanism("serial-3r")
STEP = 1e-3


def inverse(q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Torques by the file's parameters."""
    return torque_regressor(ARM, q, v, a) @ ARM.pi


def test_accelerations_are_those_of_mujoco():
    """At random states under random torques the accelerations agree with an independent engine."""
    model = mujoco.MjModel.from_xml_path(str(datasets.find_dataset("serial-3r", "mechanisms", ".xml")))
    data = mujoco.MjData(model)
    rng = np.random.default_rng(0)
    for _ in range(10):
        q, v, torque = rng.normal(size=(3, 1, ARM.tree.size))
        data.qpos, data.qvel, data.qfrc_applied = q[0], v[0], torque[0]
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(acceleration(inverse, q, v, torque)[0], data.qacc, rtol=1e-6, atol=1e-6)


def test_torques_bring_their_motion_back():
    """Torques of a known motion, from its first state, give that motion; two motions at once do not mix."""
    time = np.arange(0.0, 0.1 + STEP / 2, STEP)
    speeds = np.array([[2.0, 3.0, 4.0], [1.0, -2.0, 3.0]])
    angle = speeds[:, None, :] * time[:, None]
    q, v, a = np.sin(angle), speeds[:, None, :] * np.cos(angle), -(speeds[:, None, :] ** 2) * np.sin(angle)
    torque = np.stack([inverse(*states) for states in zip(q, v, a, strict=True)])
    found = simulate_forward(inverse, q[:, 0], v[:, 0], torque, STEP)
    np.testing.assert_allclose(found, q[:, ::2], atol=1e-8)


def test_a_motion_without_bounds_is_no_number():
    """A motion that leaves all bounds is NaN, and says nothing of the others."""
    torque = np.zeros((2, 61, 3))
    torque[0] = 1e9
    with np.errstate(over="ignore", invalid="ignore"):
        found = simulate_forward(inverse, np.zeros((2, 3)), np.zeros((2, 3)), torque, STEP)
    assert np.isnan(found[0, -1]).all()
    assert np.isfinite(found[1]).all()


def test_loops_are_refused():
    """A mechanism with loops has no free joints."""
    with pytest.raises(ModelError, match="parallelogram-6bar has loops"):
        refuse_loops(load_mechanism("parallelogram-6bar"))
