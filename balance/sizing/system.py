"""The conditions as equations for counter-masses: a mass at a site adds so many times a constant column.

``A pi + B m = 0``, m >= 0.
"""

from collections.abc import Sequence

import numpy as np

from ..arrays import Floats
from ..conditions import Conditions
from ..errors import SizingError
from ..mechanism import Mechanism


def chosen_sites(mechanism: Mechanism, sites: Sequence[str]) -> list[str]:
    """The sites named, or those that the file names counter...; SizingError if there is none."""
    names = list(dict.fromkeys(sites)) or mechanism.counter_sites
    if not names:
        raise SizingError(
            f"{mechanism.name} has no site named counter...: name the sites for counter-masses, "
            f"there are {', '.join(mechanism.sites) or 'none in the file'}"
        )
    for name in names:
        mechanism.with_counter_mass({name: 0.0})
    return names


def system(conditions: Conditions, mechanism: Mechanism, names: Sequence[str]) -> tuple[Floats, Floats]:
    """B (rank, sites) and the target -A pi (rank,) of B m = -A pi."""
    columns = []
    for name in names:
        added = mechanism.with_counter_mass({name: 1.0}).pi - mechanism.pi
        columns.append(conditions.matrix @ added)
    return np.array(columns).T, -conditions.values(mechanism)
