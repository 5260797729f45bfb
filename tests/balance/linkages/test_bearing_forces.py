"""Bearing and tooth forces, and linkages as built: against free-body sums and closed forms."""

import numpy as np
import pytest

from balance.closure import Closure
from balance.dynamics.inverse_dynamics import simulate
from balance.errors import DataError, ModelError
from balance.figures.linkage import draw_linkage
from balance.linkages.bearing_forces import PRESSURE_ANGLE, bearing_forces
from balance.linkages.equivalence_method import as_built, balance_linkage
from balance.linkages.linkage_files import linkage_from_table, load_linkage
from balance.linkages.mjcf_writer import geared_trajectory, linkage_mjcf
from balance.linkages.results import linkage_findings
from balance.linkages.verification import turn_samples, verify_linkage
from balance.mechanism.mjcf_parser import mechanism_from_text

from .conftest import balanced


def run_of(result, stage="complete", count=48):
    """Mechanism, trajectory, and forces of a stage at varying speed."""
    linkage = result.linkage
    plain, model = (mechanism_from_text(linkage_mjcf(result, s), linkage.name) for s in ("before", stage))
    closure = Closure(plain)
    start = float(closure.home[plain.coordinate_index(linkage.drive)])
    path = closure.follow(turn_samples(linkage, linkage.speed, 0.4, start, count))
    path = geared_trajectory(result, path, plain, model) if stage == "complete" else path
    return model, path, bearing_forces(result, model, path)


def weighed(keys):
    """The crank-rocker with pivots and masses of all its counter-gears given."""
    keys["gears"]["z2"]["counter"] = {"at": ["-80 mm", "10 mm"], "on": "ground", "mass": "0.7 kg"}
    keys["gears"]["z4"]["counter"] = {"at": ["0.35 m", "-30 mm"], "on": "ground", "mass": "0.4 kg"}
    return linkage_from_table(keys, "weighed")


@pytest.mark.parametrize("stage", ["before", "force", "complete"])
def test_forces_on_the_ground_add_up_to_what_shakes_it(stage, crank_rocker_keys):
    """All pins on the ground together give shaking force, its moment and weight; the torque is that of virtual work."""
    result = balance_linkage(weighed(crank_rocker_keys))
    model, path, forces = run_of(result, stage)
    response = simulate(model, path)
    scale = max(np.abs(f).max() for f in forces.joints.values())
    weight = model.total_mass * model.gravity[:2]
    np.testing.assert_allclose(forces.ground[:, :2], response.force[:, :2] + weight, atol=1e-10 * scale)
    moment = response.moment[:, 2] + response.weight_moment[:, 2]
    np.testing.assert_allclose(forces.ground[:, 2], moment, atol=1e-10 * scale)
    np.testing.assert_allclose(forces.torque, response.torque["A0"], atol=1e-10 * scale)
    on_ground = {"A0": -1.0, "B0": -1.0, "E0": -1.0}
    total = sum(sign * forces.joints[name] for name, sign in on_ground.items())
    total = total - sum((forces.counter_gears[g] for g in ("z2", "z4") if stage == "complete"), np.zeros((48, 2)))
    np.testing.assert_allclose(total, forces.ground[:, :2], atol=1e-10 * scale)
    assert forces.undetermined == ()


def test_a_pair_on_the_ground_and_one_on_a_carrier(crank_rocker_keys):
    """F r* = I* alpha*, alpha* = -(Z/Z*) alpha on the ground, (1 + Z/Z*) alpha_c - (Z/Z*) alpha on a carrier."""
    result = balance_linkage(weighed(crank_rocker_keys))
    model, path, forces = run_of(result)
    alpha = {name: path.a[:, model.coordinate_index(name)] for name in model.coordinates}
    for name, distance in (("z2", np.hypot(0.08, 0.01)), ("z4", np.hypot(0.07, 0.03))):
        gear = result.moment.gears[name]
        radius = distance * gear.gear.teeth[1] / sum(gear.gear.teeth)
        own = -gear.gear.ratio * alpha["A0" if name == "z2" else "B0"]
        np.testing.assert_allclose(forces.teeth[name] * radius, gear.inertia * own, atol=1e-9)
        side = np.tan(PRESSURE_ANGLE) * np.abs(forces.teeth[name])
        size = np.hypot(forces.teeth[name], side)
        weight = gear.counter_mass * model.gravity[1]
        bearing = forces.counter_gears[name] + [0.0, weight]
        np.testing.assert_allclose(np.linalg.norm(bearing, axis=1), size, rtol=1e-9, atol=1e-9)
    planet = result.moment.gears["z3"]
    radius = 0.1 * planet.gear.teeth[1] / sum(planet.gear.teeth)
    crank = alpha["A0"]
    absolute = crank - planet.gear.ratio * alpha["A"]
    np.testing.assert_allclose(forces.teeth["z3"] * radius, planet.inertia * absolute, atol=1e-9)


