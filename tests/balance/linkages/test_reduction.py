"""Reduction trees, chosen and checked."""

from itertools import product

import pytest

from balance.errors import ModelError
from balance.linkages.force_balance import ReducedLinkage, force_balance, reduction_tree
from balance.linkages.linkage_files import linkage_from_table, load_linkage

LINE = {"point": ["0 m", "0 m"], "along": "0 deg"}
BETWEEN = {
    "Q": {"kind": "prismatic", "4": LINE, "5": LINE},
    "R": {"kind": "prismatic", "5": LINE, "ground": {**LINE, "along": "90 deg"}},
}


@pytest.mark.parametrize(
    ("table", "change", "message"),
    [
        ("joints", BETWEEN, r"body 5 has no revolute path to the ground \(its joints: Q, R\)"),
        ("joints", {"A": {"kind": "prismatic", "2": LINE, "3": LINE}}, "body 3 has no revolute path to the ground"),
        ("reduction", {"4": "P"}, "mass does not pass through the prismatic joint P"),
        ("reduction", {"4": "A0"}, "joint A0 is not one of its own: C"),
    ],
)
def test_a_tree_that_mass_cannot_take_is_refused_by_name(table, change, message, slider_crank_keys):
    """A body between slides, an island on slides, a reduction over a slide or at another body's joint."""
    keys = slider_crank_keys
    keys[table] = keys.get(table, {}) | change
    if change is BETWEEN:
        keys["links"]["5"] = {"mass": "1 kg", "centre": ["0 m", "0 m"]}
    linkage = linkage_from_table(keys, "x")
    with pytest.raises(ModelError, match=message):
        reduction_tree(linkage, linkage.values)


def test_joints_that_lead_in_a_circle_are_refused(crank_rocker_keys):
    """Two bodies reduced to each other do not reach the ground."""
    linkage = linkage_from_table({**crank_rocker_keys, "reduction": {"3": "D", "5": "D"}}, "x")
    with pytest.raises(ModelError, match="lead in a circle"):
        reduction_tree(linkage, linkage.values)


def test_the_chosen_tree_has_the_least_counter_mass(crank_rocker_keys):
    """Of all trees over revolute joints none needs less."""
    linkage = linkage_from_table({k: v for k, v in crank_rocker_keys.items() if k != "reduction"}, "x")

    def weight(reduced):
        return sum(counter.mass for body in force_balance(reduced).values() for counter in body.counters)

    joints = [[j.name for j in linkage.joints_of(body)] for body in linkage.bodies]
    trees = [dict(zip(linkage.bodies, names, strict=True)) for names in product(*joints)]
    grounded = [
        tree for tree in trees if not (tree["3"] == tree["4"] or tree["2"] == tree["3"] or tree["5"] == tree["3"])
    ]
    least = min(weight(ReducedLinkage(linkage, linkage.values, tree)) for tree in grounded)
    assert weight(reduction_tree(linkage, linkage.values)) == pytest.approx(least)


def test_leaves_come_first():
    """Every body comes before the one that carries it."""
    linkage = load_linkage("pantograph")
    order = reduction_tree(linkage, linkage.values).leaves_first()
    assert order.index("4") < order.index("3") < order.index("2+7")
    assert order.index("6") < order.index("2+7")
