"""Verdicts and intervals of ``testbench identify`` over joint records of known truth: honest ones and such as deceive.

Made without the simulated bench: a pendulum or an arm of two links, its equations of motion by hand, moved by its motor
(prescribed motion and inverse dynamics, or motor torque and scipy's integration) or by a hand. Honest records differ in
bodies, friction, excitation, sampling, encoder steps, noise and delay; half of them have a second run with a mass that
is known. What deceives is one of ``LIES``.
"""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from balance.arrays import Floats
from balance.errors import DataError
from balance.mechanism.mechanism import Mechanism
from balance.mechanism.mjcf_parser import load_mechanism, mechanism_from_text
from testbench.identification import JointRecord, identify
from testbench.kinematics.smoothing_and_derivatives import Grid

from .table import Row, Tally, covered

GRAVITY = 9.81
PENDULUM = """<mujoco model="pendulum"><compiler angle="radian"/><option gravity="0 -9.81 0"/><worldbody>
<body name="base"><body name="link_1" quat="0.7071067811865476 0 0 -0.7071067811865476"><joint name="J1" type="hinge"
axis="0 0 1"/><inertial pos="0.3 0 0" mass="1" diaginertia="1e-3 0.02 0.02"/>
</body></body></worldbody><actuator><motor name="motor_J1" joint="J1"/></actuator>
<keyframe><key name="home" qpos="0.5"/></keyframe></mujoco>"""
LENGTH = 0.3
"""Of the arm's first link, as in its file [m]."""
MOST_FALSE, LEAST_TRUE = 1e-3, 0.9
"""Parts of the records that deceive which may be usable, at most one of few; of honest ones that must be."""
PLACE = 0.3
"""Of the known mass [m]."""
LIES = (
    "law", "hand", "slip", "stall", "sign", "encoder_slip", "lost_counts", "scale_known",
)  # fmt: skip
"""Motor torque that is a law of position and velocity while a hand moves the joint; hands or obstacles at times; a load
that slips; a joint that is kept from moving; torque of the other sign; an encoder that jumps, or loses counts; a torque
that reads wrong, with a mass that is known. An encoder that reads its angle by another scale, ``angle_scale``, is
counted apart: where the joint swings little no torque tells it."""


@dataclass(frozen=True)
class Joints:
    """One joint or two, as their equations of motion need them."""

    first: Floats
    """First moments about the joints, of all that hangs on the first, of the second link [kg m]."""
    inertia: Floats
    """About the joints, drives included; of the first with the second link's mass at its end [kg m2]."""
    coulomb: Floats
    viscous: Floats
    offset: Floats
    breakaway: float = 0.02
    """Speed over which dry friction turns its direction [rad/s]."""

    def inverse(self, q: Floats, v: Floats, a: Floats) -> Floats:
        """Motor torques (n, joints) [N m] of a motion."""
        friction = self.coulomb * np.tanh(v / self.breakaway) + self.viscous * v + self.offset
        if len(self.first) == 1:
            return self.inertia * a + GRAVITY * self.first * np.sin(q) + friction
        couple, whole = LENGTH * self.first[1], q[:, 0] + q[:, 1]
        cosine, sine = couple * np.cos(q[:, 1]), couple * np.sin(q[:, 1])
        weight = GRAVITY * self.first * np.sin(np.column_stack([q[:, 0], whole]))
        outer = self.inertia[1] * (a[:, 0] + a[:, 1]) + cosine * a[:, 0] + sine * v[:, 0] ** 2 + weight[:, 1]
        inner = (self.inertia[0] + 2.0 * cosine) * a[:, 0] + (self.inertia[1] + cosine) * a[:, 1] + weight[:, 0]
        inner += self.inertia[1] * a[:, 0] + weight[:, 1] - sine * (2.0 * v[:, 0] * v[:, 1] + v[:, 1] ** 2)
        return np.column_stack([inner, outer]) + friction


@dataclass(frozen=True)
class Case:
    """Records and what is true of them."""

    kind: str
    records: tuple[JointRecord, ...]
    mechanism: Mechanism
    truth: dict[str, tuple[dict[str, float], float]] = field(default_factory=dict)
    """Combinations of parameters by name, and their values [kg m, kg m2]."""

    @property
    def closed(self) -> bool:
        """Whether a known mass tells the scale of the torques."""
        return len(self.records) > 1


