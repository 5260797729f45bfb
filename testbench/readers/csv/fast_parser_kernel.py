"""The loop that turns regular rows of numbers into float64, for the compiler.

A number below 2**53 times or over a power of ten up to 10**22 is made of two exact float64: one product or division
gives the float64 next to what is written, which is what ``float()`` gives. Other numbers are deferred to ``float()``.
A minus sign is that of the power: processors guess wrong at every second sign that they have to branch on.

Eight characters are handled at once in a word of 64 bits, the first character in its lowest byte. Each byte of
``v = word ^ "00000000"`` is a digit's value if it is below 10; ``(v + 0x76...) | v`` has the highest bit of a byte set
where one is not. Shifting ``v`` to the left by what lies behind the digits puts zeros before them.

Only the process that compiles imports this module.
"""

from typing import Any

import numpy as np
from numba import cfunc, njit, types
from numba.cpython.unsafe.numbers import trailing_zeros
from numba.extending import intrinsic

IRREGULAR, FULL = -1, -2
"""Given in place of the number of rows where a line is no row of plain numbers, and where there are too many rows."""
_REACH = 24
"""A number that is read by words ends before this many bytes behind its beginning."""
_MOST_DECIMALS, _MOST_DIGITS, _MOST_POWER = 8, 19, 22
_EXACT = np.uint64(1 << 53)
_POWERS = np.array([10.0**k for k in range(_MOST_POWER + 1)])
_OTHER_SIGN = np.uint64(len(_POWERS))
_SIGNED_POWERS = np.concatenate((_POWERS, -_POWERS))
_WHOLE_POWERS = np.array([10**k for k in range(_MOST_DECIMALS + 1)], dtype=np.uint64)
_ONES, _ZEROS, _ABOVE_NINE, _HIGH = (np.uint64(byte * 0x0101010101010101) for byte in (0x01, 0x30, 0x76, 0x80))
_TEN, _THREE, _EIGHT, _WORD = (np.uint64(number) for number in (10, 3, 8, 64))
_FEED, _RETURN, _BLANK, _PLUS, _MINUS = 10, 13, 32, 43, 45


