"""Lengths as linear expressions of named lengths, so that results can be written in symbols and perturbed."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal

import numpy as np

from ..arrays import Floats
from ..errors import DataError, UnitError
from ..units import parse

_NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_TERM = re.compile(rf"\s*([+-])?\s*({_NUMBER})?\s*\*?\s*([^\W\d][\w]*)?\s*(?:/\s*({_NUMBER}))?\s*")
_ROUNDING = 1e-15
"""A coefficient this small is the cosine of a right angle."""


@dataclass(frozen=True)
class Symbol:
    """A number of the description by name, such as L2, m2 or I2, with the rounding of its last digit."""

    value: float
    """In SI [m, kg, kg m2]."""
    half_unit: float
    """Half a unit of the last digit as written: the number means value +- half_unit."""


@dataclass(frozen=True)
class Expression:
    """A sum of named lengths times numbers, plus a constant [m]."""

    terms: tuple[tuple[str, float], ...] = ()
    constant: float = 0.0

    def at(self, values: Mapping[str, float]) -> float:
        """Its value with the named lengths at ``values`` [m]."""
        return self.constant + sum(factor * values[name] for name, factor in self.terms)

    def plus(self, other: "Expression", factor: float = 1.0) -> "Expression":
        """This plus ``factor`` times another."""
        sums = dict(self.terms)
        for name, value in other.terms:
            sums[name] = sums.get(name, 0.0) + factor * value
        kept = tuple((name, value) for name, value in sums.items() if abs(value) > _ROUNDING)
        constant = self.constant + factor * other.constant
        return Expression(kept, constant if abs(constant) > _ROUNDING else 0.0)

    def times(self, factor: float) -> "Expression":
        """This times a number."""
        return Expression().plus(self, factor)

    @property
    def is_zero(self) -> bool:
        """Whether it is zero whatever the named lengths are."""
        return not self.terms and self.constant == 0.0

    def text(self) -> str:
        """In symbols: ``L2/2``, ``L2 + L7``, ``-R2``, ``0.045 m``."""
        parts = [_term_text(name, factor) for name, factor in self.terms]
        if self.constant or not parts:
            parts.append(f"{self.constant:.6g} m")
        return " + ".join(parts).replace("+ -", "- ")

    def factor_text(self) -> str:
        """In symbols, to be multiplied: a sum or a negative is in brackets."""
        text = self.text()
        return f"({text})" if " " in text or text.startswith("-") else text

    def power_text(self) -> str:
        """In symbols, to be squared: without its sign."""
        leading = self.terms[0][1] if self.terms else self.constant
        text = (self.times(-1.0) if leading < 0 else self).text()
        return text if text.isalnum() else f"({text})"


ZERO = Expression()


@dataclass(frozen=True)
class Point:
    """A point of the plane x-y."""

    x: Expression = ZERO
    y: Expression = ZERO

    def plus(self, other: "Point", factor: float = 1.0) -> "Point":
        """This plus ``factor`` times another."""
        return Point(self.x.plus(other.x, factor), self.y.plus(other.y, factor))

    def turned(self, angle: float) -> "Point":
        """Turned about the origin by ``angle`` [rad]."""
        c, s = float(np.cos(angle)), float(np.sin(angle))
        return Point(self.x.times(c).plus(self.y, -s), self.x.times(s).plus(self.y, c))

    def at(self, values: Mapping[str, float]) -> Floats:
        """Its coordinates, (2,) [m]."""
        return np.array([self.x.at(values), self.y.at(values)])

    def squared_text(self) -> str:
        """Its squared distance from the origin in symbols."""
        parts = [f"{e.power_text()}^2" for e in (self.x, self.y) if not e.is_zero]
        return parts[0] if len(parts) == 1 else f"[{' + '.join(parts)}]"

    @property
    def is_zero(self) -> bool:
        """Whether it is the origin whatever the named lengths are."""
        return self.x.is_zero and self.y.is_zero


ORIGIN = Point()


def read_length(text: str, lengths: Mapping[str, Symbol]) -> Expression:
    """Read ``L2/2 + 10 mm``: lengths by name or with a unit. Raises UnitError for anything else."""
    found, position = Expression(), 0
    while position < len(text) or not text:
        match = _TERM.match(text, position)
        if match is None or match.end() == position or (position and not match[1]):
            raise UnitError(f"{text!r} is not a length: expected for example 'L2/2 + 10 mm'")
        found = found.plus(_term(match, text, lengths))
        position = match.end()
    return found


def _term(match: re.Match[str], text: str, lengths: Mapping[str, Symbol]) -> Expression:
    sign = -1.0 if match[1] == "-" else 1.0
    if match[4] is not None and not float(match[4]):
        raise UnitError(f"{text!r} divides by zero")
    factor = sign / float(match[4] or 1.0)
    if match[3] in lengths:
        return Expression(((match[3], factor * float(match[2] or 1.0)),))
    if match[2] is None:
        known = ", ".join(lengths) or "none"
        raise UnitError(f"{text!r}: {match[3] or match[0]!r} is not a named length (there are: {known})")
    return Expression((), factor * parse(f"{match[2]} {match[3] or ''}", "length"))


def symbol(text: str, dimension: str) -> Symbol:
    """A quantity as written, with half a unit of its last digit."""
    value = parse(text, dimension)
    digits = re.match(rf"\s*[+-]?({_NUMBER})", text)
    if digits is None:
        raise DataError(f"{text!r} is not a {dimension}")
    number = Decimal(digits[1])
    if not number:
        return Symbol(value, 0.0)
    scale = abs(value) / float(number)
    return Symbol(value, 0.5 * scale * 10.0 ** int(number.as_tuple().exponent))


def _term_text(name: str, factor: float) -> str:
    sign, size = ("-" if factor < 0 else ""), abs(factor)
    if abs(size - 1.0) < _ROUNDING:
        return f"{sign}{name}"
    if size < 1.0 and abs(round(1.0 / size) * size - 1.0) < 1e-12:
        return f"{sign}{name}/{round(1.0 / size)}"
    return f"{sign}{size:.4g} {name}"
