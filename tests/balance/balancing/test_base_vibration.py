"""Least vibration of the base: what is made small by an integration of its own, the masses by brute force."""

from dataclasses import fields, replace
from itertools import product

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import minimize

from balance.balancing.base_vibration import (
    VibrationObjective,
    least_vibration,
    least_vibration_from_stock,
    load_measured_base,
    vibration_objective,
)
from balance.balancing.conditions import balance_conditions
from balance.balancing.objective import motion_objective
from balance.balancing.sizing import Sizing, best_sets_from_stock, exact_sizing
from balance.balancing.stock_plates import Plate
from balance.closure import Closure
from balance.dynamics.inverse_dynamics import simulate
from balance.dynamics.moving_base import locked_inertia
from balance.errors import DataError
from balance.motion.motion_files import load_motion

from .. import models

SITES = ["counter_A0A", "counter_B0B"]
FOUR_BAR = models.load("four-bar")
CONDITIONS = balance_conditions(FOUR_BAR)


@pytest.fixture(scope="module")
def vibration() -> VibrationObjective:
    """The four-bar on the shipped rig's base, in its motion at 150 Hz."""
    trajectory = Closure(FOUR_BAR).follow(load_motion("four-bar").sample(150.0))
    return vibration_objective(FOUR_BAR, trajectory, load_measured_base("parallelogram-6bar"))


def sized(objective, limits=None, added=None) -> Sizing:
    """Masses of any size."""
    return exact_sizing(CONDITIONS, FOUR_BAR, SITES, limits, objective, added=added)


def test_what_is_made_small_by_an_integration_of_its_own(vibration: VibrationObjective) -> None:
    """M x'' + C x' + K x = w by Dormand and Prince, w linear between samples; the masses count in M and in w."""
    loaded = FOUR_BAR.with_counter_mass({"counter_A0A": 2.0, "counter_B0B": 5.0})
    path = vibration.trajectory
    base = vibration.measured.base.elastic(locked_inertia(loaded, path.q[0]))
    response = simulate(loaded, path)
    wrench = np.hstack([response.force, response.moment])

    def acceleration(t: float, y: np.ndarray) -> np.ndarray:
        push = np.array([np.interp(t, path.time, column) for column in wrench.T])
        return np.linalg.solve(base.mass, push - base.damping @ y[6:] - base.stiffness @ y[:6])

    end = path.time[75]
    found = solve_ivp(lambda t, y: np.append(y[6:], acceleration(t, y)), (0.0, end), np.zeros(12), "DOP853",
                      path.time[:76], rtol=1e-9, atol=1e-13, max_step=3e-3)  # fmt: skip
    theirs = np.array([acceleration(t, y) for t, y in zip(found.t, found.y.T, strict=True)])
    measured = theirs @ vibration.measured.directions.T
    short = replace(vibration, trajectory=part(path, 76))
    assert short.value(loaded) == pytest.approx(np.mean(np.sum(measured**2, axis=1)), rel=1e-6)


def part(path, count):
    """The first samples of a trajectory."""
    cut = {f.name: getattr(path, f.name)[:count] for f in fields(path) if np.ndim(getattr(path, f.name))}
    return replace(path, **cut)


@pytest.mark.parametrize(
    ("limits", "base", "added"),
    [
        (None, {}, None),
        ({"counter_A0A": 0.6}, {}, None),
        (None, {"mass": 4.0, "inertia": (0.05, 0.05, 0.02)}, None),
        (None, {}, 1.2),
    ],
)
def test_no_other_masses_are_better(vibration: VibrationObjective, limits, base, added) -> None:
    """Neither near them, from a milligram to a kilogram away, nor those of a coarse grid, nor those of least force.

    Nor on a light base, whose inertia the masses change by as much, so that it is far from linear in them.
    """
    measured = replace(vibration.measured, base=vibration.measured.base.model_copy(update=base))
    vibration = replace(vibration, measured=measured)
    found = least_vibration(CONDITIONS, FOUR_BAR, SITES, vibration, limits, added=added)
    masses = np.array([c.mass for c in found.counter_masses])
    assert added is None or masses.sum() == pytest.approx(added, rel=1e-9)
    most = np.array([(limits or {}).get(site, 8.0) for site in SITES])
    away = [10.0**k * np.array(way) for k in (-6, -3, -2, 0) for way in product((-1, 0, 1), repeat=2)]
    others = [
        *(masses + step for step in away),
        *(most * np.array(part) for part in product((0.0, 0.3, 1.0), repeat=2)),
    ]
    least = found.root_mean_squares()[1]
    for other in np.clip(others, 0.0, most):
        if added is not None and other.sum() > added + 1e-12:
            continue
        value = vibration.value(FOUR_BAR.with_counter_mass(dict(zip(SITES, other, strict=True))))
        assert value**0.5 >= least * (1.0 - 1e-9)
    least_force = sized(motion_objective(FOUR_BAR, vibration.trajectory), limits, added)
    assert least < 0.999 * vibration.value(least_force.after) ** 0.5
    assert found.bound is None


