"""Engines: orders, places, shafts and firing, against independent dynamics and textbook values."""

import numpy as np
import pytest

from balance import datasets
from balance.closure import Closure
from balance.dynamics.inverse_dynamics import simulate
from balance.engines import free_forces
from balance.engines.engine import Cylinder, Engine, firing
from balance.engines.engine_files import load_engine, load_layout, mjcf
from balance.engines.slider_crank import SliderCrank
from balance.errors import DataError
from balance.mechanism.mjcf_parser import mechanism_from_text
from balance.motion import Samples
from balance.rotors.rotor import Unbalance

LAYOUTS = [name for name in datasets.dataset_names("engines", ".toml") if load_engine(name).normalised]
THETA = np.linspace(0.0, 2 * np.pi, 73)


def _random(seed):
    """An engine of random cylinders: own places, throws, banks and masses."""
    rng = np.random.default_rng(seed)
    cylinders = []
    for _ in range(int(rng.integers(1, 5))):
        r, rod, mass = rng.uniform(0.03, 0.06), rng.uniform(0.12, 0.2), rng.uniform(0.3, 1.0, 3)
        centre, rod_centre, offset = rng.uniform(-0.5, 0.8) * r, rng.uniform(0.2, 0.6) * rod, rng.uniform(-0.1, 0.1) * r
        inertias = 0.3 * mass[0] * r**2, 0.1 * mass[1] * rod**2
        crank = SliderCrank(r, rod, mass[0], centre, inertias[0], mass[1], rod_centre, inertias[1], mass[2], offset)
        cylinders.append(Cylinder(rng.uniform(-0.3, 0.3), *rng.uniform(0, 2 * np.pi, 2), crank))
    weights = [Unbalance("w", complex(*rng.normal(0, 0.02, 2)), rng.uniform(-0.3, 0.3)) for _ in range(2)]
    return Engine("random", tuple(cylinders), tuple(weights))


@pytest.mark.parametrize("seed", range(5))
def test_whole_engine_against_its_mechanism(seed):
    """Any banks, throws, places and counterweights at varying speed: force, all moments and torque to 1e-10."""
    engine = _random(seed)
    time = np.linspace(0.0, 1.0, 80)
    theta, omega, alpha = 30 * time + np.sin(9 * time), 30 + 9 * np.cos(9 * time), -81 * np.sin(9 * time)
    model = mechanism_from_text(mjcf(engine), "engine")
    motion = Samples(time, theta[:, None], omega[:, None], alpha[:, None], joints=("crankshaft",))
    found = simulate(model, Closure(model).follow(motion))
    force, tilting = engine.force(theta, omega, alpha), engine.tilting(theta, omega, alpha)
    np.testing.assert_allclose(found.force[:, 0] + 1j * found.force[:, 1], force, atol=1e-10 * np.abs(force).max())
    size = np.abs(tilting).max()
    np.testing.assert_allclose(-found.moment[:, 0], tilting.imag, atol=1e-10 * size)
    np.testing.assert_allclose(found.moment[:, 1], tilting.real, atol=1e-10 * size)
    rolling, torque = engine.rolling(theta, omega, alpha), engine.torque(theta, omega, alpha)
    np.testing.assert_allclose(found.moment[:, 2], rolling, atol=1e-10 * np.abs(rolling).max())
    np.testing.assert_allclose(found.torque["crankshaft"], torque, atol=1e-10 * np.abs(torque).max())


@pytest.mark.parametrize("seed", range(3))
def test_orders_sum_to_the_exact_force_and_moment(seed):
    """All orders together are the exact force, and the exact moment about any place."""
    engine = _random(seed)
    found = free_forces.free_forces(engine, 40, about=0.07)
    force = sum(f.force.at(THETA) for f in found)
    moment = sum(f.moment.at(THETA) for f in found)
    np.testing.assert_allclose(force, engine.force(THETA, 1.0), atol=1e-12 * np.abs(force).max())
    np.testing.assert_allclose(moment, engine.tilting(THETA, 1.0, about=0.07), atol=1e-12 * np.abs(moment).max())