class Maker:
    """Draws cases."""

    def __init__(self) -> None:
        self.mechanisms = mechanism_from_text(PENDULUM, "pendulum"), load_mechanism("two-joint-arm-a0")

    def case(self, kind: str, seed: int) -> Case:
        """A case ``honest``, or one of ``LIES``."""
        rng = np.random.default_rng([seed, 13, sum(map(ord, kind))])  # a kind's records do not change with the others
        count = 2 if rng.random() < 0.2 and kind not in ("stall", "slip") else 1
        joints = _joints(rng, count)
        closed = kind == "scale_known" or (rng.random() < 0.5 and count == 1)
        wrong = rng.choice([rng.uniform(0.5, 0.88), rng.uniform(1.12, 2.0)]) if kind == "scale_known" else 1.0
        sensors, records = _Sensors.drawn(rng, joints), []
        for mass in (0.0, float(rng.uniform(0.25, 1.0) * joints.first[0] / PLACE)) if closed else (0.0,):
            loaded = replace(joints, first=joints.first + mass * PLACE, inertia=joints.inertia + mass * PLACE**2)
            time, torque, shown = _RUNS.get(kind, _honest)(rng, loaded, sensors)
            record = sensors.record(rng, f"{kind} {seed} with {mass:.3g} kg", time, shown, wrong * torque)
            known = mass * np.array([1, PLACE, 0, 0, 0, 0, PLACE**2, 0, 0, PLACE**2])
            records.append(replace(record, mounted=known) if mass else record)
        return Case(kind, tuple(records), self.mechanisms[count - 1], _truth(joints))


def _truth(joints: Joints) -> dict[str, tuple[dict[str, float], float]]:
    if len(joints.first) == 1:
        return {
            "first moment": ({"mcx[link_1]": 1.0}, float(joints.first[0])),
            "inertia": ({"Izz[link_1]": 1.0, "armature[J1]": 1.0}, float(joints.inertia[0])),
        }
    return {
        "first moment of link 1": ({"mcx[link_1]": 1.0, "m[link_2]": LENGTH}, float(joints.first[0])),
        "first moment of link 2": ({"mcx[link_2]": 1.0}, float(joints.first[1])),
    }


def _joints(rng: np.random.Generator, count: int) -> Joints:
    mass, length = rng.uniform(0.4, 4.0, count), rng.uniform(0.12, 0.5, count)
    first, inertia = mass * length, mass * length**2 * rng.uniform(1.03, 1.5, count) + rng.uniform(0.0, 0.01)
    if count == 2:
        inertia = inertia + [mass[1] * LENGTH**2, 0.0]
        first = first + [mass[1] * LENGTH, 0.0]
    weight = GRAVITY * first
    return Joints(
        first,
        inertia,
        weight * rng.uniform(0.0, 0.06, count),
        weight * rng.uniform(0.0, 0.03, count),
        weight * rng.uniform(-0.02, 0.02, count),
        rng.choice([1e-3, 0.02, 0.05]),
    )


@dataclass(frozen=True)
class _Sensors:
    """How a record samples what happens."""

    seconds: float
    rate: float
    step: float
    noise: Floats
    quantum: float
    delay: int

    @classmethod
    def drawn(cls, rng: np.random.Generator, joints: Joints) -> "_Sensors":
        weight = GRAVITY * joints.first
        return cls(
            rng.uniform(6.0, 15.0),
            float(rng.choice([100.0, 200.0, 250.0, 500.0])),
            2.0 * np.pi / 2 ** rng.integers(12, 17),
            weight * 10 ** rng.uniform(-2.5, -1.2),
            float(weight[0] * rng.choice([0.0, 1e-3, 5e-3])),
            int(rng.choice([0, 0, 1, -1])),
        )

    @property
    def time(self) -> Floats:
        return np.arange(int(self.seconds * self.rate)) / self.rate

    def record(self, rng: np.random.Generator, name: str, time: Floats, q: Floats, torque: Floats) -> JointRecord:
        """With encoder steps, noise and steps of the torque, and a delay of whole samples."""
        shown = np.rint(q / self.step) * self.step
        torque = np.roll(torque, self.delay, axis=0)
        torque = torque + self.noise * rng.normal(size=torque.shape)
        if self.quantum:
            torque = np.rint(torque / self.quantum) * self.quantum
        return JointRecord(name, "simulated", Grid(float(time[0]), 1.0 / self.rate, len(time)), shown, torque)


Motion = tuple[Floats, Floats, Floats]
Run = tuple[Floats, Floats, Floats]
"""Instants [s], motor torques [N m], angles as the encoder sees them [rad]."""
Push = Callable[[float, float, float], float]
"""Torque that nobody measures, by instant, angle and speed [N m]."""


