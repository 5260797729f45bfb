"""The numbers of a function in pieces: binary or text, evenly spaced or each with its abscissa."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..stream import ByteSource, as_float64, damaged
from .function import Function

_TEXT_BYTES = 1 << 20


def per_sample(function: Function) -> int:
    """Numbers of one sample: abscissa if it is recorded, real part, imaginary part if it is complex."""
    return (not function.even) + 1 + function.is_complex


def pieces(source: ByteSource, function: Function, samples: int) -> Iterator[NDArray[np.float64]]:
    """The samples in pieces of ``samples``, each (numbers of a sample, n)."""
    read = _binary if function.dataset.binary else _text
    yield from read(source, function, samples)


def _binary(source: ByteSource, function: Function, samples: int) -> Iterator[NDArray[np.float64]]:
    kind = _binary_type(function)
    for begin in range(0, function.samples, samples):
        count = min(samples, function.samples - begin)
        offset = function.data + begin * kind.itemsize
        rows = np.frombuffer(source.read(offset, count * kind.itemsize, f"function {function.name!r}"), dtype=kind)
        yield np.stack([as_float64(rows[name]) for name in kind.names or ()])


def _binary_type(function: Function) -> np.dtype[np.void]:
    """The binary form of one sample."""
    layout = function.dataset.binary
    assert layout is not None
    names = ["re"] + ["im"] * function.is_complex
    number = [(name, f"{layout.order}f{layout.number}") for name in names]
    return np.dtype([("x", f"{layout.order}f{layout.abscissa}"), *number] if layout.abscissa else number)


def _text(source: ByteSource, function: Function, samples: int) -> Iterator[NDArray[np.float64]]:
    width, waiting, found = per_sample(function), np.empty(0), 0
    for numbers in _numbers(source, function):
        waiting = np.concatenate([waiting, numbers])
        while len(waiting) >= samples * width:
            yield waiting[: samples * width].reshape(-1, width).T
            waiting, found = waiting[samples * width :], found + samples
    found += len(waiting) // width
    if len(waiting) % width or found != function.samples:
        message = f"declares {function.samples} samples, {found} are there"
        raise damaged(source.path, f"function {function.name!r}: {message}")
    if len(waiting):
        yield waiting.reshape(-1, width).T


def _numbers(source: ByteSource, function: Function) -> Iterator[NDArray[np.float64]]:
    """The numbers of a text dataset, in pieces of whole lines."""
    offset, keep = function.data, b""
    while offset < function.dataset.end:
        count = min(_TEXT_BYTES, function.dataset.end - offset)
        text = keep + source.read(offset, count, f"function {function.name!r}")
        offset += count
        whole = len(text) if offset == function.dataset.end else text.rfind(b"\n") + 1
        keep = text[whole:]
        try:
            yield parsed(text[:whole], _widths(function))
        except ValueError as error:
            raise damaged(source.path, f"function {function.name!r}: {error}") from error


def _widths(function: Function) -> tuple[int, ...]:
    """Widths of the numbers in a full line, by the standard's formats E13.5 and E20.12."""
    if not function.is_double:
        return (13,) * 6
    if function.even:
        return (20,) * 4
    return (13, 20, 20) if function.is_complex else (13, 20, 13, 20)


def parsed(text: bytes, widths: tuple[int, ...]) -> NDArray[np.float64]:
    """The numbers of a text: parted by blanks, or else by their widths where they touch one another."""
    text = text.replace(b"D", b"E").replace(b"d", b"e")
    try:
        return np.array(text.split(), dtype=np.bytes_).astype(np.float64)
    except ValueError:
        cells = [line[a:b].strip() for line in text.splitlines() for a, b in _spans(widths)]
        return np.array([cell for cell in cells if cell], dtype=np.bytes_).astype(np.float64)


def _spans(widths: tuple[int, ...]) -> list[tuple[int, int]]:
    ends = np.cumsum(widths).tolist()
    return list(zip([0, *ends[:-1]], ends, strict=True))
