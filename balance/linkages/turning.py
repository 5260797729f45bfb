"""Which bodies always turn together: joined by a prismatic joint, or by a parallelogram as the description says."""

from ..errors import ModelError
from .description import GROUND, Linkage


def turning_groups(linkage: Linkage) -> dict[str, str]:
    """For every body and the ground, a name that it shares with those that turn as it does."""
    group = {name: name for name in (GROUND, *linkage.bodies)}
    pairs = [(j.ends[0].body, j.ends[1].body) for j in linkage.joints.values() if not j.revolute]
    for first, second in [*pairs, *linkage.turns_with]:
        old, new = group[second], group[first]
        group = {body: new if value == old else value for body, value in group.items()}
    return group


def translating(linkage: Linkage) -> set[str]:
    """Bodies that cannot turn."""
    group = turning_groups(linkage)
    return {body for body in linkage.bodies if group[body] == group[GROUND]}


def check_inertias(linkage: Linkage) -> None:
    """Raise ModelError for a link that turns and has no inertia."""
    still = translating(linkage)
    for body in linkage.bodies.values():
        for part in body.parts:
            if not part.turns and body.name not in still:
                raise ModelError(f"link {part.link} of {linkage.name} turns: give its inertia")
