"""Which bodies always turn together: joined by a prismatic joint, or by a parallelogram as the description says.

Walking a reduction tree: a body's parents, how far the ground is, leaves before what carries them.
"""

from collections.abc import Mapping
from math import inf

from ..errors import ModelError
from .linkage import GROUND, Linkage


def turning_groups(linkage: Linkage) -> dict[str, str]:
    """For every body and the ground, a name that it shares with those that turn as it does."""
    group = {name: name for name in (GROUND, *linkage.bodies)}
    pairs = [(j.ends[0].body, j.ends[1].body) for j in linkage.joints.values() if not j.revolute]
    for first, second in [*pairs, *linkage.turns_with]:
        old, new = group[second], group[first]
        group = {body: new if value == old else value for body, value in group.items()}
    return group


def translating_parts(linkage: Linkage) -> set[str]:
    """Bodies that cannot turn."""
    group = turning_groups(linkage)
    return {body for body in linkage.bodies if group[body] == group[GROUND]}


def check_inertias(linkage: Linkage) -> None:
    """Raise ModelError for a link that turns and has no inertia."""
    still = translating_parts(linkage)
    for body in linkage.bodies.values():
        for part in body.parts:
            if not part.turns and body.name not in still:
                raise ModelError(f"link {part.link} of {linkage.name} turns: give its inertia")


def leaves_first(linkage: Linkage, tree: Mapping[str, str]) -> list[str]:
    """Bodies so that every one comes before the bodies that carry it."""
    return sorted(linkage.bodies, key=lambda body: -tree_depth(linkage, tree, body))


def tree_parents(linkage: Linkage, tree: Mapping[str, str], body: str) -> list[tuple[str, str]]:
    """Joints to which a body's mass is reduced, each with the body across: one, or two of a two-point body."""
    shaped = linkage.two_point.get(body)
    names = shaped.joints if shaped else (tree[body],)
    return [(name, linkage.joints[name].other(body)) for name in names]


def tree_depth(linkage: Linkage, tree: Mapping[str, str], body: str, left: int | None = None) -> float:
    """Joints between a body and the ground; infinite in a circle."""
    left = len(tree) if left is None else left
    if body == GROUND:
        return 0
    if left < 0:
        return inf
    return 1 + max(tree_depth(linkage, tree, parent, left - 1) for _, parent in tree_parents(linkage, tree, body))
