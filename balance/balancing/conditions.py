"""Balance conditions of a mechanism, found from its model: what keeps its linear momentum zero in every motion.

Linear momentum is ``W(q, v) @ pi``. Over loop-consistent states the rows of W span a space; the mechanism is balanced
when pi is orthogonal to it. The conditions are that space's reduced row echelon form, pivots on first moments.
"""

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Floats
from ..closure import Closure
from ..dynamics import regressor
from ..dynamics.inverse_dynamics import body_momentum
from ..errors import ModelError
from ..mechanism.loop_constraints import constraints_at
from ..mechanism.mechanism import PARAMETERS, Mechanism
from ..results import frame

if TYPE_CHECKING:
    import pandas

    from .objective import Objective

GAP = 1e6
"""Least ratio between the smallest kept and the largest dropped singular value that decides a rank."""
STATES = 64
"""Closed states from which a rank is found first."""
_ROUNDING = 1e-13
"""Singular values above this, relative to the largest, are no rounding of the computation, but may be of the file."""
_ZERO = 1e-9
"""Coefficients below this are rounding of the elimination [m, or none]."""


class UndecidedRank(ModelError):
    """Singular values leave a rank in doubt: no gap among them, or more than one."""


def row_space(matrix: Floats, name: str) -> tuple[Floats, tuple[float, float]]:
    """Orthonormal basis (rank, k) [-] of the row space of ``matrix`` (m, k), in SI, and the singular values at the cut.

    Raises UndecidedRank unless one ratio of at least GAP, and only one, separates kept from dropped singular values.
    """
    used = np.flatnonzero(matrix.any(axis=0))
    rows = np.zeros((min(len(matrix), len(used)), matrix.shape[1]))
    _, values, rows[:, used] = np.linalg.svd(matrix[:, used], full_matrices=False)
    values = values / np.sqrt(len(matrix))
    if not values.any():
        return rows[:0], (0.0, 0.0)
    floor = np.maximum(values, np.finfo(float).eps * values[0])
    ratios = floor[:-1] / floor[1:]
    rank = int(np.argmax(ratios)) + 1 if len(ratios) and ratios.max() >= GAP else len(values)
    gaps = int((ratios >= GAP).sum())
    if gaps > 1 or (rank == len(values) and values[-1] < values[0] / GAP):
        raise UndecidedRank(
            f"{name}: the rank of its momentum cannot be decided: {gaps or 'no'} singular value"
            f"{'s are' if gaps else ' is'} {GAP:g} times the next (they fall from {values[0]:.3g} to {values[-1]:.3g}, "
            f"at most {ratios.max():.3g} times at once)"
        )
    return rows[:rank], (float(values[rank - 1]), float(values[rank]) if rank < len(values) else 0.0)


def reduced_row_echelon(basis: Floats, order: Sequence[int]) -> Floats:
    """Reduced row echelon form of ``basis`` (rank, k) [-], in the same shape; pivots in the given order of columns."""
    used = [column for column in order if basis[:, column].any()]
    matrix, row = basis[:, used], 0
    for column in range(len(used)):
        if row == len(matrix):
            break
        best = row + int(np.argmax(np.abs(matrix[row:, column])))
        if abs(matrix[best, column]) < _ZERO:
            continue
        matrix[[row, best]] = matrix[[best, row]]
        matrix[row] /= matrix[row, column]
        others = np.arange(len(matrix)) != row
        matrix[others] -= np.outer(matrix[others, column], matrix[row])
        row += 1
    matrix[np.abs(matrix) < _ZERO] = 0.0
    found = np.zeros_like(basis)
    found[:, used] = matrix
    return found


def _pseudo_inverse(matrix: Floats, limit: float) -> Floats:
    """Of ``matrix`` (m, n), singular values up to ``limit`` taken for zero, (n, m) [1 / its unit]."""
    left, values, right = np.linalg.svd(matrix, full_matrices=False)
    kept = values > limit
    return (right[kept].T / values[kept]) @ left[:, kept].T