def _spline(rng: np.random.Generator, time: Floats, count: int, size: float = 1.0) -> Motion:
    """A hand's or a reference's smooth way through random angles."""
    found = []
    for _ in range(count):
        gaps = rng.uniform(0.25, 0.8, int(time[-1] / 0.25) + 8)
        knots = np.cumsum(gaps) - 2.0
        angles = size * rng.uniform(-1.2, 1.2, len(knots))
        path = CubicSpline(knots, angles)
        found.append([path(time), path(time, 1), path(time, 2)])
    return tuple(np.transpose(found, (1, 2, 0)))


def _waves(rng: np.random.Generator, time: Floats, count: int) -> Motion:
    """Three to five sines a joint, or one whose frequency rises."""
    if rng.random() < 0.3:
        size, low, high = rng.uniform(0.4, 1.2, count), rng.uniform(0.1, 0.4, count), rng.uniform(1.0, 2.2, count)
        slope = 2 * np.pi * (high - low) / time[-1]
        phase = 2 * np.pi * low * time[:, None] + 0.5 * slope * time[:, None] ** 2
        omega = 2 * np.pi * low + slope * time[:, None]
        v = size * omega * np.cos(phase)
        return size * np.sin(phase), v, size * (slope * np.cos(phase) - omega**2 * np.sin(phase))
    terms = rng.integers(3, 6)
    omega = 2 * np.pi * rng.uniform(0.15, 2.2, (terms, count))
    size = rng.uniform(0.5, 1.8, count) * rng.dirichlet(np.ones(terms), count).T
    angle = omega * time[:, None, None] + rng.uniform(0, 2 * np.pi, (terms, count))
    middle = rng.choice([0.0, 0.0, 0.5, np.pi])
    return (
        middle + (size * np.sin(angle)).sum(axis=1),
        (size * omega * np.cos(angle)).sum(axis=1),
        -(size * omega**2 * np.sin(angle)).sum(axis=1),
    )


def _prescribed(rng: np.random.Generator, time: Floats, count: int) -> Motion:
    return _waves(rng, time, count) if rng.random() < 0.6 else _spline(rng, time, count, rng.uniform(0.4, 1.2))


def _honest(rng: np.random.Generator, joints: Joints, sensors: _Sensors) -> Run:
    if len(joints.first) == 1 and rng.random() < 0.4:
        return _driven(rng, joints, sensors)
    q, v, a = _prescribed(rng, sensors.time, len(joints.first))
    return sensors.time, joints.inverse(q, v, a), q


def _driven(rng: np.random.Generator, joints: Joints, sensors: _Sensors, pushed: Push | None = None) -> Run:
    """A controller follows a reference, from which something else may push the joint away."""
    time = sensors.time
    weight, inertia = GRAVITY * joints.first[0], joints.inertia[0]
    target, speed, _ = _spline(rng, time, 1, rng.uniform(0.4, 1.1))
    wanted, rate = CubicSpline(time, target[:, 0]), CubicSpline(time, speed[:, 0])
    own = 2 * np.pi * rng.uniform(1.0, 3.0)
    stiff, damp, most = inertia * own**2, 1.2 * inertia * own, weight * rng.uniform(1.5, 4.0)

    def motor(t: Floats | float, q: Floats | float, v: Floats | float) -> Floats:
        return np.clip(stiff * (wanted(t) - q) + damp * (rate(t) - v), -most, most)

    def state(t: float, x: Floats) -> list[float]:
        free = smooth.inverse(x[None, :1], x[None, 1:], np.zeros((1, 1)))[0, 0]
        push = pushed(t, x[0], x[1]) if pushed else 0.0
        return [x[1], (float(motor(t, x[0], x[1])) + push - free) / inertia]

    smooth = replace(joints, breakaway=max(joints.breakaway, 0.02))  # not too stiff for the integration
    found = solve_ivp(
        state, (0.0, time[-1]), [target[0, 0], speed[0, 0]], "LSODA", time, rtol=1e-6, atol=1e-8, max_step=0.02
    )
    q, v = found.y
    return time, motor(time, q, v)[:, None], q[:, None]


