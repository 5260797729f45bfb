"""The reduction tree: for every body the revolute joint to which its mass is reduced, all leading to the ground."""

from collections.abc import Iterator, Mapping
from itertools import product
from math import inf, prod

from ..errors import ModelError, SizingError
from .description import GROUND, Linkage
from .force import force_balance
from .walk import depth, parents

MOST_TREES = 20_000
"""Beyond so many combinations the shortest paths to the ground are taken."""


def reduction_tree(linkage: Linkage, values: Mapping[str, float]) -> dict[str, str]:
    """Reduction joint of every body: as described, and where nothing is, the choice of least counter-mass.

    Raises ModelError, naming the body, where one has no revolute path to the ground.
    """
    choices = {body: _choices(linkage, body) for body in linkage.bodies}
    _check_paths(linkage)
    if prod(len(joints) for joints in choices.values()) > MOST_TREES:
        choices = {body: [_shortest(linkage, choices, body)] for body in linkage.bodies}
    best, least, refusal = None, inf, None
    for tree in _trees(linkage, choices):
        try:
            mass = sum(c.mass for balanced in force_balance(linkage, tree, values).values() for c in balanced.counters)
        except SizingError as error:
            refusal = refusal or error
            continue
        if best is None or mass < least - 1e-9 * abs(least):
            best, least = tree, mass
    if best is None:
        raise refusal or ModelError(_circle(linkage, choices))
    return best


def _choices(linkage: Linkage, body: str) -> list[str]:
    own = [joint.name for joint in linkage.joints_of(body)]
    if body not in linkage.reduction:
        return own
    named = linkage.reduction[body]
    joint = linkage.joints[named]
    if not joint.joins(body):
        raise ModelError(f"reduction of {body}: joint {named} is not one of its own: {', '.join(own) or 'none'}")
    if not joint.revolute:
        raise ModelError(f"reduction of {body}: mass does not pass through the prismatic joint {named}")
    return [named]


def _check_paths(linkage: Linkage) -> None:
    """Raise ModelError for a body without a revolute path to the ground."""
    reached = {GROUND}
    for _ in linkage.bodies:
        reached |= {b for b in linkage.bodies if any(joint.other(b) in reached for joint in linkage.joints_of(b))}
    for body in linkage.bodies:
        if body not in reached:
            joints = ", ".join(j.name for kind in (True, False) for j in linkage.joints_of(body, kind)) or "none"
            raise ModelError(
                f"{linkage.name}: body {body} has no revolute path to the ground (its joints: {joints}); mass does "
                "not pass through prismatic joints, so the method cannot balance it"
            )


def _trees(linkage: Linkage, choices: Mapping[str, list[str]]) -> Iterator[dict[str, str]]:
    for joints in product(*choices.values()):
        tree = dict(zip(choices, joints, strict=True))
        if all(depth(linkage, tree, body) < inf for body in tree):
            yield tree


def _circle(linkage: Linkage, choices: Mapping[str, list[str]]) -> str:
    tree = {body: joints[0] for body, joints in choices.items()}
    lost = [body for body in tree if depth(linkage, tree, body) == inf]
    given = [f"{b} at {' and '.join(joint for joint, _ in parents(linkage, tree, b))}" for b in lost]
    return f"{linkage.name}: the reductions of {', '.join(given)} lead in a circle, not to the ground"


def _shortest(linkage: Linkage, choices: Mapping[str, list[str]], body: str) -> str:
    """The joint that leads to the ground over the fewest joints."""
    distance = {GROUND: 0.0}
    for _ in linkage.bodies:
        for b, joints in choices.items():
            distance[b] = 1 + min(distance.get(linkage.joints[j].other(b), inf) for j in joints)
    return min(choices[body], key=lambda joint: distance[linkage.joints[joint].other(body)])
