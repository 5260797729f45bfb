"""Static balance by counter-masses and by springs of zero free length."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pinocchio
import pytest

from balance.balancing import static_balancing
from balance.balancing.sizing import exact_sizing
from balance.balancing.springs import End, Spring, joint_torques, load_springs, spring_energy, spring_lengths
from balance.closure import Closure
from balance.dynamics.regressor import first_moment, potential
from balance.errors import DataError, ModelError, SizingError

from .. import models

MECHANISMS = {name: lambda name=name: models.load(name) for name in models.BUILT_IN}
MECHANISMS |= {
    f"own {n}R": lambda n=n: models.model(models.serial_chain(n, n)) for n in (1, 2, 3, 4)
}  # fmt: skip
MECHANISMS["own four-bar"] = lambda: flat_four_bar(models.four_bar(0.31, 0.07, 0.26, 0.22, 0.6))
MECHANISMS["parallelogram four-bar"] = lambda: flat_four_bar(models.four_bar(0.3, 0.2, 0.3, 0.2, 1.0))


def flat_four_bar(text: str):
    """A four-bar of the test models with gravity in its plane."""
    return replace(models.model(text), gravity=np.array([2.0, -9.0, 0.0]))


@pytest.mark.parametrize("name", MECHANISMS)
def test_springs_make_the_potential_energy_constant(name):
    """To 1e-12 of the unbalanced swing, at configurations other than those of the design; stiffnesses above zero."""
    mechanism = MECHANISMS[name]()
    found = static_balancing.design_springs(mechanism)
    assert found.is_balanced(1e-12)
    assert found.swing() > 0.1
    assert all(spring.stiffness > 0.0 for spring in found.springs)


@pytest.mark.parametrize("name", ["serial-3r", "four-bar", "parallelogram-6bar"])
def test_pinocchio_s_potential_energy_and_the_springs_by_its_frames(name):
    """Weight by Pinocchio's potential energy, spring ends by its frames: constant to 1e-12 as well."""
    mechanism = models.load(name)
    found = static_balancing.design_springs(mechanism)
    pin = mechanism.pinocchio_model()
    data = pin.createData()
    total = []
    for q in found.q:
        weight = pinocchio.computePotentialEnergy(pin, data, q)
        pinocchio.forwardKinematics(pin, data, q)

        def place(end: End) -> np.ndarray:
            return end.position if end.body < 0 else data.oMi[end.body + 1].act(end.position)

        elastic = [s.stiffness * np.sum((place(s.first) - place(s.second)) ** 2) / 2 for s in found.springs]
        total.append(weight + sum(elastic))
    assert np.ptp(total) < 1e-12 * found.swing()


def test_one_link_is_the_textbook_s():
    """k h r = m g e, the spring from above the pivot to a point on the link."""
    mechanism = models.load("serial-1r")
    (spring,) = static_balancing.design_springs(mechanism, (), 0.12, 0.5).springs
    assert spring.stiffness == pytest.approx(1.2 * 9.81 * 0.14 / (0.5 * 0.12), rel=1e-12)


