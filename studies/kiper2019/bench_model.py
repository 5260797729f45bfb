"""The bench of the tests as a function of its uncertain quantities: as a rig, and as one linear system.

The rig is simulated like any other. For a calibration, which asks for thousands of runs, the same bench is linearised
about its start and solved on Fourier lines. With base x, arms and hubs e, ten coordinates z = (x, e),

    (-w^2 M + i w C + K) z = loads of the command followed exactly.
"""

import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from balance import datasets
from balance.arrays import Complexes, Floats
from balance.closure import Closure, Trajectory
from balance.dynamics.inverse_dynamics import driven_rates, momentum, simulate
from balance.dynamics.moving_base import displacement_at, locked_inertia, rigid_body, skew
from balance.mechanism.mechanism import Mechanism
from balance.mechanism.mjcf_parser import load_mechanism
from balance.motion.motion_files import load_motion
from balance.units import parse
from testbench.campaign_plan import PlannedRun
from testbench.rig import Rig
from testbench.rig.rig import rig_from_text
from testbench.simulator.drive_trains import every
from testbench.simulator.loggers import sample_instants
from testbench.simulator.run import simulate_run
from testbench.simulator.sensors import base_acceleration
from testbench.vibration.metrics import Measure

PRIORS = Path(__file__).parent / "bench-priors.toml"
TEMPLATE = "parallelogram-6bar"
"""Rig that has everything that is not calibrated, and its mechanism."""
AXES = ("x", "y", "z")
_ARM_INERTIA = 0.0553
"""Of an arm with the bare platform about its pivot [kg m2], to which shares of critical damping refer."""
_OUTER = ("AC", "BD", "platform")
"""Bodies in the plane of the outer links."""
_RATE_HZ = 2000.0
_COUNT = 9000
"""Samples of a run in the linear bench: 4.5 s, after which vibration has died out."""
_HIGHEST_HZ = 420.0
"""Of the Fourier lines; the band of a reduction ends at 200 Hz."""
_LEAD = 200
"""Samples before a motion."""


@dataclass(frozen=True)
class Quantity:
    """An uncertain quantity of the bench with its prior."""

    name: str
    unit: str
    median: float
    spread: float
    """Standard deviation, of the logarithm where it is ``positive`` [unit or -]."""
    positive: bool
    reason: str

    def value(self, deviations: float) -> float:
        """What lies so many standard deviations from the median [unit]."""
        by = deviations * self.spread
        return self.median * math.exp(by) if self.positive else self.median + by


@dataclass(frozen=True)
class Priors:
    """Of all quantities."""

    quantities: tuple[Quantity, ...]
    scatter: float
    """Of a printed number about the bench [percentage points]."""
    reach: float
    """How far a quantity may be from its median [standard deviations]: its physical range."""

    @classmethod
    def load(cls, path: Path = PRIORS) -> "Priors":
        """From their file."""
        table = tomllib.loads(path.read_text(encoding="utf-8"))
        found = []
        for name, stated in table["quantities"].items():
            median, unit = _stated(stated["median"])
            positive = "factor" in stated
            spread = math.log(stated["factor"]) if positive else _stated(stated["spread"])[0]
            found.append(Quantity(name, unit, median, spread, positive, stated["reason"]))
        return cls(tuple(found), table["scatter"]["value"], table["range"]["deviations"])

    def values(self, deviations: Sequence[float] | Floats) -> dict[str, float]:
        """Of each quantity, from standard deviations off the medians (k,)."""
        return {q.name: q.value(float(d)) for q, d in zip(self.quantities, deviations, strict=True)}


_DIMENSIONS = {
    "kg": "mass", "m": "length", "MN/m": "stiffness", "kg/m": "mass per length", "kN m/rad": "moment",
    "kg m^2": "inertia",
}  # fmt: skip


def _stated(text: str) -> tuple[float, str]:
    """A value in SI and its unit as written; a share has none."""
    number, _, unit = text.partition(" ")
    return (parse(text, _DIMENSIONS[unit]) if unit else float(number)), unit


