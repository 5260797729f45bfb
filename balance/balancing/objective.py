"""What counter-masses are to make small: the mean square of the shaking force, or of what else is linear in masses.

J(pi) = |factor [pi; 1]|^2, pi the inertial parameters, of which every mass at a site is a multiple. ``factor`` is the
triangle of a QR decomposition: no square of a condition number enters.

Over a motion, J is the mean of Fx^2 + Fy^2 + Fz^2 over its samples, equally weighted, gravity excluded [N2]. Without
a motion, over the workspace, J is the mean of p' p / (2 T) over closed states and over all directions of motion
there, p the linear momentum and T the kinetic energy of the mechanism as its file has it: tr(P M^-1 P') / dof [kg],
where p = P u and 2 T = u' M u. Neither depends on the base frame, nor on names, order or scale of coordinates.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations, product

import numpy as np

from ..arrays import BLOCK, Floats
from ..closure import Closure, Trajectory
from ..dynamics.inverse_dynamics import driven_rates, simulate
from ..dynamics.regressor import driven_torque_regressor, momentum_regressor, torque_regressor, wrench_regressor
from ..errors import ModelError, SizingError
from ..mechanism.mechanism import PARAMETERS, Mechanism, mass_at

Exact = Callable[[Floats, Floats], Floats]
"""J (n,) of masses (n, sites) [kg], and of what plates have of inertia beyond that of the sites (n, sites) [kg m2]."""
QUANTITIES = {"force": "N", "moment": "Nm", "torque": "Nm"}
"""What can be made small over a motion, and the unit of its root mean square."""
MADE_SMALL = {
    "force": "shaking force", "moment": "shaking moment", "torque": "drive torque", "vibration": "acceleration",
}  # fmt: skip
"""What people call each, and vibration (``base_vibration``)."""


def made_small(weights: Mapping[str, float], motion: str | None) -> str:
    """What ``weights`` make small, in words; the momentum without a motion."""
    if motion is None:
        return "momentum"
    of_weights = f" ({', '.join(f'{name} {w:g}' for name, w in weights.items())})"
    return " and ".join(MADE_SMALL[name] for name in weights) + of_weights * (len(set(weights.values())) > 1)


_STEP = 0.25
"""Travel of the fastest joint between two states of the workspace [rad, or lengths of the mechanism]."""
_FEWEST, _HALVINGS = 12, 8
"""States for each degree of freedom, where limits leave fewer of which the step is halved, and how often at most."""
_TRAVEL = np.pi
"""Travel of the fastest joint from home [rad, or lengths of the mechanism]."""
_ALL_COMBINATIONS, _PAIRS = 3, 8
"""Number of joints up to which they move in all combinations, and in pairs."""
_DETERMINED = 1e6
"""Condition number from which driven joints do not determine the mechanism at home."""
_ROUNDING = 1e-12
"""Effect of a mass at a site, relative to the largest on any body, that is rounding: the site does not move."""
_MASSLESS = 1e-12
"""Kinetic energy of a direction of motion, relative to the largest, that is rounding."""


@dataclass(frozen=True)
class Objective:
    """J = |factor [pi; 1]|^2."""

    factor: Floats
    """(k, 10 nb + 1) [square root of the unit of J per parameter; the last column without]"""
    unit: str
    """Of the root of J: N, Nm, or for the workspace the root of kg."""

    def value(self, mechanism: Mechanism) -> float:
        """J of a mechanism of the same kind with other masses [square of ``unit``]."""
        return float(np.sum((self.factor @ np.append(mechanism.pi, 1.0)) ** 2))

    def system(self, mechanism: Mechanism, sites: Sequence[str]) -> tuple[Floats, Floats]:
        """Columns (k, sites) [unit / kg] and target (k,) [unit] with J = |columns m - target|^2, m the masses [kg]."""
        added = unit_masses(mechanism, sites)
        columns = self.factor[:, :-1] @ added.T
        largest = np.linalg.norm(self.factor[:, :-1], axis=0).reshape(-1, len(PARAMETERS)).max(axis=0)
        reach = np.abs(added) @ np.tile(largest, len(mechanism.bodies))  # of the same on the body that does most
        columns[:, np.linalg.norm(columns, axis=0) <= _ROUNDING * reach] = 0.0
        return columns, -self.factor @ np.append(mechanism.pi, 1.0)

    def turning(self, mechanism: Mechanism, sites: Sequence[str]) -> Floats:
        """Columns (k, sites) [unit / kg m2] of the inertia of a thin disc at a site."""
        return self.factor[:, :-1] @ discs(mechanism, sites).T


def unit_masses(mechanism: Mechanism, sites: Sequence[str]) -> Floats:
    """Changes (sites, 10 nb) [-, m, m2] of the inertial parameters by a counter-mass of 1 kg at each site."""
    return np.array([mechanism.with_counter_mass({name: 1.0}).pi - mechanism.pi for name in sites])


def discs(mechanism: Mechanism, sites: Sequence[str]) -> Floats:
    """Changes (sites, 10 nb) [-] of the inertial parameters by thin discs of 1 kg m2, beyond those of their masses."""
    found = np.zeros((len(sites), *mechanism.parameters.shape))
    for disc, site in zip(found, map(mechanism.site, sites), strict=True):
        disc[site.body] = mass_at(np.zeros(3), 1.0, site.axis) - mass_at(np.zeros(3), 0.0, site.axis)
    return found.reshape(len(sites), -1)


def motion_objective(
    mechanism: Mechanism, trajectory: Trajectory, weights: Mapping[str, float] | None = None
) -> Objective:
    """Mean square over the samples of a trajectory; of the force alone, or of several QUANTITIES with their weights.

    Several are each in parts of what they are for ``mechanism``: J = sum of weight times (RMS / RMS without)^2 [-].
    """
    weights = weights or {"force": 1.0}
    parts = [Objective(triangle(_ROWS[name](mechanism, trajectory)), QUANTITIES[name]) for name in weights]
    return parts[0] if len(parts) == 1 else Objective(scaled(mechanism, parts, weights), "1")


def scaled(mechanism: Mechanism, parts: Sequence[Objective], weights: Mapping[str, float]) -> Floats:
    """Factor (k, 10 nb + 1) [-] of the weighted sum of objectives, each in parts of what it is for ``mechanism``."""
    rows = []
    for part, (name, weight) in zip(parts, weights.items(), strict=True):
        if not (value := part.value(mechanism)) > 0.0:
            raise SizingError(f"{mechanism.name} has no {name} in this motion: there is nothing to weigh against")
        rows.append(part.factor * np.sqrt(weight / value))
    return np.asarray(np.linalg.qr(np.vstack(rows), mode="r"))


def triangle(blocks: Iterator[Floats]) -> Floats:
    """Triangle R (k, k) with R' R the mean over samples of W' W, for blocks of rows W (samples, rows, k), in SI."""
    count, factor = 0, None
    for block in blocks:
        rows = block.reshape(-1, block.shape[2])
        factor = np.linalg.qr(rows if factor is None else np.vstack([factor, rows]), mode="r")
        count += len(block)
    assert factor is not None
    return factor / np.sqrt(count)


def with_constant(rows: Floats, constant: Floats | None = None) -> Floats:
    """Rows (n, d, 10 nb) and what no parameter changes, (n, d), as (n, d, 10 nb + 1), in SI."""
    added = np.zeros(rows.shape[:2]) if constant is None else constant
    return np.concatenate([rows, added[:, :, None]], axis=2)


def _parts(trajectory: Trajectory) -> Iterator[tuple[slice, Floats, Floats, Floats]]:
    for start in range(0, len(trajectory.time), BLOCK):
        part = slice(start, start + BLOCK)
        yield part, trajectory.q[part], trajectory.v[part], trajectory.a[part]


def _wrench_rows(rows: slice, mechanism: Mechanism, trajectory: Trajectory) -> Iterator[Floats]:
    for _, q, v, a in _parts(trajectory):
        yield with_constant(wrench_regressor(mechanism, q, v, a)[:, rows])


def turning_drives(mechanism: Mechanism) -> list[str]:
    """Driven joints that turn: ``torque`` is of these; forces [N] of sliding ones have no sum with torques [N m]."""
    return [joint for joint in mechanism.driven if mechanism.tree.joints[mechanism.coordinate_index(joint)].revolute]


def _torque_rows(mechanism: Mechanism, trajectory: Trajectory) -> Iterator[Floats]:
    """Of the motors that turn; friction and the motors' own inertia are constant."""
    if not (turning := turning_drives(mechanism)):
        raise ModelError(f"{mechanism.name}: no motor in <actuator> turns a joint: there is no torque to make small")
    response, motors = simulate(mechanism, trajectory), mechanism.driven or mechanism.coordinates
    torque = np.array([response.torque[joint] for joint in turning]).T
    chosen = [motors.index(joint) for joint in turning]
    for part, q, v, a in _parts(trajectory):
        rates = driven_rates(mechanism, trajectory.per_drive[part], motors)
        rows = driven_torque_regressor(mechanism, q, v, a, rates)[:, chosen]
        yield with_constant(rows, torque[part] - rows @ mechanism.pi)


