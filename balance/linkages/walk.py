"""Walking a reduction tree: a body's parents, how far the ground is, leaves before what carries them."""

from collections.abc import Mapping
from math import inf

from .description import GROUND, Linkage


def leaves_first(linkage: Linkage, tree: Mapping[str, str]) -> list[str]:
    """Bodies so that every one comes before the bodies that carry it."""
    return sorted(linkage.bodies, key=lambda body: -depth(linkage, tree, body))


def parents(linkage: Linkage, tree: Mapping[str, str], body: str) -> list[tuple[str, str]]:
    """Joints to which a body's mass is reduced, each with the body across: one, or two of a two-point body."""
    shaped = linkage.two_point.get(body)
    names = shaped.joints if shaped else (tree[body],)
    return [(name, linkage.joints[name].other(body)) for name in names]


def depth(linkage: Linkage, tree: Mapping[str, str], body: str, left: int | None = None) -> float:
    """Joints between a body and the ground; infinite in a circle."""
    left = len(tree) if left is None else left
    if body == GROUND:
        return 0
    if left < 0:
        return inf
    return 1 + max(depth(linkage, tree, parent, left - 1) for _, parent in parents(linkage, tree, body))
