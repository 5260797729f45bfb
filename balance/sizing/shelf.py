"""Counter-masses from stock plates, to a proven optimum."""

from collections.abc import Sequence

import numpy as np

from ..arrays import Indices
from ..conditions import Conditions
from ..mechanism import Mechanism
from ..stock import Plate
from .result import Sizing, sizing
from .setsearch import best_sets
from .system import chosen_sites, system


def from_stock(
    conditions: Conditions, mechanism: Mechanism, plates: Sequence[Plate], sites: Sequence[str] = ()
) -> Sizing:
    """The plates at each site that leave the least first-moment residual; among equals the lightest.

    A mixed-integer programme solved to proven optimality; a plate's quantity is for all sites together.
    """
    return nested_from_stock(conditions, [mechanism], plates, sites)[0]


def nested_from_stock(
    conditions: Conditions, mechanisms: Sequence[Mechanism], plates: Sequence[Plate], sites: Sequence[str] = ()
) -> tuple[Sizing, ...]:
    """A set of plates for each of ``mechanisms`` (one mechanism, payloads rising), each set holding the one before it.

    Least, one after the other: the largest first-moment residual of all, their sum, the mass of all sets; proven.
    """
    names = chosen_sites(mechanisms[0], sites)
    systems = [system(conditions, mechanism, names) for mechanism in mechanisms]
    masses = np.array([plate.mass for plate in plates])
    quantities = np.array([plate.quantity for plate in plates], dtype=float)
    counts = best_sets(systems[0][0], np.array([target for _, target in systems]), masses, quantities)
    return tuple(
        sizing(conditions, mechanism, dict(zip(names, rows @ masses, strict=True)), _piles(names, rows, plates))
        for mechanism, rows in zip(mechanisms, counts, strict=True)
    )


def _piles(names: Sequence[str], counts: Indices, plates: Sequence[Plate]) -> dict[str, list[Plate]]:
    """Plates at each site, in the order of the stock; ``counts`` (sites, kinds)."""
    return {
        name: [plate for plate, count in zip(plates, row, strict=True) for _ in range(count)]
        for name, row in zip(names, counts, strict=True)
    }
