"""What a record determines: the printed base parameters of a serial arm, refusals by name, independence of units."""

import numpy as np
import pytest

from balance.balancing import conditions
from balance.balancing.conditions import text_of
from balance.dynamics.regressor import joint_friction_regressor, torque_regressor, wrench_regressor
from balance.errors import DataError
from balance.estimation.identifiability import NotIdentifiable, identifiability

from .. import models

RNG = np.random.default_rng(5)
STATES = RNG.normal(size=(3, 40, 2))


@pytest.fixture(scope="module")
def arm():
    """Observability of a serial 2R arm from its torques at random states."""
    mechanism = models.load("serial-2r")
    return identifiability(torque_regressor(mechanism, *STATES), mechanism.parameter_names)


def test_base_parameters_of_a_serial_arm(arm):
    """Six of twenty: the printed combinations, the elbow's mass only as what it adds to link 1."""
    assert [arm.text(row) for row in range(arm.rank)] == [
        "mcx[link_1] + 0.3 m[link_2]",
        "mcy[link_1]",
        "mcx[link_2]",
        "mcy[link_2]",
        "Izz[link_1] + 0.09 m[link_2]",
        "Izz[link_2]",
    ]
    assert arm.singular_values[0] > 1e-2
    assert arm.singular_values[1] < 1e-14


def test_base_columns_carry_the_whole_regressor(arm):
    """W = W[pivots] @ combinations at states that were not used to find them."""
    mechanism = models.load("serial-2r")
    regressor = torque_regressor(mechanism, *RNG.normal(size=(3, 30, 2)))
    carried = regressor[:, :, list(arm.pivots)] @ arm.combinations
    np.testing.assert_allclose(carried, regressor, atol=1e-9)


def test_armature_of_the_first_joint_hides_in_its_inertia():
    """The rotor of joint 1 cannot be told from the arm's inertia, that of joint 2 can."""
    mechanism = models.load("serial-2r")
    terms, names = joint_friction_regressor(("J1", "J2"), *STATES[1:])
    regressor = np.concatenate([torque_regressor(mechanism, *STATES), terms], axis=2)
    found = identifiability(regressor, [*mechanism.parameter_names, *names])
    texts = [found.text(row) for row in range(found.rank)]
    assert "Izz[link_1] + 0.09 m[link_2] + armature[J1]" in texts
    assert "armature[J2]" in texts
    assert found.rank == 13


def test_balance_conditions_are_observable_from_torque(arm):
    """Whatever balances a serial arm in the field of gravity can be identified from its torques."""
    for row in conditions.balance_conditions(models.load("serial-2r")).matrix:
        assert arm.is_identifiable(row)


@pytest.mark.parametrize("name", ["serial-3r", "parallelogram-6bar"])
def test_wrench_determines_what_balances(name):
    """The force on the base determines the left-hand side of every balance condition, loops or not."""
    mechanism = models.load(name)
    q, v, a = RNG.normal(size=(3, 60, mechanism.tree.size))
    found = identifiability(wrench_regressor(mechanism, q, v, a)[:, :3], mechanism.parameter_names)
    assert all(found.is_identifiable(row) for row in conditions.balance_conditions(mechanism).matrix)


def test_refusal_names_the_combination_and_what_there_is_instead(arm):
    """A mass that torque does not determine is refused by name, with the combinations that it is part of."""
    with pytest.raises(NotIdentifiable, match=r"^m\[link_2\] is not observable.*mcx\[link_1\] \+ 0.3 m\[link_2\], Izz"):
        arm.share(arm.vector({"m[link_2]": 1.0}))
    with pytest.raises(NotIdentifiable, match=r"mcx\[link_1\] \+ 0.2 m\[link_2\] is not"):
        arm.share(arm.vector({"mcx[link_1]": 1.0, "m[link_2]": 0.2}))
    assert not arm.is_identifiable(arm.vector({"mcz[link_1]": 1.0}))


def test_unknown_parameter_is_refused(arm):
    """A name that is no parameter is refused, listing them."""
    with pytest.raises(DataError, match=r"no parameter 'mass'.*mcx"):
        arm.vector({"mass": 1.0})


def test_a_joint_that_never_moves_leaves_its_sum_alone():
    """With the elbow fixed straight, the arm is one body: one first moment along it, not two."""
    mechanism = models.load("serial-2r")
    straight = STATES * [1.0, 0.0]
    found = identifiability(torque_regressor(mechanism, *straight)[:, :1], mechanism.parameter_names)
    assert found.rank == 3
    whole = found.vector({"mcx[link_1]": 1.0, "mcx[link_2]": 1.0, "m[link_2]": 0.3})
    assert found.is_identifiable(whole)
    assert not found.is_identifiable(found.vector({"mcx[link_2]": 1.0}))


def test_units_do_not_matter():
    """Parameters in other units: the same rank, the same combinations, rescaled."""
    mechanism = models.load("serial-2r")
    regressor = torque_regressor(mechanism, *STATES)
    scale = 10.0 ** RNG.uniform(-4, 4, regressor.shape[2])
    plain = identifiability(regressor, mechanism.parameter_names)
    scaled = identifiability(regressor * scale, mechanism.parameter_names)
    assert scaled.pivots == plain.pivots
    pivots = list(plain.pivots)
    np.testing.assert_allclose(scaled.combinations / scale * scale[pivots][:, None], plain.combinations, atol=1e-6)


def test_nothing_moves():
    """A record in which nothing depends on any parameter is refused."""
    with pytest.raises(NotIdentifiable, match="no parameter"):
        identifiability(np.zeros((10, 2, 3)), ["a", "b", "c"])


def test_text():
    """Sums read as they are written by hand."""
    assert text_of({"a": -1.0, "b": 0.15, "c": -2.0}) == "-a + 0.15 b - 2 c"
    assert text_of({}) == "0"


def test_the_condition_number_is_of_unit_columns(arm):
    """Of the base columns, each of length one: numpy's."""
    regressor = torque_regressor(models.load("serial-2r"), *STATES)
    columns = regressor.reshape(-1, regressor.shape[-1])[:, list(arm.pivots)]
    assert arm.condition == pytest.approx(np.linalg.cond(columns / np.linalg.norm(columns, axis=0)))
