"""What is missing, from forces: linear in the conditions, with intervals, refused where nothing excites it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binomtest

from balance.balancing import conditions
from balance.balancing.sizing import exact_sizing
from balance.balancing.sizing_study import study_sizing
from balance.closure import Closure
from balance.dynamics.regressor import wrench_regressor
from balance.errors import DataError
from balance.estimation.first_moment_imbalance import (
    can_be_met,
    condition_columns,
    imbalance_fit,
    masses_per_value,
    with_condition_values,
)
from balance.estimation.identifiability import NotIdentifiable
from balance.estimation.regression import RegressionRecord
from balance.mechanism.mjcf_parser import load_mechanism
from balance.motion import Samples

from .. import models

MECHANISMS = ("parallelogram-6bar", "four-bar", "serial-2r", "serial-3r")


def equations(mechanism, count=400, seed=0):
    """Columns (n, 3, rank) and shaking force (n, 3) [N] along a motion of all driven joints."""
    path = moved(Closure(mechanism), count, np.random.default_rng(seed))
    regressor = wrench_regressor(mechanism, path.q, path.v, path.a)[:, :3]
    found = conditions.balance_conditions(mechanism)
    return found, condition_columns(found, regressor), regressor @ mechanism.pi


def moved(closure, count, rng):
    """A motion of the driven joints, two sines each, closed at every sample."""
    mechanism, t = closure.mechanism, np.linspace(0.0, 2.0, count)
    home = np.array([mechanism.home[mechanism.coordinate_index(j)] for j in mechanism.driven])
    omega = 2 * np.pi * rng.uniform(1.0, 3.0, (2, len(home)))
    wave = [0.1 * np.sin(np.multiply.outer(t, w)) for w in omega]
    rate = [0.1 * w * np.cos(np.multiply.outer(t, w)) for w in omega]
    bend = [-(w**2) * x for w, x in zip(omega, wave, strict=True)]
    return closure.follow(Samples(t, home + sum(wave), sum(rate), sum(bend), mechanism.driven))


def record(columns, force, nuisance=None, stretches=20):
    """One record in equal stretches."""
    none = np.zeros((*force.shape, 1)) if nuisance is None else nuisance
    return RegressionRecord.of(columns, force, np.arange(len(force)) * stretches // len(force), none)


def measure(records, found):
    """Values of the conditions from records."""
    return imbalance_fit(records, found).imbalance


@pytest.mark.parametrize("name", MECHANISMS)
def test_values_are_those_of_the_model(name):
    """From exact forces come exactly the values of the conditions, whatever the masses."""
    found, columns, force = equations(load_mechanism(name))
    measured = measure([record(columns, force)], found)
    assert measured.values == pytest.approx(found.values(), abs=1e-9)
    assert measured.unexplained < 1e-6


@pytest.mark.parametrize("name", MECHANISMS)
def test_missing_masses_are_those_of_exact_sizing(name):
    """What each site lacks, from exact forces, is what sizing from the model mounts there."""
    mechanism = load_mechanism(name)
    found, columns, force = equations(mechanism)
    lacking = measure([record(columns, force)], found).missing(mechanism, mechanism.counter_sites)
    sized = exact_sizing(found, mechanism)
    for one, other in zip(lacking, sized.counter_masses, strict=True):
        if other.mass > 0.0:
            assert one.mass.value == pytest.approx(other.mass, rel=1e-6)
        assert one.first_moment.value == pytest.approx(one.mass.value * one.lever_arm, rel=1e-12)


def test_the_built_set_of_the_manipulator():
    """17.1105 kg for 3.4116 kg leave 0.03081 kg m on each arm: 0.8205 kg at 37.55 mm."""
    masses = {"counter_A0A": 17.1105, "counter_B0B": 17.1105}
    mechanism = load_mechanism("parallelogram-6bar").with_payload({"platform": 3.4116}).with_counter_mass(masses)
    found, columns, force = equations(mechanism)
    for one in measure([record(columns, force)], found).missing(mechanism, mechanism.counter_sites):
        assert one.first_moment.value == pytest.approx(0.030809, abs=1e-6)
        assert one.mass.value == pytest.approx(0.8205, abs=1e-4)


def test_nuisances_do_not_matter():
    """Any amount of an offset, and of a signal that is named as one, leaves the values as they are."""
    found, columns, force = equations(load_mechanism("four-bar"))
    rng = np.random.default_rng(1)
    other = rng.normal(size=force.shape)
    nuisance = np.stack([np.ones_like(force), other], axis=2)
    measured = measure([record(columns, force + 70.0 + 5.0 * other, nuisance)], found)
    assert measured.values == pytest.approx(found.values(), abs=1e-9)


def test_records_are_joined():
    """Two records that each excite half of the conditions determine all of them; one alone is refused."""
    mechanism = load_mechanism("serial-2r")
    found, columns, force = equations(mechanism)
    values = found.values()
    halves = [columns.copy(), columns.copy()]
    halves[0][:, :, 2:] = halves[1][:, :, :2] = 0.0
    records = [record(half, half @ values) for half in halves]
    assert measure(records, found).values == pytest.approx(values, abs=1e-9)
    with pytest.raises(NotIdentifiable, match=r"does not determine mc.*: its motion does not excite it"):
        measure(records[:1], found).missing(mechanism, mechanism.counter_sites)
    assert force.shape == columns.shape[:2]


def test_no_motion_is_refused():
    """Columns of zeros determine nothing."""
    found, columns, force = equations(load_mechanism("four-bar"))
    with pytest.raises(NotIdentifiable, match="nothing moves"):
        measure([record(0.0 * columns, force)], found)


def test_too_few_stretches_are_refused():
    """An interval needs stretches to leave out."""
    found, columns, force = equations(load_mechanism("four-bar"))
    with pytest.raises(DataError, match="blocks"):
        measure([record(columns, force, stretches=4)], found)


def test_adjusted_has_the_values_that_it_is_given():
    """The mechanism with measured values has them, and sizing of it mounts what is missing."""
    mechanism = load_mechanism("parallelogram-6bar")
    found = conditions.balance_conditions(mechanism)
    values = np.array([0.4, 0.01, 0.39, -0.02])
    changed = with_condition_values(found, mechanism, values)
    assert found.values(changed) == pytest.approx(values, abs=1e-12)
    left = found.values(exact_sizing(found, changed).after)  # across the links, where no site is
    assert left[[1, 3]] == pytest.approx([0.01, -0.02], abs=1e-9)


def test_intervals_hold():
    """With forces whose noise is correlated in time, 95 % intervals hold the truth as often, over seeds."""
    found, columns, force = equations(load_mechanism("four-bar"), 800)
    hits = []
    for seed in range(60):
        white = np.random.default_rng(seed).normal(size=(len(force) + 20, 3))
        noise = 0.5 * np.array([np.convolve(w, np.ones(20) / np.sqrt(20.0), "valid")[: len(force)] for w in white.T]).T
        estimate = measure([record(columns, force + noise)], found).estimate(np.eye(4)[0])
        hits.append(estimate.interval()[0] <= found.values()[0] <= estimate.interval()[1])
    assert binomtest(sum(hits), len(hits), 0.95).pvalue > 1e-3


def test_gains_say_how_readings_move_the_values():
    """Readings that are more move the values by their gains, nuisances and what else is unknown estimated jointly.

    One row hardly tells the four conditions apart. Values from normal equations are known to the rounding of those
    times their condition, the square of that of the columns; the change, of the size of the values, no better.
    """
    found, columns, force = equations(load_mechanism("four-bar"))
    rng = np.random.default_rng(1)
    columns = np.concatenate([columns, rng.normal(size=(*force.shape, 2))], axis=2)[:, :1]
    force, nuisance = force[:, :1] + 0.1 * rng.normal(size=(len(force), 1)), rng.normal(size=(len(force), 1, 2))
    before = imbalance_fit([record(columns, force, nuisance)], found)
    more = rng.normal(size=force.shape)
    after = imbalance_fit([record(columns, force + more, nuisance)], found)
    expected = np.einsum("nj,njk->k", more, before.gains()[0])
    sizes = np.linalg.norm(columns[:, 0], axis=0)
    sizes[: found.rank] = sizes[: found.rank].max()  # as the fit scales them: all conditions equally
    condition = np.linalg.cond(columns[:, 0] / sizes) ** 2
    rounding = 10.0 * np.finfo(float).eps * condition * np.linalg.norm(expected)
    assert rounding < 1e-5 * np.linalg.norm(expected)
    assert after.imbalance.values - before.imbalance.values == pytest.approx(expected, rel=0.0, abs=rounding)
    assert before.regression.explained()[0] == pytest.approx(force, abs=0.5)


def test_a_prior_holds_what_else_is_unknown():
    """A column of which much is known takes up nothing, one of which nothing is known all that it can."""
    found, columns, force = equations(load_mechanism("four-bar"))
    also = np.random.default_rng(2).normal(size=(*force.shape, 1))
    both = [record(np.concatenate([columns, also], axis=2), force + 0.5 * also[:, :, 0])]
    free = imbalance_fit(both, found, prior=np.zeros(1))
    fixed = imbalance_fit(both, found, prior=np.array([1e12]))
    assert free.shared == pytest.approx([0.5], abs=1e-6)
    assert fixed.shared == pytest.approx([0.0], abs=1e-6)


def test_few_stretches_that_tell_leave_few_degrees_of_freedom():
    """Where two stretches of twenty move the mechanism, these alone tell: the factor to an interval is larger."""
    found, columns, force = equations(load_mechanism("four-bar"))
    rng = np.random.default_rng(3)
    noise = 0.1 * rng.normal(size=force.shape)
    everywhere = measure([record(columns, force + noise)], found)
    rests = np.where(np.arange(len(force)) < len(force) // 10, 1.0, 0.03)[:, None]
    seldom = measure([record(columns * rests[:, :, None], force * rests + noise)], found)
    share = np.eye(found.rank)[0]
    assert seldom.degrees_of_freedom_of(share) < 4 <= 8 < everywhere.degrees_of_freedom_of(share)
    wide, narrow = (
        m.estimate(share).half_width() / m.estimate(share).standard_uncertainty for m in (seldom, everywhere)
    )
    assert wide > 1.3 * narrow


def test_a_site_beside_the_plane_counts_by_its_distance_from_the_axis():
    """0.6 kg at (-0.2, 0, 0.04) m, the joint's axis along z, are 0.1200 kg m: the 40 mm along the axis do not turn."""
    arm = load_mechanism("serial-2r")
    aside = replace(arm.site("counter_link_1"), position=np.array([-0.2, 0.0, 0.04]))
    mechanism = replace(arm, sites={**arm.sites, "counter_link_1": aside})
    found, columns, force = equations(mechanism)
    heavier = mechanism.with_counter_mass({"counter_link_1": 0.6})
    lighter = force - columns @ (found.values(heavier) - found.values(mechanism))
    sites = ["counter_link_1"]
    before, after = (measure([record(columns, f)], found).missing(mechanism, sites)[0] for f in (force, lighter))
    assert after.lever_arm == pytest.approx(0.2)
    assert after.mass.value - before.mass.value == pytest.approx(0.6)
    assert after.first_moment.value - before.first_moment.value == pytest.approx(0.12)
    assert after.with_added(0.6).first_moment.value == pytest.approx(before.first_moment.value)