def text_of(coefficients: Mapping[str, float], lengths: Mapping[str, float] | None = None) -> str:
    """A combination as a sum, such as ``mcx[A0A] + 0.15 m[AC]``; with named ``lengths`` [m] ``mcx[A0A] + r m[AC]``.

    A length, or a ratio of two, is written where it alone has the coefficient's value.
    """
    named = lengths or {}
    sizes = {
        "m": dict(named),
        "mc": {f"{a}/{b}": x / y for a, x in named.items() for b, y in named.items() if a != b and y},
    }
    terms: list[str] = []
    for name, value in coefficients.items():
        size = "" if abs(abs(value) - 1.0) < _ZERO else f"{abs(value):.6g} "
        known = sizes.get(name.partition("[")[0].rstrip("xyz"), {})
        equal = [text for text, number in known.items() if abs(abs(value) - number) < 1e-9 * number]
        if size and len(equal) == 1:
            size = f"{equal[0]} "
        sign = ("- " if value < 0 else "+ ") if terms else ("-" if value < 0 else "")
        terms.append(f"{sign}{size}{name}")
    return " ".join(terms) or "0"


_SYMBOLS = re.compile(
    r"\b(?P<parameter>mc|m|I)(?P<axes>[xyz]*)\[(?P<body>[^]]*)\]"
    r"|(?<![^\s-])(?P<length>[^\W\d][^\s/\[]*)(?:/(?P<over>[^\s/\[]+))? "
    r"|(?P<power>e[+-]\d+)|(?P<end> = 0$)"
)
_PARAMETERS = {"mc": r"(m c_{%s})_{%s}", "m": "%sm_{%s}", "I": r"I_{%s,%s}"}


def _name(text: str) -> str:
    """A name upright, so that it is no product of its letters; one letter is a symbol."""
    escaped = re.sub(r"([_#$%&{}])", r"\\\1", text).replace(" ", r"\ ")
    return text if len(text) == 1 and text.isalpha() else rf"\mathrm{{{escaped}}}"


def _symbol(found: re.Match[str]) -> str:
    if kind := found["parameter"]:
        return _PARAMETERS[kind] % (found["axes"], _name(found["body"]))
    if found["power"]:
        return rf"\cdot 10^{{{int(found['power'][1:])}}}"
    if found["end"]:
        return " &= 0"
    length = _name(found["length"])
    return (rf"\tfrac{{{length}}}{{{_name(found['over'])}}}" if found["over"] else length) + r"\, "


def _latex(text: str) -> str:
    """A condition's text as mathematics: ``mcx[A0A]`` is a first moment, ``m[AC]`` a mass, ``Ixx[AC]`` an inertia."""
    return _SYMBOLS.sub(_symbol, text)


MOMENTA = {"linear": [0, 1, 2], "planar": [0, 1, 2, 5], "all": [0, 1, 2, 3, 4, 5]}
"""Linear momentum; with the angular one about z; with all three angular ones."""


