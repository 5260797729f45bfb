"""Rows of a long log by a compiled loop, which is worth its start only there; all else goes the usual way."""

import math
import threading
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ...compiled_kernels import BYTE, INTEGER, PLACE, Kernel
from ...recording import Samples
from .row_parser import RowParser
from .text_blocks import count_lines

_PATIENCE_S = 1.0
"""How long the first block waits for a loop that is kept; one that is compiled anew is not waited for."""
_FEW = 32
"""One cell in so many may be deferred to ``float()``; where there are more, the block goes the usual way."""
_FULL = -2
"""What the loop gives where there are more rows than room."""
_MORE = 1.05
"""Room for rows, times that of a block whose rows are as long as those of the block before."""
_TEXT, _COLUMNS, _DEFERRED, _SHAPES = (PLACE, INTEGER), (PLACE, INTEGER), (PLACE, INTEGER), (PLACE, PLACE)
_ARGUMENTS = (*_TEXT, BYTE, BYTE, PLACE, INTEGER, *_COLUMNS, *_DEFERRED, *_SHAPES)
ROWS = Kernel("readers.csv.fast_parser_kernel", "rows", _ARGUMENTS)


class FastParser:
    """Parses blocks whose rows are plain numbers throughout; made ready in a thread meanwhile."""

    def __init__(self, parser: RowParser, kept: tuple[int, ...]) -> None:
        self._parser = parser
        self._kept = np.isin(np.arange(parser.fields), kept).astype(np.uint8)
        self._loop: Callable[..., int] | None = None
        self._density = 0.0  # rows a byte in the block before
        self._decided = threading.Event()
        self._thread = threading.Thread(target=self._load, daemon=True)
        self._thread.start()

    def _load(self) -> None:
        self._loop = ROWS.loop(compiling=self._decided.set)
        self._decided.set()

    def columns(self, text: bytes) -> list[Samples] | None:
        """The columns of whole lines, NaN in fields that are not kept; None if some cell is no plain number."""
        self._decided.wait(_PATIENCE_S)
        if self._loop is None or not text.endswith(b"\n"):
            return None
        count, columns, deferred = self._rows(self._loop, text, int(_MORE * self._density * len(text)))
        if count == _FULL:
            count, columns, deferred = self._rows(self._loop, text, count_lines(text))
        if count < 0:
            return None
        self._density = count / len(text)
        columns[self._kept == 0] = np.nan
        for begin, end, field, row in deferred:
            columns[field, row] = value = float(text[begin:end].replace(b",", b"."))
            if not math.isfinite(value):
                return None
        return list(columns[:, :count])

    def _rows(
        self, loop: Callable[..., int], text: bytes, capacity: int
    ) -> tuple[int, NDArray[np.float64], NDArray[np.int64]]:
        """How many rows the loop found if there are no more than ``capacity``; the columns; what it deferred."""
        fields = self._parser.fields
        columns = np.empty((fields, capacity))
        deferred = np.empty((1 + columns.size // _FEW, 4), np.int64)
        deferred[0] = 0
        separator, mark = ord(self._parser.separator), ord(self._parser.dialect.decimal)
        decimals, stops = np.zeros(fields, np.int64), np.zeros(fields, np.uint8)
        count = loop(
            np.frombuffer(text, dtype=np.uint8).ctypes.data, len(text), separator, mark, self._kept.ctypes.data, fields,
            columns.ctypes.data, capacity, deferred.ctypes.data, len(deferred) - 1, decimals.ctypes.data,
            stops.ctypes.data,
        )  # fmt: skip
        return count, columns, deferred[1 : 1 + deferred[0, 0]]