def test_every_condition_takes_a_degree_of_freedom():
    """20 blocks that determine all equally have 19 degrees of freedom by Satterthwaite: four conditions leave 16."""
    found, columns, force = equations(load_mechanism("four-bar"))
    noise = np.random.default_rng(4).normal(size=force.shape)
    equal = np.tile(columns[:20], (20, 1, 1))
    measured = measure([record(equal, equal @ found.values() + noise)], found)
    assert found.rank == 4
    assert measured.degrees_of_freedom_of(np.eye(4)[0]) == pytest.approx(16.0)


@pytest.mark.parametrize(
    ("name", "sites", "met"),
    [
        ("parallelogram-6bar", ("counter_A0A", "counter_B0B"), True),
        ("parallelogram-6bar", ("counter_A0A",), False),
        ("serial-2r", None, True),
        ("five-bar", ("counter_crank_left", "counter_crank_right"), False),
    ],
)
def test_whether_masses_at_sites_can_meet_the_conditions(name, sites, met):
    """Both arms of the manipulator carry one each; cranks alone never balance the rods of a five-bar."""
    mechanism = load_mechanism(name)
    found = conditions.balance_conditions(mechanism)
    assert can_be_met(found, mechanism, sites or mechanism.counter_sites) is met


@pytest.mark.parametrize("along", ["1 0 0", "0 1 0", "0.6 0 0.8", "0 0 1"])
def test_what_turns_on_a_slide_is_balanced_about_its_own_joints(along):
    """Masses by hand: 1.44 kg zero the outer first moment, then 7.013 kg the inner one, whatever slide carries both."""
    mechanism = models.model(models.on_a_slide(along, 0.3))
    found = conditions.balance_conditions(mechanism)
    sites = ["counter_upper", "counter_tip"]
    tip = 1.2 * 0.12 / 0.1
    upper = (2.0 * 0.13 + 0.3 * (1.2 + tip)) / 0.15
    masses = masses_per_value(found, mechanism, sites, found.values()) @ found.values()
    np.testing.assert_allclose(masses, [upper, tip], rtol=1e-9)
    assert found.first_moment_residual(mechanism) == pytest.approx(2.0 * 0.13 + 0.3 * 1.2, rel=1e-9)
    balanced = mechanism.with_counter_mass(dict(zip(sites, masses, strict=True)))
    assert found.first_moment_residual(balanced) < 1e-12
    assert not can_be_met(found, mechanism, sites)
    assert can_be_met(found, mechanism, sites, found.on_first_moments)
    sized = study_sizing(mechanism)
    other = sized.without_slides
    assert [one.mass for one in other.counter_masses] == pytest.approx([upper, tip], rel=1e-6)
    assert f"zero with {upper:.4f} kg at counter_upper, {tip:.4f} kg at counter_tip" in str(sized)