@dataclass(frozen=True)
class Conditions:
    """Linear conditions on the inertial parameters: balanced where ``matrix @ pi`` is zero.

    >>> import balance
    >>> found = balance.conditions("four-bar")
    >>> found.rank, found.table()["condition"][0]
    (4, 'mcx[A0A] + crank m[AB] + crank/rocker mcx[B0B] = 0')
    """

    mechanism: Mechanism
    dof: int
    matrix: Floats
    """A condition a row, in reduced row echelon form: pivots 1 on first moments, masses in m, (rank, 10 nb) [-, m]."""
    singular_values: tuple[float, float]
    """Smallest kept and largest dropped singular value of the stacked momentum regressor, or pivot: see ``rank_by``."""
    rank_by: str = "singular values"
    """What decided the rank: these, or ``elimination in extended precision`` where these leave it in doubt."""
    closure_residual: float = 0.0
    """Largest residual of the loops in the closed configuration that is the home of all others [m, rad]."""
    in_doubt: bool = False
    """Whether singular values were dropped as rounding of the file's numbers that are none of the computation."""
    rank_to_the_letter: int | None = None
    """Where it is in doubt, the number of conditions of the file's numbers as they are; None where it is undecided."""
    rank_rational: int | None = None
    """Where singular values leave the rank of an open chain in doubt, its rank in exact arithmetic, to 15 digits."""
    idle: tuple[str, ...] = ()
    """Coordinates of the idle freedoms among ``dof``: see ``Closure.idle``."""

    @property
    def rank(self) -> int:
        """Number of independent conditions."""
        return len(self.matrix)

    @cached_property
    def units(self) -> tuple[str, ...]:
        """Unit of each condition, that of its pivot: kg m; kg of masses alone; kg m2 of inertias alone, (rank,)."""
        blocks = self.matrix.reshape(self.rank, -1, len(PARAMETERS)) != 0.0
        moments, masses = blocks[:, :, 1:4].any(axis=(1, 2)), blocks[:, :, 0].any(axis=1)
        return tuple(
            "kg m" if moment else "kg" if mass else "kg m2" for moment, mass in zip(moments, masses, strict=True)
        )

    def values(self, mechanism: Mechanism | None = None) -> Floats:
        """Left-hand sides for a mechanism of the same kind with other masses, (rank,) [``units``]."""
        return self.matrix @ (mechanism or self.mechanism).pi

    def residual(self, unit: str, mechanism: Mechanism | None = None) -> float:
        """The first-moment residual, in kg m; in kg the largest mass that a body lacks alike, by conditions on masses
        alone; in kg m2 the largest absolute value of the conditions of it."""
        if unit == "kg m":
            return self.first_moment_residual(mechanism)
        if unit == "kg":
            masses = self._of_each_body(np.eye(self.rank)[[one == unit for one in self.units]], slice(1))
            return float(np.abs(masses @ self.values(mechanism)).max(initial=0.0))
        return float(np.abs(self.values(mechanism)[[one == unit for one in self.units]]).max(initial=0.0))

    def first_moment_residual(self, mechanism: Mechanism | None = None) -> float:
        """Largest first moment that a body lacks [kg m]; the same in any order of bodies and in any axes of theirs."""
        return float(np.linalg.norm(self.lacking @ self.values(mechanism), axis=1).max(initial=0.0))

    @cached_property
    def lacking(self) -> Floats:
        """L: ``L @ values`` is the first moment that each body lacks, in its frame [kg m], (nb, 3, rank) [-, m]."""
        return self._of_each_body(self.on_first_moments, slice(1, 4))

    def _of_each_body(self, rows: Floats, part: slice) -> Floats:
        """L: ``L @ values`` is what each body lacks of a ``part`` of its parameters, (nb, size of part, rank).

        Of all combinations of the ``rows @ values`` (k, rank) in which the body's own part has weight 1, the left-hand
        side of the one whose weights of the other bodies' parts are least in squares.
        """
        weights = (self.matrix.T @ rows.T).reshape(len(self.mechanism.bodies), len(PARAMETERS), len(rows))[:, part]
        least = np.linalg.pinv(np.concatenate(weights).T, rcond=_ZERO).reshape(weights.shape)
        own = least @ weights.transpose(0, 2, 1)
        return np.asarray(np.linalg.pinv(own, rcond=_ZERO) @ least @ rows)

    @cached_property
    def on_first_moments(self) -> Floats:
        """T: ``T @ values`` are the conditions without those on masses alone that no masses meet, (rank, rank).

        Of these that part counts whose momentum is like that of the others, one driven joint moving at a time over
        the workspace: a ram's mass along the arm that carries it, about its place at home, and nothing of the mass
        that a slide moves along its own axis, whatever turns on it [-, m]. Slides that move against each other, which
        a mass on one of them balances, are among the others.
        """
        masses = np.array([unit == "kg" for unit in self.units], dtype=bool)
        kept, whole = np.eye(self.rank), np.eye(self.rank)
        if masses.any():
            from scipy.optimize import nnls  # late: most mechanisms have no such condition

            of = self.matrix[masses, :: len(PARAMETERS)]
            met = [nnls(of, -column)[1] <= _ZERO * np.linalg.norm(column) for column in of.T]  # by masses on others
            kept[np.ix_(masses, masses)] = of[:, met] @ np.linalg.pinv(of[:, met], rcond=_ZERO)
            each = self._momentum_of_single_motions @ np.linalg.pinv(self.matrix)
            kept = kept + np.linalg.pinv(each @ kept, rcond=_ZERO) @ each @ (whole - kept)
        return kept

    @cached_property
    def _momentum_of_single_motions(self) -> Floats:
        """W (k, 10 nb) with |W pi|^2 the mean square of the momentum, one driven joint moving at a time."""
        from .objective import single_motions, triangle

        return triangle(iter([regressor.momentum_regressor(self.mechanism, *single_motions(self.mechanism))[:, :3]]))

    def required_first_moments(self, mechanism: Mechanism | None = None, bodies: Sequence[str] = ()) -> Floats:
        """First moments that, added to all bodies together, meet the conditions on linear momentum, (nb, 3) [kg m].

        Each in its body's frame. Least in squares on other bodies than ``bodies`` [default: those with sites named
        counter...], then on these. No first moment meets conditions on masses alone: with such the ``objective`` is
        least. The mass that gives a first moment counts too, apart.

        >>> import balance
        >>> balance.conditions("four-bar").required_first_moments()[:, 0].round(4).tolist()
        [-0.0537, 0.0, -0.1096]
        """
        model = mechanism or self.mechanism
        sites = (model.site(name).body for name in model.counter_sites)
        first = {model.body_index(body) for body in bodies} or {body for body in sites if body >= 0}
        rows = self.objective.factor[:, :-1] if "kg" in self.units else self.matrix
        blocks = rows.reshape(len(rows), -1, len(PARAMETERS))[:, :, 1:4]
        cheap = np.array([body in first for body in range(blocks.shape[1])], dtype=bool)
        given, others = (blocks[:, which].reshape(len(rows), -1) for which in (cheap, ~cheap))
        limit = _ZERO * float(np.linalg.norm(blocks))
        inverse, lacking = _pseudo_inverse(given, limit), -rows @ model.pi
        rest = others - given @ (inverse @ others)
        found = np.zeros((len(cheap), 3))
        found[~cheap] = (_pseudo_inverse(rest, limit) @ (lacking - given @ (inverse @ lacking))).reshape(-1, 3)
        found[cheap] = (inverse @ (lacking - others @ found[~cheap].ravel())).reshape(-1, 3)
        return np.where(np.abs(found) > _ZERO * np.abs(model.parameters[:, 1:4]).max(initial=_ZERO), found, 0.0)

    def is_balanced(self, tol: float, mechanism: Mechanism | None = None) -> bool:
        """Whether the ``residual`` in every unit is at most ``tol`` [kg m, kg, kg m2]."""
        return all(self.residual(unit, mechanism) <= tol for unit in self.units)

    @cached_property
    def objective(self) -> "Objective":
        """The momentum over the workspace, which sizing makes small where it has no motion."""
        from .objective import workspace_objective

        return workspace_objective(self.mechanism)

    @property
    def weights(self) -> Floats:
        """S (k, rank) [root of kg / kg m]: |S values|^2 is the ``objective``."""
        return self.objective.factor[:, :-1] @ np.linalg.pinv(self.matrix)

    def coefficients(self, row: int) -> dict[str, float]:
        """Coefficients of one condition by parameter name, without zeros."""
        names = self.mechanism.parameter_names
        return {names[k]: float(self.matrix[row, k]) for k in np.flatnonzero(self.matrix[row])}

    def document(self, mechanism: Mechanism | None = None) -> list[dict[str, Any]]:
        """Each with its value for a mechanism: ``value_kgm``, of masses alone ``value_kg``."""
        return [
            {"coefficients": self.coefficients(i), f"value_{unit.replace(' ', '')}": float(value)}
            for i, (value, unit) in enumerate(zip(self.values(mechanism), self.units, strict=True))
        ]

    def table(self) -> "pandas.DataFrame":
        """The conditions as texts, the values of their left-hand sides and their units."""
        rows = zip(self.values(), self.units, strict=True)
        return frame({"condition": self.text(i), "value": x, "unit": unit} for i, (x, unit) in enumerate(rows))

    def __repr__(self) -> str:
        return f"Conditions of {self.mechanism.name}\n{self.table().to_string(index=False)}"

    def _repr_latex_(self) -> str:
        rows = r" \\ ".join(_latex(self.text(i)) for i in range(self.rank))
        return rf"$$\begin{{aligned}}{rows}\end{{aligned}}$$"

    def text(self, row: int) -> str:
        """One condition as an equation in the lengths that the file names, such as ``mcx[A0A] + r m[AC] = 0``."""
        return f"{self.left(row)} = 0"

    def left(self, row: int) -> str:
        """Its left-hand side."""
        return text_of(self.coefficients(row), self.mechanism.lengths if self.units[row] == "kg m" else {})


