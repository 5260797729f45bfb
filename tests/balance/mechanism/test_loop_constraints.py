"""Loop residuals, Jacobians and biases against MuJoCo and finite differences."""

import mujoco
import numpy as np
import pytest

from balance.mechanism.loop_constraints import constraints_at
from balance.mechanism.mechanism import Mechanism

from .. import models


def pair(equality: str, second: str = 'pos="-0.2 0 0.1" euler="0.2 0.1 0.3"') -> str:
    """Two bodies on skew hinges, a site on each, and a constraint between them."""
    return models.mjcf(
        models.link('<site name="s1" pos="0.3 0 0"/>', "a", '<joint name="a" axis="0 0.6 0.8"/>')
        + models.link(f'<site name="s2" {second}/>', "b", '<joint name="b" axis="1 0 0"/>', 'pos="0.5 0 0"'),
        f"<equality>{equality}</equality>",
    )


def residual(mechanism: Mechanism, q: np.ndarray) -> np.ndarray:
    """Of all loops, (rows, n)."""
    return constraints_at(mechanism.tree, mechanism.loops, q.T)[0].T


def jacobian_of(mechanism: Mechanism, q: np.ndarray) -> np.ndarray:
    """Of all loops, (rows, nv, n)."""
    return constraints_at(mechanism.tree, mechanism.loops, q.T)[1].transpose(1, 2, 0)


FORMS = {
    "connect, sites": '<connect site1="s1" site2="s2"/>',
    "connect, bodies": '<connect body1="a" body2="b" anchor="0.3 0.1 0.2"/>',
    "connect, body to world": '<connect body1="a" anchor="0.3 0.1 0.2"/>',
    "weld, sites": '<weld site1="s1" site2="s2"/>',
    "weld, bodies": '<weld body1="a" body2="b"/>',
    "weld, relative pose": '<weld body1="a" body2="b" relpose="0.1 0.2 0.3 0.5 0.5 0.5 0.5"/>',
}


@pytest.mark.parametrize("name", FORMS)
def test_positions_are_mujocos(name: str) -> None:
    """Every way of writing a loop opens by the same vector as in MuJoCo, a weld also by the same angle.

    MuJoCo gives sin(angle / 2), here stands sin(angle).
    """
    text = pair(FORMS[name])
    mechanism, model = models.model(text), mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:] = q = np.array([0.3, 0.4])
    mujoco.mj_forward(model, data)
    mine = residual(mechanism, q[:, None])[:, 0]
    np.testing.assert_allclose(mine[:3], data.efc_pos[:3], atol=1e-12)
    if mechanism.loops[0].weld:
        half = np.arcsin(np.linalg.norm(data.efc_pos[3:6]))
        assert np.linalg.norm(mine[3:]) == pytest.approx(np.sin(2 * half), abs=1e-12)


@pytest.mark.parametrize("name", FORMS)
def test_jacobian_is_the_rate_of_the_residual(name: str) -> None:
    """Central differences; the turn of a weld only where it is closed, for there the rows are angular velocity."""
    mechanism, step = models.model(pair(FORMS[name], 'pos="-0.2 0 0"')), 1e-6
    q = np.random.default_rng(2).normal(size=(2, 5))
    rows = slice(None) if not mechanism.loops[0].weld else slice(3)
    jacobian = jacobian_of(mechanism, q)
    for k in range(2):
        shift = step * np.eye(2)[:, k : k + 1]
        before, after = (residual(mechanism, q + s * shift) for s in (-1, 1))
        np.testing.assert_allclose(((after - before) / (2 * step))[rows], jacobian[rows, k], atol=1e-8)


def test_weld_jacobian_where_it_is_closed() -> None:
    """At a closed state the turn's rate is the difference of the angular velocities."""
    mechanism, step = models.model(models.bennett()), 1e-6
    q = mechanism.home[:, None]
    jacobian = jacobian_of(mechanism, q)[:, :, 0]
    for k in range(4):
        shift = step * np.eye(4)[:, k : k + 1]
        before, after = (residual(mechanism, q + s * shift) for s in (-1, 1))
        np.testing.assert_allclose(((after - before) / (2 * step))[:, 0], jacobian[:, k], atol=1e-9)