_ROWS: Mapping[str, Callable[[Mechanism, Trajectory], Iterator[Floats]]] = {
    "force": partial(_wrench_rows, slice(3)), "moment": partial(_wrench_rows, slice(3, 6)), "torque": _torque_rows,
}  # fmt: skip


def workspace_objective(mechanism: Mechanism) -> Objective:
    """Mean over the workspace of momentum squared per twice the kinetic energy [kg]: see ``workspace_momentum``."""
    return Objective(triangle(iter([with_constant(workspace_momentum(mechanism))])), "root of kg")


def workspace_momentum(mechanism: Mechanism) -> Floats:
    """W with ``W @ pi`` = linear momentum per root of twice the kinetic energy, (n, 3, 10 nb) [root of kg].

    At each of the ``workspace_states``, along as many directions of motion as there are degrees of freedom, which
    share no kinetic energy. Raises ModelError where a direction has none.
    """
    return momentum_regressor(mechanism, *workspace_motions(mechanism))[:, :3]


def workspace_motions(mechanism: Mechanism) -> tuple[Floats, Floats]:
    """Configurations (n, nv) [rad, m] and rates (n, nv) with a kinetic energy of 1/2: see ``workspace_momentum``."""
    closure = Closure(mechanism).without_idle()
    q, dof = workspace_states(mechanism, closure), closure.dof
    tangents = closure.tangents(q)
    states = np.repeat(q, dof, axis=0)
    along = np.ascontiguousarray(tangents.transpose(0, 2, 1)).reshape(len(states), -1)
    still = replace(mechanism, gravity=np.zeros(3))
    torque = (torque_regressor(still, states, np.zeros_like(states), along) @ mechanism.pi).reshape(len(q), dof, -1)
    inertia = torque @ tangents
    sizes, turns = np.linalg.eigh(0.5 * (inertia + inertia.transpose(0, 2, 1)))
    if not (sizes[:, 0] > _MASSLESS * sizes.max()).all():
        raise ModelError(
            f"{mechanism.name} can move bodies without mass alone: without a motion its momentum has no measure; give "
            "one with --motion, or those bodies a mass"
        )
    unit = np.einsum("nid,ndk,nk->nki", tangents, turns, 1.0 / np.sqrt(sizes)).reshape(states.shape)
    return states, np.ascontiguousarray(unit)


