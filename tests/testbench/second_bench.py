"""A second simulated bench, from Newton and Euler by hand: a two-link arm on a frame that six springs let move.

It shares nothing with the packages, so that what both would misread shows: rotations by unit quaternions, the frame's
motion not linearised, with Coriolis, centrifugal and gyroscopic loads and gravity; sensors in volts with offsets.
Axes of the frame: x to the right, y up, z towards the viewer; angles are counted about z, links lie normal to z.
"""

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

Array = np.ndarray
GRAVITY = np.array([0.0, -9.81, 0.0])
SHOULDER = np.array([0.10, 0.15, 0.05])
ELBOW = np.array([0.32, 0.0, 0.02])  # from the shoulder, along link 1
MASS, ALONG = (3.0, 2.2), (0.16, 0.12)  # of the links [kg]; their centres from the joint, along the link [m]
INERTIA = (np.diag([0.002, 0.030, 0.031]), np.diag([0.001, 0.015, 0.0155]))  # about the centres, own axes
COUNTER = (
    np.array([-0.20, 0.0, 0.04]),
    np.array([-0.10, 0.0, -0.03]),
)  # of a point mass on each link [m]
FRAME_MASS, FRAME_CENTRE = 95.0, np.array([0.02, -0.15, -0.10])
FRAME_INERTIA = np.array([[9.0, 0.3, 0.0], [0.3, 8.0, 0.2], [0.0, 0.2, 11.0]])  # about the frame's centre [kg m2]
FEET = np.array([[x, -0.45, z] for x in (-0.35, 0.40) for z in (-0.35, 0.25)])
SPRING, DAMPER = np.array([1.6e5, 3.0e5, 2.0e5]), np.array([260.0, 400.0, 300.0])  # of a foot, axes of the floor
ACCELEROMETERS = {"A": (0.25, -0.10, 0.10), "B": (-0.25, -0.10, 0.15), "C": (0.0, 0.30, -0.20)}  # on the frame [m]
CELLS = {"P": (-0.10, 0.05, 0.12), "Q": (0.30, 0.05, 0.10), "R": (0.10, 0.05, -0.15)}  # under the arm, three axes each
VOLTS_PER = {"A": 0.0512, "B": 0.0497, "C": 0.0505, "P": 0.0040, "Q": 0.0041, "R": 0.0039}  # V per m/s2, V per N
OFFSET = {"A": 2.50, "B": 2.47, "C": 2.52, "P": 0.31, "Q": -0.22, "R": 0.08}  # [V]
NOISE_V = {"A": 5e-5, "B": 5e-5, "C": 5e-5, "P": 2e-4, "Q": 2e-4, "R": 2e-4}
ENCODER_STEP = 2.0 * np.pi / 2**17
MOVES = ((0, 0.6, 0.5, 1.1), (1, 0.9, 0.45, -1.4), (0, 1.6, 0.45, -1.1), (1, 1.9, 0.5, 1.4))  # link, from, for [s], by
START, END, STEP = (0.4, 0.7), 3.6, 2e-3  # angles at rest [rad], end of the motion with its decay [s], of a step [s]
CONTROLLER_RATE, DAQ_RATE, DAQ_START, DAQ_DRIFT = 1000.0, 2000.0, -0.173, 20e-6  # its clock is (1 + drift)(t - start)


def angles(t: Array) -> tuple[Array, Array, Array]:
    """Angle of each joint, its rate and second rate at times (n,), (n, 2) each: moves of degree seven, then rest."""
    found = [np.tile(START, (len(t), 1)), np.zeros((len(t), 2)), np.zeros((len(t), 2))]
    for link, begin, length, by in MOVES:
        s = np.clip((t - begin) / length, 0.0, 1.0)
        found[0][:, link] += by * s**4 * (35.0 - 84.0 * s + 70.0 * s**2 - 20.0 * s**3)
        found[1][:, link] += by / length * 140.0 * s**3 * (1.0 - s) ** 3
        found[2][:, link] += by / length**2 * 420.0 * s**2 * (1.0 - s) ** 2 * (1.0 - 2.0 * s)
    return found[0], found[1], found[2]


def cross(a: Array, b: Array) -> Array:
    """Vector product along the last axis."""
    (yzx, zxy), axis = ([1, 2, 0], [2, 0, 1]), -1
    return a.take(yzx, axis) * b.take(zxy, axis) - a.take(zxy, axis) * b.take(yzx, axis)


def skew(a: Array) -> Array:
    """The matrices S with S b = a x b, (p, 3, 3)."""
    return cross(a[:, None], np.eye(3)).transpose(0, 2, 1)


def times(matrices: Array, vectors: Array) -> Array:
    """Matrices (p, i, j) times vectors (p, k, j), (p, k, i)."""
    return np.einsum("pij,pkj->pki", matrices, vectors)


