"""Bodies that turn together without a prismatic joint."""

import pytest

from balance.errors import ModelError
from balance.linkages.equivalence_method import balance_linkage
from balance.linkages.linkage_files import linkage_from_table, load_linkage
from balance.linkages.verification import verify_linkage

from .conftest import balanced


def parallelogram(second="0.1 m"):
    """A parallelogram crank linkage whose coupler only translates, along a circle."""
    crank = {
        "mass": "0.4 kg",
        "centre": ["40 mm", "5 mm"],
        "inertia": "3e-4 kg m^2",
        "counter_mass": {"radius": "50 mm"},
    }
    return {
        "drive": "A0",
        "speed": "100 rpm",
        "links": {
            "2": crank,
            "3": {"mass": "0.7 kg", "centre": ["90 mm", "20 mm"], "counter_mass": {"radius": "60 mm"}},
            "4": crank,
        },
        "joints": {
            "A0": {"ground": ["0 m", "0 m"], "2": ["0 m", "0 m"]},
            "A": {"2": ["0.1 m", "0 m"], "3": ["0 m", "0 m"]},
            "B": {"3": ["0.3 m", "0 m"], "4": [second, "0 m"]},
            "B0": {"ground": ["0.3 m", "0 m"], "4": ["0 m", "0 m"]},
        },
        "turns_with": [["3", "ground"], ["4", "2"]],
        "reduction": {"3": "A"},
        "start": {"2": "70 deg", "4": "70 deg"},
        "gears": {"z2": {"body": "2", "teeth": [30, 20]}, "z4": {"body": "4"}},
    }


def test_a_parallelogram_turns_through_where_it_lies_flat():
    """A whole turn, through two positions that are singular without what is known of the coupler."""
    check = verify_linkage(balanced(parallelogram()), count=72)
    for run in (check.constant, check.varying):
        assert run.residual("complete")["force"] < 1e-12
        assert run.residual("complete")["moment"] < 1e-12
    assert "torque_constant_speed" not in check.penalty("force")  # no torque before: rounding is not compared
    assert check.penalty("force")["torque_varying_speed"] > 1.0


def test_bodies_that_do_not_turn_together_are_refused_by_name():
    """The claim is checked against the velocities that the joints allow."""
    with pytest.raises(ModelError, match="bodies 3 and ground of x do not turn together"):
        verify_linkage(balance_linkage(linkage_from_table(parallelogram("0.11 m"), "x")))


def test_the_parallelogram_of_the_pantograph_is_checked():
    """Its side 5 passes its inertia to the crank that it is parallel to."""
    result = balance_linkage(load_linkage("pantograph"))
    assert "I[5]" in [term.text for term in result.moment.bodies["2+7"].terms]
    assert verify_linkage(result, count=60).constant.trajectory.is_closed()