def rig_of(values: Mapping[str, float]) -> Rig:
    """The rig with these values."""
    return rig_from_text(rig_text(values), "calibrated")


def rig_text(values: Mapping[str, float]) -> str:
    """The rig with these values, as a file: the template's sensors and loggers, and a bench of its own."""
    head, _, _ = (datasets.ROOT / "rigs" / f"{TEMPLATE}.toml").read_text(encoding="utf-8").partition("[bench]")
    head = head[head.index("[loggers.") :]
    place = 'position = ["0.20 m", "-0.10 m", "0 m"]          # (assumed)\nattached_to = "base"'
    assert place in head
    sensor = ", ".join('"{:.4f} m"'.format(values[f"sensor_{axis}"]) for axis in AXES)
    head = head.replace(place, f'position = [{sensor}]  # calibrated\nattached_to = "base"')
    return _INTRODUCTION + head + "\n".join(_bench_lines(values)) + "\n"


_INTRODUCTION = """\
# The bench of the manipulator tests (Kiper 2019), calibrated on the 24 printed reductions of the 1.45 kg payload alone
# by testbench predict kiper2019 --rig: docs/bench.md. Sensors and loggers are as in parallelogram-6bar; what stands in
# [bench], and where the accelerometer is, was calibrated within priors (studies/kiper2019/bench-priors.toml): likely
# values, not measured ones.
name = "parallelogram-6bar bench, calibrated"
mechanism = "parallelogram-6bar"

"""


def _bench_lines(values: Mapping[str, float]) -> list[str]:
    v = values

    def each(name: str, factor: float, unit: str, power: int = 1) -> str:
        return ", ".join(f'"{factor * v[name + axis] ** power:.5g} {unit}"' for axis in AXES)

    mass, links, plates = (v[k] for k in ("mass", "links_plane", "plates_plane"))
    lines = [
        "[bench]", f'mass = "{mass:.5g} kg"', "centre = [" + each("centre_", 1.0, "m") + "]",
        "inertia = [" + each("gyration_", mass, "kg m^2", 2) + "]",
        'settling = "0.5 s"', 'coupling = "moving"', "",
        "[bench.planes]", *(f'{body} = "{1e3 * links:.4g} mm"' for body in _OUTER),
        *(f'{site} = "{1e3 * plates:.4g} mm"' for site in ("counter_A0A", "counter_B0B")), "",
    ]  # fmt: skip
    lines += ["[bench.unstated_mass]", f'platform = "{v["unstated_mass"]:.4g} kg"', ""]
    hub, control, rotor = _hub(v), _control(v), v["rotor_inertia"] / 100.0
    for joint in ("A0", "B0"):
        lines += [
            f"[bench.rotors.{joint}]", f'inertia = "{rotor:.4g} kg m^2"', "ratio = 10.0", "",
            f"[bench.drives.{joint}.transmission]", f'stiffness = "{hub[0]:.5g} N m/rad"',
            f'damping = "{hub[1]:.4g} N m s/rad"', f'motor_side = ["counter_{joint}{joint[0]}"]', "",
            f"[bench.drives.{joint}.control]", f'stiffness = "{control[0]:.5g} N m/rad"',
            f'damping = "{control[1]:.4g} N m s/rad"', "",
        ]  # fmt: skip
    stiffness, damping = each("stiffness_", 0.25, "N/m"), each("stiffness_", 0.25 * _loss(v), "N s/m")
    for foot in _feet(v):
        place = ", ".join(f'"{x:.4f} m"' for x in foot)
        lines += [
            "[[bench.mounts]]", f"position = [{place}]",
            f"stiffness = [{stiffness}]", f"damping = [{damping}]", "",
        ]  # fmt: skip
    return lines


def _feet(v: Mapping[str, float]) -> list[tuple[float, float, float]]:
    """Positions of the feet [m]."""
    return [
        (v["feet_x"] + across * v["feet_half_width"], v["feet_y"], v["feet_z"] + along * v["feet_half_depth"])
        for across in (-1, 1)
        for along in (-1, 1)
    ]


