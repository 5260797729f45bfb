"""Published closed forms and balance conditions, and their comparison with the conditions derived from the model.

The closed forms are the tests' oracle, and the only sizing where Pinocchio cannot be installed.
Source: G. Kiper, "Dinamik Dengeleme Calismalari", slides, METU Mechanical Engineering, Ankara, 20-21 November 2019.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from .. import datasets
from ..arrays import Floats
from ..mechanism.forward_kinematics import Joint
from ..mechanism.mechanism import Mechanism
from ..results import Key
from . import stock_plates
from .conditions import Conditions
from .sizing import sizing_of_given


def published_sizing() -> dict[str, Any]:
    """Inputs and results of the source's sizing of its manipulator as built, units in the keys."""
    text = datasets.find_dataset("kiper2019", "published", ".json").read_text(encoding="utf-8")
    sizing: dict[str, Any] = json.loads(text)["sizing_sheet_A_as_built"]
    return sizing


def manipulator_first_moment(m1: float, p1: float, m2: float, p2: float, r: float, payload: float) -> float:
    """First moment that each counter-mass of the parallelogram 6-bar manipulator must make up [kg m].

    m1 p1 + (m2 + m5) r + m2 p2, the same for both arms: m1 [kg] and p1 [m] mass and centre of an inner arm, m2 and p2
    of an outer arm, r [m] the arms' length, m5 = ``payload`` [kg], the platform included.
    """
    return m1 * p1 + (m2 + payload) * r + m2 * p2


def manipulator_counter_mass(first_moment: float, p_cm: float) -> float:
    """Counter-mass of one arm [kg] at p_cm [m] along the arm, negative behind the pivot: m_cm p_cm = -first moment."""
    return -first_moment / p_cm


def manipulator_balanced_payload(
    m1: float, p1: float, m2: float, p2: float, r: float, m_cm: float, p_cm: float
) -> float:
    """Payload that a counter-mass m_cm [kg] at p_cm [m] on each arm balances [kg]."""
    return (-m_cm * p_cm - m1 * p1 - m2 * p2) / r - m2


def serial_chain(lengths: Sequence[float]) -> list[dict[str, float]]:
    """Conditions of a planar serial chain of n revolute joints, bodies ``link_1`` ... ``link_n``.

    m_i e_i + l_i (m_i+1 + ... + m_n) = 0 and m_i f_i = 0 for each link, e along it and f across, lengths in m.
    """
    count = len(lengths)
    rows: list[dict[str, float]] = []
    for i, length in enumerate(lengths, 1):
        outer = {f"m[link_{j}]": length for j in range(i + 1, count + 1)}
        rows += [{f"mcx[link_{i}]": 1.0} | outer, {f"mcy[link_{i}]": 1.0}]
    return rows


def four_bar_loop_closure(l1: float, l2: float, l3: float) -> list[dict[str, float]]:
    """Conditions of the four-bar A0-A-B-B0 by loop closure, bodies ``A0A``, ``AB``, ``B0B`` of lengths l1, l2, l3 [m].

    Published with link 3 measured from B: m1 e1 + m2 (1 - e2/l2) l1 = 0, m1 f1 - m2 (f2/l2) l1 = 0,
    m3 (l3 - e3) + m2 (e2/l2) l3 = 0, m3 f3 - m2 (f2/l2) l3 = 0; here link 3 is measured from B0, turned by 180 degrees.
    """
    return [
        {"mcx[A0A]": 1.0, "m[AB]": l1, "mcx[AB]": -l1 / l2},
        {"mcy[A0A]": 1.0, "mcy[AB]": -l1 / l2},
        {"mcx[B0B]": 1.0, "mcx[AB]": l3 / l2},
        {"mcy[B0B]": 1.0, "mcy[AB]": l3 / l2},
    ]


TOLERANCE = 1e-12
"""Distance of a row from a space, rows of length 1, up to which it counts as in it."""
Row = dict[str, float]


