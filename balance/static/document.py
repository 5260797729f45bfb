"""What static balance has to say, as one document: every number of its tables and figure, units in the keys."""

from typing import Any

import numpy as np

from ..arrays import Floats
from ..closure import Closure
from ..conditions import Conditions
from ..dynamics.inverse_dynamics import driven_rates, simulate
from ..dynamics.regressor import potential
from ..mechanism import Mechanism
from ..motion import Samples
from ..sizing import Sizing
from .design import Springs
from .springs import joint_torques, lengths


def document(found: Conditions, counter: Sizing | None, springs: Springs) -> dict[str, Any]:
    """Conditions; the mechanism as it is, with counter-masses (None: no place for any), and with springs."""
    mechanism, q = springs.mechanism, springs.q
    weight = springs.weight()
    balanced = None if counter is None else potential(counter.after, q)
    return {
        "mechanism": mechanism.name,
        "gravity_m_per_s2": [float(x) for x in mechanism.gravity],
        "configurations": len(q),
        "conditions": [
            {"text": found.text(k), "value_kgm": float(value)} for k, value in enumerate(found.values(mechanism))
        ],
        "as_it_is": _balance(weight, weight, _holding(mechanism, q, None)),
        "counter_masses": None if counter is None or balanced is None else _counter(counter, balanced, weight, q),
        "springs": _balance(weight + springs.spring(), weight, _holding(mechanism, q, springs))
        | {"springs": _springs(springs)},
        "workspace": {
            "weight_J": weight.tolist(),
            "springs_J": springs.spring().tolist(),
            "with_counter_masses_J": None if balanced is None else balanced.tolist(),
        },
    }


def _counter(counter: Sizing, total: Floats, weight: Floats, q: Floats) -> dict[str, Any]:
    return _balance(total, weight, _holding(counter.after, q, None)) | {
        "masses_kg": {c.site: c.mass for c in counter.counter_masses},
        "added_mass_kg": counter.added_mass,
        "added_inertia_kgm2": counter.added_inertia,
    }


def _balance(total: Floats, weight: Floats, holding: dict[str, float]) -> dict[str, Any]:
    swing, whole = float(np.ptp(total)), float(np.ptp(weight))
    share = swing / whole if whole > 0.0 else None
    return {"potential_swing_J": swing, "share_of_unbalanced": share, "holding_torque_peak_Nm": holding}


def _springs(found: Springs) -> list[dict[str, Any]]:
    mechanism, length = found.mechanism, lengths(found.mechanism, found.springs, found.q)
    return [
        {
            "name": spring.name or f"spring {k}",
            "first": spring.first.text(mechanism),
            "second": spring.second.text(mechanism),
            "first_m": [float(x) for x in spring.first.position],
            "second_m": [float(x) for x in spring.second.position],
            "stiffness_N_per_m": spring.stiffness,
            "shortest_m": float(length[:, k - 1].min()),
            "longest_m": float(length[:, k - 1].max()),
            "force_peak_N": spring.stiffness * float(length[:, k - 1].max()),
        }
        for k, spring in enumerate(found.springs, 1)
    ]


def _holding(mechanism: Mechanism, q: Floats, springs: Springs | None) -> dict[str, float]:
    """Largest torque of each motor that holds the mechanism still; none where motors do not determine it."""
    closure, motors = Closure(mechanism), mechanism.driven or mechanism.coordinates
    if len(motors) != closure.dof:
        return {}
    place = q[:, [mechanism.coordinate_index(joint) for joint in motors]]
    rest = np.zeros_like(place)
    at = closure.follow(Samples(np.arange(float(len(q))), place, rest, rest, joints=motors))
    torque = dict(simulate(mechanism, at).torque)
    if springs is not None:
        needed = joint_torques(mechanism, springs.springs, at.q)
        extra = np.einsum("nij,ni->nj", driven_rates(mechanism, at.per_drive, motors), needed)
        torque = {joint: torque[joint] + extra[:, k] for k, joint in enumerate(motors)}
    return {joint: float(np.abs(values).max()) for joint, values in torque.items()}