def _law(rng: np.random.Generator, joints: Joints, sensors: _Sensors) -> Run:
    """A hand moves the joints while each motor holds to a law of position and velocity."""
    time, count = sensors.time, len(joints.first)
    q, v, _ = _spline(rng, time, count, rng.uniform(0.4, 1.2)) if rng.random() < 0.5 else _waves(rng, time, count)
    weight, centre = GRAVITY * joints.first * rng.uniform(0.5, 1.5), rng.uniform(-0.5, 0.5, count)
    omega = 2 * np.pi * rng.uniform(0.4, 1.5)
    stiff, damp = joints.inertia * omega**2, joints.inertia * omega * rng.uniform(0.0, 1.0)
    holds = weight * np.sin(q)
    follows = -stiff * (q - centre) - damp * v
    energy = 0.5 * joints.inertia * v**2 + weight * (1.0 - np.cos(q))
    laws = {
        "gravity": holds,
        "gravity and damping": holds - damp * v,
        "spring": follows,
        "gravity and spring": holds + follows,
        "limited": np.clip(2.0 * follows, -weight, weight),
        "soft limit": weight * np.tanh(follows / weight),
        "energy": -0.3 * v / np.abs(v).max(axis=0) * (energy - 1.5 * weight),
        "negative spring": -follows,
        "cubic": -weight * (q - centre) ** 3 - damp * v,
    }
    return time, laws[str(rng.choice(list(laws)))], q


def _hand(rng: np.random.Generator, joints: Joints, sensors: _Sensors) -> Run:
    """At times a hand or an obstacle pushes, in a stretch of 0.3 to 2 s, by a share of the weight."""
    time, count = sensors.time, len(joints.first)
    q, v, a = _prescribed(rng, time, count)
    push = np.zeros_like(q)
    for _ in range(rng.integers(1, 5)):
        begin, length = rng.uniform(0.5, time[-1] - 2.5), rng.uniform(0.3, 2.0)
        window = np.where((time > begin) & (time < begin + length), np.sin(np.pi * (time - begin) / length) ** 2, 0.0)
        push += window[:, None] * GRAVITY * joints.first * rng.choice([-1, 1]) * rng.uniform(0.25, 1.0)
    return time, joints.inverse(q, v, a) - push, q


def _events(rng: np.random.Generator, time: Floats, shortest: float, longest: float) -> Motion:
    """An angle that moves away in one to four steps, each in so many seconds, and its rates, (n,)."""
    found = np.zeros((3, len(time)))
    for _ in range(rng.integers(1, 5)):
        begin, size = rng.uniform(0.1, 0.9) * time[-1], rng.choice([-1, 1]) * rng.uniform(0.08, 0.6)
        length = rng.uniform(shortest, longest)
        s = np.clip((time - begin) / length, 0.0, 1.0)
        inside = (s > 0.0) & (s < 1.0)
        found += size * np.array([
            s**3 * (10 - 15 * s + 6 * s**2),
            inside * 30 * s**2 * (1 - s) ** 2 / length,
            inside * 60 * s * (1 - s) * (1 - 2 * s) / length**2,
        ])  # fmt: skip
    return found[0], found[1], found[2]


def _slip(rng: np.random.Generator, joints: Joints, sensors: _Sensors) -> Run:
    """The load slips on its shaft; the encoder is the motor's."""
    time = sensors.time
    q, v, a = _prescribed(rng, time, 1)
    away = _events(rng, time, 0.08, 0.5)
    load = [x - y[:, None] for x, y in zip((q, v, a), away, strict=True)]
    return time, joints.inverse(*load), q


def _encoder_slip(rng: np.random.Generator, joints: Joints, sensors: _Sensors) -> Run:
    """The encoder slips on its shaft, at once or within 0.3 s."""
    time = sensors.time
    q, v, a = _prescribed(rng, time, len(joints.first))
    away = _events(rng, time, *((1e-6, 1e-5) if rng.random() < 0.4 else (0.02, 0.3)))[0]
    slips = rng.permutation(np.eye(q.shape[1])[0])  # one of the encoders
    return time, joints.inverse(q, v, a), q + np.outer(away, slips)


def _lost_counts(rng: np.random.Generator, joints: Joints, sensors: _Sensors) -> Run:
    """The encoder loses counts where the joint is fast, one way."""
    time = sensors.time
    q, v, a = _prescribed(rng, time, len(joints.first))
    limit, share = np.quantile(np.abs(v), rng.uniform(0.5, 0.9)), rng.uniform(0.05, 0.4)
    lost = np.where(v > limit, share * v, 0.0)
    return time, joints.inverse(q, v, a), q - np.cumsum(lost, axis=0) / sensors.rate