@dataclass(frozen=True)
class ConditionComparison:
    """Published conditions compared with the derived ones, as spaces of rows."""

    method: str
    published: tuple[Row, ...]
    """Published conditions, by parameter name."""
    given: tuple[Row, ...]
    """Conditions under which the published ones are also necessary; none where nothing more is needed."""
    rank: tuple[int, int]
    """Ranks of the published and of the derived conditions."""
    sufficient: float
    """Largest distance of a derived condition from the published span [-]: zero where these are sufficient."""
    necessary: float
    """Largest distance of a published condition from the derived span [-]: zero where these are necessary."""
    equal_given: float | None
    """The larger of both distances once ``given`` is added to the derived conditions; None without ``given``."""

    def is_equal(self, tol: float = TOLERANCE) -> bool:
        """Whether published and derived conditions span one space to ``tol`` [-]."""
        return max(self.sufficient, self.necessary) <= tol

    def verdict(self, tol: float = TOLERANCE) -> str:
        """How published and derived conditions compare, in words."""
        if self.is_equal(tol):
            return "equal to the derived conditions"
        if self.sufficient <= tol:
            more = "sufficient, not necessary"
            if self.equal_given is not None and self.equal_given <= tol:
                return f"{more}: equal once {' and '.join(_text(row) for row in self.given)}"
            return more
        return "necessary, not sufficient" if self.necessary <= tol else "neither sufficient nor necessary"


def compare_conditions(conditions: Conditions) -> list[ConditionComparison]:
    """Every published method for a mechanism's kind: serial chains of n revolute joints, four-bars. Else none."""
    mechanism = conditions.mechanism
    if (lengths := serial_lengths(mechanism)) is not None:
        rows = _renamed(serial_chain(lengths), {f"link_{k}": b for k, b in enumerate(mechanism.bodies, 1)})
        return [compare_spans(f"serial chain, {len(lengths)}R", rows, conditions)]
    if (shape := four_bar_lengths(mechanism)) is not None:
        (crank, coupler, rocker), sides = shape
        names = {"A0A": crank, "AB": coupler, "B0B": rocker}
        split, centred = _renamed(split_coupler(*sides), names), _renamed([{"mcy[AB]": 1.0}], names)
        return [
            compare_spans("four-bar, the coupler's mass split between two chains", split, conditions, centred),
            compare_spans("four-bar, loop closure", _renamed(four_bar_loop_closure(*sides), names), conditions),
        ]
    return []


def split_coupler(l1: float, l2: float, l3: float) -> list[Row]:
    """Method 1: the coupler's mass m2 = m2a + m2b split freely between the serial chains A0-A and B0-B.

    Each chain is 2R: m1 e1 + m2a l1 = 0, m1 f1 = 0, m3 e3 + m2b l3 = 0 (from B0), m3 f3 = 0, the centre of part a at A
    and of part b at B, so m2 e2 = m2b l2 and m2 f2 = 0. Here m2b is eliminated: whatever the split, these remain.
    """
    return [
        {"mcx[A0A]": 1.0, "m[AB]": l1, "mcx[AB]": -l1 / l2},
        {"mcy[A0A]": 1.0},
        {"mcx[B0B]": 1.0, "mcx[AB]": l3 / l2},
        {"mcy[B0B]": 1.0},
        {"mcy[AB]": 1.0},
    ]


def compare_spans(
    method: str, published: Sequence[Row], conditions: Conditions, given: Sequence[Row] = ()
) -> ConditionComparison:
    """Compare published conditions with the derived ones, as spaces of rows."""
    names = conditions.mechanism.parameter_names
    rows, derived = _basis(_matrix(published, names)), _basis(conditions.matrix)
    equal_given = None
    if given:
        more = _basis(np.vstack([conditions.matrix, _matrix(given, names)]))
        equal_given = max(_distance(more, rows), _distance(rows, more))
    return ConditionComparison(
        method, tuple(published), tuple(given), (len(rows), len(derived)), _distance(derived, rows),
        _distance(rows, derived), equal_given,
    )  # fmt: skip


def serial_lengths(mechanism: Mechanism) -> list[float] | None:
    """Lengths of a planar serial chain of revolute joints whose links lie along x; None for another mechanism [m].

    The last link's length does not matter and is 0.
    """
    joints = mechanism.tree.joints
    if mechanism.loops or any(j.parent != k - 1 or not _flat(j) for k, j in enumerate(joints)):
        return None
    if any(abs(joint.position[1]) > 1e-12 for joint in joints[1:]):
        return None
    return [float(joint.position[0]) for joint in joints[1:]] + [0.0]


