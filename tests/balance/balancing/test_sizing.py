"""Counter-masses of any mass and from stock plates: residuals, optima, and how equals are decided."""

from dataclasses import replace
from itertools import product
from xml.etree import ElementTree

import numpy as np
import pytest

import balance
from balance.balancing import sizing_study, stock_plates
from balance.balancing.conditions import Conditions, balance_conditions
from balance.balancing.least_masses import distribute_masses
from balance.balancing.sizing import (
    CounterMass,
    balanced_payload,
    best_sets_from_stock,
    exact_sizing,
    sizing_of_given,
    stock_use,
)
from balance.balancing.stock_plates import Plate
from balance.errors import SizingError
from balance.mechanism.mechanism import Mechanism
from balance.results import table

from .. import models

M1, M2, M3, M4 = 5.02746, 5.06421, 7.01882, 7.15208
SITES = ("counter_A0A", "counter_B0B")


def carrying(payload: float) -> tuple[Conditions, Mechanism]:
    """The manipulator with a payload, and its conditions."""
    mechanism = models.load("parallelogram-6bar").with_payload({"platform": payload})
    return balance_conditions(mechanism), mechanism


EXACT = {1.451: 10.099021, 3.4116: 17.930978, 5.0: 24.276118}


@pytest.mark.parametrize("name", models.MANIPULATORS)
@pytest.mark.parametrize("payload", EXACT)
def test_exact_counter_masses(name: str, payload: float) -> None:
    """Found from the model, both models: 10.099021, 17.930978 and 24.276118 kg on each arm; nothing is sizing."""
    mechanism = models.load(name).with_payload({"platform": payload})
    sized = exact_sizing(balance_conditions(mechanism), mechanism)
    assert [c.site for c in sized.counter_masses] == list(SITES)
    assert [c.mass for c in sized.counter_masses] == pytest.approx([EXACT[payload]] * 2, abs=1e-6)
    assert sized.residual() < 1e-12
    assert sized.is_balanced(1e-12)
    assert sized.balanced_payloads()["platform"] == pytest.approx(payload, abs=1e-9)


BUILT = {
    1.451: ((M1, M2), 2.760e-4, 0.073),
    3.4116: ((M1, M2, M3), 3.081e-2, 4.576),
    5.0: ((M1, M2, M3, M4), 5.086e-4, 0.056),
}


@pytest.mark.parametrize("payload", BUILT)
def test_built_sets(payload: float) -> None:
    """What the sets that were built leave: kg m, and per cent of what there was without."""
    plates, residual, per_cent = BUILT[payload]
    found, mechanism = carrying(payload)
    sizing = sizing_of_given(found, mechanism, dict.fromkeys(SITES, sum(plates)))
    assert sizing.residual() == pytest.approx(residual, rel=5e-4)
    assert sizing.residual_percent() == pytest.approx(per_cent, abs=5e-4)


def test_the_built_and_the_printed_set_for_3_4116_kg_balance_less() -> None:
    """17.1105 kg built and 17.1064 kg printed balance 3.206 and 3.205 kg."""
    found, mechanism = carrying(3.4116)
    for counter, payload in ((M1 + M2 + M3, 3.2062), (17.1064, 3.2052)):
        sizing = sizing_of_given(found, mechanism, dict.fromkeys(SITES, counter))
        assert balanced_payload(found, sizing.after, "platform") == pytest.approx(payload, abs=5e-5)


def test_best_stock_for_3_4116_kg() -> None:
    """M1 + M2 + M4 = 17.24375 kg on each arm leaves 0.02581 kg m: better than the set that was built."""
    found, mechanism = carrying(3.4116)
    best, *_ = best_sets_from_stock(found, mechanism, stock_plates.load_stock("kiper2019"))
    assert [c.plates for c in best.counter_masses] == [("M1", "M2", "M4")] * 2
    assert best.counter_masses[0].mass == pytest.approx(17.24375, abs=1e-9)
    assert best.residual() == pytest.approx(0.02581, abs=5e-6)


@pytest.mark.parametrize("payload", BUILT)
def test_best_stock_is_no_worse_than_what_was_built(payload: float) -> None:
    """For 1.451 and 5 kg the best set is the built one."""
    found, mechanism = carrying(payload)
    best, *_ = best_sets_from_stock(found, mechanism, stock_plates.load_stock("kiper2019"))
    built = sizing_of_given(found, mechanism, dict.fromkeys(SITES, sum(BUILT[payload][0])))
    assert best.residual() <= built.residual() + 1e-12
    if payload != 3.4116:
        assert best.residual() == pytest.approx(built.residual())


