"""The graphical solution: vector polygons whose closing sides are the corrections.

About the first plane only the correction in the last one has a moment: the closing side of the polygon of U_i (z_i -
z_L) is U_R (z_R - z_L). Likewise about the last plane. The polygon of the unbalances and both corrections closes.
"""

from dataclasses import dataclass

from .planes import Correction


@dataclass(frozen=True)
class Polygon:
    """Vectors laid head to tail."""

    title: str
    unit: str
    """``kg m`` for a polygon of unbalances, ``kg m2`` for one of their moments."""
    names: tuple[str, ...]
    vectors: tuple[complex, ...]
    """Sides that are given."""
    closing_names: tuple[str, ...]
    closing: tuple[complex, ...]
    """Sides that the corrections add."""

    @property
    def vertices(self) -> tuple[complex, ...]:
        """Corners, from the origin on; the last is back at the origin where the polygon closes."""
        corners = [0j]
        for side in (*self.vectors, *self.closing):
            corners.append(corners[-1] + side)
        return tuple(corners)

    def gap(self) -> float:
        """Distance from the last corner to the first, in ``unit``."""
        return abs(self.vertices[-1])


def polygons(correction: Correction) -> list[Polygon]:
    """Of moments about the first plane, of moments about the last, and of unbalances; in one plane the last alone."""
    planes = correction.planes
    about = [planes[0], planes[-1]] if len(planes) > 1 else []
    found = []
    for plane in about:
        found.append(_moments(correction, plane.name, plane.at))
    names = tuple(u.name for u in correction.unbalances)
    given = tuple(u.vector for u in correction.unbalances)
    found.append(Polygon("Unbalances", "kg m", names, given, tuple(p.name for p in planes), correction.vectors))
    return found


def _moments(correction: Correction, name: str, about: float) -> Polygon:
    """Sides U (z - about); the correction in the plane itself has no moment and is left out."""
    given = tuple(u.vector * (u.at - about) for u in correction.unbalances)
    closing = [
        (plane.name, vector * (plane.at - about))
        for plane, vector in zip(correction.planes, correction.vectors, strict=True)
        if plane.at != about
    ]
    names = tuple(u.name for u in correction.unbalances)
    return Polygon(
        f"Moments about plane {name}", "kg m2", names, given, tuple(n for n, _ in closing), tuple(v for _, v in closing)
    )