def _loss(v: Mapping[str, float]) -> float:
    """Damping of the feet over their stiffness [s]."""
    return 2.0 * v["damping"] / math.sqrt(v["stiffness_y"] / v["mass"])


def _hub(v: Mapping[str, float]) -> tuple[float, float]:
    """Stiffness [N m/rad] and damping [N m s/rad] between hub and arm."""
    return v["hub_stiffness"], 2.0 * v["hub_damping"] * math.sqrt(v["hub_stiffness"] * _ARM_INERTIA)


def _control(v: Mapping[str, float]) -> tuple[float, float]:
    """Gains [N m/rad, N m s/rad]."""
    inertia = _ARM_INERTIA + v["rotor_inertia"]
    return v["control_stiffness"], 2.0 * v["control_damping"] * math.sqrt(v["control_stiffness"] * inertia)


def simulated_reductions(rig: Rig, pairs: Sequence[tuple[PlannedRun, PlannedRun]], rate: float | None = None) -> Floats:
    """Reductions [%] of pairs of runs, with counter-masses and without, as ``compare`` simulates them, (n, 3).

    ``rate`` [Hz] of the simulation, by default that of the rig.
    """
    mechanism, measure = load_mechanism(rig.mechanism), Measure()
    (sensor,) = rig.base_accelerometers.values()
    logger = rig.loggers[sensor.logger]

    def amplitudes(planned: PlannedRun) -> Floats:
        run = simulate_run(rig, mechanism, planned, rate=rate)
        taken = sample_instants(logger, float(run.time[-1]))[1]
        seen = base_acceleration(sensor, run)
        return np.array([measure.amplitude(np.interp(taken, run.time, seen[axis]), logger.rate) for axis in AXES])

    return 100.0 * np.array([1.0 - amplitudes(with_masses) / amplitudes(without) for with_masses, without in pairs])


@dataclass(frozen=True)
class _Part:
    """A part of the mechanism along a command: what it does to base and joints, Fourier lines (lines, ...) first."""

    wrench: Complexes
    """(lines, 6) [N, N m]"""
    torque: Complexes
    """On the driven joints, (lines, 2) [N m]."""
    outer: Complexes
    """Of the force, what acts in the plane of the outer links, (lines, 3) [N]."""

    def plus(self, other: "_Part", times: float) -> "_Part":
        """With another part so many times."""
        return _Part(*(mine + times * its for mine, its in zip(vars(self).values(), vars(other).values(), strict=True)))


@dataclass(frozen=True)
class _Carried:
    """A part of the mechanism at the start of all motions."""

    locked: Floats
    """(6, 6) [kg, kg m, kg m2]"""
    per_rate: Floats
    """Momentum per rate of the driven joints, (6, 2) [kg m, kg m2]."""
    outer_per_rate: Floats
    """Of the linear one, that of bodies in the plane of the outer links, (3, 2) [kg m]."""
    inertia: Floats
    """Generalised, (2, 2) [kg m2]."""

    def plus(self, other: "_Carried", times: float) -> "_Carried":
        """With another part so many times."""
        both = zip(vars(self).values(), vars(other).values(), strict=True)
        return _Carried(*(mine + times * its for mine, its in both))


