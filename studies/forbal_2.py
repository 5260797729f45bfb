"""Forecast of what Forbal-2 exerts on its base and what its drives give, for the motions that its repository sends.

    python -m studies.forbal_2 > docs/validation/forbal-2-forecast.md

Written before anything measured was looked at, to be held against measurements when there are some. The motions are
those of `19_forbal2_commands_constant.txt` and `20_forbal2_commands_trapezoid.txt` (`testbench recordings fetch`), by
the laws of that repository's controller (forbal_controllers/src/forbal2.cpp, MIT): Hermite cubics through the
way-points, the speed along them constant in their parameter or trapezoidal, a joint position each 10 ms by its inverse
kinematics. What follows such positions is smoothed: everything is forecast below CUTOFF_HZ, and measurements must be
smoothed alike. Friction, drive inertia and tracking errors are not known, and not in it.
"""

import hashlib
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from balance import datasets
from balance.arrays import Floats
from balance.closure import Closure
from balance.dynamics.inverse_dynamics import driven_rates
from balance.dynamics.regressor import driven_torque_regressor, first_moment_regressor, wrench_regressor
from balance.mechanism.mechanism import Mechanism
from balance.mechanism.mjcf_parser import load_mechanism, mechanism_from_text
from balance.motion import Samples
from testbench import public_recordings
from testbench.kinematics.smoothing_and_derivatives import smoothed_derivatives

FILES = {"constant": "19_forbal2_commands_constant.txt", "trapezoid": "20_forbal2_commands_trapezoid.txt"}
DATE = "2026-11-22"
"""Day of the forecast."""
LINK_M, LAST_LINK_M, ORIGIN_M = 0.2, 0.225, (0.01616, 0.2275)
"""Of the controller's inverse kinematics (forbal2.yaml): links, the last with its tool, origin in x and z."""
STEP_S, REST_S = 0.01, 0.5
"""Step of the controller's joint positions; rest before and after a motion [s]."""
CUTOFF_HZ = 10.0
DRAWS, SEED = 1000, 1
LINK_MASS, LINK_CENTRE_M = 0.05, 0.002
"""Standard uncertainties of a link by its drawing: of its mass, as a share (print, screws, cables), and of its centre
along each axis [m]. Inertia scales with the mass."""
RING_MASS, RING_PLACE_M = 0.005, 0.0005
"""Standard uncertainties of a steel ring: of its mass, as a share (a kitchen scale), and of its place [m]."""
QUANTITIES = ("Fx [N]", "Fz [N]", "My [N m]", "My with weight [N m]", "joint11 [N m]", "joint21 [N m]")
"""Force and moment of the mechanism on its base, about the base frame's origin, without weight; the moment's change
with the weight that moves; torques of the drives, gravity included."""


_ABOUT = f"""# Forecast for Forbal-2

Made on {DATE}, before anything measured on this machine was looked at. SHA-256 of the rows of the table below, joined by
newlines: `{{digest}}`.

What the machine exerts on its base and what its drives give, for the motions of its repository: {{sources}}.
Mechanism: `datasets/mechanisms/forbal-2.xml` (SHA-256 `{{mechanism}}`),
with the three steel rings that are its counter-masses, and without. `studies/forbal_2.py` computes it; its docstring has
the laws. Of that repository the description, the controller and its commands were read. After the forecast was made, and
without any change to it, a layout of plots was opened (`forbal_description/launch/cnt_rft.xml`), which shows axes of plots.

* Fx, Fz, My: force and moment of the mechanism on its base about the origin of the base frame, weight excluded; "My with
  weight" is the change of My from the start, the weight that moves included: what a sensor below the base shows.
* Torques of the drives include gravity; **friction, the drives' own inertia and tracking errors are not known and not in
  them**. A drive's own inertia adds to the moment on the base, too.
* Everything is below {CUTOFF_HZ:g} Hz (zero phase, fourth order): measurements must be smoothed alike. The controller
  sends a position each 10 ms; what the drives make of its jumps in speed is above that.
* Intervals are of 95 %, by {DRAWS} draws of what is not known of the bodies: standard uncertainties of
  {100 * LINK_MASS:g} % of the mass and {1e3 * LINK_CENTRE_M:g} mm of the centre of a link (its drawing's values, with print,
  screws, cables), {100 * RING_MASS:g} % and {1e3 * RING_PLACE_M:g} mm of a ring. These were chosen beforehand; nobody weighed
  the parts for this. With the rings the file's own values balance nearly all, and lie at the lower end of what such parts do.

| motion | rings | quantity | largest value | root mean square |
|---|---|---|---|---|"""  # noqa: E501


