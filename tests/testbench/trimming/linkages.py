"""Runs of other mechanisms on a bench that stands still: encoders, motor torques and a force plate, simulated."""

from pathlib import Path

import mujoco
import numpy as np

from balance import datasets
from balance.closure import Closure, Trajectory
from balance.dynamics.inverse_dynamics import simulate
from balance.mechanism.mechanism import Mechanism
from balance.motion import Samples
from testbench.recording import Channel, UniformClock
from testbench.simulator.simulated_logs import MemoryRun
from testbench.store.run import StoredGroup

RATE = 1000.0
STEP = 1e-4
"""Over which the motion is differentiated [s]: to 1e-6."""
START = 0.213
"""When the forces' logger started, on the encoders' clock [s]."""

HEAD = """
name = "bench of {name}"
mechanism = "{name}"
[loggers.drive]
rate = "1 kHz"
[loggers.plate]
rate = "1 kHz"
"""
PLATE = """
[sensors.plate]
kind = "wrench"
logger = "plate"
channels = { Fx = "Fx", Fy = "Fy", Fz = "Fz", Mx = "Mx", My = "My", Mz = "Mz" }
range = { F = "500 N", M = "100 N m" }
position = ["0 m", "0 m", "0 m"]
[sensors.base_acc]
kind = "accelerometer"
logger = "plate"
channels = { x = "ax", y = "ay", z = "az" }
unit = "m/s^2"
position = ["0.3 m", "-0.2 m", "0 m"]
"""
ON_BASE = """
[sensors.base_{k}]
kind = "accelerometer"
logger = "drive"
channels = {{ x = "ax{k}", y = "ay{k}" }}
unit = "m/s^2"
position = ["{at[0]} m", "{at[1]} m", "0 m"]
"""
PLACES = (0.05, -0.2), (-0.2, -0.1)
"""Of accelerometers on a base that moves in its plane [m]."""
JOINT = """
[sensors.encoder_{joint}]
kind = "encoder"
logger = "drive"
channel = "q_{joint}"
joint = "{joint}"
[sensors.motor_{joint}]
kind = "torque"
logger = "drive"
channel = "tau_{joint}"
joint = "{joint}"
"""


def rig_text(mechanism: Mechanism, plate: bool = True) -> str:
    """The rig of a mechanism's bench."""
    joints = "".join(JOINT.format(joint=joint) for joint in mechanism.driven)
    return HEAD.format(name=mechanism.name) + joints + (PLATE if plate else "")


def run(
    mechanism: Mechanism,
    seed: int = 0,
    counter_masses=None,
    plate: bool = True,
    seconds: float = 4.0,
    rate: float = RATE,
    amplitude: float = 0.25,
    shaken: bool = False,
) -> MemoryRun:
    """A run of sines of an ``amplitude`` [rad] from rest to rest: forces to 0.1 N, positions to 2e-5 rad, torques to
    0.02 N m; ``shaken`` on a base that moves as the first joint does, by MuJoCo.
    """
    rng = np.random.default_rng(seed)
    mounted = mechanism.with_counter_mass(counter_masses or {})
    time = np.arange(0.0, seconds, 1.0 / rate)
    path = Closure(mounted).follow(motion(mounted, time, np.random.default_rng(5), amplitude))
    response = simulate(mounted, path)
    data, groups = {}, []
    drive = {f"q_{j}": path.q[:, mounted.coordinate_index(j)] + rng.normal(0, 2e-5, len(time)) for j in mounted.driven}
    drive |= {f"tau_{j}": response.torque[j] + rng.normal(0, 0.02, len(time)) for j in mounted.driven}
    text = rig_text(mechanism, plate)
    if shaken:
        base, speed = (rates[:, :1] * np.array([0.03, -0.02, -0.04]) for rates in (path.a, path.v))
        for joint, more in zip(mounted.driven, _base_torques(mounted, path, speed, base).T, strict=True):
            drive[f"tau_{joint}"] += more
        for k, (x, y) in enumerate(PLACES):
            drive |= {f"ax{k}": base[:, 0] - y * base[:, 2], f"ay{k}": base[:, 1] + x * base[:, 2]}
            text += ON_BASE.format(k=k, at=(x, y))
    groups.append(group("drive", drive, data, rate))
    if plate:
        cut = slice(round(START * rate), None)
        wrench = np.hstack([response.force, response.moment])[cut]
        names = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
        forces = {n: w + rng.normal(0, 0.1, len(w)) for n, w in zip(names, wrench.T, strict=True)}
        forces |= {a: rng.normal(0, 0.005, len(wrench)) for a in ("ax", "ay", "az")}
        groups.append(group("plate", forces, data, rate))
    conditions = {"counter_masses": counter_masses or {}}
    return MemoryRun(Path("linkage.h5"), tuple(groups), "simulated", conditions, text, (), {"data": data})