def test_the_force_follows_from_the_conditions_where_a_mass_stands_before_the_first_moment_that_leads():
    """A body with two hinges 0.3 m apart, geared to the next one: 0.3 m[x] + mcx[y] = 0, and the file has x first."""
    hinges = '<joint name="a" axis="0 0 1"/><joint name="b" axis="0 0 1" pos="0.3 0 0"/>'
    gear = '<equality><joint joint1="y" joint2="a" polycoef="0 1 0 0 0"/></equality>' + models.motors("a", "b")
    machine = models.model(models.mjcf(models.link("", "x", hinges) + models.link("", "y"), gear))
    found, columns, force = equations(machine, 20)
    assert "0.3 m[x] + mcx[y] = 0" in found.table()["condition"].tolist()
    np.testing.assert_allclose(columns @ found.values(), force, atol=1e-12 * np.abs(force).max())


SLIDE = '<joint name="{0}" type="slide" axis="{1}"/>'
TIE = '<equality><joint joint1="b" joint2="{0}" polycoef="0 {1} 0 0 0"/></equality>'


@pytest.mark.parametrize("order", [1, -1])
def test_slides_that_move_against_each_other_are_balanced_by_masses(order):
    """Carriage b goes half as far as a, against it: of 2 kg and 1.5 kg, b lacks 2.5 kg, which are told and balance."""
    slides = [
        models.link(f'<site name="counter_{n}"/>', n, SLIDE.format(n, "1 0 0"), mass=m)
        for n, m in (("a", 2.0), ("b", 1.5))
    ]
    machine = models.model(models.mjcf("".join(slides[::order]), TIE.format("a", -0.5) + models.motors("a")))
    found = conditions.balance_conditions(machine)
    masses = masses_per_value(found, machine, ["counter_b"], found.values()) @ found.values()
    assert masses == pytest.approx([2.5], rel=1e-9)
    assert found.residual("kg") == pytest.approx(2.5, rel=1e-9)  # and not 1.25 where a is first
    balanced = machine.with_counter_mass({"counter_b": masses[0]})
    assert np.abs(found.values(balanced)).max() < 1e-9


