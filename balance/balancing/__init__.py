"""Counter-masses from balance conditions: of any mass, within limits, and from stock plates."""

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
