"""The spanning tree of joints that a linkage is modelled with, and the pins that close its loops."""

from collections.abc import Mapping
from dataclasses import dataclass

from ..errors import ModelError
from .description import GROUND, End, Joint
from .expressions import ORIGIN
from .method import Balance


@dataclass(frozen=True)
class Skeleton:
    """The spanning tree of joints over the bodies, and the joints that close loops."""

    parent: Mapping[str, Joint]
    """Joint towards the base, by body."""
    loops: tuple[Joint, ...]

    def path(self, body: str) -> list[tuple[str, Joint]]:
        """Bodies and their joints from ``body`` down to the ground."""
        found = []
        while body != GROUND:
            joint = self.parent[body]
            found.append((body, joint))
            body = joint.other(body)
        return found


def skeleton(result: Balance, together: bool = True) -> Skeleton:
    """The driven joint, all prismatic ones, and where possible those of gears are in the tree; pins close the loops.

    ``together`` makes use of which bodies turn together: a parallelogram is then not singular where it lies flat.
    Raises ModelError for a loop of slides, or a body that is not connected.
    """
    linkage = result.linkage
    geared = {gear.joint for gear in result.moment.gears.values()} if result.moment else set()
    joints = [*linkage.joints.values(), *(_sliding(pair) for pair in linkage.turns_with if together)]
    order = sorted(
        joints, key=lambda j: (j.name != linkage.drive, j.revolute, j.name not in geared, not j.joins(GROUND))
    )
    group = {name: name for name in (GROUND, *linkage.bodies)}
    edges: list[Joint] = []
    loops: list[Joint] = []
    for joint in order:
        first, second = (group[end.body] for end in joint.ends)
        (loops if first == second else edges).append(joint)
        group = {body: first if value == second else value for body, value in group.items()}
    for joint in loops:
        if not joint.revolute:
            raise ModelError(f"{linkage.name}: prismatic joint {joint.name} closes a loop of slides: not supported")
    if loose := [body for body in linkage.bodies if group[body] != group[GROUND]]:
        raise ModelError(f"{linkage.name}: body {loose[0]} is not connected to the ground")
    return Skeleton(_rooted(edges), tuple(loops))


def _sliding(pair: tuple[str, str]) -> Joint:
    """Between bodies that turn together: both directions of sliding, no turn."""
    first, second = pair
    return Joint(f"{first}~{second}", False, (End(first, ORIGIN), End(second, ORIGIN)), both=True)


def _rooted(edges: list[Joint]) -> dict[str, Joint]:
    """Joints towards the ground by body."""
    found: dict[str, Joint] = {}
    reached = {GROUND}
    while len(found) < len(edges):
        for joint in edges:
            first, second = (end.body for end in joint.ends)
            if (first in reached) != (second in reached):
                body = second if first in reached else first
                found[body] = joint
                reached.add(body)
    return found
