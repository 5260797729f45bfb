"""Arithmetic written down once and run for many samples: a tape of operations on rows of numbers.

A computation on ``Node`` in place of arrays is recorded, each operation once however often it occurs. The tape is then
run block by block, so that what it works on stays in the processor's cache: by a compiled loop where numba is
installed (the extra ``compiled``), else by NumPy.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, Union

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats

if TYPE_CHECKING:
    from ..compiled_kernels import Kernel

LANES = 64
"""Samples that the compiled loop works on at a time, as many as in ``tape_kernel``."""
_BLOCK = 2048
"""Samples that NumPy works on at a time."""
COMPILED_FROM = 2048
"""Samples of a run from which the compiled loop takes it. By the run alone: both round differently in the last digit,
and the same run gives the same bits whatever was run before."""
_LARGEST_ANGLE = 1e5
"""Up to here the compiled loop's sine and cosine are right [rad]."""


@cache
def kernel() -> "Kernel":
    """The compiled loop, as it is kept and compiled."""
    from ..compiled_kernels import INTEGER, PLACE, Kernel  # late: few samples do without it

    arguments = (PLACE, INTEGER, PLACE, PLACE, INTEGER, PLACE, PLACE, INTEGER, INTEGER)
    return Kernel("balance.mechanism.tape_kernel", "run_tape", arguments)


@cache
def compiled_loop() -> Callable[..., int] | None:
    """The compiled loop, compiled once a machine (some seconds) and kept; None where it is not to be had."""
    return kernel().loop() if find_spec("numba") else None


class Op(IntEnum):
    """Operations, as they are numbered in the compiled loop; a, b and c are operands."""

    LOAD = 0
    """Row a of the inputs."""
    STORE = 1
    """Operand a into row d of the outputs."""
    ADD = 2
    SUB = 3
    MUL = 4
    NEG = 5
    INVERSE = 6
    """1 / a"""
    PLUS_PRODUCT = 7
    """c + a b"""
    MINUS_PRODUCT = 8
    """c - a b"""
    PRODUCT_LESS = 9
    """a b - c"""
    SINCOS = 10
    """Sine of a; its cosine goes to the register that b names."""
    SIGN = 11
    LARGER = 12
    """The larger of |a| and |b|."""
    COSINE = 13
    """Of the sine before it; no operation of its own."""
    CONSTANT = 14
    """Number a of the constants."""


class Node:
    """A value of a tape, in place of an array over samples; arrays of nodes and numbers are computed with as any other.

    A number that is zero or one costs nothing: in a planar mechanism most components are zero, and its general code is
    as quick as a planar one.
    """

    __slots__ = ("index", "tape")

    def __init__(self, tape: "Tape", index: int) -> None:
        self.tape, self.index = tape, index

    def __add__(self, other: "Operand") -> "Operand":
        return NotImplemented if isinstance(other, np.ndarray) else self.tape.add(self, other)

    def __sub__(self, other: "Operand") -> "Operand":
        return NotImplemented if isinstance(other, np.ndarray) else self.tape.subtract(self, other)

    def __rsub__(self, other: "Operand") -> "Operand":
        return self.tape.subtract(other, self)

    def __mul__(self, other: "Operand") -> "Operand":
        return NotImplemented if isinstance(other, np.ndarray) else self.tape.multiply(self, other)

    def __neg__(self) -> "Operand":
        return self.tape.subtract(0.0, self)

    def __rtruediv__(self, other: "Operand") -> "Operand":
        return self.tape.multiply(self.tape.emit(Op.INVERSE, self), other)

    __radd__, __rmul__ = __add__, __mul__

    def sin(self) -> "Node":
        """Sine of an angle [rad]: what ``numpy.sin`` calls."""
        return self.tape.emit(Op.SINCOS, self)

    def cos(self) -> "Node":
        """Cosine of an angle [rad]: what ``numpy.cos`` calls."""
        return self.tape.emit(Op.COSINE, self.sin())

    def sign(self) -> "Node":
        """-1, 0 or 1."""
        return self.tape.emit(Op.SIGN, self)


Operand = Union[Node, float]  # noqa: UP007
Symbols = NDArray[np.object_]
"""Array of nodes and numbers."""


def numbers(values: Floats) -> Symbols:
    """Numbers (...,) in SI, to be computed with together with nodes."""
    return values.astype(object)


