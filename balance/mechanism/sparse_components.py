"""Vectors over many samples by component, where a component that is constant zero or one costs nothing.

In a planar mechanism most components are zero: skipping them makes the general code as quick as a planar one. The same
code computes with arrays, and writes a tape (see :mod:`.tape`) when it is given nodes of one.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..arrays import Floats
from .tape import Node, Op

Entry = Any
"""One component: an array over samples (n,), a node of a tape, or a constant (float)."""
Entries = Floats | Sequence[Entry]
"""Several of them, such as the joint positions."""
Vector = tuple[Entry, Entry, Entry]
"""Three components, base axes unless stated otherwise."""
Matrix = tuple[Vector, Vector, Vector]
"""Three columns."""

Rows = list[list[Entry]]
"""A matrix of any size, row by row."""

ZERO: Vector = (0.0, 0.0, 0.0)
IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def vector(values: Floats) -> Vector:
    """Components of a constant vector (3,) in SI."""
    x, y, z = (float(value) for value in values)
    return x, y, z


def matrix(values: Floats) -> Matrix:
    """Columns of a constant matrix (3, 3) in SI."""
    return vector(values[:, 0]), vector(values[:, 1]), vector(values[:, 2])


def mul(a: Entry, b: Entry) -> Entry:
    """Product of two components."""
    if isinstance(a, float):
        if a == 0.0:
            return 0.0
        if a == 1.0:
            return b
    if isinstance(b, float):
        if b == 0.0:
            return 0.0
        if b == 1.0:
            return a
    return a * b


def add(a: Entry, b: Entry) -> Entry:
    """Sum of two components."""
    if isinstance(a, float) and a == 0.0:
        return b
    if isinstance(b, float) and b == 0.0:
        return a
    return a + b


def sub(a: Entry, b: Entry) -> Entry:
    """Difference of two components."""
    if isinstance(b, float) and b == 0.0:
        return a
    if isinstance(a, float) and a == 0.0:
        return -b
    return a - b


def plus(a: Vector, b: Vector) -> Vector:
    """Sum of two vectors."""
    return add(a[0], b[0]), add(a[1], b[1]), add(a[2], b[2])


def minus(a: Vector, b: Vector) -> Vector:
    """Difference of two vectors."""
    return sub(a[0], b[0]), sub(a[1], b[1]), sub(a[2], b[2])


def scale(factor: Entry, a: Vector) -> Vector:
    """A vector times a number a sample."""
    return mul(factor, a[0]), mul(factor, a[1]), mul(factor, a[2])


def dot(a: Vector, b: Vector) -> Entry:
    """Scalar product of two vectors."""
    return add(add(mul(a[0], b[0]), mul(a[1], b[1])), mul(a[2], b[2]))


def cross(a: Vector, b: Vector) -> Vector:
    """Vector product of two vectors."""
    return (
        sub(mul(a[1], b[2]), mul(a[2], b[1])),
        sub(mul(a[2], b[0]), mul(a[0], b[2])),
        sub(mul(a[0], b[1]), mul(a[1], b[0])),
    )


def apply(m: Matrix, a: Vector) -> Vector:
    """Matrix times vector: columns times components."""
    return plus(plus(scale(a[0], m[0]), scale(a[1], m[1])), scale(a[2], m[2]))


def apply_transposed(m: Matrix, a: Vector) -> Vector:
    """Transposed matrix times vector."""
    return dot(m[0], a), dot(m[1], a), dot(m[2], a)


def product(m: Matrix, other: Matrix) -> Matrix:
    """Product of two matrices."""
    return apply(m, other[0]), apply(m, other[1]), apply(m, other[2])


def fill(out: Floats, a: Vector) -> Floats:
    """Write a vector into the array ``out`` (3, n), in SI as the vector, and return it."""
    for row, entry in zip(out, a, strict=True):
        row[...] = entry
    return out


def dense(a: Vector, count: int) -> Floats:
    """A vector at ``count`` samples as an array (3, n), in SI as the vector."""
    return fill(np.empty((3, count)), a)


def zeros(rows: int, columns: int) -> Rows:
    """A matrix of zeros."""
    return [[0.0] * columns for _ in range(rows)]


def sincos(angle: Entry) -> tuple[Entry, Entry]:
    """Sine and cosine of an angle [rad]."""
    return angle.tape.sincos(angle) if isinstance(angle, Node) else (np.sin(angle), np.cos(angle))


def sign(a: Entry) -> Entry:
    """-1, 0 or 1."""
    return a.tape.emit(Op.SIGN, a) if isinstance(a, Node) else np.sign(a)


def largest(values: Entries) -> Entry:
    """The largest absolute value, sample by sample."""
    found: Entry = 0.0
    for value in values:
        if isinstance(value, Node) or isinstance(found, Node):
            tape = value.tape if isinstance(value, Node) else found.tape
            found = tape.emit(Op.LARGER, found, value)
        else:
            found = np.maximum(found, np.abs(value))
    return found


def dense_columns(values: Entries, count: int) -> Floats:
    """A vector of any length at ``count`` samples as an array (rows, n), in SI."""
    out = np.empty((len(values), count))
    for row, value in zip(out, values, strict=True):
        row[...] = value
    return out


def dense_rows(rows: Rows, columns: int, count: int) -> Floats:
    """A matrix at ``count`` samples as an array (rows, columns, n), in SI as the matrix."""
    out = np.empty((len(rows), columns, count))
    for i, row in enumerate(rows):
        for j, entry in enumerate(row):
            out[i, j] = entry
    return out