@dataclass(frozen=True)
class Path:
    """A motion of the repository."""

    name: str
    time: Floats
    """Of the way-points (k,) [s]."""
    place: Floats
    """Of the tool in x and z, (k, 2) [m]."""
    law: str
    """``constant_waypoints``, ``trapezoidal_waypoints``, or ``joint_trajectory``."""
    acceleration_s: float
    """Duration of each end's acceleration, of the trapezoidal law [s]."""


def paths() -> Iterator[Path]:
    """The motions that the two files name "trajectory"."""
    for kind, file in FILES.items():
        path = public_recordings.local_recording(file)
        text = (path or public_recordings.fetch(public_recordings.recording_named(file))).read_text("utf-8")
        for part in text.split("## trajectory ")[1:]:
            title, found = part.partition("\n")[0], dict(re.findall(r"(\w+):\s*\[([^\]]*)\]", part))
            time, x, z = (np.array([float(v) for v in found[key].split(",")]) for key in ("time", "x", "z"))
            law, ends = re.search(r"type: '(\w+)'", part), re.search(r"acc_time: ([\d.]+)", part)
            assert law is not None
            assert ends is not None
            yield Path(f"{kind} {title}", time, np.column_stack([x, z]), law[1], float(ends[1]))


def joint_positions(path: Path) -> Floats:
    """Positions of joint11 and joint21 that the controller sends, a row each STEP_S, (n, 2) [rad]."""
    time = np.arange(round(path.time[-1] / STEP_S) + 1) * STEP_S
    if path.law == "joint_trajectory":
        return np.asarray(_hermite(path.time, inverse_kinematics(path.place))(time))
    spline = _hermite(path.time, path.place)
    if path.law == "trapezoidal_waypoints":
        end, ramp = float(path.time[-1]), path.acceleration_s
        rate = 1.0 / (end - ramp)  # so that the whole way is done: share of the parameter per s at full speed
        share = np.select(
            [time <= ramp, time <= end - ramp],
            [0.5 * rate / ramp * time**2, rate * (time - 0.5 * ramp)],
            1.0 - 0.5 * rate / ramp * (end - time) ** 2,
        )
        time = share * end
    return inverse_kinematics(np.asarray(spline(time)))


def _hermite(time: Floats, values: Floats) -> CubicHermiteSpline:
    """Cubics with slopes by three points, at rest at both ends."""
    before, after = np.diff(time)[:-1, None], np.diff(time)[1:, None]
    slope = np.zeros_like(values)
    chord = np.diff(values, axis=0) / np.diff(time)[:, None]
    slope[1:-1] = (chord[:-1] * after + chord[1:] * before) / (before + after)
    return CubicHermiteSpline(time, values, slope)


def inverse_kinematics(place: Floats) -> Floats:
    """joint11 and joint21 (n, 2) [rad] for the tool's ``place`` (n, 2) [m], by the controller's formulas."""
    x, z = (place - ORIGIN_M).T
    far = np.hypot(x, z)
    beta = np.arccos((LINK_M**2 + LAST_LINK_M**2 - far**2) / (2.0 * LINK_M * LAST_LINK_M))
    gamma = np.arccos((far**2 + LINK_M**2 - LAST_LINK_M**2) / (2.0 * LINK_M * far))
    second = gamma + np.arctan(z / x)
    return np.column_stack([np.pi - beta - second, second])


def machine(rings: bool) -> Mechanism:
    """Forbal-2 with its counter-masses, or without."""
    text = load_mechanism("forbal-2").text
    if rings:
        return mechanism_from_text(text, "forbal-2")
    root = ElementTree.fromstring(text)
    for parent in list(root.iter("body")):
        for ring in [body for body in parent.findall("body") if body.get("name", "").startswith("ring_")]:
            parent.remove(ring)
    return mechanism_from_text(ElementTree.tostring(root, encoding="unicode"), "forbal-2 without rings")


