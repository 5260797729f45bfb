"""An engine as a mechanism file (MJCF), for Pinocchio, MuJoCo and the other commands of ``balance``."""

from ..errors import DataError
from .engine import Cylinder, Engine

_SMALL = 1e-9
"""Inertia given to a body that has none, which the format does not allow [kg m2]."""


def mjcf(engine: Engine, gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> str:
    """The engine as MJCF text: crankshaft about z, rods on its pins, pistons in their cylinders, loops by <connect>.

    The crankshaft must have mass, as the format asks of every body that moves. The file starts with the crankshaft's
    mark along x.
    """
    rods = [(i, c) for i, c in enumerate(engine.cylinders, 1) if c.crank.rod_mass > 0.0]
    if len(rods) < len(engine.cylinders) or any(c.crank.piston_mass <= 0.0 for c in engine.cylinders):
        raise DataError(f"{engine.name}: a mechanism file needs rods and pistons with mass")
    lines = [
        f'<mujoco model="{_name(engine.name)}">',
        '  <compiler angle="radian"/>',
        f'  <option gravity="{_vector(*gravity)}"/>',
        "  <worldbody>",
        '    <body name="base">',
        '      <body name="crankshaft">',
        '        <joint name="crankshaft" type="hinge" axis="0 0 1"/>',
        *_crank_inertia(engine),
    ]
    for i, cylinder in rods:
        lines += _rod(i, cylinder)
    lines.append("      </body>")
    for i, cylinder in rods:
        lines += _piston(i, cylinder)
    lines += ["    </body>", "  </worldbody>", "  <equality>"]
    lines += [f'    <connect name="pin_{i}" site1="rod_{i}_end" site2="piston_{i}_pin"/>' for i, _ in rods]
    lines += ["  </equality>", "  <actuator>", '    <motor name="starter" joint="crankshaft"/>', "  </actuator>"]
    return "\n".join([*lines, *_keyframe(engine), "</mujoco>", ""])


def _name(text: str) -> str:
    return "".join(letter if letter.isalnum() else "-" for letter in text)


def _vector(*values: float) -> str:
    return " ".join(repr(float(value)) for value in values)


def _crank_inertia(engine: Engine) -> list[str]:
    """Throws and counterweights as one rigid body; a counterweight is a point mass at one crank radius."""
    import numpy as np

    points = []
    for cylinder in engine.cylinders:
        at = cylinder.crank.crank_centre * np.exp(1j * cylinder.throw)
        points.append((cylinder.crank.crank_mass, at.real, at.imag, cylinder.at, cylinder.crank.crank_inertia))
    radius = engine.cylinders[0].crank.radius
    for weight in engine.counterweights:
        mass = abs(weight.vector) / radius
        at = weight.vector / mass if mass else 0j
        points.append((mass, at.real, at.imag, weight.at, 0.0))
    mass = sum(p[0] for p in points)
    if mass <= 0.0:
        raise DataError(f"{engine.name}: a mechanism file needs a crankshaft with mass: give crank_mass")
    places = np.array([p[1:4] for p in points])
    masses = np.array([p[0] for p in points])
    centre = masses @ places / mass
    inertia = np.eye(3) * sum(p[4] for p in points)
    for m, place in zip(masses, places - centre, strict=True):
        inertia += m * (place @ place * np.eye(3) - np.outer(place, place))
    if np.linalg.eigvalsh(inertia)[0] < _SMALL:
        inertia += _SMALL * np.eye(3)
    full = [inertia[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    return [f'        <inertial pos="{_vector(*centre)}" mass="{_vector(mass)}" fullinertia="{_vector(*full)}"/>']


def _rod(i: int, cylinder: Cylinder) -> list[str]:
    """On its pin, its frame's x axis from the crank pin to the piston pin."""
    import numpy as np

    crank = cylinder.crank
    pin = crank.radius * np.exp(1j * cylinder.throw)
    moment = max(crank.rod_inertia, _SMALL)
    return [
        f'        <body name="rod_{i}" pos="{_vector(pin.real, pin.imag, cylinder.at)}">',
        f'          <joint name="rod_{i}" type="hinge" axis="0 0 1"/>',
        f'          <inertial pos="{_vector(crank.rod_centre, 0, 0)}" mass="{_vector(crank.rod_mass)}" '
        f'diaginertia="{_vector(moment, moment, moment)}"/>',
        f'          <site name="rod_{i}_end" pos="{_vector(crank.rod_length, 0, 0)}"/>',
        "        </body>",
    ]


def _piston(i: int, cylinder: Cylinder) -> list[str]:
    """A slide along the cylinder's axis, from the foot of the crankshaft's axis on it."""
    import numpy as np

    crank = cylinder.crank
    axis = np.exp(1j * cylinder.bank)
    foot = 1j * axis * crank.offset
    moment = crank.piston_mass * crank.radius**2
    return [
        f'      <body name="piston_{i}" pos="{_vector(foot.real, foot.imag, cylinder.at)}">',
        f'        <joint name="piston_{i}" type="slide" axis="{_vector(axis.real, axis.imag, 0)}"/>',
        f'        <inertial pos="0 0 0" mass="{_vector(crank.piston_mass)}" '
        f'diaginertia="{_vector(moment, moment, moment)}"/>',
        f'        <site name="piston_{i}_pin" pos="0 0 0"/>',
        "      </body>",
    ]


def _keyframe(engine: Engine) -> list[str]:
    """Crankshaft at zero, every rod towards its cylinder: the way an engine is put together."""
    import numpy as np

    rods, pistons = [], []
    for cylinder in engine.cylinders:
        crank = cylinder.crank
        own = cylinder.throw - cylinder.bank
        lean = -np.arcsin((crank.radius * np.sin(own) - crank.offset) / crank.rod_length)
        rods.append(cylinder.bank + lean)
        pistons.append(crank.radius * np.cos(own) + crank.rod_length * np.cos(lean))
    return ["  <keyframe>", f'    <key name="home" qpos="{_vector(0.0, *rods, *pistons)}"/>', "  </keyframe>"]