def test_weighed_against_force_and_moment(vibration: VibrationObjective) -> None:
    """Its value is that of its parts, each over what it is without; by a minimiser of its own, no masses have less."""
    weights = {"vibration": 1.0, "force": 0.5, "moment": 2.0}
    both = vibration_objective(FOUR_BAR, vibration.trajectory, vibration.measured, weights)

    def mean_squares(masses) -> dict[str, float]:
        loaded = FOUR_BAR.with_counter_mass(dict(zip(SITES, masses, strict=True)))
        response = simulate(loaded, vibration.trajectory)
        squares = {name: np.mean(np.sum(getattr(response, name) ** 2, axis=1)) for name in ("force", "moment")}
        return squares | {"vibration": vibration.value(loaded)}

    without = mean_squares((0.0, 0.0))

    def weighed(masses) -> float:
        squares = mean_squares(masses)
        return float(sum(weight * squares[name] / without[name] for name, weight in weights.items()))

    found = least_vibration(CONDITIONS, FOUR_BAR, SITES, both)
    masses = [c.mass for c in found.counter_masses]
    assert both.value(found.after) == pytest.approx(weighed(masses), rel=1e-9)
    best = minimize(weighed, (1.0, 1.0), method="Nelder-Mead", bounds=[(0.0, 9.0)] * 2,
                    options={"xatol": 1e-5, "fatol": 1e-10})  # fmt: skip
    assert weighed(masses) == pytest.approx(best.fun, rel=1e-8)
    alone = least_vibration(CONDITIONS, FOUR_BAR, SITES, vibration)
    assert weighed(masses) < 0.99 * weighed([c.mass for c in alone.counter_masses])


@pytest.mark.parametrize("ways", [81, 10**9])
def test_plates_by_brute_force(vibration: VibrationObjective, ways: int) -> None:
    """Of all choices of four kinds of plates for two sites, those that leave the least; proven where all are few."""
    plates = [Plate(f"P{k}", mass, 1) for k, mass in enumerate((0.3, 0.5, 0.8, 1.1))]

    def search(objective, exact):
        return best_sets_from_stock(CONDITIONS, FOUR_BAR, plates, SITES, None, objective, best=2, exact=exact)

    start = least_vibration(CONDITIONS, FOUR_BAR, SITES, vibration).objective
    assert isinstance(start, VibrationObjective)
    found = least_vibration_from_stock(FOUR_BAR, SITES, start, ways, search)
    every = [
        vibration.value(FOUR_BAR.with_counter_mass({
            site: sum(plate.mass for plate, where in zip(plates, choice, strict=True) if where == k)
            for k, site in enumerate(SITES)
        }))
        for choice in np.ndindex(3, 3, 3, 3)
    ]  # fmt: skip
    assert found[0].root_mean_squares()[1] == pytest.approx(min(every) ** 0.5, rel=1e-12)
    assert found[0].bound == (pytest.approx(min(every), rel=1e-12) if ways == 81 else None)


def test_a_rig_without_an_accelerometer_on_its_base_is_refused(tmp_path) -> None:
    """Nor one without a stated base; and what of a rig's bench is not known here is listed."""
    rig = tmp_path / "rig.toml"
    rig.write_text('mechanism = "four-bar"\n', encoding="utf-8")
    with pytest.raises(DataError, match=r"rig\.toml: no \[bench\]: .* add its mass"):
        load_measured_base(rig)
    rig.write_text('[bench]\nmass = "90 kg"\nplanes = { AB = "10 mm" }\ncoupling = "locked"\n', encoding="utf-8")
    with pytest.raises(DataError, match=r"rig\.toml: no accelerometer is attached to the base"):
        load_measured_base(rig)
    sensor = (
        '[sensors.a]\nkind = "accelerometer"\nlogger = "l"\nchannels = { y = "Y" }\nposition = ["1 m", "0 m", "2 m"]\n'
    )
    rig.write_text(rig.read_text(encoding="utf-8") + sensor, encoding="utf-8")
    found = load_measured_base(rig)
    np.testing.assert_array_equal(found.directions, [[0.0, 1.0, 0.0, -2.0, 0.0, 1.0]])
    assert (found.base.mass, found.left_out) == (90.0, ("planes",))
