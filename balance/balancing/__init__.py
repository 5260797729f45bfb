"""Counter-masses from balance conditions: of any mass, within limits, and from stock plates."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .sizing import (
        BALANCES,
        CounterMass,
        Sizing,
        balanced_payload,
        exact_sizing,
        nested_exact_sizing,
        nested_size_from_stock,
        size_from_stock,
        sizing_of_given,
    )

__all__ = [
    "BALANCES",
    "CounterMass",
    "Sizing",
    "balanced_payload",
    "exact_sizing",
    "nested_exact_sizing",
    "nested_size_from_stock",
    "size_from_stock",
    "sizing_of_given",
]


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """Sizing is imported when it is asked for: who needs the conditions alone imports none of it."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.sizing"), name)
