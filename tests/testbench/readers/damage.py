"""Copies of a file, damaged in ways that loggers, cables and enemies have; seeded."""

import numpy as np


def copies(whole, count, seed):
    """``count`` damaged copies, one kind after the other."""
    random = np.random.default_rng(seed)
    kinds = (_cut, _flipped, _flipped_in_head, _spliced, _zeroed, _repeated, _large_numbers, _grown)
    for i in range(count):
        yield kinds[i % len(kinds)](bytearray(whole), random)


def _at(raw, random, before=None):
    return int(random.integers(0, max(1, min(len(raw), before or len(raw)))))


def _cut(raw, random):
    return raw[: _at(raw, random)]


def _flipped(raw, random):
    for _ in range(int(random.integers(1, 20))):
        raw[_at(raw, random)] ^= 1 << int(random.integers(0, 8))
    return raw


def _flipped_in_head(raw, random):
    for _ in range(int(random.integers(1, 4))):
        raw[_at(raw, random, 2000)] = int(random.integers(0, 256))
    return raw


def _spliced(raw, random):
    """A piece is missing."""
    begin = _at(raw, random)
    del raw[begin : begin + int(random.integers(1, 200))]
    return raw


def _zeroed(raw, random):
    begin, count = _at(raw, random), int(random.integers(1, 600))
    return raw[:begin] + bytes(min(count, len(raw) - begin)) + raw[begin + count :]


def _repeated(raw, random):
    """A piece comes again elsewhere."""
    begin, other = _at(raw, random), _at(raw, random)
    return raw[:other] + raw[begin : begin + int(random.integers(1, 600))] + raw[other:]


def _large_numbers(raw, random):
    """Lengths and addresses as large as can be."""
    begin, width = _at(raw, random, 4000), (2, 4, 8)[int(random.integers(3))]
    largest = 1 << 8 * width
    value = (largest // 2, largest - 1, largest - 16, 1 << 4 * width)[int(random.integers(4))]
    return raw[:begin] + value.to_bytes(width, "little") + raw[begin + width :]


def _grown(raw, random):
    return raw + random.bytes(int(random.integers(1, 3000)))