def _base_torques(mechanism: Mechanism, path: Trajectory, speed: np.ndarray, base: np.ndarray) -> np.ndarray:
    """Torques (n, joints) [N m] of a planar arm that a small motion of its base in its plane adds.

    Of speeds (n, 3) [m/s, rad/s] and accelerations (n, 3) [m/s2, rad/s2].
    """
    text = datasets.find_dataset(mechanism.name, "mechanisms", ".xml").read_text("utf-8").partition("<keyframe>")[0]
    joints = "<inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/>"
    joints += "<joint type='slide' axis='1 0 0'/><joint type='slide' axis='0 1 0'/><joint/>"
    engine = mujoco.MjModel.from_xml_string(
        text.replace('<body name="base">', f'<body name="base">{joints}') + "</mujoco>"
    )
    state, found = mujoco.MjData(engine), np.zeros_like(path.q)
    for k, (angles, rates, moves, moved) in enumerate(zip(path.q, path.v, speed, base, strict=True)):
        for sign in (1.0, -1.0):
            state.qpos[3:], state.qvel[3:], state.qvel[:3], state.qacc[:3] = angles, rates, sign * moves, sign * moved
            mujoco.mj_inverse(engine, state)
            found[k] += 0.5 * sign * state.qfrc_inverse[3:]
    return found


def exact_run(mechanism: Mechanism, seconds: float = 6.0, rate: float = 500.0) -> MemoryRun:
    """Encoders, torques and a force plate on one logger, without noise; the motion has nothing above 10 Hz.

    Cosines within a Gaussian window, derivatives written out: filters and splines change them by 1e-11 of their size.
    The same forwards and backwards in time, so that sensors show the same at rest before and after.
    """
    time = np.arange(0.0, seconds, 1.0 / rate)
    home = np.array([mechanism.home[mechanism.coordinate_index(joint)] for joint in mechanism.driven])
    z = (time - 0.5 * time[-1])[:, None] / (seconds / 14.0)
    omega = 2 * np.pi * np.array([1.1, 1.7])[: len(home)]
    rate_of_window = 14.0 / seconds
    wave = 0.6 * np.exp(-0.5 * z**2 + 1j * omega * (time[:, None] - 0.5 * time[-1]))
    slope = 1j * omega - z * rate_of_window
    samples = Samples(
        time, home + wave.real, (slope * wave).real, ((slope**2 - rate_of_window**2) * wave).real, mechanism.driven
    )
    path = Closure(mechanism).follow(samples)
    response = simulate(mechanism, path)
    values = {f"q_{j}": path.q[:, mechanism.coordinate_index(j)] for j in mechanism.driven}
    values |= {f"tau_{j}": response.torque[j] for j in mechanism.driven}
    names = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
    values |= dict(zip(names, np.hstack([response.force, response.moment]).T, strict=True))
    text = rig_text(mechanism).partition("[sensors.base_acc]")[0].replace('logger = "plate"', 'logger = "drive"')
    data: dict[str, np.ndarray] = {}
    return MemoryRun(
        Path("exact.h5"),
        (group("drive", values, data, rate),),
        "simulated",
        {"counter_masses": {}},
        text,
        (),
        {"data": data},
    )


UNITS = {"q": "rad", "t": "N m", "F": "N", "M": "N m", "a": "m/s^2"}


def group(name: str, columns: dict[str, np.ndarray], data: dict[str, np.ndarray], rate: float) -> StoredGroup:
    """The columns (n,) as one logger's, their values put into ``data``."""
    data.update({f"{name}/{key}": values for key, values in columns.items()})
    channels = tuple(Channel(key, UNITS[key[0]]) for key in columns)
    count = len(next(iter(columns.values())))
    return StoredGroup(name, channels, UniformClock(rate), None, count, rate, "declared", None, name, tuple(columns))


def motion(mechanism: Mechanism, time: np.ndarray, rng: np.random.Generator, amplitude: float) -> Samples:
    """Sines of each driven joint within a window that begins and ends at rest."""
    home = np.array([mechanism.home[mechanism.coordinate_index(joint)] for joint in mechanism.driven])
    omega = 2 * np.pi * rng.uniform(0.8, 4.0, (3, len(home)))
    phase = rng.uniform(0, 2 * np.pi, omega.shape)
    end = time[-1]

    def position(at: np.ndarray) -> np.ndarray:
        window = np.where((at > 0.4) & (at < end - 0.4), np.sin(np.pi * (at - 0.4) / (end - 0.8)) ** 4, 0.0)[:, None]
        return home + window * sum(
            amplitude * np.sin(np.multiply.outer(at, w) + p) for w, p in zip(omega, phase, strict=True)
        )

    # differences over samples at 250 Hz are 0.3 % low in a wave of 4 Hz, which would seem to be missing
    before, q, after = (position(time + by) for by in (-STEP, 0.0, STEP))
    return Samples(time, q, (after - before) / (2.0 * STEP), (after - 2.0 * q + before) / STEP**2, mechanism.driven)
