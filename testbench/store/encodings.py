"""How the samples of a channel lie in the file: as they are, compressed, or as whole numbers of decimal places.

A logger that writes fixed decimals writes x = k / 10**d with whole k. The float64 next to that quotient is what k
divided by 10**d gives, so that k and d restore it to the bit; multiplying by 10**-d does not. Counted from the smallest
k, the numbers have no sign and few digits, which HDF5's own filters compress almost as far as any can.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..recording import Samples

MOST_DECIMALS = 15
LARGEST = 2**53
"""Whole numbers beyond this are not all float64."""
GZIP_LEVEL = 4
"""Above it files shrink by no more than one per cent and take several times as long."""
_TRIED = 4096
"""Samples by which numbers without fixed decimals are recognised first."""
_NAN_BITS = np.float64(np.nan).view(np.uint64)
_COMPRESSED: dict[str, Any] = {"shuffle": True, "compression": "gzip", "compression_opts": GZIP_LEVEL}


@dataclass(frozen=True)
class Plain:
    """Float64 as parsed: type, HDF5's filters but the checksum, and what tells other people's tools how to read it."""

    kind: str = "<f8"
    options: Mapping[str, Any] = field(default_factory=dict)
    attributes: Mapping[str, Any] = field(default_factory=dict)

    def stored(self, values: Samples) -> NDArray[Any]:
        """The values (n,) [as recorded] themselves."""
        return values


PLAIN = Plain()
COMPRESSED = Plain(options=_COMPRESSED)
"""Float64 that loses nothing, whatever the values are."""


@dataclass(frozen=True)
class Decimals:
    """Whole numbers: value = (stored + ``first``) / 10**``decimals``, to the bit.

    The largest number that ``kind`` holds stands for NaN. ``negative_zeros`` says that some zeros carry a minus sign,
    which a whole number cannot: a bit for each sample is stored as well.
    """

    decimals: int
    first: int
    kind: str = "<u4"
    has_nan: bool = False
    negative_zeros: bool = False

    @property
    def options(self) -> Mapping[str, Any]:
        """HDF5's own filters: no plugin is needed to read them."""
        return _COMPRESSED

    @property
    def missing(self) -> int:
        """What stands for NaN."""
        return int(np.iinfo(self.kind).max)

    @property
    def attributes(self) -> Mapping[str, Any]:
        """CF: stored * scale_factor + add_offset is the value but for rounding; by ours it is the value to the bit."""
        power = 10**self.decimals
        known = {"decimals": self.decimals, "first": self.first}
        known |= {"scale_factor": 1 / power, "add_offset": self.first / power}
        return known | ({"_FillValue": np.array(self.missing, self.kind)[()]} if self.has_nan else {})

    def stored(self, values: Samples) -> NDArray[Any]:
        """The values (n,) [as recorded] as whole numbers, (n,) [-]."""
        nan = np.isnan(values)
        whole = np.rint(np.where(nan, self.first / 10**self.decimals, values) * 10.0**self.decimals).astype(np.int64)
        return np.where(nan, self.missing, whole - self.first).astype(self.kind)

    def restored(self, stored: NDArray[Any], minus: NDArray[np.uint8] | None = None) -> Samples:
        """The values (n,) [as recorded]; ``minus``, (n / 8,) [-], has a bit for each zero with a minus sign."""
        values: Samples = (stored.astype(np.int64) + self.first) / 10.0**self.decimals
        if self.has_nan:
            values[stored == self.missing] = np.nan
        if minus is not None:
            values[np.unpackbits(minus, count=len(values)).astype(bool)] = -0.0
        return values


Form = Plain | Decimals


def minus_bits(values: Samples) -> NDArray[np.uint8]:
    """A bit for each of the values (n,) [as recorded], (n / 8,) [-]: whether it is a zero with a minus sign."""
    return np.packbits((values == 0.0) & np.signbit(values))


class Search:
    """The form in which a channel is smallest, found by looking at all its samples, block by block."""

    def __init__(self) -> None:
        self._decimals = 0
        self._least, self._most = np.inf, -np.inf
        self._fits, self._nan, self._minus = True, False, False

    def update(self, values: Samples) -> None:
        """Look at the next samples."""
        if self._fits:
            self._fits = self._take(values)

    def _take(self, values: Samples) -> bool:
        nan = np.isnan(values)
        if nan.any():
            self._nan = True
            if (values[nan].view(np.uint64) != _NAN_BITS).any():
                return False  # NaN with a message in it
            values = values[~nan]
        if not values.size:
            return True
        self._minus |= bool(minus_bits(values).any())
        self._least, self._most = min(self._least, values.min()), max(self._most, values.max())
        return self._found(values[:_TRIED]) and self._found(values)

    def _found(self, values: Samples) -> bool:
        """Whether there is a number of decimals, no fewer than so far, that these values have."""
        for decimals in range(self._decimals, MOST_DECIMALS + 1):
            with np.errstate(over="ignore"):
                whole = np.rint(values * 10.0**decimals)
            if not np.abs(whole).max() <= LARGEST:
                return False
            if (whole / 10.0**decimals == values).all():
                self._decimals = decimals
                return True
        return False

    def result(self) -> Form:
        """The form; whoever stores by it must compare what it restores."""
        power = 10.0**self._decimals
        if not self._fits or not max(abs(self._least), abs(self._most)) * power <= LARGEST:
            return COMPRESSED
        first, last = round(self._least * power), round(self._most * power)
        kind = "<u4" if last - first < np.iinfo("<u4").max else "<i8"
        return Decimals(self._decimals, first, kind, self._nan, self._minus)


def from_dict(known: Mapping[str, Any] | None) -> Decimals | None:
    """The whole numbers that a description speaks of; None for float64. Raises ValueError for what we never write."""
    if known is None:
        return None
    form = Decimals(**known)
    numbers = (form.decimals, form.first)
    if form.kind not in {"<u4", "<i8"} or not all(type(n) is int and abs(n) <= LARGEST for n in numbers):
        raise ValueError(f"no form of samples: {known}")
    if not 0 <= form.decimals <= MOST_DECIMALS:
        raise ValueError(f"{form.decimals} decimals, expected 0 to {MOST_DECIMALS}")
    return form
