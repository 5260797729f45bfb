"""Mirror images of the mechanism, beside it on the same base and geared to the same motors.

An image under the reflection or half turn T about the base's origin exerts F' = T F and Mz' = det(T) Mz. One image
cancels what T reverses and doubles the rest; three images (both mirrors and the half turn) cancel all.
"""

from dataclasses import replace

import numpy as np

from ..closure import Trajectory
from ..dynamics.inverse_dynamics import Response, simulate
from ..mechanism import Mechanism
from .outcome import Outcome

IMAGES = {
    "mirror image, left-right": ((-1.0, 1.0),),
    "mirror image, up-down": ((1.0, -1.0),),
    "image turned by 180 deg": ((-1.0, -1.0),),
    "three images": ((-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)),
}
"""Signs of x and y for each image of a method."""


def applied(mechanism: Mechanism, trajectory: Trajectory) -> list[Outcome]:
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