@pytest.mark.parametrize("seed", range(3))
def test_half_axes_are_the_extremes(seed):
    """An order's largest and least values over a turn are the half-axes, in their direction."""
    for free in free_forces.free_forces(_random(seed), 3):
        values = free.force.at(np.linspace(0, 2 * np.pi, 20001))
        assert np.abs(values).max() == pytest.approx(free.force.largest, rel=1e-6)
        assert np.abs(values).min() == pytest.approx(free.force.least, rel=1e-4, abs=1e-7)
        along = (values * np.exp(-1j * free.force.direction)).real
        assert np.abs(along).max() == pytest.approx(free.force.largest, rel=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_shafts_remove_every_order(seed):
    """Shafts make the opposite of force and moment of their order, about any place."""
    found = free_forces.free_forces(_random(seed), 4)
    for shaft in free_forces.balance_shafts(found, -0.2, 0.3):
        free = found[shaft.order - 1]
        force, moment = (free_forces.shaft_vectors([shaft], 0.0, about) for about in (None, free.about))
        own = (
            (free.force.forward, free.moment.forward) if shaft.forward else (free.force.backward, free.moment.backward)
        )
        scale = abs(own[0]) + abs(own[1])
        assert abs(force + own[0]) < 1e-13 * scale
        assert abs(moment + own[1]) < 1e-13 * scale


@pytest.mark.parametrize(
    ("name", "F1", "M1", "F2", "M2"),
    [
        ("in-line-1", 1.0, 0.0, 1.0, 0.0),
        ("in-line-2-360", 2.0, 0.0, 2.0, 0.0),
        ("in-line-2-180", 0.0, 1.0, 2.0, 0.0),
        ("in-line-3", 0.0, np.sqrt(3), 0.0, np.sqrt(3)),
        ("in-line-4", 0.0, 0.0, 4.0, 0.0),
        ("in-line-4-crossplane", 0.0, np.sqrt(10), 0.0, 0.0),
        ("in-line-5", 0.0, 0.4490, 0.0, 4.9798),
        ("in-line-6", 0.0, 0.0, 0.0, 0.0),
        ("boxer-4", 0.0, 0.0, 0.0, 1.0),
        ("boxer-6", 0.0, 0.0, 0.0, 0.0),
        ("v2-90", 1.0, 0.0, np.sqrt(2), 0.0),
        ("v6-60", 0.0, 1.5, 0.0, 1.5),
        ("v8-90-crossplane", 0.0, np.sqrt(10), 0.0, 0.0),
        ("v8-90-flat", 0.0, 0.0, 4 * np.sqrt(2), 0.0),
        ("v12-60", 0.0, 0.0, 0.0, 0.0),
    ],
)
def test_common_engines(name, F1, M1, F2, M2):
    """Textbook amplitudes, in m r omega^2 (times r / l at second order) and the spacing."""
    first, second = free_forces.free_forces(load_layout(name), kind="second-order")
    assert first.force.largest == pytest.approx(F1, abs=1e-12)
    assert first.moment.largest == pytest.approx(M1, rel=1e-4, abs=1e-12)
    assert second.force.largest / 0.25 == pytest.approx(F2, abs=1e-12)
    assert second.moment.largest / 0.25 == pytest.approx(M2, rel=1e-4, abs=1e-12)
    if name in {"v2-90", "v6-60", "v8-90-crossplane"}:  # counterweights alone balance first order
        assert max(abs(first.force.backward), abs(first.moment.backward)) < 1e-12


def test_in_line_four_of_the_source():
    """Only the first-order moment remains; its sums are -3 a and -a about cylinder 1, its amplitude sqrt(10)."""
    engine = load_engine("in-line-4-two-stroke")
    sums = {k: free_forces.cylinder_sums(engine, k) for k in (1, 2)}
    assert sums[1] == {"force": (0.0, 0.0), "moment": (pytest.approx(-3.0), pytest.approx(-1.0))}
    assert sums[2] == {"force": (0.0, 0.0), "moment": (0.0, 0.0)}
    first, second = free_forces.free_forces(engine, kind="second-order", about=0.0)
    assert first.moment.largest == pytest.approx(np.sqrt(10))
    assert second.force.largest == second.moment.largest == first.force.largest == 0.0
    theta = np.linspace(0, 6, 40)
    np.testing.assert_allclose(first.moment.at(theta).real, -3 * np.cos(theta) + np.sin(theta), atol=1e-12)
    assert firing(engine).even


def test_place_of_the_resultant():
    """Equal cranks act in the middle; a resultant that wanders, or a couple, has no place."""
    four = free_forces.free_forces(load_layout("in-line-4"), 2, about=-1.0)
    assert four[1].place == pytest.approx(1.5)
    assert four[0].place is None
    twin = free_forces.free_forces(load_layout("in-line-2-270"), 1)[0]
    assert twin.force.largest > 0.0
    assert twin.place is None
    single = free_forces.free_forces(load_layout("in-line-1"), 1, about=0.4)[0]
    assert single.place == pytest.approx(0.0)


@pytest.mark.parametrize("name", LAYOUTS)
def test_lanchester_shafts_of_an_in_line_four(name):
    """Second order of any layout: each shaft's unbalance is the turning part over 4, m r lambda / 2 in the four."""
    second = free_forces.free_forces(load_layout(name), kind="second-order")[1]
    found = [s for s in free_forces.balance_shafts([second], 0.0, 3.0) if len(s.unbalances) == 1]
    for shaft in found:
        part = second.force.forward if shaft.forward else second.force.backward
        assert shaft.unbalances[0].vector == pytest.approx(-part / 4)
    if name == "in-line-4":
        assert [abs(s.unbalances[0].vector) for s in found] == pytest.approx([0.125, 0.125])
        assert [s.unbalances[0].at for s in found] == pytest.approx([1.5, 1.5])


@pytest.mark.parametrize(
    ("name", "intervals"),
    [
        ("in-line-3", [240] * 3),
        ("in-line-4", [180] * 4),
        ("in-line-4-crossplane", [90, 180, 270, 180]),
        ("in-line-5", [144] * 5),
        ("in-line-6", [120] * 6),
        ("boxer-2", [360] * 2),
        ("v2-45", [405, 315]),
        ("v2-90", [450, 270]),
        ("v6-60", [120] * 6),
        ("v6-90-split", [120] * 6),
        ("v8-90-crossplane", [90] * 8),
        ("v12-60", [60] * 12),
    ],
)
def test_firing_intervals(name, intervals):
    """Firing intervals of the common engines [deg]."""
    assert firing(load_engine(name)).intervals_deg == pytest.approx(intervals)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            'throws = ["0 deg", "240 deg", "120 deg", "120 deg", "240 deg", "0 deg"]\n'
            "firing_order = [1, 2, 3, 4, 5, 6]",  # takes more than two turns
            "does not fit into one cycle",
        ),
        ("throws = []", "throws: has 0 values: expected at least 1"),
        ('throws = ["0 deg"]\nbanks = ["0 deg", "1 deg"]', "banks: has 2 values: expected one for each of the 1"),
        ('throws = ["0 deg"]\nfiring_order = [2]', r"firing_order: \[2\]: expected the cylinders"),
        ('throws = ["0 deg"]\n[slider_crank]\ncrank_radius = "1 m"\nrod_length = "3 m"', "piston_mass: missing"),
        (
            'throws = ["0 deg"]\n[slider_crank]\ncrank_radius = "1 m"\nrod_length = "3 m"\npiston_mass = "1 kg"\n'
            'rod_mass = "1 kg"',
            "rod_centre is missing",
        ),
        (
            'throws = ["0 deg"]\n[slider_crank]\ncrank_radius = "1 m"\nrod_length = "0.3 m"\npiston_mass = "1 kg"',
            "engine.toml: slider_crank: crank 1 m, rod 0.3 m",
        ),
        (
            'throws = ["0 deg", "180 deg"]\n[slider_crank]\ncrank_radius = "1 m"\nrod_length = "3 m"\n'
            'piston_mass = "1 kg"',
            "spacing is missing",
        ),
        (
            'throws = ["0 deg"]\n[slider_crank]\ncrank_radius = "1 m"\nrod_length = "3 m"\npiston_mass = "1 kg"\n'
            'rod_inertia = "-1 kg m^2"',
            "slider_crank.rod_inertia: '-1 kg m\\^2': expected zero or more",
        ),
        (
            'throws = ["0 deg"]' + 2 * ('\n[[counterweights]]\nname = "a"\nunbalance = "1 kg mm @ 0 deg"\nat = 1'),
            "counterweights: 'a' is there twice",
        ),
    ],
)
def test_wrong_files_are_named(tmp_path, text, message):
    """What is missing, unknown or of the wrong number is refused by key."""
    path = tmp_path / "engine.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(DataError, match=message):
        firing(load_engine(path))


def test_cylinders_on_one_pin_need_no_spacing(tmp_path):
    """A V-twin whose rods share a plane: the counterweight of its first order is half the two reciprocating masses."""
    path = tmp_path / "v.toml"
    path.write_text(
        'throws = ["0 deg", "0 deg"]\nbanks = ["-45 deg", "45 deg"]\nat = [0, 0]\n'
        '[slider_crank]\ncrank_radius = "40 mm"\nrod_length = "150 mm"\npiston_mass = "0.5 kg"\n',
        encoding="utf-8",
    )
    forward = free_forces.free_forces(load_engine(path), 2)[0].force.forward
    assert abs(forward) == pytest.approx(0.5 * 0.04)
