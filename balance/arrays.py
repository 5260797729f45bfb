"""The array types that annotations name, and arrays that are handed out frozen."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating[Any]]
"""Array of real numbers, double precision; its shape and unit stand in the docstring."""
Complexes = NDArray[np.complexfloating]
"""Array of complex numbers."""
Indices = NDArray[np.intp]
"""Array of positions."""


def frozen(array: Floats) -> Floats:
    """The same array, read-only from now on."""
    array.setflags(write=False)
    return array
