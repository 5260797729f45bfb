"""What the last printed digits of the inputs leave open in the results."""

from collections.abc import Collection, Mapping

from .method import NOTHING, Balance, balance


def intervals(result: Balance, omit: Mapping[str, Collection[str]] = NOTHING) -> dict[str, tuple[float, float]]:
    """Every result with the interval that its inputs' rounding leaves it, worst cases added, SI.

    Each input is moved by half a unit of its last digit, both ways, on the same tree; ``omit`` as in ``balance``.
    """
    nominal = result.results()
    low, high = dict(nominal), dict(nominal)
    for name, symbol in result.linkage.symbols.items():
        if symbol.half_unit:
            moved = [_moved(result, name, half, omit) for half in (-symbol.half_unit, symbol.half_unit)]
            for key, value in nominal.items():
                changes = [other.get(key, 0.0) - value for other in moved]
                low[key] += min(0.0, *changes)
                high[key] += max(0.0, *changes)
    return {key: (low[key], high[key]) for key in nominal}


def _moved(result: Balance, name: str, change: float, omit: Mapping[str, Collection[str]]) -> dict[str, float]:
    values = {**result.values, name: result.values[name] + change}
    return balance(result.linkage, values, gears=result.moment is not None, omit=omit, tree=result.tree).results()