def test_what_no_masses_meet_is_left_out_whatever_the_rows():
    """Slide a along x carries b, which goes along y as c does: m[a] - m[c] = 0 alone could be met, both never."""
    inner = models.link("", "b", SLIDE.format("b", "0 1 0"))
    bodies = models.link(inner, "a", SLIDE.format("a", "1 0 0")) + models.link("", "c", SLIDE.format("c", "0 1 0"))
    found = conditions.balance_conditions(
        models.model(models.mjcf(bodies, TIE.format("c", 1) + models.motors("a", "c")))
    )
    assert [found.text(row) for row in range(2)] == ["m[a] - m[c] = 0", "m[b] + m[c] = 0"]
    assert not found.on_first_moments.any()


@pytest.mark.parametrize("stroke", ["", 'range="-0.04 0.04"', 'range="-0.1 0.1"'])
def test_a_ram_counts_where_it_begins(stroke):
    """In the middle of its stroke: 0.12 m beyond its guide at 0.3 m, whatever the stroke."""
    mechanism = models.model(models.on_a_slide("1 0 0", 0.3, stroke or 'range="-1 1"'))
    found = conditions.balance_conditions(mechanism)
    masses = masses_per_value(found, mechanism, ["counter_upper"], found.values()) @ found.values()
    assert masses[0] == pytest.approx((2.0 * 0.13 + 1.2 * (0.3 + 0.12)) / 0.15, rel=1e-6)