def turned(quaternion: Array) -> Array:
    """Rotation matrices of unit quaternions (k, 4), scalar first, from the frame's axes to the floor's, (k, 3, 3)."""
    across = skew(quaternion[:, 1:])
    return np.eye(3) + 2.0 * quaternion[:, :1, None] * across + 2.0 * across @ across


def distribution(places: Array) -> Array:
    """Forces at places (p, 3) of least squares that make up a wrench about the origin, (3 p, 6)."""
    return np.linalg.pinv(np.vstack([np.tile(np.eye(3), len(places)), np.hstack(list(skew(places)))]))


class Pieces(NamedTuple):
    """Rigid pieces on the frame, the frame itself first, at n instants, in its axes: (n, p, ...), p pieces."""

    mass: Array  # (p, k) in k cases [kg]
    place: Array
    velocity: Array
    acceleration: Array
    spin: Array
    spin_rate: Array
    inertia: Array  # about the pieces' centres, (n, p, 3, 3)


def pieces(q: Array, v: Array, a: Array, counter: Array) -> Pieces:
    """Frame, links and what is mounted on the links (k, 2) [kg], from the angles, rates and second rates (n, 2)."""
    count, cases, none, z = len(q), len(counter), np.zeros((len(q), 3)), np.array([0.0, 0.0, 1.0])
    found = [(np.full(cases, FRAME_MASS), none + FRAME_CENTRE, *[none] * 4, np.tile(FRAME_INERTIA, (count, 1, 1)))]
    joint, joint_v, joint_a = none + SHOULDER, none, none
    for link in (0, 1):
        angle, rate, second = (x[:, : link + 1].sum(axis=1) for x in (q, v, a))
        along = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
        turn = np.stack([along, cross(z, along), none + z], axis=2)
        spin, spin_rate, inertia = (
            rate[:, None] * z,
            second[:, None] * z,
            turn @ INERTIA[link] @ turn.transpose(0, 2, 1),
        )
        own = (np.full(cases, MASS[link]), np.array([ALONG[link], 0.0, 0.0]), inertia)
        for mass, at, about in (own, (counter[:, link], COUNTER[link], 0.0 * inertia), (None, ELBOW, None)):
            arm = turn @ at
            place, velocity = joint + arm, joint_v + cross(spin, arm)
            moved = joint_a + cross(spin_rate, arm) + cross(spin, cross(spin, arm))
            if mass is not None:
                found.append((mass, place, velocity, moved, spin, spin_rate, about))
        joint, joint_v, joint_a = place, velocity, moved
    mass, *others = zip(*found, strict=True)
    return Pieces(np.array(mass), *(np.stack(each, axis=1) for each in others))


def loads(p: Pieces, i: int, omega: Array, down: Array) -> tuple[Array, Array, Array]:
    """Of each piece about the frame's origin, forces before moments, on a frame turning at ``omega`` (k, 3): what moves
    it, (p, k, 6, 6) times the frame's accelerations plus (p, k, 6), and its weight (p, k, 6).
    """
    place, spin, mass, across = p.place[i][:, None], p.spin[i][:, None], p.mass[:, :, None], skew(p.place[i])
    carried = cross(omega, cross(omega, place) + 2.0 * p.velocity[i][:, None]) + p.acceleration[i][:, None]
    total, turning = omega + spin, p.spin_rate[i][:, None] + cross(omega, spin)
    about = times(p.inertia[i], turning) + cross(total, times(p.inertia[i], total))
    by_mass = np.zeros((len(mass), 6, 6))
    by_mass[:, :3, :3], by_mass[:, :3, 3:] = np.eye(3), -across
    by_mass[:, 3:, :3], by_mass[:, 3:, 3:] = across, -across @ across
    matrix = mass[..., None] * by_mass[:, None]
    matrix[:, :, 3:, 3:] += p.inertia[i][:, None]
    force, heavy = mass * carried, mass * down
    return matrix, np.dstack([force, cross(place, force) + about]), np.dstack([heavy, cross(place, heavy)])


def feet(x: Array, turn: Array, v: Array, omega: Array, preload: Array) -> Array:
    """What the feet exert on the frame, (k, 6), its axes; ``x``, ``v`` of its origin and ``preload`` in the floor's."""
    moved = x[:, None] + np.einsum("kij,fj->kfi", turn, FEET) - FEET
    rate = v[:, None] + np.einsum("kij,kfj->kfi", turn, cross(omega[:, None], FEET))
    force = np.einsum("kji,kfj->kfi", turn, preload - SPRING * moved - DAMPER * rate)
    return np.concatenate([force, cross(FEET, force)], axis=2).sum(axis=1)


