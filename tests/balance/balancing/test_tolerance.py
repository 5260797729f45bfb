"""Tolerances: the linear answer against mechanisms that are made and simulated, and its own limits."""

import numpy as np
import pytest

from balance.balancing.sweep import Problem
from balance.balancing.tolerance import Tolerance, analyze_tolerances
from balance.closure import Closure
from balance.dynamics.inverse_dynamics import simulate
from balance.errors import ClosureError, ModelError
from balance.mechanism.mjcf_parser import mechanism_from_text
from balance.motion.motion_files import load_motion
from balance.task_pool import HERE
from tests.balance.models import load
from tests.other_process import OtherProcess

COUNTERS = {"counter_A0A": 24.2761, "counter_B0B": 24.2761}
TOLERANCES = (
    Tolerance("counter_A0A", "mass", 0.2), Tolerance("counter_B0B", "x", 1e-3), Tolerance("platform", "mass", 0.1),
)  # fmt: skip


def manipulator() -> Problem:
    """The manipulator with 5 kg, balanced, on its motion along x."""
    mechanism = load("parallelogram-6bar").with_payload({"platform": 5.0})
    return Problem(mechanism, load_motion("x").sample(300.0), COUNTERS)


def test_as_mechanisms_that_are_made():
    """Percentiles of 200 mechanisms, each with its own masses and radius: 3 s of their sampling scatter of 4 %."""
    problem, rng = manipulator(), np.random.default_rng(5)
    found = analyze_tolerances(problem, TOLERANCES, 20_000, 1)
    trajectory, made = Closure(problem.mechanism).follow(problem.samples), []
    for error in rng.uniform(-1.0, 1.0, (200, 3)):
        mass, radius, payload = error * [t.half_width for t in TOLERANCES]
        moved = problem.with_points({("counter_B0B", "x"): problem.place("counter_B0B", "x") + radius}).mechanism
        counters = {**COUNTERS, "counter_A0A": COUNTERS["counter_A0A"] + mass}
        mechanism = moved.with_payload({"platform": 5.0 + payload}).with_counter_mass(counters)
        made.append(float(np.sqrt(np.mean(np.sum(simulate(mechanism, trajectory).force ** 2, axis=1)))))
    assert np.percentile(made, 50) == pytest.approx(found.percentiles["50"], rel=0.12)
    assert np.percentile(made, 95) == pytest.approx(found.percentiles["95"], rel=0.12)
    assert not found.doubtful
    assert sum(effect.variance_share for effect in found.effects) == pytest.approx(1.0)
    costs = [effect.rms_95 for effect in found.effects]
    assert costs == sorted(costs, reverse=True)


def test_a_payload_at_a_site_stays_where_a_place_is_in_error():
    """Joint A out of place, 1 kg at B of the coupler: as with a body of that mass in the file, fixed there."""
    filed = load("four-bar")
    body = '<body name="load" pos="0.26 0 0"><inertial pos="0 0 0" mass="1" diaginertia="1e-9 1e-9 1e-9"/></body>'
    site = '<site name="B_AB" pos="0.26 0 0"/>'
    assert site in filed.text
    written = mechanism_from_text(filed.text.replace(site, site + body), "written")
    samples, errors = load_motion("four-bar").sample(300.0), [Tolerance("AB", "x", 2e-4)]
    found, expected = (
        analyze_tolerances(Problem(one, samples, {"counter_A0A": 1.0}), errors, 1000, 1)
        for one in (filed.with_payload({"B_AB": 1.0}), written)
    )
    assert found.nominal == pytest.approx(expected.nominal, rel=1e-9)
    assert found.percentiles == pytest.approx(expected.percentiles, rel=1e-9)


def test_one_error_in_closed_form():
    """One counter-mass wrong by t: the force is |error| times that of 1 kg there, rectangular: 95 % within 0.95 t."""
    found = analyze_tolerances(manipulator(), TOLERANCES[:1], 20_000, 1)
    balanced = manipulator()
    off = Problem(balanced.mechanism, balanced.samples, {**COUNTERS, "counter_A0A": COUNTERS["counter_A0A"] + 0.2})
    full = off.results((), np.zeros((1, 0)))["rms_F_N"][0]
    assert found.percentiles["95"] == pytest.approx(0.95 * full, rel=0.02)
    assert found.nominal < 1e-3 * full


@pytest.mark.parametrize(
    ("name", "part", "in_per_cent", "in_units"),
    [
        ("counter_A0A", "mass", "2%", f"{0.02 * COUNTERS['counter_A0A']!r} kg"),
        ("platform", "mass", "1 %", "50 g"),
        ("BD", "x", ".5%", 0.005),
    ],
)
def test_per_cent_are_of_the_nominal_value(name, part, in_per_cent, in_units):
    """Of the counter-mass that is mounted, a body's mass with its payload, the coordinate in the file."""
    problem = manipulator()
    if part == "x":
        in_units *= abs(problem.place(name, part))
    one, other = (
        analyze_tolerances(problem, [Tolerance.of(name, part, error)], 1000, 1) for error in (in_per_cent, in_units)
    )
    assert one.effects[0].tolerance.half_width == pytest.approx(other.effects[0].tolerance.half_width, rel=1e-12)
    assert one.percentiles["95"] == pytest.approx(other.percentiles["95"], rel=1e-9)