def _stall(rng: np.random.Generator, joints: Joints, sensors: _Sensors) -> Run:
    """The joint runs on stops, or is held for a while, as its controller goes on."""
    low, high, stiff = -rng.uniform(0.15, 0.5), rng.uniform(0.15, 0.5), 200.0 * GRAVITY * joints.first[0]
    held = [(b, b + rng.uniform(0.6, 2.0)) for b in rng.uniform(1.0, sensors.seconds - 2.5, rng.integers(1, 3))]
    stops = rng.random() < 0.5
    brake = 400.0 * joints.inertia[0]

    def pushed(t: float, q: float, v: float) -> float:
        if stops:
            return float(-stiff * (max(q - high, 0.0) + min(q - low, 0.0)) - 0.05 * stiff * v * (q > high or q < low))
        return -brake * v if any(a < t < b for a, b in held) else 0.0

    return _driven(rng, joints, sensors, pushed)


def _sign(rng: np.random.Generator, joints: Joints, sensors: _Sensors) -> Run:
    """The torque of one joint or of all reads with the other sign."""
    time, torque, shown = _honest(rng, joints, sensors)
    signs = -np.ones(torque.shape[1])
    if len(signs) > 1 and rng.random() < 0.5:
        signs[rng.integers(len(signs))] = 1.0
    return time, torque * signs, shown


def _angle_scale(rng: np.random.Generator, joints: Joints, sensors: _Sensors) -> Run:
    """One encoder reads its angle by another scale."""
    time, torque, shown = _honest(rng, joints, sensors)
    scales = np.ones(shown.shape[1])
    scales[rng.integers(len(scales))] = rng.choice([rng.uniform(0.5, 0.88), rng.uniform(1.12, 2.0)])
    return time, torque, shown * scales


_RUNS: dict[str, Callable[[np.random.Generator, Joints, _Sensors], Run]] = {
    "law": _law, "hand": _hand, "slip": _slip, "stall": _stall, "sign": _sign, "encoder_slip": _encoder_slip,
    "lost_counts": _lost_counts, "angle_scale": _angle_scale,
}  # fmt: skip


def study(count: int, brief: bool) -> Iterator[Row]:
    """False verdicts of ``count`` records that deceive, true ones of as many honest records, and their intervals."""
    maker = Maker()
    usable: dict[str, int] = {}
    wrong = 0
    for seed in range(count):
        kind = LIES[seed % len(LIES)]
        verdict, inside = _verdict(maker.case(kind, seed // len(LIES)))
        usable[kind] = usable.get(kind, 0) + (verdict != "doubtful")
        wrong += verdict != "doubtful" and not all(inside)
    most = max(1, round(MOST_FALSE * count))
    kinds = ", ".join(f"{kind} {number}" for kind, number in usable.items() if number) or "none"
    kinds += f"; {wrong} with a value outside of its interval"
    yield Row(
        "usable, up to a scale or not, of records that deceive", sum(usable.values()), f"of {count}", 0, most, kinds
    )
    scaled = -(-count // len(LIES))
    passed = sum(_verdict(maker.case("angle_scale", seed))[0] != "doubtful" for seed in range(scaled))
    yield Row("the same of records whose encoder reads another scale", passed, f"of {scaled}")
    verdicts, tally = Counter[str](), Tally()
    for seed in range(count):
        verdict, inside = _verdict(case := maker.case("honest", seed))
        verdicts[verdict if verdict == "doubtful" or (verdict == "usable") == case.closed else "of the other kind"] += 1
        for hit in inside if verdict != "doubtful" else ():
            tally.add(hit)
    right = count - verdicts["doubtful"] - verdicts["of the other kind"]
    kinds = ", ".join(f"{number} {verdict}" for verdict, number in sorted(verdicts.items()))
    yield Row("usable, up to a scale where no mass is known, of honest records", right, f"of {count}",
              int(LEAST_TRUE * count), count, kinds)  # fmt: skip
    note = "first moments and inertias of usable records; intervals hold methods and filters too"
    yield covered("their values", tally.hits, tally.count, note, conservative=True)


def _verdict(case: Case) -> tuple[str, list[bool]]:
    """The verdict, and whether each true value lies in its interval; a refusal is a doubt."""
    try:
        found = identify(case.records, case.mechanism)
        intervals = [(found.value(names).interval, value) for names, value in case.truth.values()]
    except DataError:
        return "doubtful", []
    return found.verdict, [low <= value <= high for (low, high), value in intervals]
