"""Terms of joints: each acts on its own joint alone, with the sign of what it opposes."""

import numpy as np

from balance.dynamics.joint_friction import TERMS, joint_terms

V = np.array([[2.0, -3.0], [-2.0, 0.0]])
A = np.array([[0.5, 4.0], [-1.0, 2.0]])


def test_each_joint_has_its_own_terms():
    """coulomb sign(v) + viscous v + offset + armature a on the joint itself, nothing on the other."""
    columns, names = joint_terms(("J1", "J2"), V, A)
    assert names == tuple(f"{term}[{joint}]" for joint in ("J1", "J2") for term in TERMS)
    assert columns.shape == (2, 2, 8)
    np.testing.assert_allclose(columns[0, 0], [1.0, 2.0, 1.0, 0.5, 0, 0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(columns[0, 1], [0, 0, 0, 0, -1.0, -3.0, 1.0, 4.0], atol=1e-12)
    np.testing.assert_allclose(columns[1, 1], [0, 0, 0, 0, 0.0, 0.0, 1.0, 2.0], atol=1e-12)


def test_friction_takes_energy():
    """Friction's power is never negative, whichever way the joint turns; a joint at rest has none."""
    v = np.linspace(-1.0, 1.0, 41)[:, None]
    columns, _ = joint_terms(("J",), v, np.zeros_like(v))
    assert (columns[:, 0, 0] * v[:, 0] >= 0.0).all()
    assert columns[20, 0, 0] == 0.0
