"""Active balancing: masses driven along x and y and a disc driven about z, so that the base feels nothing.

The masses keep the first moment of mass constant, m_a x_a = -(S_x - mean), the disc the angular momentum,
J_a w_a = -L; the masses run on lines through the base's origin. Stroke and force follow, bandwidth does not enter.

Mirror images of the mechanism, beside it on the same base and geared to the same motors.

An image under the reflection or half turn T about the base's origin exerts F' = T F and Mz' = det(T) Mz. One image
cancels what T reverses and doubles the rest; three images (both mirrors and the half turn) cancel all.
"""

from dataclasses import replace

import numpy as np

from ..arrays import Floats
from ..closure import Trajectory
from ..dynamics.inverse_dynamics import Response, momentum, simulate
from ..dynamics.regressor import first_moment
from ..mechanism.mechanism import Mechanism
from .outcome import Outcome

_NOTHING = 1e-9
"""First moment [kg m] or angular momentum [kg m2/s] below which an axis needs no mass."""


def active_outcome(mechanism: Mechanism, trajectory: Trajectory, stroke: float, turn: float) -> Outcome:
    """The outcome of masses that move ``stroke`` [m] and a disc that turns ``turn`` [rad], both from end to end."""
    response = simulate(mechanism, trajectory)
    needs, mass = _masses(mechanism, trajectory, response, stroke)
    disc, inertia = _disc(mechanism, trajectory, response, turn)
    still = np.zeros_like(response.force)
    note = "masses on lines through the base's origin and a disc, each with its own motor; ideal control"
    return Outcome("active", still, still, response.torque, mass, inertia, needs | disc, note)


def _masses(
    mechanism: Mechanism, trajectory: Trajectory, response: Response, stroke: float
) -> tuple[dict[str, float], float]:
    """What each axis needs, and the mass of all."""
    moment, linear = first_moment(mechanism, trajectory.q), momentum(mechanism, trajectory.q, trajectory.v)
    needs: dict[str, float] = {}
    total = 0.0
    for axis, name in enumerate("xy"):
        swing = float(np.ptp(moment[:, axis]))
        if swing < _NOTHING:
            continue
        mass = swing / stroke
        speed, force = -linear[:, axis] / mass, response.force[:, axis]
        needs |= {
            f"mass_{name}_kg": mass,
            f"stroke_{name}_m": swing / mass,
            f"force_{name}_peak_N": float(np.abs(force).max()),
            f"speed_{name}_peak_m_per_s": float(np.abs(speed).max()),
            f"power_{name}_peak_W": float(np.abs(force * speed).max()),
        }
        total += mass
    return needs, total


def _disc(
    mechanism: Mechanism, trajectory: Trajectory, response: Response, turn: float
) -> tuple[dict[str, float], float]:
    """What the disc needs, and its inertia."""
    angular = momentum(mechanism, trajectory.q, trajectory.v)[:, 5]
    swept = _integral(trajectory.time, angular)
    swing = float(np.ptp(swept))
    if float(np.abs(angular).max()) < _NOTHING or swing == 0.0:
        return {}, 0.0
    inertia = swing / turn
    speed, torque = -angular / inertia, response.moment[:, 2]
    return {
        "disc_kgm2": inertia,
        "disc_turn_rad": swing / inertia,
        "disc_drift_rad": -float(swept[-1]) / inertia,
        "disc_torque_peak_Nm": float(np.abs(torque).max()),
        "disc_speed_peak_rad_per_s": float(np.abs(speed).max()),
        "disc_power_peak_W": float(np.abs(torque * speed).max()),
    }, inertia


def _integral(time: Floats, values: Floats) -> Floats:
    """From the first instant, by trapezoids."""
    return np.concatenate([[0.0], np.cumsum(0.5 * np.diff(time) * (values[1:] + values[:-1]))])


IMAGES = {
    "mirror image, left-right": ((-1.0, 1.0),),
    "mirror image, up-down": ((1.0, -1.0),),
    "image turned by 180 deg": ((-1.0, -1.0),),
    "three images": ((-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)),
}
"""Signs of x and y for each image of a method."""


def mirror_outcome(mechanism: Mechanism, trajectory: Trajectory) -> list[Outcome]:
    """The outcome of each set of images, none of them balanced otherwise."""
    own = simulate(mechanism, trajectory)
    return [_with_images(mechanism, trajectory, own, name, signs) for name, signs in IMAGES.items()]


def _with_images(
    mechanism: Mechanism, trajectory: Trajectory, own: Response, name: str, images: tuple[tuple[float, float], ...]
) -> Outcome:
    force, moment = own.force.copy(), own.moment.copy()
    torque = {joint: values.copy() for joint, values in own.torque.items()}
    for sx, sy in images:
        flip = np.array([sx, sy, 1.0])
        # An image under gravity g needs the torque of the mechanism itself under T g.
        image = simulate(replace(mechanism, gravity=flip * mechanism.gravity), trajectory)
        force += flip * own.force
        moment += sx * sy * flip * own.moment
        torque = {joint: values + image.torque[joint] for joint, values in torque.items()}
    count = len(images)
    inertia = float(sum(mechanism.parameters[b, 9] for b in range(len(mechanism.bodies))))
    note = f"{count} more mechanism{'s' * (count > 1)}, driven by the same motors; "
    note += "cancels all" if count == 3 else _left(*images[0])
    return Outcome(name, force, moment, torque, count * mechanism.total_mass, count * inertia, {}, note)


def _left(sx: float, sy: float) -> str:
    gone = [what for what, sign in (("Fx", sx), ("Fy", sy), ("Mz", sx * sy)) if sign < 0.0]
    kept = [what for what in ("Fx", "Fy", "Mz") if what not in gone]
    return f"cancels {' and '.join(gone)}, doubles {' and '.join(kept)}"