@pytest.mark.parametrize("name", ["serial-2r", "four-bar", "parallelogram-6bar"])
def test_torque_of_springs_is_the_slope_of_their_energy(name):
    """dV/dq by central differences, to 1e-6, for springs between links and to the base."""
    mechanism = models.load(name)
    q = Closure(mechanism).states(6, 3)
    springs = [
        Spring(End(-1, np.array([0.1, 0.4, 0.05])), End(1, np.array([0.1, -0.05, 0.0])), 80.0),
        Spring(End(0, np.array([0.05, 0.02, 0.0])), End(len(mechanism.bodies) - 1, np.array([0.03, 0.1, 0.0])), 50.0),
    ]
    torque, h = joint_torques(mechanism, springs, q), 1e-6
    for j in range(q.shape[1]):
        step = h * np.eye(q.shape[1])[j]
        slope = (spring_energy(mechanism, springs, q + step) - spring_energy(mechanism, springs, q - step)) / (2 * h)
        np.testing.assert_allclose(torque[:, j], slope, rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("name", models.BUILT_IN)
def test_counter_masses_make_the_potential_energy_constant(name):
    """Sized on the static conditions: 1e-12 of the swing; and static conditions follow from those of force balance."""
    mechanism = models.load(name)
    found = static_balancing.static_conditions(mechanism)
    objective = static_balancing.potential_objective(mechanism)
    sized = exact_sizing(found, mechanism, objective=objective)
    q = Closure(mechanism).states(60, 5)
    assert np.ptp(potential(sized.after, q)) < 1e-12 * np.ptp(potential(mechanism, q))
    from balance.balancing.conditions import balance_conditions

    both = np.vstack([balance_conditions(mechanism).matrix, found.matrix])
    assert np.linalg.matrix_rank(both, tol=1e-9) == balance_conditions(mechanism).rank


def test_what_moves_level_needs_nothing():
    """A carriage along x: no condition, no spring."""
    slide = '<joint name="s" type="slide" axis="1 0 0"/><site name="counter" pos="0 0 0"/>'
    carriage = models.link("", "carriage", slide)
    text = models.mjcf(carriage, models.motors("s") + models.key([0.1]), '<option gravity="0 -9.81 0"/>')
    assert static_balancing.static_conditions(models.model(text)).rank == 0
    assert static_balancing.design_springs(models.model(text)).springs == ()


def test_without_gravity_there_is_nothing_to_balance():
    """Said, not computed."""
    with pytest.raises(ModelError, match="no gravity"):
        static_balancing.static_conditions(replace(models.load("four-bar"), gravity=np.zeros(3)))


def test_potential_is_minus_gravity_times_first_moment():
    """Pinocchio's centre of mass times total mass is the first moment."""
    mechanism = models.load("parallelogram-6bar-full")
    pin = mechanism.pinocchio_model()
    data = pin.createData()
    q = Closure(mechanism).states(5, 1)
    centre = np.array([pinocchio.centerOfMass(pin, data, state) for state in q])
    np.testing.assert_allclose(first_moment(mechanism, q), mechanism.total_mass * centre, atol=1e-12)


def test_places_that_cannot_do_it_are_refused():
    """A spring that ends at the pivot does no work; one below the pivot only pushes the wrong way."""
    mechanism = models.load("serial-1r")
    idle = Spring(End(-1, np.array([0.0, 0.3, 0.0])), End(0, np.zeros(3)))
    with pytest.raises(SizingError, match="cannot balance"):
        static_balancing.design_springs(mechanism, [idle])
    below = Spring(End(-1, np.array([0.0, -0.3, 0.0])), End(0, np.array([0.1, 0.0, 0.0])))
    with pytest.raises(SizingError, match="only pull"):
        static_balancing.design_springs(mechanism, [below])


def test_a_spring_file(tmp_path):
    """The shipped places for the manipulator, stiffness found; the same with stiffness given is evaluated unchanged."""
    mechanism = models.load("parallelogram-6bar").with_payload({"platform": 5.0})
    places, given = load_springs("parallelogram-6bar", mechanism)
    assert not given
    found = static_balancing.design_springs(mechanism, places)
    assert found.is_balanced(1e-12)
    assert [s.stiffness for s in found.springs] == pytest.approx([9.81 * 0.91157 / (0.15 * 0.075)] * 2, rel=1e-4)
    path = tmp_path / "mine.toml"
    path.write_text(
        '[[spring]]\nstiffness = "2 N/cm"\nfirst = { body = "base", at = ["0 m", "20 cm", "0 m"] }\n'
        'second = { body = "AC" }\n', encoding="utf-8",
    )  # fmt: skip
    springs, given = load_springs(path, mechanism)
    assert given
    assert springs[0].stiffness == pytest.approx(200.0)
    evaluated = static_balancing.evaluate_springs(mechanism, springs)
    assert not evaluated.is_balanced(1e-3)
    assert (spring_lengths(mechanism, springs, evaluated.q) > 0.0).all()


def test_an_end_on_a_body_that_is_fixed_to_another(tmp_path):
    """Its place is in that body's own frame."""
    hand = '<body name="hand" pos="0.3 0 0" euler="0 0 1.5707963267948966"/>'
    path = tmp_path / "mine.toml"
    end = '{ body = "hand", at = ["0.1 m", "0 m", "0 m"] }'
    path.write_text(f'[[spring]]\nfirst = {end}\nsecond = {{ body = "base" }}\n', encoding="utf-8")
    ((spring,), _) = load_springs(path, models.model(models.mjcf(models.link(hand, "arm"))))
    assert spring.first.position == pytest.approx([0.3, 0.1, 0.0])


WRONG = {
    "springs = 1": "springs: unknown key; did you mean 'spring'",
    "[[spring]]\nfirst = 1": r"spring\[0\]\.first: 1: expected a table",
    '[[spring]]\nfirst = { body = "X" }\nsecond = { body = "base" }': "no moving body 'X'",
    '[[spring]]\nfirst = { body = "base", at = ["1", "0 m", "0 m"] }\nsecond = { body = "base" }': "no unit",
    '[[spring]]\nfirst = { body = "base", at = ["1 m"] }\nsecond = { body = "base" }': "first.at: missing: expected",
    '[[spring]]\nfirst = { body = "base" }\nsecond = { body = "AC" }\nlength = "1 m"': "length: unknown key",
    '[[spring]]\nfirst = { body = "base" }\nsecond = { body = "AC" }\nstiffness = "-1 N/m"': "'-1 N/m': expected more",
    '[[spring]]\nfirst = { body = "base" }\nsecond = { body = "AC" }\nstiffness = "1 N/m"\n'
    '[[spring]]\nfirst = { body = "base" }\nsecond = { body = "BD" }': "give all or none",
}


@pytest.mark.parametrize(("text", "message"), WRONG.items(), ids=range(len(WRONG)))
def test_wrong_spring_files_are_named(tmp_path, text, message):
    """The spring and the key."""
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises((DataError, ModelError), match=message):
        load_springs(path, models.load("parallelogram-6bar"))


def test_a_spring_that_rounding_holds(monkeypatch):
    """Linear programming may hold more springs than are needed, at rounding: dependent, they took others below zero."""
    a, b = np.random.default_rng(29).normal(size=(2, 30))
    held = SimpleNamespace(success=True, x=np.array([1.0, 2e-6, 3e-6]))
    monkeypatch.setattr(static_balancing, "linprog", lambda *_, **__: held)
    columns = np.column_stack([a, b, a + b])
    found = static_balancing._softest(models.load("four-bar"), columns, a, np.ones(3))
    assert found == pytest.approx([1.0, 0.0, 0.0], abs=1e-12)