def simulate(counters: Sequence[tuple[float, float]]) -> dict[str, Array]:
    """The arm with each pair of counter-masses [kg]: ``time`` (n,), ``wrench`` on the frame without weight (n, k, 6),
    ``load`` with it (n, k, 6), and by sensor ``A`` ... what an ideal accelerometer there shows, a - g, (n, k, 3).
    """
    time = np.arange(0.0, END, STEP)
    arm = pieces(*angles(np.arange(2 * len(time) + 1) * STEP / 2.0), np.array(counters, dtype=float))
    at_rest = loads(arm, 0, np.zeros(3), GRAVITY)[2].sum(axis=0)
    preload = -(at_rest @ distribution(FEET).T).reshape(-1, 4, 3)
    places = np.array(list(ACCELEROMETERS.values()))[:, None]

    def rates(state: Array, i: int) -> tuple[Array, ...]:
        x, quaternion, v, omega = state[:, :3], state[:, 3:7], state[:, 7:10], state[:, 10:]
        turn = turned(quaternion)
        down = GRAVITY @ turn
        matrix, rest, heavy = loads(arm, i, omega, down)
        push = feet(x, turn, v, omega, preload) + (heavy - rest).sum(axis=0)
        moved = np.linalg.solve(matrix.sum(axis=0), push[:, :, None])[:, :, 0]
        half, vector = 0.5 * omega, quaternion[:, 1:]
        spun = [-np.sum(half * vector, axis=1, keepdims=True), quaternion[:, :1] * half + cross(vector, half)]
        done = np.hstack([v, *spun, times(turn, moved[:, None, :3])[:, 0], moved[:, 3:]])
        wrench = -(times(matrix.sum(axis=0) - matrix[0], moved[:, None])[:, 0] + rest[1:].sum(axis=0))
        felt = moved[:, :3] + cross(moved[:, 3:], places) + cross(omega, cross(omega, places)) - down
        return done, wrench, wrench + heavy[1:].sum(axis=0), felt

    state = np.tile(np.append([0.0, 0.0, 0.0, 1.0], np.zeros(9)), (len(counters), 1))
    shown = []
    for i in range(0, 2 * len(time), 2):
        k1, *found = rates(state, i)
        shown.append(found)
        k2 = rates(state + 0.5 * STEP * k1, i + 1)[0]
        k3 = rates(state + 0.5 * STEP * k2, i + 1)[0]
        state = state + STEP / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + rates(state + STEP * k3, i + 2)[0])
        state[:, 3:7] /= np.linalg.norm(state[:, 3:7], axis=1, keepdims=True)
    wrench, load, felt = map(np.array, zip(*shown, strict=True))
    return {"time": time, "wrench": wrench, "load": load} | {n: felt[:, i] for i, n in enumerate(ACCELEROMETERS)}


def write_logs(folder: Path, name: str, truth: dict[str, Array], case: int, seed: int) -> list[Path]:
    """Two plain CSV logs of a run: ``_daq`` of accelerometers and load cells, in volts; ``_controller`` of encoders."""
    rng, end = np.random.default_rng(seed), truth["time"][-1]
    own = np.arange(0.0, (end - 0.01 - DAQ_START) * (1.0 + DAQ_DRIFT), 1.0 / DAQ_RATE)
    t = own / (1.0 + DAQ_DRIFT) + DAQ_START
    cells = (truth["load"][:, case] @ distribution(np.array(list(CELLS.values()))).T).reshape(-1, 3, 3)
    signals = {n: truth[n][:, case] for n in ACCELEROMETERS} | {n: cells[:, i] for i, n in enumerate(CELLS)}
    columns = {"time (s)": [f"{x:.6f}" for x in own]}
    for sensor, values in signals.items():
        exact = CubicSpline(truth["time"], values)(np.clip(t, 0.0, end))
        volts = OFFSET[sensor] + VOLTS_PER[sensor] * exact + NOISE_V[sensor] * rng.standard_normal(exact.shape)
        columns |= {f"{sensor}{axis} (V)": [f"{x:.6f}" for x in volts[:, i]] for i, axis in enumerate("xyz")}
    t = np.arange(0.0, end, 1.0 / CONTROLLER_RATE)
    steps = np.round(angles(t)[0] / ENCODER_STEP + 0.5 * rng.standard_normal((len(t), 2))) * ENCODER_STEP
    encoders = {"time (s)": [f"{x:.4f}" for x in t]}
    encoders |= {f"J{i + 1} (rad)": [f"{x:.7f}" for x in steps[:, i]] for i in (0, 1)}
    paths = [folder / f"{name}_{logger}.csv" for logger in ("daq", "controller")]
    for path, table in zip(paths, (columns, encoders), strict=True):
        with path.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows([list(table), *zip(*table.values(), strict=True)])
    return paths
