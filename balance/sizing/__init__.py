"""Counter-masses from balance conditions: of any mass, within limits, and from stock plates."""

from .exactly import exact, nested_exact
from .result import BALANCES, CounterMass, Sizing, balanced_payload, given
from .shelf import from_stock, nested_from_stock

__all__ = [
    "BALANCES",
    "CounterMass",
    "Sizing",
    "balanced_payload",
    "exact",
    "from_stock",
    "given",
    "nested_exact",
    "nested_from_stock",
]
