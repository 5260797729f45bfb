"""Counter-masses of any mass, within limits: least squares on the conditions."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from ..conditions import Conditions
from ..errors import SizingError
from ..mechanism import Mechanism
from .result import Sizing, sizing
from .system import chosen_sites, distribute_masses, system


def exact(
    conditions: Conditions, mechanism: Mechanism, sites: Sequence[str] = (), limits: Mapping[str, float] | None = None
) -> Sizing:
    """Counter-masses of any mass at ``sites`` (default: those named counter...) that leave the least residual.

    Least squares over the conditions, each mass between zero and its limit [kg]; of equals the lightest, then least
    squares of the masses. Raises SizingError if there is no site or the solver does not converge.
    """
    names = chosen_sites(mechanism, sites)
    if unused := [name for name in limits or {} if name not in names]:
        raise SizingError(f"the limit at {unused[0]!r} limits nothing: counter-masses go to {', '.join(names)}")
    columns, target = system(conditions, mechanism, names)
    upper = np.array([(limits or {}).get(name, np.inf) for name in names])
    for name, limit in zip(names, upper, strict=True):
        if not limit >= 0.0:
            raise SizingError(f"the limit at {name!r} is {limit:g} kg: expected zero or more")
    masses = distribute_masses(columns, target, upper).masses
    return sizing(conditions, mechanism, dict(zip(names, masses, strict=True)), {})


def nested_exact(
    conditions: Conditions, mechanisms: Sequence[Mechanism], sites: Sequence[str] = ()
) -> tuple[Sizing, ...]:
    """Exact counter-masses for each of ``mechanisms`` (one mechanism, payloads rising), as sets that only grow.

    Raises SizingError where a counter-mass would have to shrink: then no such sets are exact.
    """
    found = tuple(exact(conditions, mechanism, sites) for mechanism in mechanisms)
    for lighter, heavier in pairwise(found):
        for less, more in zip(lighter.counter_masses, heavier.counter_masses, strict=True):
            if more.mass < less.mass * (1.0 - 1e-12):
                raise SizingError(
                    f"the counter-mass at {less.site!r} would have to shrink from {less.mass:.4f} to {more.mass:.4f} "
                    "kg as the payload grows: no sets that only grow are exact; size each payload by itself"
                )
    return found
