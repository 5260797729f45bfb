"""What a moving base asks of the motors: the sum over the particles of spatial bodies, one by one."""

import numpy as np
import pytest

from balance.closure import Closure
from balance.mechanism.mjcf_parser import load_mechanism, mechanism_from_text
from testbench.simulator.moving_base_coupling import second_moment, velocity_cross_product

SPATIAL = """
<mujoco model="spatial"><compiler angle="radian"/><worldbody><body name="base">
  <body name="one"><joint name="q1" type="hinge" axis="0 0 1"/>
    <inertial pos="0.1 0.02 0.05" mass="2" diaginertia="0.02 0.03 0.04"/>
    <body name="two" pos="0.3 0 0.1"><joint name="q2" type="hinge" axis="0 1 0"/>
      <inertial pos="0.05 -0.03 0.2" mass="1.5" diaginertia="0.03 0.02 0.01"/></body></body>
</body></worldbody></mujoco>
"""


def particles(row: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Six particles with a body's mass, centre and second moments: masses (6,), places (6, 3)."""
    m, centre = row[0], row[1:4] / row[0]
    about = second_moment(row) - m * np.outer(centre, centre)
    size, axes = np.linalg.eigh(about)
    arms = axes.T * np.sqrt(3.0 * size / m)[:, None]
    return np.full(6, m / 6.0), centre + np.vstack([arms, -arms])


def test_second_moment():
    """Particles placed by it have the body's inertia."""
    row = mechanism_from_text(SPATIAL, "spatial").parameters[1]
    mass, place = particles(row)
    inertia = sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(mass, place, strict=True))
    xx, xy, yy, xz, yz, zz = row[4:]
    assert inertia == pytest.approx(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))


def test_sum_over_particles():
    """In space the sum over bodies is the sum over particles, each moved by its own finite difference."""
    mechanism = mechanism_from_text(SPATIAL, "spatial")
    q, rates = np.array([0.3, -0.7]), np.array([[2.0, -1.0], [0.5, 3.0]])

    def places(at: np.ndarray) -> np.ndarray:
        c1, s1, c2, s2 = np.cos(at[0]), np.sin(at[0]), np.cos(at[1]), np.sin(at[1])
        first = np.array([[c1, -s1, 0], [s1, c1, 0], [0, 0, 1]])
        second = first @ np.array([[c2, 0, s2], [0, 1, 0], [-s2, 0, c2]])
        origin = first @ [0.3, 0.0, 0.1]
        return np.vstack([bodies[0][1] @ first.T, origin + bodies[1][1] @ second.T])

    bodies = [particles(row) for row in mechanism.parameters]
    mass, step = np.concatenate([m for m, _ in bodies]), 1e-6
    one, two = ((places(q + step * r) - places(q - step * r)) / (2 * step) for r in rates)
    expected = (mass[:, None] * np.cross(one, two)).sum(axis=0)
    assert np.abs(expected).min() > 1e-3
    assert velocity_cross_product(mechanism, q[None], rates[:1], rates[1:])[0] == pytest.approx(expected, rel=1e-7)


def test_nothing_along_itself():
    """It is odd: no sweep of a motion across itself, and the opposite the other way round."""
    mechanism = load_mechanism("parallelogram-6bar")
    closure = Closure(mechanism)
    q = closure.states(5, seed=2)
    v, u = closure.velocities(q, 1), closure.velocities(q, 2)
    assert velocity_cross_product(mechanism, q, v, v) == pytest.approx(np.zeros((5, 3)), abs=1e-15)
    assert velocity_cross_product(mechanism, q, v, u) == pytest.approx(
        -velocity_cross_product(mechanism, q, u, v), abs=1e-15
    )