def balance_conditions(mechanism: Mechanism, momentum: str = "linear") -> Conditions:
    """Find the conditions that keep a momentum zero, one of MOMENTA.

    Raises ClosureError if the mechanism cannot be closed or moved, ModelError if the rank cannot be decided.
    """
    if momentum not in MOMENTA:
        raise ModelError(f"momentum is {momentum!r}: expected one of {', '.join(MOMENTA)}")
    closure = Closure(mechanism)
    decided_by, in_doubt, exact, rational = "singular values", False, None, None
    held = (loop.name for loop in closure.mechanism.loops)  # those of the file, and coordinates held as at home
    key = ("momentum space", momentum, closure.length, closure.home.tobytes(), *held)
    try:
        basis, gap, in_doubt = mechanism.tree.once(key, lambda: _momentum_space(closure, MOMENTA[momentum]))
    except UndecidedRank:
        rational = _rational_rank(mechanism, momentum)
        basis, gap = _extended_momentum_space(closure, MOMENTA[momentum], rational)
        decided_by = "elimination in extended precision"
    if in_doubt:
        rational = _rational_rank(mechanism, momentum)
        with suppress(UndecidedRank):
            exact = len(_extended_momentum_space(closure, MOMENTA[momentum])[0])
        in_doubt = exact != len(basis)
    residual = float(closure.residual(closure.home[None])[0])
    return Conditions(
        closure.mechanism, closure.dof, reduced_row_echelon(basis, pivot_order(mechanism)), gap, decided_by, residual,
        in_doubt, exact if in_doubt else None, rational, closure.idle,
    )  # fmt: skip