def workspace_states(mechanism: Mechanism, closure: Closure, travel: float = _TRAVEL) -> Floats:
    """Closed configurations that stand for the workspace, home first, (n, nv) [rad, m].

    They lie on ways from home: the driven joints (all joints, where those do not determine the mechanism) start at
    equal rates (slides in lengths of the mechanism) in all combinations of forwards, backwards and not at all; of more
    than three of them singly and in pairs, of more than eight singly. A way ends after a ``travel`` [rad, lengths of
    the mechanism] of the fastest joint, at a limit, or near a singular position. Steps are _STEP long, and shorter
    where limits leave little room.
    """
    headings, states = _headings(mechanism, closure), closure.home[None]
    for halvings in range(_HALVINGS + 1):
        states = closure.rays(headings, _STEP / 2**halvings, travel)
        if len(states) >= _FEWEST * closure.dof:
            break
    return states


def single_motions(mechanism: Mechanism) -> tuple[Floats, Floats]:
    """Configurations (n, nv) [rad, m] and rates (n, nv) over the workspace, one driven joint moving at a time.

    All rates are as large, slides in lengths of the mechanism.
    """
    closure = Closure(mechanism).without_idle()
    q = workspace_states(mechanism, closure)
    single = _one_at_a_time(mechanism, closure, q)
    sizes = np.linalg.norm(single / closure.scales[:, None], axis=1, keepdims=True)
    single = np.divide(single, sizes, out=np.zeros_like(single), where=sizes > 0.0)
    count = single.shape[2]
    return np.repeat(q, count, axis=0), np.ascontiguousarray(single.transpose(0, 2, 1)).reshape(len(q) * count, -1)


def _one_at_a_time(mechanism: Mechanism, closure: Closure, q: Floats) -> Floats:
    """Directions of motion at configurations ``q`` (n, nv), in each of which one driven joint moves, (n, nv, count).

    One of all joints, where those that are driven do not determine the mechanism; it takes others along then.
    """
    tangents, scale = closure.tangents(q), closure.scales
    driven = [mechanism.coordinate_index(joint) for joint in mechanism.driven]
    rates = tangents[:, driven] / scale[driven, None]
    if len(driven) == closure.dof and (np.linalg.cond(rates) < _DETERMINED).all():
        return np.asarray(tangents @ np.linalg.inv(rates))
    return np.asarray(tangents @ (tangents / scale[:, None]).transpose(0, 2, 1))


def _headings(mechanism: Mechanism, closure: Closure) -> Floats:
    """Directions of motion from home, (n, nv): see ``workspace_states``."""
    single = _one_at_a_time(mechanism, closure, closure.home[None])[0]
    count = single.shape[1]
    most = count if count <= _ALL_COMBINATIONS else 2 if count <= _PAIRS else 1
    return np.array(
        [
            single[:, list(chosen)] @ np.array(signs)
            for size in range(1, most + 1)
            for chosen in combinations(range(count), size)
            for signs in product((1.0, -1.0), repeat=size)
        ]
    )
