"""One rigid body: momentum, its rate and weight, by the parallel-axis theorem and a spinning top."""

import numpy as np
import pytest

from balance import body, kinematics
from balance.components import dense
from balance.mechanism import Site

from . import models


def test_a_disc_is_its_mass_at_a_site() -> None:
    """1 kg at a site: parameters of a disc normal to z by Steiner's theorem, its trace the sum of squares."""
    site = Site("s", 0, np.array([0.3, -0.4, 0.1]), radius_of_gyration=0.2)
    m, *first, xx, xy, yy, xz, yz, zz = site.unit_mass()
    assert (m, first) == (1.0, [0.3, -0.4, 0.1])
    at_centre = np.diag([0.02, 0.02, 0.04])
    steiner = 0.26 * np.eye(3) - np.outer(first, first)
    np.testing.assert_allclose([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], at_centre + steiner, atol=1e-15)


def test_a_link_turning_steadily() -> None:
    """A bar turning at w about z: m c w of momentum, J w of angular momentum, m c w2 of centripetal force."""
    mechanism, w = models.load("serial-1r"), 3.0
    at = kinematics.pose(mechanism.tree, np.array([[0.5]]))
    moving = kinematics.motion(mechanism.tree, at, np.array([[w]]))
    row = mechanism.parameters[0]
    carried, load = body.momentum(row, at, moving, 0), body.rate_of_momentum(row, at, moving, 0)
    assert np.linalg.norm(dense(carried.force, 1)) == pytest.approx(1.2 * 0.14 * w)
    assert dense(carried.moment, 1)[2, 0] == pytest.approx(row[9] * w)
    np.testing.assert_allclose(
        dense(load.force, 1)[:, 0], -1.2 * 0.14 * w**2 * np.array([np.cos(0.5), np.sin(0.5), 0.0]), atol=1e-12
    )
    np.testing.assert_allclose(dense(load.moment, 1), 0.0, atol=1e-15)
