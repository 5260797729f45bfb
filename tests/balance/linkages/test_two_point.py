"""Bodies shaped as two point masses."""

import copy

import pytest

from balance.errors import ModelError, SizingError
from balance.linkages.results import linkage_equations

from .conftest import balanced, left_over


def four_bar(keys):
    """A crank-rocker without its dyad, its coupler two point masses at crank and rocker."""
    keys = {**keys, "two_point": {"3": {"joints": ["A", "B"], "reshaped": "3"}}}
    keys["links"] = {name: dict(link) for name, link in keys["links"].items() if name in "234"}
    keys["links"]["3"] |= {"centre": ["0.15 m", "12 mm"], "inertia": "1e-3 kg m^2"}
    keys["links"]["3"]["counter_mass"] = {"at": ["0.16 m", "-50 mm"]}
    keys["joints"] = {name: joint for name, joint in keys["joints"].items() if name in ("A0", "A", "B", "B0")}
    keys["gears"] = {name: keys["gears"][name] for name in ("z2", "z4")}
    keys["start"] = {name: angle for name, angle in keys["start"].items() if name in "234"}
    del keys["reduction"]
    return keys


def test_a_two_point_coupler_needs_no_gear(crank_rocker_keys):
    """I = m_A m_B L^2 / (m_A + m_B): balanced at varying speed with gears on crank and rocker alone."""
    result = balanced(four_bar(crank_rocker_keys))
    shares = result.force["3"].shares
    assert min(shares.values()) > 0
    assert left_over(result) < 1e-10


def test_the_equations_of_a_two_point_body_and_of_a_counter_mass_at_a_radius(crank_rocker_keys):
    """Across the line of the joints in symbols; at a radius with the rule of its inertia."""
    keys = four_bar(crank_rocker_keys)
    keys["links"]["2"]["counter_mass"] = {"radius": "60 mm", "bar": "30 mm"}
    found = {equation.text: equation.value for equation in linkage_equations(balanced(keys))}
    assert found["m3* = (m3 n[3]) / -n[m3*], n across the line A B"] == pytest.approx(1.15 * 12 / 50)
    mass = next(value for text, value in found.items() if text.startswith("m2* = |"))
    assert found["I2* = m2* (0.03 m)^2/12"] == pytest.approx(mass * 0.03**2 / 12)


def test_a_gear_that_rides_on_a_two_point_body_is_in_its_equation(crank_rocker_keys):
    """A link on the coupler, its gear's mass shared between the coupler's joints: the equation gives its value."""
    keys = copy.deepcopy(crank_rocker_keys)
    keys["two_point"] = {"3": {"joints": ["A", "B"], "reshaped": "3"}}
    keys["links"]["3"] |= {"inertia": "1e-5 kg m^2", "counter_mass": {"at": ["0.15 m", "-70 mm"]}}
    keys["links"]["5"] |= {"mass": "0.2 kg", "centre": ["0.05 m", "12 mm"]}
    keys["joints"]["D"]["3"] = ["0.12 m", "30 mm"]
    del keys["gears"]["z3"], keys["reduction"]["3"]
    result = balanced(keys)
    assert left_over(result) < 1e-10
    known, texts = result.results(), [equation.text for equation in linkage_equations(result)]
    (text,) = (text for text in texts if text.startswith("I3 = "))
    assert text.startswith("I3 = (m[3 at B] + m_z[3 at B]) L^2 - ")
    length = 0.3
    others = result.moment.bodies["3"].inertia - result.values["I3"]
    shares = known["m[3 at B]"] + known["m_z[3 at B]"]
    assert known["I3 reshaped"] == pytest.approx(shares * length**2 - others)
    (gears,) = (text for text in texts if text.startswith("m4z* = "))
    assert gears.startswith("m4z* = |m_z[3 at B] r[3]|")


@pytest.mark.parametrize(
    ("link", "change", "message"),
    [
        ("3", {"counter_mass": {"at": ["0.16 m", "50 mm"]}}, "two_point of 3: its centre of mass is off the line"),
        ("3", {"centre": ["0.45 m", "0 m"]}, "two_point of 3: its centre of mass is not between A and B"),
        (
            "9",
            {"fixed_to": "3", "mass": "0.1 kg", "centre": ["0.15 m", "0 m"], "inertia": "1 kg m^2"},
            "link 3 would need an inertia of -",
        ),
    ],
)
def test_what_two_point_masses_cannot_replace_is_refused(link, change, message, crank_rocker_keys):
    """A centre off the line without a place on the other side, one outside the joints, too much inertia elsewhere."""
    keys = four_bar(crank_rocker_keys)
    keys["links"][link] = keys["links"].get(link, {}) | change
    with pytest.raises(SizingError, match=message):
        balanced(keys)


def test_a_slider_is_no_second_joint_of_a_gearless_rod(slider_crank_keys):
    """The rod's second point mass would pass to the slider, which itself is reduced to the rod: in a circle."""
    keys = slider_crank_keys
    keys["links"]["3"] |= {"counter_mass": {"at": ["20 mm", "30 mm"]}}
    keys["two_point"] = {"3": {"joints": ["A", "C"], "reshaped": "3"}}
    del keys["gears"]["z3"]
    with pytest.raises(ModelError, match="circle"):
        balanced(keys)
