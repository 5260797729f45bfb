"""The rank of an open chain's momentum in exact arithmetic: rational configurations, modulo a prime.

A joint turned by the quaternion (1, t k) has a rational rotation for any rational t and axis k, so that momenta of an
open chain with rational dimensions are rational. Modulo a prime no rank rises, so that what is found is a proven lower
bound; it is less than the rank in all motions with a probability below 1e-5 (Schwartz 1980, Zippel 1979). Loops have
no rational configurations in general: there is none of this for them.
"""

from fractions import Fraction

import numpy as np

from ..mechanism.forward_kinematics import Tree
from ..mechanism.mechanism import PARAMETERS

_PRIME = 2**31 - 1
"""Products of two residues fit 64 bits."""
_DIGITS = 15
"""To which numbers are read as decimals: what a double holds of each decimal of so many digits."""
_INERTIAS = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))

Residues = np.ndarray[tuple[int, ...], np.dtype[np.int64]]


def _residues(values: object) -> Residues:
    """Numbers as decimals, modulo the prime, in the same shape."""
    given = np.asarray(values, dtype=float)
    decimals = [Fraction(f"{value:.{_DIGITS}g}") for value in given.ravel().tolist()]
    found = [one.numerator * pow(one.denominator, -1, _PRIME) % _PRIME for one in decimals]
    return np.array(found, dtype=np.int64).reshape(given.shape)


def _product(a: Residues, b: Residues) -> Residues:
    """Matrix product of residues (..., m, k) and (..., k, l): a term at a time, so that no sum overflows."""
    total = np.zeros((*np.broadcast_shapes(a.shape[:-2], b.shape[:-2]), a.shape[-2], b.shape[-1]), dtype=np.int64)
    for k in range(a.shape[-1]):
        total = (total + a[..., :, k, None] * b[..., None, k, :]) % _PRIME
    return total


def _cross(vector: Residues) -> Residues:
    """Matrices (..., 3, 3) of the cross product with vectors (..., 3)."""
    x, y, z = np.moveaxis(vector, -1, 0)
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2) % _PRIME


def _rotation(quaternion: Residues) -> Residues:
    """Rotations (..., 3, 3) by quaternions (..., 4) of any length, scalar first."""
    k = _cross(quaternion[..., 1:])
    norm = (quaternion * quaternion % _PRIME).sum(axis=-1) % _PRIME
    inverse = np.array([pow(int(one), -1, _PRIME) for one in norm.ravel()], dtype=np.int64).reshape(norm.shape)
    twice = 2 * (quaternion[..., 0, None, None] * k % _PRIME + _product(k, k)) % _PRIME
    return (np.eye(3, dtype=np.int64) + twice * inverse[..., None, None]) % _PRIME


def rational_rank(tree: Tree, rows: list[int]) -> int:
    """Rank of the ``rows`` of the momenta (linear, angular about the base's origin) of an open chain in all motions.

    Its dimensions are taken as decimals of 15 digits, and its fixed rotations by the quaternion so rounded.
    """
    from scipy.spatial.transform import Rotation

    columns = len(PARAMETERS) * len(tree.bodies)
    count = columns + 4  # a state may add one alone: its forces are seldom new where those of others are known
    rng = np.random.default_rng(0)
    turn, rate = rng.integers(1, _PRIME, (2, tree.size, count))
    places: list[tuple[Residues, ...]] = []
    still = (np.tile(np.eye(3, dtype=np.int64), (count, 1, 1)), *np.zeros((3, count, 3), dtype=np.int64))
    for joint, t, v in zip(tree.joints, turn, rate, strict=True):
        frame, origin, omega, velocity = places[joint.parent] if joint.parent >= 0 else still
        quaternion = Rotation.from_matrix(joint.rotation).as_quat(scalar_first=True)
        arm = _product(frame, _residues(joint.position)[:, None])[..., 0]
        velocity = (velocity + _product(_cross(omega), arm[..., None])[..., 0]) % _PRIME
        origin = (origin + arm) % _PRIME
        frame = _product(frame, _rotation(_residues(quaternion)))
        axis = _residues(joint.axis)
        along = _product(frame, axis[:, None])[..., 0]
        if joint.revolute:
            turned = np.concatenate([np.ones((count, 1), dtype=np.int64), t[:, None] * axis % _PRIME], axis=-1)
            frame = _product(frame, _rotation(turned))
            omega = (omega + v[:, None] * along) % _PRIME
        else:
            step = t[:, None] * along % _PRIME
            origin = (origin + step) % _PRIME
            velocity = (velocity + v[:, None] * along + _product(_cross(omega), step[..., None])[..., 0]) % _PRIME
        places.append((frame, origin, omega, velocity))
    blocks = [_regressor(*places[joint])[:, rows] for joint in tree.bodies]
    return _rank(np.concatenate(blocks, axis=2).reshape(-1, columns))


def _regressor(frame: Residues, origin: Residues, omega: Residues, velocity: Residues) -> Residues:
    """Momenta (n, 6, 10) of one body per inertial parameter: as ``inverse_dynamics.body_momentum`` has them."""
    turning = _cross(omega)
    linear = np.concatenate([velocity[..., None], _product(turning, frame)], axis=-1)
    about = _product(_cross(origin), linear)
    about[..., 1:] = (about[..., 1:] - _product(_cross(velocity), frame)) % _PRIME
    own = _product(np.swapaxes(frame, -1, -2), omega[..., None])[..., 0]
    spins = []
    for a, b in _INERTIAS:
        spin = frame[..., a] * own[..., b, None] % _PRIME
        spins.append(spin if a == b else (spin + frame[..., b] * own[..., a, None]) % _PRIME)
    inertias = np.stack(spins, axis=-1)
    whole = [np.concatenate([linear, np.zeros_like(inertias)], axis=-1), np.concatenate([about, inertias], axis=-1)]
    return np.concatenate(whole, axis=-2)


def _rank(matrix: Residues) -> int:
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
