"""Streams of random numbers, one for each thing that is drawn: what is drawn of one does not depend on the others."""

import zlib

import numpy as np


def stream(*key: int | str) -> np.random.Generator:
    """The generator of a key of numbers and words, the same each time."""
    return np.random.default_rng([zlib.crc32(part.encode()) if isinstance(part, str) else part for part in key])