def cross(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    """Vector product of vectors (3,), of nodes or numbers in SI; or of numbers (n, 3)."""
    (x, y, z), (u, v, w) = a.T, b.T
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u], dtype=np.result_type(a, b)).T


def largest(values: Iterable[Operand]) -> Operand:
    """The largest absolute value, sample by sample."""
    found: Operand = 0.0
    for value in values:
        node = next((one for one in (found, value) if isinstance(one, Node)), None)
        found = max(abs(found), abs(value)) if node is None else node.tape.emit(Op.LARGER, found, value)  # type: ignore[arg-type]
    return found


class Tape:
    """Operations in the order in which they were asked for, none of them twice."""

    def __init__(self) -> None:
        self.operations: list[tuple[int, int, int]] = []
        self.constants: list[float] = []
        self._places: dict[float, int] = {}
        self.parameter_count = 0
        self.inputs = 0
        self._known: dict[tuple[int, int, int], int] = {}

    def rows(self, count: int) -> Symbols:
        """The next ``count`` rows of the inputs, (count,)."""
        self.inputs += count
        return np.array([self._node(Op.LOAD, k) for k in range(self.inputs - count, self.inputs)], dtype=object)

    def parameters(self, values: Floats) -> Symbols:
        """Numbers (...,) [SI] that each run gives anew; those that are zero here are so in all."""
        first, self.parameter_count = self.parameter_count, self.parameter_count + values.size
        found = [self._node(Op.CONSTANT, -1 - first - k) if x else 0.0 for k, x in enumerate(values.ravel())]
        return np.array(found, dtype=object).reshape(values.shape)

    def _node(self, op: int, a: int, b: int = -1) -> Node:
        key = (op, a, b)
        index = self._known.get(key)
        if index is None:
            index = self._known[key] = len(self.operations)
            self.operations.append(key)
        return Node(self, index)

    def emit(self, op: Op, a: Operand, b: Operand | None = None) -> Node:
        """The value of an operation."""
        return self._node(op, self._index(a), -1 if b is None else self._index(b))

    def _index(self, operand: Operand) -> int:
        if isinstance(operand, Node):
            return operand.index
        value = float(operand) + 0.0  # a zero without a sign
        if value not in self._places:
            self._places[value] = len(self.constants)
            self.constants.append(value)
        return self._node(Op.CONSTANT, self._places[value]).index

    def _negated(self, operand: Operand) -> Node | None:
        """What an operand is the negative of, if it was written as one."""
        if isinstance(operand, Node) and self.operations[operand.index][0] == Op.NEG:
            return Node(self, self.operations[operand.index][1])
        return None

    def add(self, a: Operand, b: Operand) -> Operand:
        """a + b, at least one of them a node."""
        if not isinstance(a, Node):
            a, b = b, a
        if not isinstance(b, Node) and b == 0.0:
            return a
        if (plain := self._negated(b)) is not None:
            return self.subtract(a, plain)
        if (plain := self._negated(a)) is not None:
            return self.subtract(b, plain)
        return self._node(Op.ADD, *sorted((self._index(a), self._index(b))))

    def subtract(self, a: Operand, b: Operand) -> Operand:
        """a - b, at least one of them a node."""
        if not isinstance(b, Node) and b == 0.0:
            return a
        if (plain := self._negated(b)) is not None:
            return self.add(a, plain)
        if not isinstance(a, Node) and a == 0.0:
            return self._node(Op.NEG, self._index(b))
        return self._node(Op.SUB, self._index(a), self._index(b))

    def multiply(self, a: Operand, b: Operand) -> Operand:
        """a b, at least one of them a node."""
        if not isinstance(a, Node):
            a, b = b, a
        if not isinstance(b, Node) and b in (0.0, 1.0, -1.0):
            return 0.0 if b == 0.0 else a if b == 1.0 else self.subtract(0.0, a)
        for one, other in ((a, b), (b, a)):
            if (plain := self._negated(one)) is not None:
                return self.subtract(0.0, self.multiply(plain, other))
        return self._node(Op.MUL, *sorted((self._index(a), self._index(b))))

    def program(self, outputs: Iterable[Operand]) -> "Program":
        """What computes ``outputs``, a row each."""
        return _Assembler(self, [self._index(value) for value in outputs]).program()


