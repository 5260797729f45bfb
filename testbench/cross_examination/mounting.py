"""Ways in which axes of a sensor may be mounted, or wired, other than its rig states: exchanged, reversed, or both."""

from collections.abc import Sequence
from functools import lru_cache
from itertools import permutations, product

Signs = tuple[int, ...]


@lru_cache(maxsize=8)
def signs_of(count: int) -> tuple[Signs, ...]:
    """Signs of ``count`` axes, all as they are first, then those with ever more reversed."""
    return tuple(sorted(product((1, -1), repeat=count), key=lambda signs: signs.count(-1)))


@lru_cache(maxsize=8)
def exchanges(count: int) -> tuple[tuple[int, ...], ...]:
    """Orders of ``count`` axes of which none stays: of two an exchange, of three both turns about their diagonal."""
    return tuple(order for order in permutations(range(count)) if all(n != k for n, k in enumerate(order)))


def exchanged_axes(channels: Sequence[str], order: Sequence[int], signs: Sequence[int], verb: str, end: str) -> str:
    """What each of ``channels`` shows instead, and which of them the other way round; sign 0 where that is not told."""
    if len(order) == 2 and min(signs) > 0:
        return f"each {verb} what the other {end}"
    says = {1: "what {} {}", -1: "the opposite of what {} {}", 0: "what {} {}, or its opposite"}
    each = zip(channels, order, signs, strict=True)
    return ", ".join(f"{name} {verb} {says[sign].format(channels[k], end)}" for name, k, sign in each)