class LinearBench:
    """The reductions of pairs of planned runs, with counter-masses and without, on the bench linearised."""

    def __init__(self, pairs: Sequence[tuple[PlannedRun, PlannedRun]]) -> None:
        self._pairs, self._closure, self._measure = pairs, Closure(load_mechanism(TEMPLATE)), Measure()
        frequency = np.fft.rfftfreq(_COUNT, 1.0 / _RATE_HZ)
        self._used = frequency < _HIGHEST_HZ
        self._rate = 2j * np.pi * frequency[self._used]
        assert self._measure.band is not None
        self._gain = self._measure.band.gain(frequency, _RATE_HZ)[:, None, None]
        self._groups: dict[tuple[float, float], list[PlannedRun]] = {}
        for run in (run for pair in pairs for run in pair):
            self._groups.setdefault(_loaded_with(run), []).append(run)
        self._parts = {run.name: self._both_parts(run) for pair in pairs for run in pair}
        self._carried = {key: self._both_carried(runs[0]) for key, runs in self._groups.items()}

    def reductions(self, values: Mapping[str, float]) -> Floats:
        """Reductions [%] with the bench's quantities at these values, (pairs, 3)."""
        found: dict[str, Floats] = {}
        for key, runs in self._groups.items():
            found |= dict(zip((run.name for run in runs), self._amplitudes(values, key, runs), strict=True))
        return 100.0 * np.array([1.0 - found[a.name] / found[b.name] for a, b in self._pairs])

    def _amplitudes(self, v: Mapping[str, float], key: tuple[float, float], runs: Sequence[PlannedRun]) -> Floats:
        """Of the acceleration along each axis, (runs, 3) [m/s2]."""
        carried = [(links.plus(more, v["unstated_mass"]), hubs) for links, hubs, more in [self._carried[key]]]
        matrix = self._matrix(v, carried[0])
        parts = [
            (links.plus(more, v["unstated_mass"]), hubs) for links, hubs, more in (self._parts[r.name] for r in runs)
        ]
        loads = np.stack([_loads(*pair, v["links_plane"], v["plates_plane"]) for pair in parts], axis=2)
        moved = np.linalg.solve(matrix, loads)[:, :6] * self._rate[:, None, None] ** 2
        at = displacement_at(np.array([v[f"sensor_{axis}"] for axis in AXES]))
        lines = np.zeros((len(self._gain), 3, len(runs)), complex)
        lines[self._used] = np.einsum("ij,njk->nik", at, moved)
        return np.ptp(np.fft.irfft(lines * self._gain, _COUNT, axis=0), axis=0).T

    def _matrix(self, v: Mapping[str, float], carried: tuple[_Carried, _Carried]) -> Complexes:
        """M (i w)^2 + C i w + K on all lines, (lines, 10, 10)."""
        links, hubs = carried
        centre = np.array([v[f"centre_{axis}"] for axis in AXES])
        own = np.diag([v["mass"] * v[f"gyration_{axis}"] ** 2 for axis in AXES])
        own = own - v["mass"] * skew(centre) @ skew(centre)
        mass, stiffness = np.zeros((2, 10, 10))
        mass[:6, :6] = rigid_body(v["mass"], v["mass"] * centre, own) + links.locked + hubs.locked
        foot = np.diag([v[f"stiffness_{axis}"] / 4.0 for axis in AXES])
        for place in _feet(v):
            at = displacement_at(np.array(place))
            stiffness[:6, :6] += at.T @ foot @ at
        damping = _loss(v) * stiffness
        mass[:6, 6:8] = links.per_rate + _moved_out(links.outer_per_rate.T, v["links_plane"]).T
        mass[:6, 8:] = hubs.per_rate + _moved_out(hubs.per_rate[:3].T, v["plates_plane"]).T
        mass[6:, :6] = mass[:6, 6:].T
        mass[6:8, 6:8], mass[8:, 8:] = links.inertia, hubs.inertia + v["rotor_inertia"] * np.eye(2)
        apart = np.kron(np.array([[1.0, -1.0], [-1.0, 1.0]]), np.eye(2))
        held = np.diag([0.0, 0.0, 1.0, 1.0])
        for matrix, hub, control in zip((stiffness, damping), _hub(v), _control(v), strict=True):
            matrix[6:, 6:] += hub * apart + control * held
        s = self._rate[:, None, None]
        return np.asarray(s**2 * mass + s * damping + stiffness, dtype=complex)

    def _both_parts(self, run: PlannedRun) -> tuple[_Part, _Part, _Part]:
        """Links with the payload, counter-masses, and one more kilogram on the platform."""
        assert run.peak_acceleration is not None
        motion = load_motion(run.motion).with_peak_acceleration(run.peak_acceleration)
        path = self._closure.follow(motion.sample(_RATE_HZ))
        links, hubs, more = (self._part(part, path) for part in _bodies(self._closure.mechanism, run))
        return links, hubs, more

    def _part(self, mechanism: Mechanism, path: Trajectory) -> _Part:
        found, outer = simulate(mechanism, path), simulate(_outer(mechanism), path)
        torque = np.column_stack([found.torque[joint] for joint in mechanism.driven])
        return _Part(*map(self._lines, (np.hstack([found.force, found.moment]), torque, outer.force)))

    def _lines(self, signal: Floats) -> Complexes:
        """Of a signal (n, k) beyond its value at rest, (lines, k)."""
        padded = np.zeros((_COUNT, signal.shape[1]))
        padded[_LEAD : _LEAD + len(signal)] = signal - signal[0]
        padded[_LEAD + len(signal) :] = signal[-1] - signal[0]
        return np.fft.rfft(padded, axis=0)[self._used]

    def _both_carried(self, run: PlannedRun) -> tuple[_Carried, _Carried, _Carried]:
        motion = load_motion(run.motion).sample(_RATE_HZ)
        path = self._closure.follow(motion)
        start = every(path, len(path.time))
        links, hubs, more = (_carried(part, start) for part in _bodies(self._closure.mechanism, run))
        return links, hubs, more