@dataclass(frozen=True)
class Program:
    """A tape made ready to run: operations on registers, each a row of samples."""

    code: "np.ndarray[tuple[int, int], np.dtype[np.int32]]"
    """An operation a row: its number, where its value goes, operands a, b, c."""
    registers: int
    """How many there are; the first hold the constants."""
    constants: Floats
    """Numbers of the computation; NaN where a run's parameter belongs."""
    parameters: dict[int, int]
    """Which constant is which parameter of a run."""
    outputs: int
    """Number of rows that it computes."""

    def values(self, *inputs: Floats, parameters: Floats | None = None) -> Floats:
        """What :meth:`run` computes, (rows, n) [SI], from ``inputs`` (rows, n) [SI] and in their precision."""
        found = np.empty((self.outputs, inputs[0].shape[1]), dtype=inputs[0].dtype)
        self.run(inputs, [found], parameters)
        return found

    def run(self, inputs: Sequence[Floats], outputs: Sequence[Floats], parameters: Floats | None = None) -> None:
        """Compute ``outputs`` from ``inputs``, arrays (rows, n) [SI] whose rows are stacked in the order of the trace.

        ``parameters`` (k,) [SI] are those of this run.
        """
        values = self.constants.copy()
        for constant, parameter in self.parameters.items():
            assert parameters is not None
            values[constant] = parameters[parameter]
        read = [row for block in inputs for row in block]
        write = [row for block in outputs for row in block]
        count = len(read[0])
        loop = compiled_loop() if count >= COMPILED_FROM and read[0].dtype == float else None
        if loop is not None and max(np.abs(x).max() for x in inputs) < _LARGEST_ANGLE:
            self._run_compiled(loop, values, read, write)
            return
        for begin in range(0, count, _BLOCK):
            part = slice(begin, min(begin + _BLOCK, count))
            self._run_block(values, [row[part] for row in read], [row[part] for row in write])

    def _run_compiled(self, loop: Callable[..., int], values: Floats, read: list[Floats], write: list[Floats]) -> None:
        """Rows are handed over as distances in memory from the first of them."""
        rows = [row if row.strides == (8,) else np.ascontiguousarray(row) for row in read]
        places = np.array([row.ctypes.data for row in (*rows, *write)], dtype=np.int64)
        assert all(row.strides == (8,) for row in write)
        first = int(places.min())
        offsets = (places - first) // 8
        space = np.ones((self.registers + 1) * LANES)
        loop(
            self.code.ctypes.data, len(self.code), space.ctypes.data, values.ctypes.data, len(values),
            first, offsets.ctypes.data, len(rows), len(read[0]),
        )  # fmt: skip

    def _run_block(self, values: Floats, read: list[Floats], write: list[Floats]) -> None:
        count = len(read[0])
        space = np.empty((self.registers - len(values) + 1, count), dtype=read[0].dtype)
        spare = space[-1]
        cells: list[Floats] = [*values, *space]
        for op, d, a, b, c in self.code.tolist():
            if op == Op.LOAD:
                cells[d] = read[a]
            elif op == Op.STORE:
                write[d][...] = cells[a]
            else:
                out = cells[d] = space[d - len(values)]
                if op == Op.SINCOS:
                    cells[b] = space[b - len(values)]
                    np.cos(cells[a], out=cells[b])
                _NUMPY[op](cells[a], cells[b], cells[c], out, spare)


_NUMPY: dict[int, Callable[[Floats, Floats, Floats, Floats, Floats], Floats]] = {
    Op.ADD: lambda a, b, c, out, spare: np.add(a, b, out=out),
    Op.SUB: lambda a, b, c, out, spare: np.subtract(a, b, out=out),
    Op.MUL: lambda a, b, c, out, spare: np.multiply(a, b, out=out),
    Op.NEG: lambda a, b, c, out, spare: np.negative(a, out=out),
    Op.INVERSE: lambda a, b, c, out, spare: np.divide(1.0, a, out=out),
    Op.SINCOS: lambda a, b, c, out, spare: np.sin(a, out=out),
    Op.SIGN: lambda a, b, c, out, spare: np.sign(a, out=out),
    Op.LARGER: lambda a, b, c, out, spare: np.maximum(np.abs(a), np.abs(b), out=out),
    Op.PLUS_PRODUCT: lambda a, b, c, out, spare: np.add(np.multiply(a, b, out=spare), c, out=out),
    Op.MINUS_PRODUCT: lambda a, b, c, out, spare: np.subtract(c, np.multiply(a, b, out=spare), out=out),
    Op.PRODUCT_LESS: lambda a, b, c, out, spare: np.subtract(np.multiply(a, b, out=spare), c, out=out),
}
"""Operations of a block of samples; ``spare`` is a row for what is between."""


