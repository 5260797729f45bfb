"""Gears, leaves to root."""

import numpy as np
import pytest

from balance.errors import ModelError, SizingError
from balance.linkages.verification import verify_linkage

from .conftest import balanced, left_over


def test_a_fixed_pair_has_the_inertia_of_its_body_over_the_ratio(slider_crank_keys):
    """I_z = (Z*/Z) I, and the carrier gains I_z (1 + Z/Z*)."""
    moment = balanced(slider_crank_keys).moment
    assert moment.gears["z3"].inertia == pytest.approx(50 / 20 * moment.bodies["3"].inertia)
    assert moment.gears["z2"].inertia == pytest.approx(20 / 30 * moment.bodies["2"].inertia)
    gain = [term.value for term in moment.bodies["2"].terms if term.text.startswith("I_z3")]
    assert sum(gain) == pytest.approx(moment.gears["z3"].inertia * (1 + 20 / 50))


def test_a_real_gear_loads_its_carrier_and_asks_for_counter_masses_up_the_tree(crank_rocker_keys):
    """The gear of 5 and its counter-gear load 3, and 3 with its counter-mass against them loads 2."""
    moment = balanced(crank_rocker_keys).moment
    on_three = {load.symbols: load.mass for load in moment.bodies["3"].extra.loads}
    assert on_three == {("m_z5",): 0.2, ("m_z5*",): pytest.approx(moment.gears["z5"].inertia / 0.06**2)}
    on_two = {load.symbols[0]: load.mass for load in moment.bodies["2"].extra.loads}
    assert on_two["m_z3"] == moment.gears["z3"].wheel_mass
    assert on_two["m_z3*"] == moment.gears["z3"].counter_mass
    assert sum(on_two.values()) > sum(on_three.values())
    assert moment.bodies["2"].extra.counters


def test_prismatic_transport_gives_the_inertia_to_the_body_with_the_gear(crank_rocker_keys):
    """Block 6 turns with link 5 and has no gear: its inertia is one of 5's terms."""
    moment = balanced(crank_rocker_keys).moment
    term = next(term for term in moment.bodies["5"].terms if term.text == "I[6]")
    assert term.value == moment.bodies["6"].inertia > 0


def test_prismatic_transport_prefers_the_ground(crank_rocker_keys):
    """With the gear on block 6, pivoted on the ground, link 5 needs no planet; all is balanced still."""
    keys = crank_rocker_keys
    keys["gears"]["z6"] = {"body": "6", "teeth": [30, 20]}
    del keys["gears"]["z5"]
    result = balanced(keys)
    assert result.moment.gears["z6"].inertia == pytest.approx(20 / 30 * result.moment.bodies["6"].inertia)
    assert left_over(result) < 1e-10


def test_a_gear_at_another_joint_than_the_reduction_joint(crank_rocker_keys):
    """The coupler's gear may sit where it meets the rocker: the rocker then carries the planet."""
    keys = crank_rocker_keys
    keys["gears"]["z3"] |= {"joint": "B"}
    result = balanced(keys)
    assert result.moment.gears["z3"].carrier == "4"
    assert result.moment.gears["z3"].pivot == result.tree["4"]
    assert left_over(result) < 1e-10


@pytest.mark.parametrize("at", [["40 mm", "20 mm"], ["-30 mm", "0 mm"]])
def test_a_counter_gear_may_be_pivoted_anywhere_on_its_carrier(at, crank_rocker_keys):
    """Its mass is then balanced like any other."""
    keys = crank_rocker_keys
    keys["gears"]["z3"]["counter"] = {"on": "2", "at": at, "mass": "0.8 kg"}
    residual = verify_linkage(balanced(keys), count=60).varying.residual("complete")
    assert max(residual.values()) < 1e-10


def test_a_disc_has_its_pitch_diameter(slider_crank_keys):
    """d = 2 a Z / (Z + Z*), mass with its square, inertia m d^2 / 8."""
    keys = slider_crank_keys
    keys["gears"]["z3"]["disc"] = {"mass": "6.127 kg", "diameter": "1 m"}
    gear = balanced(keys).moment.gears["z3"]
    diameter = 2 * 0.05 * 20 / 70
    assert gear.wheel_mass == pytest.approx(6.127 * diameter**2)
    assert gear.wheel_inertia == pytest.approx(gear.wheel_mass * diameter**2 / 8)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda keys: keys["gears"].pop("z4"), "body 4 turns and has no gear"),
        (lambda keys: keys["gears"]["z5"].pop("counter"), "counter-gear rides on 3, whose pivot moves"),
        (lambda keys: keys["gears"].update(z9={"body": "3"}), "gears z3 and z9 are both on body 3"),
        (lambda keys: keys["gears"]["z5"].update(joint="P"), "joint P is not a revolute joint of body 5"),
        (
            lambda keys: keys["gears"]["z2"].update(counter={"at": ["0 m", "0 m"], "on": "ground"}),
            "gear z2: its counter-gear is pivoted where A0 is on ground, on the gear's own axis",
        ),
        (lambda keys: keys["links"]["5"].pop("inertia"), "link 5 of x turns: give its inertia"),
        (lambda keys: keys["gears"]["z3"].update(joint="D"), "carry each other's gears in a circle"),
    ],
)
def test_what_cannot_be_geared_is_named(change, message, crank_rocker_keys):
    """Not computed through."""
    change(crank_rocker_keys)
    with pytest.raises(ModelError, match=message):
        balanced(crank_rocker_keys)


def test_a_slider_whose_centre_is_off_its_line_is_no_point_mass(slider_crank_keys):
    """Named: its moment would remain; force balance alone is still possible, and a counter-mass mends it."""
    keys = slider_crank_keys
    keys["links"]["4"]["centre"] = ["15 mm", "6 mm"]
    with pytest.raises(SizingError, match=r"body 4 only translates, and its centre of mass moves 0\.006 m off"):
        balanced(keys)
    assert verify_linkage(balanced(keys, gears=False), count=60).varying.residual("force")["force"] < 1e-12
    keys["links"]["4"]["counter_mass"] = {"radius": "20 mm"}
    assert left_over(balanced(keys)) < 1e-12


def test_inertia_is_that_of_all_pieces_about_the_joint(slider_crank_keys):
    """Summed term by term or by the parallel axis theorem of the merged body: the same."""
    from balance.linkages.equivalence_method import composite_bodies, merged_body

    result = balanced(slider_crank_keys)
    whole = merged_body(composite_bodies(result, "complete")["3"])
    slider = result.force["4"].mass * 0.2**2
    about = whole.inertia + whole.mass * float(whole.at @ whole.at)
    assert result.moment.bodies["3"].inertia == pytest.approx(about + slider)
    assert np.isclose(result.residual(), 0.0, atol=1e-15)


def test_a_counter_gear_is_pivoted_on_its_carrier(crank_rocker_keys):
    """A pivot that is stated on another body is refused: its place would be read in the wrong frame."""
    keys = crank_rocker_keys
    keys["gears"]["z5"]["counter"] |= {"at": ["20 mm", "0 m"], "on": "2"}
    with pytest.raises(ModelError, match=r"gear z5: .* pivoted on 2, but the pair is carried by 3"):
        balanced(keys)
    keys["gears"]["z5"]["counter"]["on"] = "3"
    assert left_over(balanced(keys)) < 1e-10