def test_per_cent_of_nothing_are_refused():
    """A site without a counter-mass has no mass of which a part could be meant."""
    problem = Problem(load("four-bar"), load_motion("four-bar").sample(300.0))
    with pytest.raises(ModelError, match=r"counter_A0A.mass is zero, of which 2 % are nothing: give .* --counter"):
        analyze_tolerances(problem, [Tolerance.of("counter_A0A", "mass", "2%")], 1000, 1)


def test_a_length_of_the_mechanism():
    """The crank's pin moved evenly over its tolerance, each a file of its own: the same percentiles; bend doubles."""
    four_bar, made = load("four-bar"), []
    problem = Problem(four_bar, load_motion("four-bar").sample(300.0))
    found, half = (analyze_tolerances(problem, [Tolerance("AB", "x", x)], 20_000, 1) for x in (4e-4, 2e-4))
    for x in np.linspace(0.0996, 0.1004, 11):
        text = four_bar.text.replace('name="AB" pos="0.1 0 0"', f'name="AB" pos="{float(x)!r} 0 0"')
        other = mechanism_from_text(text, "four-bar")
        force = simulate(other, Closure(other).follow(problem.samples)).force
        made.append(float(np.sqrt(np.mean(np.sum(force**2, axis=1)))))
    for level in ("50", "90"):
        assert found.percentiles[level] == pytest.approx(np.percentile(made, float(level)), rel=1e-3)
    assert found.percentiles["90"] > 1.001 * found.percentiles["50"]
    assert found.effects[0].curvature == pytest.approx(2.0 * half.effects[0].curvature, rel=0.05)


def test_too_wide_a_tolerance_is_doubtful():
    """A crank of 100 mm that may be 30 mm longer or shorter bends the answer: named, not hidden."""
    problem = Problem(load("four-bar"), load_motion("four-bar").sample(300.0))
    assert [e.tolerance.name for e in analyze_tolerances(problem, [Tolerance("AB", "x", 0.03)], 1000, 1).doubtful] == [
        "AB"
    ]


def test_what_has_no_effect_is_not_doubtful():
    """Where the frame's joint lies does not matter to a balanced four-bar, however bent what is left of it."""
    counters = {"counter_A0A": 1.0738, "counter_B0B": 1.3702}
    problem = Problem(load("four-bar"), load_motion("four-bar").sample(300.0), counters)
    wide, mass = Tolerance("A0A", "x", 8e-3), Tolerance("counter_A0A", "mass", 0.02)
    found = analyze_tolerances(problem, [wide, mass], 1000, 1)
    assert found.effects[1].tolerance == wide
    assert found.effects[1].curvature > 0.05
    assert not found.doubtful


def test_one_out_of_the_plane_is_named():
    """A planar loop does not close with it."""
    problem = Problem(load("four-bar"), load_motion("four-bar").sample(300.0))
    with pytest.raises(ClosureError, match=r"the tolerance AB\.z ± 0\.2 mm: .* out of a planar mechanism's plane"):
        analyze_tolerances(problem, [Tolerance("AB", "z", 2e-4)], 1000, 1)


def test_a_table_has_the_unit_of_each_tolerance():
    """Kilograms and metres in one column are told apart; the keys are those that there were, and the unit's."""
    rows = analyze_tolerances(manipulator(), TOLERANCES, 1000, 1).table()
    by_name = dict(zip(rows["tolerance.name"], rows["tolerance.unit"], strict=True))
    assert by_name == {"counter_A0A": "kg", "counter_B0B": "m", "platform": "kg"}
    assert {"tolerance.part", "tolerance.half_width", "tolerance.relative"} <= set(rows.columns)


@pytest.mark.parametrize(
    ("name", "size", "message"),
    [
        ("counter_A0A", 0.1, "'counter_A0A' is 0 kg with a tolerance of 0.1 kg"),
        ("AB", 5.0, "the mass of 'AB' is .* kg with a tolerance of 5 kg"),
    ],
)
def test_a_mass_below_its_tolerance_is_refused(name, size, message):
    """A mass cannot be negative: --counter is missing or the tolerance is too wide."""
    problem = Problem(load("four-bar"), load_motion("four-bar").sample(300.0))
    with pytest.raises(ModelError, match=message):
        analyze_tolerances(problem, [Tolerance(name, "mass", size)], 1000, 1)


def test_in_other_processes_it_is_the_same():
    """Each end of a tolerance is a task: they travel, and come back in any order."""
    here, there = (analyze_tolerances(manipulator(), TOLERANCES, 1000, 1, pool) for pool in (HERE, OtherProcess(None)))
    assert here == there