def _loads(links: _Part, hubs: _Part, plane: float, plates: float) -> Complexes:
    """On base, arms and hubs, (lines, 10) [N, N m]; the motors know the torque of the rigid mechanism in advance."""
    wrench = links.wrench + hubs.wrench + _moved_out(links.outer, plane) + _moved_out(hubs.wrench[:, :3], plates)
    return np.hstack([wrench, -links.torque, links.torque])


def _moved_out(force: NDArray[np.number], z: float) -> NDArray[np.number]:
    """What forces (n, 3) [N] add to their wrench as they move along z by so much [m], (n, 6) [N, N m]."""
    found = np.zeros((len(force), 6), force.dtype)
    found[:, 3], found[:, 4] = -z * force[:, 1], z * force[:, 0]
    return found


def _loaded_with(run: PlannedRun) -> tuple[float, float]:
    """Payload and counter-mass of an arm [kg]."""
    assert run.payload is not None
    return run.payload, max(run.counter_masses.values(), default=0.0)


def _bodies(mechanism: Mechanism, run: PlannedRun) -> tuple[Mechanism, Mechanism, Mechanism]:
    """The mechanism with its payload, its counter-masses alone, and 1 kg on the platform alone."""
    bare, payload = replace(mechanism, parameters=0.0 * mechanism.parameters), _loaded_with(run)[0]
    loaded, more = (mechanism.with_payload({"platform": mass}) for mass in (payload, payload + 1.0))
    alone = replace(bare, parameters=more.parameters - loaded.parameters)
    return loaded, bare.with_counter_mass(run.counter_masses), alone


def _outer(mechanism: Mechanism) -> Mechanism:
    chosen = np.array([[float(body in _OUTER)] for body in mechanism.bodies])
    return replace(mechanism, parameters=chosen * mechanism.parameters)


def _carried(mechanism: Mechanism, start: Trajectory) -> _Carried:
    rates = driven_rates(mechanism, start.per_drive, mechanism.driven)
    columns = [np.ascontiguousarray(rates[:, :, k]) for k in range(rates.shape[2])]

    def per_rate(part: Mechanism) -> Floats:
        return np.stack([momentum(part, start.q, column)[0] for column in columns], axis=1)

    def torque(acceleration: Floats) -> Floats:
        found = simulate(mechanism, replace(start, a=acceleration)).torque
        return np.array([found[joint][0] for joint in mechanism.driven])

    still = torque(np.zeros_like(start.a))
    inertia = np.stack([torque(column) - still for column in columns], axis=1)
    locked = locked_inertia(mechanism, start.q[0])
    return _Carried(locked, per_rate(mechanism), per_rate(_outer(mechanism))[:3], inertia)
