"""Complete balance by the dynamics of the core, of Pinocchio and of MuJoCo."""

from dataclasses import replace

import numpy as np
import pytest

from balance.closure import Closure
from balance.errors import ClosureError, ModelError
from balance.linkages.equivalence_method import balance_linkage
from balance.linkages.linkage_files import linkage_from_table, load_linkage
from balance.linkages.mjcf_writer import geared_trajectory, linkage_mjcf
from balance.linkages.verification import turn_samples, verify_linkage
from balance.mechanism.mjcf_parser import mechanism_from_text

from .conftest import balanced, left_over


def geared_path(result, count=60, variation=0.4):
    """Text and trajectory of every stage at varying speed."""
    linkage = result.linkage
    texts = {stage: linkage_mjcf(result, stage) for stage in ("before", "force", "complete")}
    models = {stage: mechanism_from_text(text, linkage.name) for stage, text in texts.items()}
    closure = Closure(models["before"])
    start = float(closure.home[models["before"].coordinate_index(linkage.drive)])
    path = closure.follow(turn_samples(linkage, linkage.speed, variation, start, count))
    geared = geared_trajectory(result, path, models["before"], models["complete"])
    return texts, {"before": path, "force": path, "complete": geared}


@pytest.mark.parametrize("referee", ["mujoco", "pinocchio"])
@pytest.mark.parametrize("name", ["two-levels", "pantograph"])
def test_shipped_linkages_are_balanced_by_other_dynamics(name, referee, referees):
    """Force and moment are below 1e-10 of before at varying speed, by dynamics that are not ours."""
    texts, paths = geared_path(balance_linkage(load_linkage(name)))
    before, after = (referees[referee](texts[s], paths[s], gravity=False)[:, :3] for s in ("before", "complete"))
    assert np.abs(after[:, :2]).max() < 1e-10 * np.abs(before[:, :2]).max()
    assert np.abs(after[:, 2]).max() < 1e-10 * np.abs(before[:, 2]).max()


@pytest.mark.parametrize("seed", range(6))
def test_random_linkages_are_balanced_by_three_dynamics(seed, random_crank_rocker, referees):
    """Off-line centres, odd gear ratios, two planet levels and a prismatic joint: balanced whatever the numbers are."""
    result = balance_linkage(random_crank_rocker(seed))
    assert all(r < 1e-10 for r in verify_linkage(result, count=120).varying.residual("complete").values())
    texts, paths = geared_path(result, count=24)
    for referee in referees.values():
        before, after = (referee(texts[s], paths[s], gravity=False)[:, :3] for s in ("before", "complete"))
        assert (np.abs(after).max(axis=0) < 1e-10 * np.abs(before).max(axis=0)).all()


@pytest.mark.parametrize("referee", ["mujoco", "pinocchio"])
def test_force_moment_and_torque_are_those_of_other_dynamics(referee, random_crank_rocker, referees):
    """Every stage, weight and gears included: equal to 1e-10 of the largest."""
    result = balance_linkage(random_crank_rocker(11))
    texts, paths = geared_path(result, count=720, variation=0.3)
    run = verify_linkage(result, count=720).varying
    for stage, path in paths.items():
        free, loaded = (referees[referee](texts[stage], path, gravity=g) for g in (False, True))
        series = run.series(stage)
        scale = np.abs(run.series("before")["Fx_N"]).max()
        assert np.allclose(-free[:, 0], series["Fx_N"], atol=1e-10 * scale)
        assert np.allclose(-free[:, 2], series["Mz_Nm"], atol=1e-10 * scale)
        torque = np.einsum("nij,ni->n", path.per_drive, loaded[:, 3:])
        assert np.allclose(torque, series["torque_Nm"], atol=1e-10 * np.abs(torque).max())


def test_slider_crank_needs_no_counter_mass_on_its_slider(slider_crank_keys):
    """A slider whose centre lies on its line of sliding is a point mass at its pin, for force and moment."""
    assert left_over(balanced(slider_crank_keys)) < 1e-12


def test_constant_speed_hides_a_wrong_gear_on_the_crank(crank_rocker_keys):
    """Without the crank's gear the moment vanishes at constant speed, and only varying speed shows it."""
    result = balance_linkage(linkage_from_table(crank_rocker_keys, "crank-rocker"))
    result.moment.gears.pop("z2")
    check = verify_linkage(result)
    assert check.constant.residual("complete")["moment"] < 1e-10
    assert check.varying.residual("complete")["moment"] > 0.1


