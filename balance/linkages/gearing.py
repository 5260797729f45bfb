"""Which body's inertia is cancelled by which gear: where gears sit, and what passes through prismatic joints."""

from collections.abc import Mapping
from dataclasses import dataclass

from ..errors import ModelError
from .description import GROUND, Gear, Linkage
from .turning import check_inertias, translating, turning_groups


@dataclass(frozen=True)
class Gearing:
    """Gears by body."""

    own: Mapping[str, Gear]
    """The gear of every body that has one."""
    joint: Mapping[str, str]
    """The joint that every gear sits at."""
    carrier: Mapping[str, str]
    """The body that carries every gear pair, or the ground."""
    passes_to: Mapping[str, str]
    """Bodies without a gear of their own, and the one that turns with them to which their inertia is added."""


def gearing(linkage: Linkage, tree: Mapping[str, str]) -> Gearing:
    """Assign gears. Raises ModelError, naming the body, where one that turns has none, or two."""
    check_inertias(linkage)
    own: dict[str, Gear] = {}
    joint: dict[str, str] = {}
    for gear in linkage.gears.values():
        if gear.body in own:
            raise ModelError(f"gears {own[gear.body].name} and {gear.name} are both on body {gear.body}: keep one")
        if gear.body in linkage.two_point:
            raise ModelError(f"gear {gear.name}: body {gear.body} is two point masses and needs no gear")
        own[gear.body] = gear
        joint[gear.name] = _joint_of(linkage, tree, gear)
    carrier = {name: linkage.joints[joint[name]].other(gear.body) for name, gear in linkage.gears.items()}
    for gear in linkage.gears.values():
        _check_pivot(gear, carrier[gear.name])
    return Gearing(own, joint, carrier, _passes_to(linkage, own, carrier))


def _check_pivot(gear: Gear, carrier: str) -> None:
    """Raise ModelError for a counter-gear that is said to be pivoted on another body than its carrier."""
    if gear.pivot_on not in (None, carrier):
        raise ModelError(
            f"gear {gear.name}: its counter-gear is said to be pivoted on {gear.pivot_on}, but the pair is carried by "
            f"{carrier}: give its place on {carrier}, or another joint for the gear"
        )


def _joint_of(linkage: Linkage, tree: Mapping[str, str], gear: Gear) -> str:
    name = gear.joint or tree[gear.body]
    joint = linkage.joint(name)
    if not joint.joins(gear.body) or not joint.revolute:
        raise ModelError(f"gear {gear.name}: joint {name} is not a revolute joint of body {gear.body}")
    return name


def _passes_to(linkage: Linkage, own: Mapping[str, Gear], carrier: Mapping[str, str]) -> dict[str, str]:
    """Prismatic transport: to the body that turns with it and has a gear, best one pivoted on the ground."""
    group, still, found = turning_groups(linkage), translating(linkage), {}
    for body in linkage.bodies:
        if body in own or body in still or body in linkage.two_point:
            continue
        partners = [other for other in own if group[other] == group[body]]
        if not partners:
            raise ModelError(
                f"{linkage.name}: body {body} turns and has no gear, nor has one that always turns with it; add for "
                f'example [gears.z{body}] with body = "{body}"'
            )
        found[body] = min(partners, key=lambda other: carrier[own[other].name] != GROUND)
    return found
