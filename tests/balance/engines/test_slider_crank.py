"""One slider-crank: its exact force, moment and torque against independent dynamics."""

import mujoco
import numpy as np
import pytest

from balance.engines.engine import Cylinder, Engine, dead_centres
from balance.engines.engine_files import mjcf
from balance.engines.slider_crank import SliderCrank, replacements
from balance.errors import DataError

OWN = SliderCrank(0.05, 0.2, 1.0, 0.025, 0.002, 1.2, 0.06, 0.0101, 0.8)
TIME = np.linspace(0.0, 2.0, 200)
THETA, OMEGA, ALPHA = 40 * TIME + np.sin(9 * TIME), 40 + 9 * np.cos(9 * TIME), -81 * np.sin(9 * TIME)


def test_mujoco_as_referee():
    """MuJoCo's momentum of the same mechanism file, differentiated in time, gives the same force."""
    model = mujoco.MjModel.from_xml_string(mjcf(Engine("one", (Cylinder(0.0, 0.0, 0.0, OWN),))))
    data, step, found = mujoco.MjData(model), 1e-6, []
    for theta in (0.3, 1.7, 4.4):
        momenta = []
        for angle in (theta - step, theta + step):
            place, first, _ = OWN._slide(np.array([angle]))
            lean = -np.arcsin(OWN.radius * np.sin(angle) / OWN.rod_length)
            data.qpos[:] = [angle, lean - angle, place[0]]
            data.qvel[:] = [1.0, OWN._lean(np.array([angle]))[0][0] - 1.0, first[0]]
            mujoco.mj_forward(model, data)
            mujoco.mj_subtreeVel(model, data)
            momenta.append(data.subtree_linvel[1] * model.body_subtreemass[1])
        found.append(-(momenta[1] - momenta[0])[:2] / (2 * step))
    expected = OWN.force(np.array([0.3, 1.7, 4.4]), 1.0)
    np.testing.assert_allclose(np.array(found), np.c_[expected.real, expected.imag], rtol=1e-6)


def test_a_positive_offset_is_where_the_pin_goes_from_dead_centre():
    """Crank and rod are in line after the crank points along the cylinder's axis, at asin e / (r + l)."""
    crank = SliderCrank(0.05, 0.2, piston_mass=0.8, offset=0.01)
    at = np.arcsin(0.01 / 0.25)
    place, rate, _ = crank._slide(np.array([at]))
    assert at == pytest.approx(crank.dead_centre)
    engine = Engine("inclined", (Cylinder(0.0, 0.2, 0.5, crank),))
    assert dead_centres(engine) == pytest.approx([np.degrees(0.3 + at)])
    assert (place[0], rate[0]) == (pytest.approx(0.25 * np.cos(at)), pytest.approx(0.0, abs=1e-15))


def test_rotating_and_reciprocating_parts():
    """1.34 kg rotates at the crank radius, 1.16 kg reciprocates; two point masses give the true force."""
    crank = SliderCrank(0.05, 0.2, 1.0, 0.025, 0.0, 1.2, 0.06, 0.0101, 0.8)
    assert crank.rotating_unbalance / crank.radius == pytest.approx(1.34)
    assert crank.reciprocating_mass == pytest.approx(1.16)
    inline = crank.reciprocating_mass * crank.radius * crank.reciprocation(THETA)
    np.testing.assert_allclose(
        crank.force(THETA, 1.0), inline + crank.rotating_unbalance * np.exp(1j * THETA), rtol=1e-12
    )


def test_rod_as_point_masses():
    """Masses at the pins miss the inertia I - m l_B l_C; the other replacements keep all three conditions."""
    pins, percussion, three = replacements(OWN)
    assert [m.mass for m in pins.masses] == pytest.approx([0.84, 0.36])
    assert pins.missing_inertia == pytest.approx(2e-5, rel=1e-6)
    for exact in (percussion, three):
        assert sum(m.mass for m in exact.masses) == pytest.approx(OWN.rod_mass)
        assert sum(m.mass * m.at for m in exact.masses) == pytest.approx(OWN.rod_mass * OWN.rod_centre)
        assert exact.missing_inertia == pytest.approx(0.0, abs=1e-16)


def test_two_masses_give_the_true_force_but_not_the_moment():
    """A rod whose inertia is m l_B l_C is two masses; with another the moment is off by -dI chi''."""
    two = SliderCrank(0.05, 0.2, 1.0, 0.025, 0.002, 1.2, 0.06, 1.2 * 0.06 * 0.14, 0.8)
    np.testing.assert_allclose(two.force(THETA, OMEGA, ALPHA), OWN.force(THETA, OMEGA, ALPHA), rtol=1e-12)
    off = OWN.moment(THETA, OMEGA, ALPHA) - two.moment(THETA, OMEGA, ALPHA)
    lean = np.gradient(np.gradient(-np.arcsin(0.25 * np.sin(THETA)), TIME, edge_order=2), TIME, edge_order=2)
    np.testing.assert_allclose(off[3:-3], -replacements(OWN)[0].missing_inertia * lean[3:-3], atol=2e-3)
    assert np.abs(off).max() > 1e-3


def test_what_cannot_turn_is_refused():
    """A rod not longer than crank and offset together locks."""
    with pytest.raises(DataError, match="cannot make a full turn"):
        SliderCrank(0.05, 0.06, offset=0.02)
    assert replacements(SliderCrank(0.05, 0.2, rod_mass=1.0, rod_centre=0.3, piston_mass=1.0)) == []
