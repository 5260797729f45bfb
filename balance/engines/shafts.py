"""Balance shafts: the unbalances that remove an order of an engine's force and moment.

A vector of order k that turns forward is removed by a shaft that turns forward at k omega with unbalance
-P / k^2, and so backward. Forward at first order that shaft is the crankshaft itself. Force and moment together need
two unbalances a shaft; a force with a fixed place, or a couple alone, fewer.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from ..rotors.planes import correct
from ..rotors.rotor import Plane, Unbalance
from .orders import Free


@dataclass(frozen=True)
class Shaft:
    """A shaft parallel to the crankshaft."""

    order: int
    forward: bool
    """Whether it turns with the crankshaft; at order times its speed."""
    unbalances: tuple[Unbalance, ...]
    """In its planes, at angles from x when the crankshaft's mark is at x, in the sense of the crankshaft [kg m]."""

    @property
    def is_crankshaft(self) -> bool:
        """Forward at first order: counterweights on the crankshaft do it."""
        return self.forward and self.order == 1


def shafts(free: Sequence[Free], first: float, last: float) -> list[Shaft]:
    """Shafts that remove the given orders, each with unbalances at ``first`` and ``last`` [m].

    Where one unbalance does it, it stands in the place of the resultant. A pair of equal shafts that turn against each
    other must stand at equal height on both sides, or they add a moment about the crankshaft's axis.
    """
    found = []
    for order in free:
        for forward in (True, False):
            force = order.force.forward if forward else order.force.backward
            moment = order.moment.forward if forward else order.moment.backward
            if force or moment:
                found.append(_shaft(order, forward, (force, moment), (first, last)))
    return found


def _shaft(order: Free, forward: bool, parts: tuple[complex, complex], ends: tuple[float, float]) -> Shaft:
    """The rotor whose two-plane correction removes force and moment, both per omega^2."""
    k, (force, moment) = order.force.order, parts
    size = max(abs(force), abs(moment) / abs(ends[1] - ends[0])) if ends[0] != ends[1] else abs(force)
    place = moment / force if abs(force) > 1e-12 * size else None
    if place is not None and abs(place.imag) <= 1e-9 * max(abs(place), abs(ends[1] - ends[0])):
        return Shaft(k, forward, (Unbalance("1", -force / k**2, order.about + place.real),))
    pair = [Unbalance("force", force, order.about), Unbalance("+", moment, order.about + 1.0)]
    pair.append(Unbalance("-", -moment, order.about))
    correction = correct(pair, [Plane("1", ends[0]), Plane("2", ends[1])])
    planes = zip(correction.planes, correction.vectors, strict=True)
    return Shaft(k, forward, tuple(Unbalance(p.name, v / k**2, p.at) for p, v in planes))


def removed(free: Free, shaft: Shaft) -> tuple[complex, complex]:
    """What a shaft adds to the force and to the moment of its own sense of its order, per omega^2 [kg m, kg m2]."""
    k = shaft.order
    force = sum((k**2 * u.vector for u in shaft.unbalances), 0j)
    return force, sum((k**2 * u.vector * (u.at - free.about) for u in shaft.unbalances), 0j)
