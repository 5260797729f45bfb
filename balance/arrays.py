"""The array types that annotations name."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating[Any]]
"""Array of real numbers, double precision; its shape and unit stand in the docstring."""
Indices = NDArray[np.intp]
"""Array of positions."""