def test_a_counter_gear_without_a_pivot_has_no_tooth_force(crank_rocker_keys):
    """Its couple is known, so that torque and ground are right; the tooth and the bearing it loads are not shown."""
    result = balance_linkage(linkage_from_table(crank_rocker_keys, "open"))
    model, path, forces = run_of(result)
    assert sorted(forces.undetermined) == ["z2", "z4"]
    assert "A0" not in forces.joints
    assert "z2" not in forces.teeth
    torque = simulate(model, path).torque["A0"]
    np.testing.assert_allclose(forces.torque, torque, atol=1e-10 * np.abs(torque).max())


def test_two_pins_in_one_place_have_no_forces_by_equilibrium(slider_crank_keys):
    """A second pin in the place of one."""
    keys = slider_crank_keys
    result = balanced(keys)
    model, path, _ = run_of(result)
    again = {**result.linkage.joints, "C2": result.linkage.joints["C"]}
    object.__setattr__(result.linkage, "joints", again)
    with pytest.raises(ModelError, match="statically indeterminate"):
        bearing_forces(result, model, path)


def test_as_built_leaves_what_the_difference_is():
    """A link's counter-mass 1 % too heavy leaves its m r omega^2; nothing stated, nothing changed."""
    result = balance_linkage(load_linkage("two-levels"))
    ((body, counter), *_) = [(b, c) for b, c in result.counters("force") if c.symbol == "m2*"]
    assert body == "2"
    built = as_built(result, {"m2*": f"{1.01 * counter.mass!r} kg"})
    check = verify_linkage(result, count=90, built=built)
    speed = check.speed
    left = 0.01 * counter.mass * np.linalg.norm(counter.position) * speed**2
    series = check.constant.series("built")
    np.testing.assert_allclose(np.hypot(series["Fx_N"], series["Fy_N"]), left, rtol=1e-9)
    assert check.mass["built"] - check.mass["complete"] == pytest.approx(0.01 * counter.mass)
    same = verify_linkage(result, count=30, built=as_built(result, {"m2": "0.8 kg"})).varying
    for name, values in same.series("complete").items():
        np.testing.assert_array_equal(same.series("built")[name], values)


def test_stock_gears_leave_the_moment_of_their_ratio():
    """Another ratio of the fixed pair on the crank leaves I* (ratio - ratio') alpha."""
    result = balance_linkage(load_linkage("two-levels"))
    built = as_built(result, {"z2": (60, 25)})
    run = verify_linkage(result, count=90, built=built).varying
    alpha = run.trajectory.a[:, 0]  # of A0
    left = result.moment.gears["z2"].inertia * (60 / 25 - 60 / 24) * alpha
    scale = np.abs(run.series("before")["Mz_Nm"]).max()
    np.testing.assert_allclose(run.series("built")["Mz_Nm"], left, atol=1e-9 * scale)


@pytest.mark.parametrize(
    ("built", "message"),
    [
        ({"m9*": "1 kg"}, r"'m9\*' is none of this linkage: there are"),
        ({"m2*": "-1 kg"}, "expected more than zero"),
        ({"I_z2": "-1 kg m^2"}, "expected zero or more"),
        ({"z2": "1 kg"}, "expected teeth"),
        ({"m2*": (2, 3)}, "expected a quantity"),
    ],
)
def test_what_cannot_be_built_is_refused(built, message):
    """By symbol."""
    with pytest.raises(DataError, match=message):
        as_built(balance_linkage(load_linkage("two-levels")), built)


def test_impossible_rods_and_counter_masses_are_findings(slider_crank_keys):
    """An inertia in kg cm2 read as kg m2; a counter-mass a tenth of a millimetre from its joint."""
    keys = slider_crank_keys
    assert linkage_findings(balanced(keys)) == []
    keys["links"]["2"]["counter_mass"] = {"radius": "0.01 mm"}
    (heavy,) = linkage_findings(balanced(keys))
    assert "counter-mass m2* is" in heavy
    assert "0.01 mm from joint A0" in heavy
    keys["links"]["2"]["counter_mass"] = {"radius": "50 mm"}
    keys["joints"]["C"] = {"3": ["200 mm", "0 m"], "5": ["0 m", "0 m"]}
    keys["joints"]["D"] = {"5": ["90 mm", "0 m"], "4": ["0 m", "0 m"]}
    keys["links"]["5"] = {"mass": "0.1 kg", "centre": ["45 mm", "0 m"], "inertia": "2 kg m^2",
                          "counter_mass": {"radius": "40 mm"}}  # fmt: skip
    assert "link 5: inertia 2 kg m2 means a radius of gyration" in linkage_findings(balanced(keys, gears=False))[0]


def test_the_drawing_shows_gears_by_their_pitch_circles():
    """Two circles a pair, that touch: radii in proportion to the teeth, together the distance of the axes."""
    result = balance_linkage(load_linkage("two-levels"))
    circles = draw_linkage(result).axes[0].patches[-2 * len(result.moment.gears) :]
    for (first, second), gear in zip(
        zip(circles[::2], circles[1::2], strict=True), result.moment.gears.values(), strict=True
    ):
        apart = np.hypot(*np.subtract(first.center, second.center))
        assert first.radius + second.radius == pytest.approx(apart)
        assert first.radius / second.radius == pytest.approx(gear.gear.ratio)