def drawn_parameters(mechanism: Mechanism) -> Floats:
    """Inertial parameters by the stated uncertainties, the file's first, (1 + DRAWS, 10 nb) [kg, kg m, kg m2]."""
    rng, drawn = np.random.default_rng(SEED), np.zeros((1 + DRAWS, *mechanism.parameters.shape))
    for body, (row, own) in mechanism.own_mass.items():
        mass, place = (RING_MASS, RING_PLACE_M) if body.startswith("ring_") else (LINK_MASS, LINK_CENTRE_M)
        share = np.r_[0.0, mass * rng.normal(size=DRAWS)]
        moved = np.vstack([np.zeros(3), place * rng.normal(size=(DRAWS, 3))])
        centre = own[1:4] / own[0]
        at = centre + moved
        changed = own * np.ones((1 + DRAWS, 1))
        changed[:, 1:4] = own[0] * at
        changed[:, 4:] += own[0] * (_about(at) - _about(centre[None]))
        drawn[:, row] += changed * (1.0 + share)[:, None]
    return drawn.reshape(1 + DRAWS, -1)


def _about(at: Floats) -> Floats:
    """Inertia of a unit mass at places (n, 3) [m] about the origin: Ixx, Ixy, Iyy, Ixz, Iyz, Izz, (n, 6) [m2]."""
    x, y, z = at.T
    return np.column_stack([y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z, x * x + y * y])


def forecast(path: Path, mechanism: Mechanism) -> Floats:
    """Largest absolute value and root mean square of each quantity, (2, quantities, 1 + DRAWS); the file's first."""
    still = round(REST_S / STEP_S)
    sent = np.pad(joint_positions(path), ((still, still), (0, 0)), mode="edge")
    moved = smoothed_derivatives(sent, CUTOFF_HZ, 1.0 / STEP_S)
    time = np.arange(len(sent)) * STEP_S
    way = Closure(mechanism).follow(Samples(time, moved.q, moved.v, moved.a, mechanism.driven))
    rates = driven_rates(mechanism, way.per_drive, mechanism.driven)
    wrench = wrench_regressor(mechanism, way.q, way.v, way.a)
    first = first_moment_regressor(mechanism, way.q)
    g = float(np.linalg.norm(mechanism.gravity))
    weight = g * first[:, 0]  # My of a weight along -z at x is + g x
    rows = [wrench[:, 0], wrench[:, 2], wrench[:, 4], wrench[:, 4] + weight - weight[:1]]
    rows += list(np.moveaxis(driven_torque_regressor(mechanism, way.q, way.v, way.a, rates), 1, 0))
    values = np.einsum("qnp,dp->qnd", np.array(rows), drawn_parameters(mechanism))
    return np.array([np.abs(values).max(axis=1), np.sqrt(np.mean(values**2, axis=1))])


def table_rows(known: list[Path]) -> Iterator[str]:
    """The forecast's table, a row a motion, machine and quantity: the file's value and its 95 % interval."""
    for path in known:
        for rings in (True, False):
            found = forecast(path, machine(rings))
            for k, quantity in enumerate(QUANTITIES):
                ends = np.quantile(found[:, k, 1:], [0.025, 0.975], axis=1).T
                cells = [
                    f"{one[k, 0]:.4g} [{low:.4g}, {high:.4g}]" for one, (low, high) in zip(found, ends, strict=True)
                ]
                yield f"| {path.name} | {'with' if rings else 'without'} | {quantity} | {cells[0]} | {cells[1]} |"


def page() -> str:
    """The forecast as it stands in docs/validation."""
    rows = list(table_rows(list(paths())))
    digest = hashlib.sha256("\n".join(rows).encode()).hexdigest()
    sources = "; ".join(public_recordings.recording_named(file).credit for file in FILES.values())
    return "\n".join([_ABOUT.format(digest=digest, mechanism=_digest_of_mechanism(), sources=sources), *rows, ""])


def _digest_of_mechanism() -> str:
    return hashlib.sha256((datasets.ROOT / "mechanisms" / "forbal-2.xml").read_bytes()).hexdigest()


if __name__ == "__main__":
    sys.stdout.write(page())
