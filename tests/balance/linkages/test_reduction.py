"""Reduction trees, chosen and checked."""

from itertools import product

import pytest

from balance.errors import ModelError
from balance.linkages.force_balance import force_balance, leaves_first, reduction_tree
from balance.linkages.linkage_files import linkage_from_table, load_linkage


def test_a_body_between_prismatic_joints_is_refused_by_name(slider_crank_keys):
    """No revolute path to the ground: named, with its joints."""
    keys = slider_crank_keys
    keys["links"]["5"] = {"mass": "1 kg", "centre": ["0 m", "0 m"]}
    line = {"point": ["0 m", "0 m"], "along": "0 deg"}
    keys["joints"]["Q"] = {"kind": "prismatic", "4": line, "5": line}
    keys["joints"]["R"] = {"kind": "prismatic", "5": line, "ground": {**line, "along": "90 deg"}}
    with pytest.raises(ModelError, match=r"body 5 has no revolute path to the ground \(its joints: Q, R\)"):
        reduction_tree(linkage_from_table(keys, "x"), {})


def test_a_bodies_island_on_slides_is_refused(slider_crank_keys):
    """Two bodies pinned to each other, but to the ground only by slides, are refused too."""
    keys = slider_crank_keys
    line = {"point": ["0 m", "0 m"], "along": "0 deg"}
    keys["joints"]["A"] = {"kind": "prismatic", "2": line, "3": line}
    with pytest.raises(ModelError, match="body 3 has no revolute path to the ground"):
        reduction_tree(linkage_from_table(keys, "x"), {})


def test_mass_does_not_pass_through_a_prismatic_joint(slider_crank_keys):
    """A reduction joint that is prismatic is refused."""
    linkage = linkage_from_table({**slider_crank_keys, "reduction": {"4": "P"}}, "x")
    with pytest.raises(ModelError, match="mass does not pass through the prismatic joint P"):
        reduction_tree(linkage, linkage.values)


def test_a_foreign_joint_is_refused(slider_crank_keys):
    """A reduction joint must be one of the body's own."""
    linkage = linkage_from_table({**slider_crank_keys, "reduction": {"4": "A0"}}, "x")
    with pytest.raises(ModelError, match="joint A0 is not one of its own: C"):
        reduction_tree(linkage, linkage.values)


def test_joints_that_lead_in_a_circle_are_refused(crank_rocker_keys):
    """Two bodies reduced to each other do not reach the ground."""
    linkage = linkage_from_table({**crank_rocker_keys, "reduction": {"3": "D", "5": "D"}}, "x")
    with pytest.raises(ModelError, match="lead in a circle"):
        reduction_tree(linkage, linkage.values)


def test_the_chosen_tree_has_the_least_counter_mass(crank_rocker_keys):
    """Of all trees over revolute joints none needs less."""
    linkage = linkage_from_table({k: v for k, v in crank_rocker_keys.items() if k != "reduction"}, "x")

    def weight(tree):
        done = force_balance(linkage, tree, linkage.values)
        return sum(counter.mass for body in done.values() for counter in body.counters)

    chosen = reduction_tree(linkage, linkage.values)
    joints = [[j.name for j in linkage.joints_of(body)] for body in linkage.bodies]
    trees = [dict(zip(linkage.bodies, names, strict=True)) for names in product(*joints)]
    grounded = [
        tree for tree in trees if not (tree["3"] == tree["4"] or tree["2"] == tree["3"] or tree["5"] == tree["3"])
    ]
    assert weight(chosen) == pytest.approx(min(weight(tree) for tree in grounded))


def test_leaves_come_first():
    """Every body comes before the one that carries it."""
    linkage = load_linkage("pantograph")
    order = leaves_first(linkage, reduction_tree(linkage, linkage.values))
    assert order.index("4") < order.index("3") < order.index("2+7")
    assert order.index("6") < order.index("2+7")
