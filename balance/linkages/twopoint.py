"""The two-point alternative: a body shaped so that point masses at two of its joints replace it, and no gear is needed.

m_B = S / L, m_A = m - m_B about joint A; its inertia must be I_cg = m_A m_B L^2 / (m_A + m_B).
"""

from collections.abc import Mapping, Sequence

import numpy as np

from ..arrays import Floats
from ..errors import ModelError, SizingError
from .description import Body, Linkage, Place
from .expressions import Point
from .loads import CounterMass, ForceBalance, Load, pin


def two_point_balanced(
    linkage: Linkage,
    tree: Mapping[str, str],
    values: Mapping[str, float],
    body: Body,
    loads: tuple[Load, ...],
    places: Sequence[Place],
    first: Floats,
    total: float,
) -> ForceBalance:
    """Counter-masses that bring the centre of mass onto the line of the two joints, and the two point masses."""
    joints = linkage.two_point[body.name].joints
    arm = span(linkage, values, body.name)
    length = float(np.linalg.norm(arm))
    across = np.array([-arm[1], arm[0]]) / length
    origin = pin(linkage, tree[body.name], body.name)
    counters = _onto_line(places, origin, values, across, first, total * length, body.name)
    first = first + sum((c.mass * c.position for c in counters), np.zeros(2))
    total += sum(c.mass for c in counters)
    share = float(first @ arm) / length**2
    if total and not 0.0 < share < total:
        raise SizingError(
            f"two_point of {body.name}: its centre of mass is not between {joints[0]} and {joints[1]}: one of the two "
            f"point masses would be {min(share, total - share):.4g} kg"
        )
    shares = {joints[0]: total - share, joints[1]: share}
    return ForceBalance(body.name, tree[body.name], loads, counters, shares, np.zeros(2))


def span(linkage: Linkage, values: Mapping[str, float], body: str) -> Floats:
    """From the first to the second of the two joints, (2,) [m]. Raises ModelError where they are none of the body's."""
    joints = linkage.two_point[body].joints
    for joint in joints:
        if not linkage.joints[joint].joins(body) or not linkage.joints[joint].revolute:
            raise ModelError(f"two_point of {body}: joint {joint} is not a revolute joint of it")
    arm = pin(linkage, joints[1], body).plus(pin(linkage, joints[0], body), -1.0).at(values)
    if not arm.any():
        raise ModelError(f"two_point of {body}: joints {' and '.join(joints)} lie in one point")
    return arm


def _onto_line(
    places: Sequence[Place],
    origin: Point,
    values: Mapping[str, float],
    across: Floats,
    first: Floats,
    scale: float,
    body: str,
) -> tuple[CounterMass, ...]:
    """The lightest counter-mass against the first moment across the line of the joints."""
    off = float(across @ first)
    if abs(off) <= 1e-13 * scale:
        return ()
    at = [p.point.plus(origin, -1.0).at(values) if p.point is not None else None for p in places]
    fit = [
        (-off / float(across @ x), p, x)
        for p, x in zip(places, at, strict=True)
        if x is not None and across @ x * off < 0
    ]
    if not fit:
        raise SizingError(
            f"two_point of {body}: its centre of mass lies beside the line of the two joints (first moment {off:.4g} "
            "kg m); two point masses can only stand for a body whose centre is on that line: give a counter_mass place "
            "on the other side"
        )
    mass, place, position = min(fit, key=lambda found: found[0])
    return (CounterMass(place, mass, position, place.inertia(mass, values)),)