@intrinsic
def _get(typing: Any, place: Any, at: Any) -> Any:
    """What lies ``at`` so many items behind ``place``."""

    def load(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.load(builder.gep(arguments[0], [arguments[1]]))

    return place.dtype(place, at), load


@intrinsic
def _put(typing: Any, place: Any, at: Any, value: Any) -> Any:
    """Put ``value`` so many items behind ``place``."""

    def store(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        builder.store(arguments[2], builder.gep(arguments[0], [arguments[1]]))
        return context.get_dummy_value()

    return types.void(place, at, place.dtype), store


@intrinsic
def _word(typing: Any, text: Any, at: Any) -> Any:
    """The eight bytes of ``text`` from ``at`` on, which need not be aligned."""

    def load(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        from llvmlite import ir

        place = builder.bitcast(builder.gep(arguments[0], [arguments[1]]), ir.IntType(64).as_pointer())
        return builder.load(place, align=1)

    return types.uint64(text, at), load


@njit(inline="always", error_model="numpy")
def _spelled(digits: Any) -> Any:
    """The number that eight digits spell, one a byte: by pairs, then fours, then the whole."""
    pairs = digits * _TEN + (digits >> _EIGHT)
    mask = np.uint64(0x000000FF000000FF)
    first = (pairs & mask) * np.uint64(100 + (1000000 << 32))
    second = ((pairs >> np.uint64(16)) & mask) * np.uint64(1 + (10000 << 32))
    return (first + second) >> np.uint64(32)


@njit(inline="always", error_model="numpy")
def _by_words(text: Any, at: Any, points: Any, decimals: Any, stop: Any) -> Any:
    """A number such as -12.345678 of so many decimals and the byte ``stop``: value and place of that byte, or -1."""
    word = _word(text, at)
    found = word ^ points
    found = (found - _ONES) & ~found & _HIGH
    begin = at + (trailing_zeros(found) >> 3) + 1
    end = begin + decimals
    if not found or _get(text, end) != stop:
        return 0.0, -1
    negative = np.uint64((word & np.uint64(255)) == np.uint64(_MINUS))
    length = (np.uint64(begin - at - 1) - negative) << _THREE
    before = ((word >> (negative << _THREE)) ^ _ZEROS) << (_WORD - length)
    behind = (_word(text, begin) ^ _ZEROS) << (_WORD - np.uint64(decimals << 3))
    if length + np.uint64(decimals << 3) <= _WORD:  # eight digits at most: all in one word
        digits = behind | before >> np.uint64(decimals << 3)
        odd = ((digits + _ABOVE_NINE) | digits) & _HIGH
        whole = _spelled(digits)
    else:
        odd = ((before + _ABOVE_NINE) | before | (behind + _ABOVE_NINE) | behind) & _HIGH
        whole = _spelled(before) * _WHOLE_POWERS[decimals] + _spelled(behind)
    if not length or odd or whole >= _EXACT:
        return 0.0, -1
    return np.float64(np.int64(whole)) / _SIGNED_POWERS[negative * _OTHER_SIGN + np.uint64(decimals)], end


@njit(inline="always", error_model="numpy")
def _digits(text: Any, at: Any, whole: Any) -> Any:
    """The number ``whole`` with the digits from ``at`` on behind it, and where they end."""
    while 48 <= _get(text, at) <= 57:
        whole = whole * _TEN + np.uint64(_get(text, at) - 48)
        at += 1
    return whole, at


@njit(inline="always", error_model="numpy")
def _exponent(text: Any, at: Any) -> Any:
    """An exponent from its ``e`` on and where it ends; -1 if it is none."""
    at += 1
    falls = _get(text, at) == _MINUS
    if falls or _get(text, at) == _PLUS:
        at += 1
    begin, exponent = at, np.int64(0)
    while 48 <= _get(text, at) <= 57:
        exponent = exponent * 10 + np.int64(_get(text, at) - 48) if exponent < 1000 else exponent
        at += 1
    return -exponent if falls else exponent, at if at > begin else -1


@njit(inline="always", error_model="numpy")
def _any_number(text: Any, at: Any, mark: Any) -> Any:
    """Any number: value, whether it is exact, its decimals and where it ends; -1 if it is none."""
    negative = _get(text, at) == _MINUS
    if negative or _get(text, at) == _PLUS:
        at += 1
    whole, end = _digits(text, at, np.uint64(0))
    count, decimals, exponent = end - at, 0, 0
    if _get(text, end) == mark:
        at = end + 1
        whole, end = _digits(text, at, whole)
        decimals = end - at
    count += decimals
    if not count:
        return 0.0, False, 0, -1
    if _get(text, end) == 69 or _get(text, end) == 101:
        exponent, end = _exponent(text, end)
    power = exponent - decimals
    if count > _MOST_DIGITS or whole >= _EXACT or not -_MOST_POWER <= power <= _MOST_POWER:
        return 0.0, False, decimals, end
    value = np.float64(np.int64(whole))
    value = value / _POWERS[-power] if power < 0 else value * _POWERS[power]
    return -value if negative else value, True, decimals, end


@njit(inline="always", error_model="numpy")
def _past(text: Any, at: Any, byte: Any) -> Any:
    """Where ``byte`` or the line feed is, from ``at`` on."""
    while _get(text, at) != byte and _get(text, at) != _FEED:
        at += 1
    return at


@njit(inline="always", error_model="numpy")
def _behind_blanks(text: Any, at: Any) -> Any:
    while _get(text, at) == _BLANK:
        at += 1
    return at


_BYTES, _INTEGERS, _FLOATS = (types.CPointer(kind) for kind in (types.uint8, types.int64, types.float64))
_SIGNATURE = types.int64(
    _BYTES, types.int64, types.uint8, types.uint8, _BYTES, types.int64, _FLOATS, types.int64, _INTEGERS, types.int64,
    _INTEGERS, _BYTES,
)  # fmt: skip


@njit(inline="always", error_model="numpy")
def _defer(deferred: Any, begin: Any, end: Any, field: Any, row: Any) -> None:
    """One more cell for ``float()``."""
    count = _get(deferred, 0) + 1
    _put(deferred, 0, count)
    _put(deferred, 4 * count, begin)
    _put(deferred, 4 * count + 1, end)
    _put(deferred, 4 * count + 2, field)
    _put(deferred, 4 * count + 3, row)


def rows(
    text: Any,
    size: Any,
    separator: Any,
    mark: Any,
    kept: Any,
    fields: Any,
    columns: Any,
    capacity: Any,
    deferred: Any,
    most_deferred: Any,
    decimals: Any,
    stops: Any,
) -> Any:
    """Parse ``text``, whole lines of ``size`` bytes, into ``columns``, (fields, capacity); the rows, IRREGULAR or FULL.

    Fields that are not ``kept`` are passed over. Of cells that ``float()`` must judge, begin, end, field and row go
    to ``deferred``, (1 + most_deferred, 4), behind a row that begins with their number; full, all is irregular.
    ``decimals`` and ``stops``, (fields,), must be zero.
    """
    points = np.uint64(mark) * _ONES
    at = row = 0
    while at < size:
        if row == capacity:
            return FULL
        for j in range(fields):
            if _get(decimals, j) and at < size - _REACH:  # as many as in the row before, mostly
                value, end = _by_words(text, at, points, _get(decimals, j), _get(stops, j))
                if end >= 0:
                    _put(columns, j * capacity + row, value)
                    at = end + 1
                    continue
            begin = end = _behind_blanks(text, at)
            if _get(kept, j):
                value, exact, places, end = _any_number(text, begin, mark)
                if end < 0 or (not exact and _get(deferred, 0) == most_deferred):
                    return IRREGULAR
                _put(columns, j * capacity + row, value)
                _put(decimals, j, places if places <= _MOST_DECIMALS else 0)
                if not exact:
                    _defer(deferred, begin, end, j, row)
                end = _behind_blanks(text, end)
            else:
                end = _past(text, end, separator)
            stop = _get(text, end)
            if stop != separator if j < fields - 1 else stop != _FEED and stop != _RETURN:
                return IRREGULAR
            _put(stops, j, stop)
            at = end + 1
        if _get(text, at - 1) == _RETURN:
            if _get(text, at) != _FEED:
                return IRREGULAR
            at += 1
        row += 1
    return row


def compiled() -> str:
    """The loop for this processor, as text that LLVM takes; its entry is called ``rows``."""
    function = cfunc(_SIGNATURE, error_model="numpy")(rows)
    return str(function.inspect_llvm()).replace(function.native_name, "rows")