@pytest.mark.parametrize("seed", range(6))
def test_stock_is_the_best_of_all_combinations(seed: int) -> None:
    """Random plates and quantities, unequal arms: no other choice leaves less, and none as good is lighter."""
    rng = np.random.default_rng(seed)
    text = models.load("parallelogram-6bar").text.replace('mass="1.04642"', f'mass="{rng.uniform(0.5, 3.0)}"', 1)
    mechanism = models.model(text).with_payload({"platform": float(rng.uniform(1.0, 3.0))})
    found = balance_conditions(mechanism)
    plates = [Plate(f"P{i}", round(float(rng.uniform(1.0, 9.0)), 3), int(rng.integers(1, 4))) for i in range(3)]
    best, *_ = best_sets_from_stock(found, mechanism, plates)

    def every(plates: list[Plate]) -> list[tuple[float, float]]:
        """J and mass of all choices."""
        counts = [range(p.quantity + 1) for p in plates]
        results = []
        for first, second in product(product(*counts), repeat=2):
            if all(a + b <= p.quantity for a, b, p in zip(first, second, plates, strict=True)):
                masses = [sum(n * p.mass for n, p in zip(row, plates, strict=True)) for row in (first, second)]
                mounted = mechanism.with_counter_mass(dict(zip(SITES, masses, strict=True)))
                results.append((best.objective.value(mounted), sum(masses)))
        return results

    results = every(plates)
    least = min(value for value, _ in results)
    assert best.objective.value(best.after) == pytest.approx(least, rel=1e-9)
    assert best.bound == pytest.approx(least, rel=1e-9)
    assert best.added_mass == pytest.approx(min(m for r, m in results if r < least * (1.0 + 1e-9)), abs=1e-9)
    before, left = best.objective.value(mechanism), {}
    for plate in plates:
        assert sum(c.plates.count(plate.name) for c in best.counter_masses) <= plate.quantity
        more = [replace(p, quantity=p.quantity + (p is plate)) for p in plates]
        left[plate.name] = min(value for value, _ in every(more))
    use = stock_use([best], plates)
    assert not use.unproven
    better = sorted((value, name) for name, value in left.items() if value < 0.998 * least)
    assert list(use.with_more) == [name for _, name in better]
    assert list(use.with_more.values()) == pytest.approx([(value / before) ** 0.5 for value, _ in better], rel=1e-9)


def test_nothing_in_stock_mounts_nothing() -> None:
    """Plates of which there are none: no counter-mass, all of the unbalance sizing."""
    found, mechanism = carrying(1.451)
    none, *_ = best_sets_from_stock(found, mechanism, [Plate("M1", 5.0, 0)])
    assert none.added_mass == 0.0
    assert none.residual_percent() == pytest.approx(100.0)


def test_a_limit_holds_and_the_rest_is_best() -> None:
    """One arm limited to 5 kg takes all 5; the other takes what leaves the least, which is not its exact mass."""
    found, mechanism = carrying(1.451)
    sized = exact_sizing(found, mechanism, limits={"counter_A0A": 5.0})
    first, second = (c.mass for c in sized.counter_masses)
    assert first == 5.0
    _, least = sized.root_mean_squares()
    for other in (second - 1e-3, second + 1e-3):
        masses = dict(zip(SITES, (5.0, other), strict=True))
        given = sizing_of_given(found, mechanism, masses, objective=sized.objective)
        assert given.root_mean_squares()[1] > least
    assert sized.bound == pytest.approx(least**2, rel=1e-12)


def test_a_limit_of_nothing_and_impossible_limits() -> None:
    """A site limited to zero gets none; a negative limit, or none of a number, is refused."""
    found, mechanism = carrying(1.451)
    sized = exact_sizing(found, mechanism, limits={"counter_A0A": 0.0})
    assert sized.counter_masses[0].mass == 0.0
    for limit in (-1.0, float("nan")):
        with pytest.raises(SizingError, match=rf"limit at 'counter_B0B' is {limit:g} kg: expected zero or more"):
            exact_sizing(found, mechanism, limits={"counter_B0B": limit})
    with pytest.raises(SizingError, match="the limit at 'C_AC' has no effect: counter-masses are sized at counter_A0A"):
        exact_sizing(found, mechanism, limits={"C_AC": 1.0})


def test_what_pulls_the_wrong_way_gets_nothing() -> None:
    """A site ahead of the pivot would need a negative mass: it gets none."""
    text = models.load("serial-1r").text.replace('name="counter_link_1" pos="-0.1', 'name="counter_link_1" pos="0.1')
    mechanism = models.model(text)
    sized = exact_sizing(balance_conditions(mechanism), mechanism)
    assert sized.counter_masses[0].mass == 0.0
    assert sized.residual_percent() == pytest.approx(100.0)