class _Assembler:
    """From a tape to a program: what is needed, products joined with sums, registers used again."""

    def __init__(self, tape: Tape, outputs: list[int]) -> None:
        self.tape, self.outputs = tape, outputs
        self.steps: dict[int, tuple[int, int, int, int]] = {}
        self.uses = [0] * len(tape.operations)
        self._find_needed()
        self._join_products()

    def _find_needed(self) -> None:
        for index in self.outputs:
            self.uses[index] += 1
        for index in reversed(range(len(self.tape.operations))):
            op, a, b = self.tape.operations[index]
            if self.uses[index]:
                self.steps[index] = (op, a, b, -1)
                if op not in (Op.LOAD, Op.CONSTANT):
                    self.uses[a] += 1
                    self.uses[b] += b >= 0

    def _join_products(self) -> None:
        """A product that is used once, in a sum, becomes part of it."""
        for index in sorted(self.steps):
            op, a, b, _ = self.steps[index]
            if op not in (Op.ADD, Op.SUB):
                continue
            for product, other, joined in (
                (b, a, Op.PLUS_PRODUCT if op == Op.ADD else Op.MINUS_PRODUCT),
                (a, b, Op.PLUS_PRODUCT if op == Op.ADD else Op.PRODUCT_LESS),
            ):
                if self.uses[product] == 1 and self.steps[product][0] == Op.MUL:
                    self.steps[index] = (joined, *self.steps[product][1:3], other)
                    del self.steps[product]
                    break

    def program(self) -> Program:
        """Registers by linear scan: one is free again after the last use of what it holds."""
        order = sorted(self.steps)
        constants = [i for i in order if self.steps[i][0] == Op.CONSTANT]
        register = {index: k for k, index in enumerate(constants)}
        free: list[int] = []
        size, left = len(constants), dict.fromkeys(order, 0)
        stored: dict[int, list[int]] = {}
        for row, index in enumerate(self.outputs):
            stored.setdefault(index, []).append(row)
        for index in order:
            for operand in self._operands(index):
                left[operand] += 1
        code: list[tuple[int, int, int, int, int]] = []

        def take(index: int) -> int:
            nonlocal size
            if not free:
                free.append(size)
                size += 1
            register[index] = free.pop()
            return register[index]

        for index in order:
            op, a, b, c = self.steps[index]
            if op == Op.CONSTANT:
                pass
            elif op == Op.LOAD:
                continue  # where it is used first
            elif op != Op.COSINE:
                for operand in self._operands(index):
                    if operand not in register:
                        code.append((Op.LOAD, take(operand), self.steps[operand][1], 0, 0))
                target = take(index)
                if op == Op.SINCOS:
                    cosine = next((k for k in self._cosines(index)), -1 - index)
                    code.append((op, target, register[a], take(cosine), 0))
                    if cosine < 0:
                        free.append(register[cosine])
                else:
                    first, second, third = (register[k] if k >= 0 else 0 for k in (a, b, c))
                    code.append((op, target, first, second, third))
            for row in stored.get(index, []):
                code.append((Op.STORE, row, register[index], 0, 0))
            for operand in (*self._operands(index), index):
                if operand != index:
                    left[operand] -= 1
                if not left[operand] and operand in register and register[operand] >= len(constants):
                    free.append(register.pop(operand))
        for index in order:  # inputs that are outputs too
            if self.steps[index][0] == Op.LOAD and stored.get(index):
                code.append((Op.LOAD, size, self.steps[index][1], 0, 0))
                code.extend((Op.STORE, row, size, 0, 0) for row in stored[index])
        numbers = [self.steps[index][1] for index in constants]
        values = [np.nan if k < 0 else self.tape.constants[k] for k in numbers]
        parameters = {place: -1 - k for place, k in enumerate(numbers) if k < 0}
        return Program(np.array(code, dtype=np.int32), size + 1, np.array(values), parameters, len(self.outputs))

    def _operands(self, index: int) -> tuple[int, ...]:
        op, *operands = self.steps[index]
        if op in (Op.LOAD, Op.CONSTANT):
            return ()
        return tuple(dict.fromkeys(k for k in operands if k >= 0))

    def _cosines(self, sine: int) -> list[int]:
        key = (int(Op.COSINE), sine, -1)
        index = self.tape._known.get(key)
        return [index] if index in self.steps else []