def _rational_rank(mechanism: Mechanism, momentum: str) -> int | None:
    """Rank in exact arithmetic; None where loops are closed, which have no rational configurations in general.

    And where frames are turned by other than quarter turns: axes that are parallel by them are not so by decimals.
    """
    turned = np.array([joint.rotation for joint in mechanism.tree.joints])
    if mechanism.loops or np.abs(turned - np.round(turned)).max(initial=0.0) > 1e-12:
        return None
    from .rational_rank import rational_rank  # late: hardly any rank is in doubt

    return rational_rank(mechanism.tree, MOMENTA[momentum])


def _momentum_space(closure: Closure, rows: list[int]) -> tuple[Floats, tuple[float, float], bool]:
    """The row space of a momentum's ``rows`` over so many closed states that a third more of them add nothing.

    With it whether singular values that are no rounding were dropped.
    """
    count = STATES
    while True:
        q = closure.states(count)
        states = zip(q, closure.velocities(q), strict=True)
        by_state = np.array([closure.engine.momentum_regressor(*state)[rows] for state in states])
        found, others = (part.reshape(-1, by_state.shape[2]) for part in np.split(by_state, [3 * count // 4]))
        basis, gap = row_space(found, closure.mechanism.name)
        if np.abs(others - (others @ basis.T) @ basis).max() <= _ZERO * np.abs(others).max():
            return basis, gap, gap[1] > _ROUNDING * float(np.linalg.norm(found)) / len(found) ** 0.5
        count *= 2


def _extended_momentum_space(
    closure: Closure, rows: list[int], rank: int | None = None
) -> tuple[Floats, tuple[float, float]]:
    """The row space of a momentum's ``rows`` in NumPy's extended precision, 64 bits of mantissa on most processors.

    Where its pivots leave no gap, it has the ``rank`` that is known.
    States are closed to that precision by Newton's method with the inverse in double precision. Raises UndecidedRank.
    """
    tree, loops = closure.mechanism.tree, closure.mechanism.loops
    q = closure.states(2 * STATES).astype(np.longdouble)
    v = closure.velocities(q.astype(float)).astype(np.longdouble)
    for _ in range(3):
        gap, jacobian = constraints_at(tree, loops, q)
        inverse = np.linalg.pinv(jacobian.astype(float), rcond=_ZERO)
        q = q - np.einsum("nij,nj->ni", inverse, gap)
        v = v - np.einsum("nij,nj->ni", inverse, np.einsum("nij,nj->ni", jacobian, v))
    program = regressor.regressor_program(closure.mechanism, "momentum", body_momentum, 2)
    columns = program.values(q.T, v.T).reshape(-1, 6, len(q))[:, rows]
    matrix = columns.transpose(2, 1, 0).reshape(-1, len(columns))
    return _eliminated(matrix, closure.mechanism.name, rank)


def _eliminated(matrix: Floats, name: str, known: int | None = None) -> tuple[Floats, tuple[float, float]]:
    """Orthonormal basis of a row space by Gauss's elimination with complete pivoting, and the pivots at the cut."""
    rest, kept, pivots = matrix / np.abs(matrix).max(), [], []
    for _ in range(min(matrix.shape)):
        row, column = np.unravel_index(np.argmax(np.abs(rest)), rest.shape)
        pivots.append(float(abs(rest[row, column])))
        if not pivots[-1] > 0.0:
            break
        kept.append((rest[row] / rest[row, column]).astype(float))
        rest = rest - np.outer(rest[:, column] / rest[row, column], rest[row])
        rest[row] = 0.0
    floor = np.maximum(pivots, float(np.finfo(np.longdouble).eps))
    gaps = np.flatnonzero(floor[:-1] / floor[1:] >= GAP)
    if not len(gaps) and known is None:
        raise UndecidedRank(
            f"{name}: the rank of its momentum cannot be decided, not in extended precision either: its pivots fall "
            f"from {pivots[0]:.3g} to {pivots[-1]:.3g} without a gap of {GAP:g}"
        )
    rank = int(gaps[-1]) + 1 if len(gaps) else min(known or 0, len(kept))
    return np.linalg.qr(np.array(kept[:rank]).T)[0].T, (pivots[rank - 1], pivots[rank] if rank < len(pivots) else 0.0)


def pivot_order(mechanism: Mechanism) -> list[int]:
    """First moments body by body, then masses, then inertias."""
    bodies = range(len(mechanism.bodies))
    blocks = [(1, 2, 3), (0,), (4, 5, 6, 7, 8, 9)]
    return [10 * body + k for block in blocks for body in bodies for k in block]