def test_force_balance_raises_the_moment_and_full_balance_the_torque():
    """The cost of counter-masses and gears: mass, and torque at both speeds."""
    check = verify_linkage(balance_linkage(load_linkage("two-levels")))
    assert check.constant.residual("force")["moment"] > 1.0
    cost = check.penalty("complete")
    assert cost["mass"] > 5.0
    assert cost["torque_varying_speed"] > cost["torque_constant_speed"] > 4.0


def test_varying_speed_is_the_rate_of_its_position():
    """Velocity and acceleration are the derivatives of the position, of a turn and of a swing."""
    linkage = load_linkage("two-levels")
    for described in (linkage, replace(linkage, swing=(0.5, 1.1))):
        motion = turn_samples(described, 12.0, 0.3, 1.0, 4000)
        step = motion.time[1]
        for values, rates in ((motion.position, motion.velocity), (motion.velocity, motion.acceleration)):
            numeric = (values[2:, 0] - values[:-2, 0]) / (2 * step)
            assert np.allclose(numeric, rates[1:-1, 0], atol=2e-5 * np.abs(rates).max())


def test_a_joint_that_makes_no_full_turn_is_told_to_swing(crank_rocker_keys):
    """A rocker driven round is refused with what to write; within its swing it is balanced."""
    keys = crank_rocker_keys | {"drive": "B0", "swing": ["75 deg", "140 deg"]}
    with pytest.raises(ClosureError, match=r"\(B0 in rad\); a joint that makes no full turns needs swing"):
        verify_linkage(
            balance_linkage(linkage_from_table({k: v for k, v in keys.items() if k != "swing"}, "x")), count=60
        )
    with pytest.raises(ClosureError, match="give it a narrower swing"):
        verify_linkage(balanced(keys), count=60)
    keys["swing"] = ["100 deg", "115 deg"]
    assert left_over(balanced(keys)) < 1e-10


def test_a_line_of_sliding_has_no_sense(crank_rocker_keys):
    """A block the other way round slides the same way; with no mass off its pivot the forces are equal."""
    crank_rocker_keys["links"]["6"] |= {"centre": ["0 m", "0 m"]}
    crank_rocker_keys["joints"]["P"]["6"]["point"] = ["0 m", "0 m"]
    found = {}
    for way in ("170 deg", "-10 deg"):
        crank_rocker_keys["start"]["6"] = way
        run = verify_linkage(balance_linkage(linkage_from_table(crank_rocker_keys, "own")), count=90).varying
        assert all(r < 1e-10 for r in run.residual("complete").values())
        found[way] = run.series("before")
    for name, values in found["170 deg"].items():
        np.testing.assert_allclose(found["-10 deg"][name], values, atol=1e-9 * np.abs(values).max())


def test_a_linkage_with_two_freedoms_is_not_told_to_swing(crank_rocker_keys):
    """A pin left out: one driven joint cannot lead both freedoms, which no swing would mend."""
    del crank_rocker_keys["joints"]["B"]
    with pytest.raises(ClosureError, match="degrees of freedom") as refused:
        verify_linkage(balance_linkage(linkage_from_table(crank_rocker_keys, "own")))
    assert "swing" not in str(refused.value)


def test_a_linkage_without_ground_pivots_is_not_simulated():
    """What is not given is named."""
    with pytest.raises(ModelError, match="where joint A0 is on the ground is not given"):
        verify_linkage(balance_linkage(load_linkage("dwell")))


def test_pantograph_gives_the_published_rms_values():
    """Drive torque within 0.1 % of the interval that the published digits allow, other RMS values within 11 %."""
    linkage = load_linkage("pantograph")
    run = verify_linkage(balance_linkage(linkage)).constant
    published = linkage.published.rms
    for stage, half in (("before", 0.0005), ("force", 0.0005)):
        torque = published[stage][3]
        off = abs(run.rms(stage)["torque_Nm"] - torque)
        assert max(0.0, off - half) < 1e-3 * torque
    for stage, column, k in (
        ("before", "Fx_N", 0),
        ("before", "Fy_N", 1),
        ("before", "Mz_Nm", 2),
        ("force", "Mz_Nm", 2),
        ("complete", "torque_Nm", 3),
    ):
        assert run.rms(stage)[column] == pytest.approx(published[stage][k], rel=0.11)
