"""The drawing of a mechanism is to scale, and holds what it should."""

from itertools import cycle

import numpy as np
import pytest
from matplotlib.patches import Circle

from balance.balancing.sizing import CounterMass
from balance.errors import DataError
from balance.figures.mechanism import STEEL_KG_PER_M2, draw_mechanism, save

from .. import models


def test_pivots_are_where_the_mechanism_has_them():
    """Pivots on the ground at x = -0.12 and 0.12 m; the loops' joints where the keyframe closes them."""
    axes = draw_mechanism(models.load("parallelogram-6bar")).axes[0]
    ground = [line.get_xydata()[0] for line in axes.lines if line.get_marker() == "^"]
    np.testing.assert_allclose(sorted(map(tuple, ground)), [(-0.12, 0.0), (0.12, 0.0)], atol=1e-12)
    assert axes.get_aspect() == 1.0
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x [m]", "y [m]")


def test_a_ball_joint_is_one_pivot_and_its_link_goes_to_its_centre():
    """On the base, as three hinges in one place; the link has neither a second joint nor a site."""
    arm = "<body name='arm' pos='0.1 0.2 0'><joint name='k' type='ball'/>{}</body>"
    inertial = "<inertial pos='0.3 0 0' mass='2' diaginertia='0.01 0.02 0.02'/>"
    text = f"<mujoco><worldbody>{arm.format(inertial)}</worldbody></mujoco>"
    link, pivot = draw_mechanism(models.model(text)).axes[0].lines
    assert pivot.get_marker() == "^"
    np.testing.assert_allclose(pivot.get_xydata(), [[0.1, 0.2]], atol=1e-12)
    np.testing.assert_allclose(sorted(map(tuple, link.get_xydata()[:2])), [(0.1, 0.2), (0.4, 0.2)], atol=1e-12)


TOOL = "<body name='tool' pos='{} 0 0'><inertial pos='0.01 0 0' mass='0.5' diaginertia='1e-4 1e-4 1e-4'/></body>"


@pytest.mark.parametrize(
    ("what", "reach"),
    [
        (TOOL.format(0.26), 0.26),
        (TOOL.format(0), 0.1),
        ("<site name='tip' pos='0.25 0 0'/>" + TOOL.format(0), 0.25),
        ("<site name='counter_b' pos='-0.1 0 0'/>" + TOOL.format(0), 0.1),
    ],
)
def test_a_last_link_ends_at_what_is_fixed_to_it_whatever_it_carries(what, reach):
    """At its tool or site, else at its own centre of mass; balanced, its centre of mass is its joint."""
    inertial = "<inertial pos='0.1 0 0' mass='0.8' diaginertia='1e-3 6e-3 6e-3'/><site name='counter' pos='-0.2 0 0'/>"
    text = f"<mujoco><worldbody><body name='arm'><joint name='k'/>{inertial}{what}</body></worldbody></mujoco>"
    mechanism = models.model(text).with_payload(tool="1.3 kg")
    balanced = mechanism.with_counter_mass(counter=mechanism.parameters[0, 1] / 0.2)
    assert balanced.parameters[0, 1] == pytest.approx(0.0, abs=1e-12)
    for one in (mechanism, balanced):
        xy = draw_mechanism(one).axes[0].lines[0].get_xydata()
        assert np.ptp(xy, axis=0) == pytest.approx([reach, 0.0], abs=1e-12)


def test_a_mechanism_in_another_plane_is_drawn_in_that():
    """Four joints of a link in x-z, as a polygon that does not cross itself; the axes say which they are."""
    inertial = "<inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/>"
    leg = "<body pos='{} 0 {}'><joint axis='0 1 0'/>" + inertial + "</body>"
    legs = "".join(leg.format(*at) for at in ((0.3, 0.2), (0.3, 0), (0, 0.2)))
    text = f"<mujoco><worldbody><body><joint axis='0 1 0'/>{inertial}{legs}</body></worldbody></mujoco>"
    axes = draw_mechanism(models.model(text)).axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x [m]", "z [m]")
    sides = np.linalg.norm(np.diff(axes.lines[0].get_xydata(), axis=0), axis=1)
    assert sorted(sides) == pytest.approx([0.2, 0.2, 0.3, 0.3])


def test_discs_have_the_area_of_their_mass():
    """A counter-mass of 24.28 kg is a disc of that mass at its site; twice the mass, twice the area."""
    mechanism = models.load("parallelogram-6bar")
    site = mechanism.site("counter_A0A").position
    areas = []
    for mass in (12.0, 24.0):
        axes = draw_mechanism(mechanism, [CounterMass("counter_A0A", mass, site)]).axes[0]
        (disc,) = [patch for patch in axes.patches if isinstance(patch, Circle)]
        areas.append(np.pi * disc.radius**2)
        np.testing.assert_allclose(disc.center, [-0.12 + 0.03755 / np.sqrt(2), -0.03755 / np.sqrt(2)], atol=1e-9)
    assert areas[0] == pytest.approx(12.0 / STEEL_KG_PER_M2)
    assert areas[1] == pytest.approx(2 * areas[0])


@pytest.mark.parametrize(("name", "ending"), [*zip(models.BUILT_IN, cycle(["svg", "png", "pdf"]))])
def test_every_mechanism_can_be_drawn_and_saved(name, ending, tmp_path):
    """Every one of them, each format that is offered twice."""
    path = tmp_path / f"{name}.{ending}"
    save(draw_mechanism(models.load(name)), path)
    assert path.stat().st_size > 2000


def test_other_formats_are_refused(tmp_path):
    """An ending that is no picture's: the expected one of listed, nothing is written."""
    with pytest.raises(DataError, match=r"a\.doc: cannot draw.*png"):
        save(draw_mechanism(models.load("serial-1r")), tmp_path / "a.doc")
    assert not list(tmp_path.iterdir())
