"""The rank of an open chain's momentum in exact arithmetic: rational configurations, modulo a prime.

A joint turned by the quaternion (1, t k) has a rational rotation for any rational t and axis k, so that momenta of an
open chain with rational dimensions are rational. Modulo a prime no rank rises, so that what is found is a proven lower
bound; it is less than the rank in all motions with a probability below 1e-5 (Schwartz 1980, Zippel 1979). Loops have
no rational configurations in general: there is none of this for them.
"""

from dataclasses import replace
from fractions import Fraction
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..arrays import Floats
from ..dynamics.inverse_dynamics import body_momentum
from ..mechanism.forward_kinematics import Tree, motion, pose, rotated
from ..mechanism.mechanism import PARAMETERS
from ..mechanism.tape import Symbols, numbers

_PRIME = 2**31 - 1
"""Products of two residues fit 64 bits."""
_DIGITS = 15
"""To which numbers are read as decimals: what a double holds of each decimal of so many digits."""


class Residue:
    """A residue modulo the prime, or those of n states, in place of a number; beside it floats are whole numbers."""

    def __init__(self, values: Any) -> None:  # noqa: ANN401
        self.values = values % _PRIME

    def __add__(self, other: Any) -> "Residue":  # noqa: ANN401
        return NotImplemented if isinstance(other, np.ndarray) else Residue(self.values + _values(other))

    def __mul__(self, other: Any) -> "Residue":  # noqa: ANN401
        return NotImplemented if isinstance(other, np.ndarray) else Residue(self.values * _values(other))

    def __neg__(self) -> "Residue":
        return Residue(-self.values)

    def __sub__(self, other: Any) -> "Residue":  # noqa: ANN401
        return NotImplemented if isinstance(other, np.ndarray) else Residue(self.values - _values(other))

    def __rsub__(self, other: float) -> "Residue":
        return -self + other

    __radd__, __rmul__ = __add__, __mul__


def _values(number: Residue | float) -> Any:  # noqa: ANN401
    return number.values if isinstance(number, Residue) else int(number)


def _residues(values: Floats) -> Symbols:
    """Numbers (n,) as decimals, modulo the prime, (n,) [their unit]."""
    decimals = [Fraction(f"{value:.{_DIGITS}g}") for value in values.tolist()]
    found = [Residue(one.numerator * pow(one.denominator, -1, _PRIME)) for one in decimals]
    return np.array(found, dtype=object)


def _angle(w: Residue, u: Residue, axis: Symbols) -> SimpleNamespace:
    """Sine s and cosine c with which a quaternion (w, u axis) of any length turns by 1 + s K + (1 - c) K K.

    K is the cross product with the axis, which may have any length too.
    """
    length = np.atleast_1d((w * w + u * u * (axis @ axis)).values)
    share = u * Residue(np.array([2 * pow(int(one), -1, _PRIME) for one in length], dtype=np.int64))
    return SimpleNamespace(sin=lambda: w * share, cos=lambda: 1.0 - u * share)


def rational_rank(tree: Tree, rows: list[int]) -> int:
    """Rank of the ``rows`` of the momenta (linear, angular about the base's origin) of an open chain in all motions.

    Its dimensions are taken as decimals of 15 digits, and its fixed rotations by the quaternion so rounded.
    """
    from scipy.spatial.transform import Rotation

    columns = len(PARAMETERS) * len(tree.bodies)
    count = columns + 4  # a state may add one alone: its forces are seldom new where those of others are known
    turn, rate = np.random.default_rng(0).integers(1, _PRIME, (2, tree.size, count))
    joints, q, one = [], list[Any](), Residue(1)
    for joint, t in zip(tree.joints, turn, strict=True):
        w, *fixed = _residues(Rotation.from_matrix(joint.rotation).as_quat(scalar_first=True))
        about, axis = np.array(fixed, dtype=object), _residues(joint.axis)
        frame = rotated(numbers(np.eye(3)), about, _angle(w, one, about))
        joints.append(replace(joint, rotation=frame, position=_residues(joint.position), axis=axis))
        q.append(_angle(one, Residue(t), axis) if joint.revolute else Residue(t))
    exact = Tree(tuple(joints), tree.bodies)
    at = pose(exact, np.array(q, dtype=object))
    moving = motion(exact, at, np.array([Residue(v) for v in rate], dtype=object))
    units = [(row, joint) for joint in tree.bodies for row in numbers(np.eye(len(PARAMETERS)))]
    momenta = [body_momentum(row, at, moving, joint)[rows] for row, joint in units]
    whole = np.array([[np.broadcast_to(_values(part), count) for part in momentum] for momentum in momenta])
    return _rank(whole.transpose(2, 1, 0).reshape(-1, columns))


def _rank(matrix: np.ndarray[tuple[int, ...], np.dtype[np.int64]]) -> int:
    """Rank of a matrix modulo the prime, by elimination."""
    rest, rank = matrix.copy(), 0
    for column in range(rest.shape[1]):
        below = np.flatnonzero(rest[rank:, column]) + rank
        if not len(below):
            continue
        rest[[rank, below[0]]] = rest[[below[0], rank]]
        pivot = rest[rank, column:] * pow(int(rest[rank, column]), -1, _PRIME) % _PRIME
        others = np.flatnonzero(rest[rank + 1 :, column]) + rank + 1
        rest[others, column:] = (rest[others, column:] - rest[others, column, None] * pivot) % _PRIME
        rank += 1
    return rank
