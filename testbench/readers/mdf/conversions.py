"""Conversions from raw numbers to physical values: the laws of MDF 3 and 4.

Formulas are text of the file: parsed to arithmetic of the raw number, and never evaluated as code.
"""

import ast
import operator
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ...recording import Samples

Conversion = Callable[[Samples], Samples]
"""Physical values (n,) [unit of the channel] of raw numbers (n,) [-]."""

_OPERATORS: dict[type, Callable[..., Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.Pow: operator.pow, ast.Mod: operator.mod, ast.USub: operator.neg, ast.UAdd: operator.pos,
}  # fmt: skip
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "sin": np.sin, "cos": np.cos, "tan": np.tan, "asin": np.arcsin, "acos": np.arccos, "atan": np.arctan,
    "arcsin": np.arcsin, "arccos": np.arccos, "arctan": np.arctan, "sinh": np.sinh, "cosh": np.cosh, "tanh": np.tanh,
    "exp": np.exp, "log": np.log, "ln": np.log, "log10": np.log10, "sqrt": np.sqrt, "abs": np.abs,
}  # fmt: skip
_LONGEST_FORMULA = 1000


def linear(offset: float, factor: float) -> Conversion | None:
    """y = factor * x + offset."""
    if (offset, factor) == (0.0, 1.0):
        return None
    return lambda x: x * factor + offset if offset else x * factor


def rational(p: Sequence[float]) -> Conversion:
    """y = (p0 x^2 + p1 x + p2) / (p3 x^2 + p4 x + p5)."""
    return lambda x: (p[0] * x**2 + p[1] * x + p[2]) / (p[3] * x**2 + p[4] * x + p[5])


def polynomial(p: Sequence[float]) -> Conversion:
    """y = (p1 - p3 (x - p4 - p5)) / (p2 (x - p4 - p5) - p0), numbered from 0, of version 3."""
    return lambda x: (p[1] - p[3] * (x - p[4] - p[5])) / (p[2] * (x - p[4] - p[5]) - p[0])


def logarithmic(p: Sequence[float], inner: Any) -> Conversion:  # noqa: ANN401
    """The exponential and logarithmic laws of version 3: ``inner`` is the logarithm or the exponential."""
    if p[3] == 0:
        return lambda x: inner(((x - p[6]) * p[5] - p[2]) / p[0]) / p[1]
    return lambda x: inner((p[2] / (x - p[6]) - p[5]) / p[3]) / p[4]


def table(raw: Sequence[float], physical: Sequence[float], interpolate: bool) -> Conversion:
    """Values between pairs: on the line between them, or of the nearest pair, the lower one half-way."""
    order = np.argsort(raw, kind="stable")
    x0, y0 = np.asarray(raw, dtype=np.float64)[order], np.asarray(physical, dtype=np.float64)[order]
    if interpolate:
        return lambda x: np.asarray(np.interp(x, x0, y0), dtype=np.float64)
    middle = (x0[1:] + x0[:-1]) / 2
    return lambda x: np.asarray(y0[np.searchsorted(middle, x, side="left")], dtype=np.float64)


def ranges(
    lower: Sequence[float], upper: Sequence[float], physical: Sequence[float], otherwise: float, ends_belong: bool
) -> Conversion:
    """The value of the first range that holds the number; the upper end belongs to it for integers only."""

    def conversion(x: Samples) -> Samples:
        y = np.full(len(x), otherwise)
        for low, high, value in reversed(list(zip(lower, upper, physical, strict=True))):
            y[(x >= low) & ((x <= high) if ends_belong else (x < high) | (x == low))] = value
        return y

    return conversion


def formula(text: str) -> Conversion:
    """A formula of X with the four operations, powers and the usual functions; ValueError for anything else."""
    if len(text) > _LONGEST_FORMULA:
        raise ValueError(f"a formula of {len(text)} letters")
    try:
        tree = ast.parse(text.strip().replace("^", "**"), mode="eval").body
    except (SyntaxError, RecursionError, MemoryError) as error:
        raise ValueError(f"{text!r} is no formula") from error
    _value(tree, np.ones(1))
    return lambda x: np.asarray(np.broadcast_to(_value(tree, x), x.shape), dtype=np.float64)


def _value(node: ast.expr, x: Samples) -> Any:  # noqa: ANN401
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        return float(node.value)
    if isinstance(node, ast.Name) and node.id.upper() in ("X", "X1"):
        return x
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        return _OPERATORS[type(node.op)](_value(node.left, x), _value(node.right, x))
    if isinstance(node, ast.UnaryOp) and type(node.op) in _OPERATORS:
        return _OPERATORS[type(node.op)](_value(node.operand, x))
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        function = _FUNCTIONS.get(node.func.id.lower())
        if function is not None and len(node.args) == 1:
            return function(_value(node.args[0], x))
        if node.func.id.lower() == "pow" and len(node.args) == 2:
            return _value(node.args[0], x) ** _value(node.args[1], x)
    raise ValueError(f"{ast.unparse(node)!r} is none of the operations that are known")