def four_bar_lengths(mechanism: Mechanism) -> tuple[tuple[str, str, str], tuple[float, float, float]] | None:
    """Bodies (crank, coupler, rocker) and their lengths [m], links along x; None for another mechanism."""
    joints, loops = mechanism.tree.joints, mechanism.closed_loops
    counts = len(joints), len(mechanism.loops), len(loops)
    if counts != (3, 1, 1) or loops[0].weld or not all(map(_flat, joints)):
        return None
    ground = [k for k, joint in enumerate(joints) if joint.parent < 0]
    coupler = next((k for k, joint in enumerate(joints) if joint.parent >= 0), -1)
    if len(ground) != 2 or coupler < 0:
        return None
    crank, ends = joints[coupler].parent, {end.joint: end.position for end in (loops[0].first, loops[0].second)}
    rocker = next(k for k in ground if k != crank)
    if set(ends) != {coupler, rocker}:
        return None
    places = [joints[coupler].position, ends[coupler], ends[rocker]]
    if any(abs(place[1]) > 1e-12 for place in places):
        return None
    bodies = [mechanism.bodies[mechanism.tree.bodies.index(k)] for k in (crank, coupler, rocker)]
    return (bodies[0], bodies[1], bodies[2]), (float(places[0][0]), float(places[1][0]), float(places[2][0]))


def _flat(joint: Joint) -> bool:
    """Whether a joint turns about z and its frame is parallel to its parent's."""
    return joint.revolute and bool(np.allclose(joint.axis, (0, 0, 1)) and np.allclose(joint.rotation, np.eye(3)))


def _renamed(rows: Sequence[Row], names: dict[str, str]) -> list[Row]:
    def own(parameter: str) -> str:
        kind, body = parameter[:-1].split("[")
        return f"{kind}[{names[body]}]"

    return [{own(name): value for name, value in row.items()} for row in rows]


def _matrix(rows: Sequence[Row], names: list[str]) -> Floats:
    matrix = np.zeros((len(rows), len(names)))
    for k, row in enumerate(rows):
        for name, value in row.items():
            matrix[k, names.index(name)] = value
    return matrix


def _basis(rows: Floats) -> Floats:
    """Orthonormal basis of a space of rows."""
    _, size, basis = np.linalg.svd(rows, full_matrices=False)
    return basis[size > 1e-10 * size[0]]


def _distance(rows: Floats, space: Floats) -> float:
    """Largest distance of orthonormal rows from a space given by its orthonormal basis."""
    return float(np.linalg.norm(rows - rows @ space.T @ space, axis=1).max())


def _text(row: Row) -> str:
    return " + ".join(f"{'' if value == 1.0 else f'{value:.6g} '}{name}" for name, value in row.items()) + " = 0"


@dataclass(frozen=True)
class BuiltSet:
    """The set that the source built for a payload, the same on each arm."""

    payload: Annotated[float, Key("payload_kg")]
    plates: Annotated[tuple[str, ...], Key()]
    mass: Annotated[float, Key("mass_kg")]
    """Of its plates [kg]."""
    residual: Annotated[float, Key("residual_first_moment_kgm")]
    """Its first-moment residual [kg m], computed."""


def built_sets(
    conditions: Conditions, mechanisms: Sequence[Mechanism], payloads: Sequence[float]
) -> tuple[BuiltSet, ...]:
    """Sets that the source built for exactly these payloads [kg] of its manipulator; empty for any others."""
    published = published_sizing()
    if list(payloads) != [float(key) for key in published["built_counter_mass_kg_per_arm"]]:
        return ()
    plates = stock_plates.load_stock("kiper2019")
    found = []
    for mechanism, payload, names in zip(mechanisms, payloads, published["built_sets"].values(), strict=True):
        mass = stock_plates.plates_mass(names, plates)
        sizing = sizing_of_given(conditions, mechanism, dict.fromkeys(mechanism.counter_sites, mass))
        found.append(BuiltSet(payload, tuple(names), mass, sizing.residual()))
    return tuple(found)
