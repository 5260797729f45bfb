"""Counter-masses for several payloads: the sets of the source, limits and totals, against brute force and scipy."""

from functools import cache
from itertools import pairwise, product

import numpy as np
import pytest
from scipy.optimize import minimize

import balance
from balance.balancing.objective import workspace_objective
from balance.cli import main
from balance.errors import CounterpoiseError

from ...commands import call
from .test_sizing import BUILT, EXACT, SITES

LOADS = (1.451, 3.4116)
STOCK = ((2.0, 2), (3.7, 2), (5.1, 2))
"""Mass [kg] and quantity of three kinds of plates."""


def nested(loads=EXACT, **given) -> "balance.NestedSizing":
    """The manipulator's sets for payloads of its platform [kg]."""
    return balance.size_nested("parallelogram-6bar", [{"platform": one} for one in loads], **given)


def masses(study: "balance.NestedSizing") -> np.ndarray:
    """Of each set, at both sites, (sets, 2) [kg]."""
    return np.array([[one.mass for one in each.counter_masses] for each in study.sets])


@cache
def effects() -> list[tuple[np.ndarray, np.ndarray]]:
    """For each of LOADS the vector whose square is the objective: without counter-masses, per kilogram at the sites."""
    model, found = balance.load("parallelogram-6bar"), []
    for load in LOADS:
        one = model.with_payload(platform=load)
        factor, per_kilogram = (
            workspace_objective(one).factor,
            [one.with_counter_mass({s: 1.0}).pi - one.pi for s in SITES],
        )
        triangle = np.linalg.qr(
            np.column_stack([factor @ np.append(one.pi, 1.0), factor[:, :-1] @ np.array(per_kilogram).T])
        )[1]
        found.append((triangle[:, 0], triangle[:, 1:]))
    return found


def total(sets: np.ndarray) -> float:
    """Sum over LOADS of the mean square of the momentum that sets (loads, 2) [kg] leave."""
    return sum(float(np.sum((base + per @ row) ** 2)) for (base, per), row in zip(effects(), sets, strict=True))


def after_each(study: "balance.NestedSizing"):
    """Objective and mechanism of each set as it is mounted."""
    return [(one.objective, one.after) for one in study.sets]


def test_a_payload_at_a_site_is_mounted_once() -> None:
    """Payloads at a point of a link in place of a body: for each the masses of any size that it has alone."""
    done = [call(main, "balance", "size", "four-bar", *words, "--json") for words in (
        ("-p", "B_AB=1kg"), ("-p", "B_AB=2kg"), ("-p", "B_AB=1kg", "-p", "B_AB=2kg"),
    )]  # fmt: skip
    alone = [[at["mass_kg"] for at in one.json["counter_masses"]] for one in done[:2]]
    together = [[at["mass_kg"] for at in one["counter_masses"]] for one in done[2].json["sets"]]
    np.testing.assert_allclose(together, alone, rtol=1e-6)  # they rise, so that sets that only grow are the best alone


def test_sets_that_grow_for_the_payloads_of_the_source() -> None:
    """M1 + M2, + M4, + M3: as the built sets at 1.451 and 5 kg, better than the built one between."""
    study = nested(BUILT, stock="kiper2019")
    assert [c.counter_masses[0].plates for c in study.sets] == [
        ("M1", "M2"),
        ("M1", "M2", "M4"),
        ("M1", "M2", "M3", "M4"),
    ]
    assert [one.plates for one in study.counter_masses if one.site == SITES[0]] == [("M1", "M2"), ("M4",), ("M3",)]
    for sizing, (_, built, _) in zip(study.sets, BUILT.values(), strict=True):
        assert sizing.residual() <= built + 5e-7


def test_exact_sets_that_grow() -> None:
    """Any mass: each payload's own exact counter-mass, the order of payloads rising; nothing is sizing."""
    study = nested()
    assert masses(study)[:, 1] == pytest.approx(list(EXACT.values()), abs=1e-6)
    assert study.balanced
    for less, more in pairwise(study.sets):
        assert more.added_mass > less.added_mass
        assert more.residual() < 1e-12


def test_sets_for_loads_that_ask_for_less_stay_as_they_are() -> None:
    """Payloads that fall: the best compromise never shrinks, and is the fixed set; it lies between what each needs."""
    first, second = masses(nested((5.0, 1.451)))
    assert second == pytest.approx(first, abs=1e-9)
    assert all(EXACT[1.451] < mass < EXACT[5.0] for mass in first)
    assert masses(nested((5.0, 1.451), fixed=True)) == pytest.approx(np.array([first, first]), abs=1e-9)


