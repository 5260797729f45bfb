"""Where links that are rigidly joined to others sit in the body that they form."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from ..errors import CounterpoiseError, DataError
from ..quantities import parse
from .expressions import ORIGIN, Point


@dataclass(frozen=True)
class Placement:
    """The frame of a link in the frame of its body."""

    root: str
    """The link whose frame is the body's."""
    origin: Point = ORIGIN
    angle: float = 0.0
    """[rad]."""

    def of(self, point: Point) -> Point:
        """A point of the link in the body's frame."""
        return self.origin.plus(point.turned(self.angle))


def placements(
    links: Mapping[str, Mapping[str, Any]], read_point: Callable[[object, str], Point]
) -> dict[str, Placement]:
    """Placement of every link. Raises DataError where one is fixed to nothing, or in a circle."""
    found: dict[str, Placement] = {}

    def place(link: str, behind: tuple[str, ...]) -> Placement:
        keys, where = links[link], f"links.{link}"
        if link in behind:
            raise DataError(f"{where}: fixed in a circle: {' to '.join([*behind, link])}")
        if link not in found:
            found[link] = Placement(link)
            if "fixed_to" in keys:
                base = str(keys["fixed_to"])
                if base not in links:
                    raise DataError(f"{where}: fixed_to is {base!r}: expected one of {', '.join(links)}")
                del found[link]
                under = place(base, (*behind, link))
                origin = under.of(read_point(keys.get("at", ["0 m", "0 m"]), f"{where}.at"))
                found[link] = Placement(under.root, origin, under.angle + _angle(keys, where))
            elif unused := {"at", "angle"} & set(keys):
                raise DataError(f"{where}: {unused.pop()} is for a link that is fixed_to another")
        return found[link]

    for link in links:
        place(link, ())
    return found


def _angle(keys: Mapping[str, Any], where: str) -> float:
    try:
        return parse(str(keys.get("angle", "0 deg")), "angle")
    except CounterpoiseError as error:
        raise DataError(f"{where}.angle: {error}") from error