def test_a_site_that_does_not_move_gets_nothing() -> None:
    """A triangle of bars is rigid up to rounding; a carriage alone moves, and no counter-mass helps it."""
    site = '<site name="counter_a" pos="-0.1 0.2 0"/>'
    bars = models.link(site, "a", place='euler="0.3 0.2 0.1"') + models.link(
        '<site name="counter_b" pos="0.1 0 0"/>', "b", place='pos="0.31 0.07 0"'
    )
    slide = models.link("", "c", '<joint name="c" type="slide" axis="0.3 0.5 0.7"/>')
    tied = '<equality><weld body1="a" body2="b"/></equality>'
    mechanism = models.model(models.mjcf(bars + slide, tied))
    sized = exact_sizing(balance_conditions(mechanism), mechanism)
    assert [one.mass for one in sized.counter_masses] == [0.0, 0.0]
    assert sized.residual() == 0.0  # there is a condition on a mass alone, and no first moment is lacking
    columns = np.diag([1.0, 0.0, 0.0])
    assert distribute_masses(columns, np.ones(3)).masses.tolist() == [1.0, 0.0, 0.0]


def test_of_redundant_sites_the_lightest_choice() -> None:
    """Two sites on one line: the further one does it with less, so it takes all; equal arms would need the same."""
    near, far = (f'<site name="counter_{n}" pos="-{d} 0 0"/>' for n, d in (("near", 0.05), ("far", 0.2)))
    text = models.load("serial-1r").text.replace('<site name="counter_link_1" pos="-0.1 0 0"/>', near + far)
    mechanism = models.model(text)
    masses = {c.site: c.mass for c in exact_sizing(balance_conditions(mechanism), mechanism).counter_masses}
    assert masses == pytest.approx({"counter_near": 0.0, "counter_far": 1.2 * 0.14 / 0.2}, abs=1e-9)
    limited = exact_sizing(balance_conditions(mechanism), mechanism, limits={"counter_far": 0.5})
    assert {c.site: c.mass for c in limited.counter_masses} == pytest.approx(
        {"counter_far": 0.5, "counter_near": (1.2 * 0.14 - 0.5 * 0.2) / 0.05}, abs=1e-9
    )


def test_serial_chain_by_the_printed_rule() -> None:
    """Each link of a 2R carries the outer ones: the printed rule link by link, from the tip inwards."""
    mechanism = models.load("serial-2r")
    sized = exact_sizing(balance_conditions(mechanism), mechanism)
    outer = 0.9 * 0.11 / 0.1
    inner = (1.2 * 0.14 + (0.9 + outer) * 0.3) / 0.1
    assert [c.mass for c in sized.counter_masses] == pytest.approx([inner, outer], abs=1e-9)
    assert sized.residual() < 1e-12


def test_four_bar_by_loop_closure() -> None:
    """Crank and rocker counter-masses of the four-bar from the printed conditions."""
    mechanism = models.load("four-bar")
    sized = exact_sizing(balance_conditions(mechanism), mechanism)
    crank = (0.4 * 0.04 + 0.7 * (1 - 0.12 / 0.26) * 0.1) / 0.05
    rocker = (0.5 * 0.09 + 0.7 * (0.12 / 0.26) * 0.2) / 0.08
    assert [c.mass for c in sized.counter_masses] == pytest.approx([crank, rocker], abs=1e-9)


def test_inertia_added_is_about_the_joints() -> None:
    """m (p2 + k2) of each counter-mass, k its own radius of gyration."""
    found, mechanism = carrying(5.0)
    sized = sizing_of_given(found, mechanism, {"counter_A0A": 3.0, "counter_B0B": 1.0})
    assert sized.added_inertia == pytest.approx(4.0 * (0.03755**2 + 0.06**2))
    assert sized.added_mass == 4.0
    np.testing.assert_allclose(sized.counter_masses[0].first_moment, [-3.0 * 0.03755, 0.0, 0.0])


def test_nothing_to_balance_has_no_per_cent() -> None:
    """Where the mechanism is balanced already, per cent of nothing is no number."""
    text = models.load("serial-1r").text.replace('pos="0.14 0 0"', 'pos="0 0 0"')
    mechanism = models.model(text)
    assert exact_sizing(balance_conditions(mechanism), mechanism).residual_percent() is None


def test_a_body_that_no_payload_balances() -> None:
    """A mass on the axis of its joint moves nothing: no payload there balances anything."""
    text = models.load("serial-1r").text.replace('pos="0.14 0 0"', 'pos="0 0 0"')
    mechanism = models.model(text)
    assert balanced_payload(balance_conditions(mechanism), mechanism, "link_1") is None