@pytest.mark.parametrize(
    ("limits", "equal", "added"),
    [
        ({SITES[0]: 9.0}, False, None),
        ({SITES[0]: 12.0, SITES[1]: 14.0}, False, None),
        ({SITES[1]: 14.0}, True, None),
        (None, False, 25.0),
        ({SITES[0]: 11.0}, False, 18.0),
        ({SITES[0]: 0.0}, False, None),
        (None, False, 0.0),
    ],
)
@pytest.mark.parametrize("fixed", [False, True])
def test_any_masses_within_limits_are_the_best_that_scipy_finds(limits, equal, added, fixed) -> None:
    """What each set adds is unknown, limits and total hold for the last: SLSQP on the momentum finds nothing less."""
    study = nested(LOADS, limits=limits, equal=[SITES] if equal else (), added=added, fixed=fixed)
    found = masses(study)
    upper, whole = np.array([(limits or {}).get(site, np.inf) for site in SITES]), np.inf if added is None else added
    assert (np.diff(found, axis=0, prepend=0.0) >= -1e-12).all()
    assert (found <= upper * (1.0 + 1e-9)).all()
    assert found[-1].sum() <= whole * (1.0 + 1e-9)
    assert study.proven

    def sets(unknown):
        return np.tile(unknown[:2], (2, 1)) if fixed else np.cumsum(unknown.reshape(2, 2), axis=0)

    kept = [{"type": "ineq", "fun": lambda x, i=i: upper[i] - sets(x)[-1, i]} for i in range(2) if upper[i] < np.inf]
    kept += [{"type": "ineq", "fun": lambda x: whole - sets(x)[-1].sum()}] if whole < np.inf else []
    kept += [{"type": "eq", "fun": lambda x: np.diff(sets(x), axis=1).ravel()}] if equal else []
    scale = total(np.zeros((2, 2)))
    other = minimize(
        lambda x: total(sets(x)) / scale, np.full(4, 2.0), bounds=[(0.0, 60.0)] * 4, constraints=kept, method="SLSQP",
        options={"ftol": 1e-12, "maxiter": 200},
    )  # fmt: skip
    assert total(found) / scale == pytest.approx(float(other.fun), abs=1e-7)


@pytest.mark.parametrize(
    ("limits", "equal", "added"),
    [(None, False, None), ({SITES[0]: 6.0}, False, None), (None, True, None), ({SITES[1]: 7.5}, False, 13.0)],
)
@pytest.mark.parametrize("fixed", [False, True])
def test_plates_within_limits_are_the_best_of_all(tmp_path, limits, equal, added, fixed) -> None:
    """All ways to share six plates among two sites and two payloads: the sum over the payloads is the least."""
    stock = tmp_path / "stock.csv"
    stock.write_text("name,mass_kg,quantity\n" + "".join(f"P{m},{m},{n}\n" for m, n in STOCK), encoding="utf-8")
    study = nested(LOADS, stock=str(stock), limits=limits, equal=[SITES] if equal else (), added=added, fixed=fixed)
    plates, most = np.array([m for m, _ in STOCK]), [n for _, n in STOCK]
    places = 2 if fixed else 4
    kinds = [[one for one in product(range(n + 1), repeat=places) if sum(one) <= n] for n in most]
    best = np.inf
    for chosen in product(*kinds):
        increments = (plates @ np.array(chosen)).reshape(-1, 2)
        sets = np.repeat(increments, 2, axis=0) if fixed else np.cumsum(increments, axis=0)
        last = sets[-1]
        if any(last[SITES.index(site)] > limit + 1e-9 for site, limit in (limits or {}).items()):
            continue
        if (equal and np.ptp(sets, axis=1).max() > 1e-9) or (added is not None and last.sum() > added + 1e-9):
            continue
        best = min(best, total(sets))
    assert sum(objective.value(after) for objective, after in after_each(study)) == pytest.approx(best, rel=1e-9)
    assert study.proven


def test_what_is_no_question_for_several_payloads_is_refused() -> None:
    """One payload alone, a moment without a motion: said."""
    with pytest.raises(CounterpoiseError, match=r"balance\.size"):
        nested((5.0,))
    with pytest.raises(CounterpoiseError, match="of a motion"):
        nested(objective={"moment": 1.0})