def test_sites_can_be_chosen() -> None:
    """Any site of a moving body will do; without one named counter... they must be named."""
    text = models.load("serial-1r").text.replace("counter_link_1", "tail")
    mechanism = models.model(text)
    found = balance_conditions(mechanism)
    with pytest.raises(SizingError, match=r"no site named counter\.\.\.: add one.*tail, tip"):
        exact_sizing(found, mechanism)
    assert exact_sizing(found, mechanism, ["tail"]).counter_masses[0].mass == pytest.approx(1.2 * 0.14 / 0.1)
    with pytest.raises(SizingError, match="no site named counter"):
        best_sets_from_stock(found, mechanism, [Plate("M1", 5.0, 1)])


def test_payloads_of_other_bodies() -> None:
    """Asked for two bodies, each has its own balanced payload."""
    found, mechanism = carrying(5.0)
    sized = exact_sizing(found, mechanism)
    payload = balanced_payload(found, sized.after, "AC")
    assert payload == pytest.approx(0.58909, abs=1e-9)


def test_plates_as_drawn_bring_their_own_inertia() -> None:
    """The mechanism as made has m p2 + the plates' own inertia, not that of the site's assumed radius of gyration."""
    found, mechanism = carrying(1.451)
    drawn = [Plate("A", 10.0, 2, 0.05), Plate("B", 0.1, 2)]
    sized, *_ = best_sets_from_stock(found, mechanism, drawn)
    assert [c.plates for c in sized.counter_masses] == [("A", "B")] * 2
    own = 0.05 + 0.1 * 0.06**2
    assert [c.inertia for c in sized.counter_masses] == pytest.approx([own] * 2)
    assert sized.added_inertia == pytest.approx(2 * (10.1 * 0.03755**2 + own))
    row, izz = mechanism.body_index("A0A"), 9
    gained = sized.after.parameters[row, izz] - mechanism.parameters[row, izz]
    assert gained == pytest.approx(10.1 * 0.03755**2 + own)


def test_no_payload_is_balanced_by_unequal_counter_masses() -> None:
    """With 1 kg on one arm and 10.099 kg on the other no payload is balanced: none is named."""
    conditions, mechanism = carrying(0.3121)
    result = sizing_of_given(conditions, mechanism, dict(zip(SITES, (1.0, 10.099), strict=True)))
    assert result.balanced_payloads() == {"platform": None}


def test_a_balanced_payload_depends_neither_on_the_order_of_bodies_nor_on_their_axes() -> None:
    """Counter-masses 0.6 % too heavy and 0.5 % too light: the rocker first, frames turned, the same 0.696 kg."""
    text = models.load("four-bar").text
    root = ElementTree.fromstring(text)
    base, home = root.find("worldbody/body"), root.find("keyframe/key")
    assert base is not None
    assert home is not None
    base.append(base[0])
    del base[0]
    home.set("qpos", " ".join(home.get("qpos", "").split()[k] for k in (2, 0, 1)))
    found = []
    for other in (text, ElementTree.tostring(root, "unicode"), models.reframed(text, np.eye(3), 4)):
        mechanism = models.model(other)
        loaded = mechanism.with_counter_mass({"counter_A0A": 1.080289, "counter_B0B": 1.363341})
        found.append(balanced_payload(balance_conditions(mechanism), loaded, "AB"))
    assert found == pytest.approx([0.695994] * 3, abs=1e-6)


def test_places_are_printed_along_the_axes_they_are_on():
    """A site off x showed x and its first moment, both zero; a machine of millimetres showed no moment at all."""
    at = ([0.0, 0.0, 0.04], [-0.1, 1e-12, 0.02], [0.0, 0.0, 0.0], [1.2345678e-6, 0.0, 0.0])
    rows = table(CounterMass, [CounterMass("s", 2.0, np.array(place)) for place in at], "position", "first_moment")[1]
    expected = [["z 40", "z 0.08"], ["x -100, z 20", "x -0.2, z 0.04"], ["0", "0"], ["x 0.0012346", "x 2.4691e-06"]]
    assert rows == expected


def test_a_further_site_that_is_not_found_is_said(monkeypatch):
    """What one trial fails by takes nothing from the advice on the others; no body is passed over without a word."""
    tried = sizing_study._with_sites_on

    def failing(bodies, *arguments):
        if bodies[-1] == "AB":
            raise SizingError("counter-masses did not converge: stopped")
        return tried(bodies, *arguments)

    whole = balance.size("four-bar", sites=["counter_A0A"])
    assert "was not found" not in str(whole)
    assert not whole.document()["sites_unknown"]
    monkeypatch.setattr(sizing_study, "_with_sites_on", failing)
    study = balance.size("four-bar", sites=["counter_A0A"])
    assert study.document()["sites_unknown"] == {"AB": "counter-masses did not converge: stopped"}
    assert "further site on AB would do better was not found" in str(study)
    assert "With a further site, on B0B" in str(study)
