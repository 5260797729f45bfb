"""Coverage of the intervals of ``testbench analyze`` in laboratories drawn at random, through ingest and analysis.

A laboratory is a rig, a motion back and forth, a base whose modes it shakes, and a family of noise; nothing of it is
taken from the simulator. The truth is the reduction of the signals without noise, in the metric and band of the
analysis. The measure of half widths is an oracle that knows the law of the noise, not its path: by the estimator of the
analysis, from the same records, alignment, band and lines of the mains, but with noise drawn from the law, rounding
included, in the place of noise that was estimated. It does not know the signal, as nobody does. By how many swings may
be the largest, and by how much noise raises it, a reading of the known signal scatters less than what any signal that
fits the record allows: half widths by that scatter alone are of no interval that covers. They stand beside it: what
the estimator loses itself, in any noise, is seen in them alone. The oracle samples at exact instants.
"""

import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from pathlib import Path

import numpy as np
from scipy.signal import cont2discrete, lfilter
from scipy.stats import binomtest

from balance.arrays import Floats
from testbench.errors import AnalysisError
from testbench.ingestion import Ingest
from testbench.ingestion.planned_runs import plan_runs
from testbench.rig import load_rig
from testbench.signal import METRIC_NAMES, Metric
from testbench.store import open_campaign
from testbench.vibration.amplitude import Amplitude
from testbench.vibration.amplitude_likelihood import AmplitudeLikelihood
from testbench.vibration.condition import Condition, ConditionAmplitude
from testbench.vibration.metrics import METRICS, Measure
from testbench.vibration.noise_floor import Draws, Noise, NoiseRecords, Segment
from testbench.vibration.ratio_interval import Ratio
from testbench.vibration.reduction import Analysis, Reduction, analyze
from testbench.vibration.repeatability import Group, Synchronous
from testbench.vibration.run_pairs import Pair

from .table import LEVEL, Row, Tally, covered

G0 = 9.81
FINE = 10_000.0
"""Rate at which signals without noise are computed [Hz]."""
HOME = (0.0, 0.212)
"""Of the platform of the manipulator whose arms' encoders are logged [m]."""
ENCODER_STEP = 4.8e-5
"""[rad]"""
ORACLE_DRAWS = 60
"""Records of noise that the oracle draws for each run: its standard deviation is known to a tenth."""
WIDER = 1.5
"""Times the half width of the oracle that intervals may have, in the median."""
FEWEST = 10
"""Intervals whose median says so: of fewer it is shown alone."""
Law = Callable[[np.random.Generator, Floats, Floats], Floats]
"""Noise of one channel at instants (n,) [s] with a share (n,) of the mechanism's top speed: one draw, (n,) [m/s2]."""


@dataclass(frozen=True)
class Course:
    """Legs of a point-to-point motion, from ``starts`` for ``durations`` by ``distances`` (k,) [s, s, m]."""

    axis: str
    peak: float
    """Peak acceleration [m/s2]."""
    shape: Floats
    """Of acceleration, speed and place over one leg of length and duration one, (3, m)."""
    starts: Floats
    durations: Floats
    distances: Floats

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> "Course":
        """Several times there and back, with pulses of sine or trapezoid, with dwells or none."""
        phase = np.linspace(0.0, 1.0, 2001)
        sine = np.sin(2 * np.pi * phase)
        pulse = sine if rng.random() < 0.5 else np.clip(sine / np.sin(2 * np.pi * rng.uniform(0.05, 0.15)), -1.0, 1.0)
        speed = np.cumsum(pulse) - 0.5 * pulse
        place = np.cumsum(speed) - 0.5 * speed
        shape = np.array([pulse * 2000.0**2, speed * 2000.0, place]) / place[-1]
        span, peak, cycles = rng.uniform(0.02, 0.05), G0 * rng.choice([0.5, 1.0, 2.0, 3.0]), int(rng.integers(1, 5))
        distances = span * np.array([1.0, *[-2.0, 2.0] * cycles, -1.0])
        durations = np.sqrt(np.abs(distances) * shape[0].max() / peak)
        dwells = rng.uniform(0.0, 0.12) * (rng.random() < 0.7)
        starts = np.concatenate([[0.0], np.cumsum(durations[:-1] + dwells)])
        return cls(str(rng.choice(["x", "y"])), float(peak), shape, starts, durations, distances)

    @property
    def end(self) -> float:
        """End of the last leg [s]."""
        return float(self.starts[-1] + self.durations[-1])

    def at(self, time: Floats) -> Floats:
        """Acceleration, speed and place (3, n) at instants (n,) [m/s2, m/s, m]."""
        found, grid = np.zeros((3, len(time))), np.linspace(0.0, 1.0, self.shape.shape[1])
        for start, length, distance in zip(self.starts, self.durations, self.distances, strict=True):
            phase = np.clip((time - start) / length, 0.0, 1.0)
            for row, (shape, power) in enumerate(zip(self.shape, (2, 1, 0), strict=True)):
                found[row] += distance / length**power * np.interp(phase, grid, shape)
        return found


@dataclass(frozen=True)
class Controller:
    """Logger of the arms' encoders and of the commanded acceleration, where they are logged."""

    logger: str
    rate: float
    """[Hz]"""
    ahead: float
    """By how much it starts earlier than that of the accelerometer [s]."""
    encoders: bool
    target: bool


@dataclass(frozen=True)
class Laboratory:
    """A rig, a motion, a base, and the law of the noise of each axis of its accelerometer."""

    rng: np.random.Generator
    rest: float
    """Before the motion [s]."""
    course: Course
    rate: float
    axes: str
    step: float
    """Of the accelerometer's readings [m/s2]."""
    white: float
    """Standard deviation of its noise [m/s2]."""
    sample_jitter: float
    """Of the sample's clock [sample periods]."""
    recorded_time: str
    """``uniform``: none; ``nominal``; ``true``."""
    late: tuple[Floats, Floats]
    """By how much the command of each run comes late, with and without counter-masses [s]."""
    signals: Floats
    """Without noise, with and without counter-masses, at rate FINE from the end of the rest, (2, axes, n) [m/s2]."""
    laws: Sequence[Law]
    """By axis."""
    position: Floats
    """Of the accelerometer, (3,) [m]."""
    step_stated: bool
    """Whether the rig states the step."""
    controller: Controller
    metric: Metric

    @cached_property
    def time(self) -> Floats:
        """Nominal instants of the accelerometer's logger, zero where the motion begins, (n,) [s]."""
        return np.arange(-self.rest, self.signals.shape[2] / FINE, 1.0 / self.rate)

    def seen(self, side: int, axis: int, time: Floats) -> Floats:
        """The signal without noise at instants (n,) after the command, (n,) [m/s2]."""
        signal = self.signals[side, axis]
        return np.interp(time, np.arange(len(signal)) / FINE, signal, left=0.0)

    def read(self, side: int, axis: int, rng: np.random.Generator, true: Floats, late: float = 0.0) -> Floats:
        """One record of a channel, (n,) [m/s2], sampled at ``true`` (n,) [s] of a command that is ``late`` [s]."""
        speed = np.abs(self.course.at(self.time - late)[1])
        noise = self.laws[axis](rng, self.time, speed / speed.max())
        exact = self.seen(side, axis, true - late) + noise + self.white * rng.standard_normal(len(true))
        zero = rng.uniform(-0.5, 0.5)  # of the converter, within a step
        return np.asarray((np.round(exact / self.step + zero)) * self.step)

    def truth(self, axis: int, measure: Measure) -> tuple[float, float]:
        """Mean amplitudes of the runs without noise, with and without counter-masses [m/s2]."""
        balanced, bare = (
            np.mean([measure.amplitude(self.seen(side, axis, self.time - late), self.rate) for late in self.late[side]])
            for side in (0, 1)
        )
        return float(balanced), float(bare)

    def in_known_noise(self, one: Amplitude, run: str, axis: int) -> "InKnownNoise":
        """A channel as a run shows it, with records of its noise drawn from the law and read as the analysis does."""
        side, repeat = int(run.startswith("without")), int(run[-1]) - 1
        late, rng = float(self.late[side][repeat]), np.random.default_rng([axis, repeat])
        without = self.seen(side, axis, self.time - late)
        records = np.array([without, *(self.read(side, axis, rng, self.time, late) for _ in range(ORACLE_DRAWS))])
        rest = None if one.rest is None else (one.rest.start / one.rate_hz, one.rest.stop / one.rate_hz)
        clean, *drawn = Amplitude.of(records, self.rate, one.measure, rest)
        noise = np.array([other.course - clean.course for other in drawn])
        law = Noise.of([Segment(row, one.rate_hz) for row in noise])
        given = {part.name: getattr(one, part.name) for part in fields(Amplitude)}
        return InKnownNoise(**given, signal=clean.course, noise=noise, law=law)


@dataclass(frozen=True)
class InKnownNoise(Amplitude):
    """A channel in one run, in noise whose law is known."""

    signal: Floats = field(default_factory=lambda: np.zeros(0))
    """Without noise, in the band, (n,) [m/s2]."""
    noise: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    """Records of the law in the band, (ORACLE_DRAWS, n) [m/s2]."""
    law: Noise | None = None

    def noises(self, noise: Noise) -> NoiseRecords:
        """Records of the law; all that is not known is in them."""
        number, count = len(self.noise), len(self.course)
        known = np.full(number, float(np.mean(self.noise**2)))
        return NoiseRecords(
            Draws((self.noise.T[:count].astype(np.float32),), known), np.zeros(number), self.averages**-0.5
        )

    @property
    def likelihood(self) -> AmplitudeLikelihood:
        """What is read, by the estimator of the analysis."""
        assert self.law is not None
        return AmplitudeLikelihood.of(self, self.law)

    @property
    def scatter(self) -> float:
        """Standard deviation of readings of the signal itself [m/s2]."""
        read = METRICS[self.measure.metric][1]
        return float(np.std([read(self.signal + row) for row in self.noise]))


def oracle(laboratory: Laboratory, pair: Pair, measure: Measure) -> dict[str, tuple[float, float]]:
    """Half widths [%] of 95 % intervals by axis, of who knows the law of the noise, and of who knows the signal too."""
    condition = Condition.of(pair, measure)
    aligned, found = [Synchronous.of(side.records) for side in condition.sides], {}
    for place in condition.places:
        axis, sides, scatters = laboratory.axes.index(place[1]), [], []
        for side, both in zip(condition.sides, aligned, strict=True):
            each = zip(side.records, side.names, strict=True)
            runs = [laboratory.in_known_noise(run[place], name, axis) for run, name in each]
            group = Group(tuple(run.likelihood for run in runs), side.names)
            if both and not group.clear:
                mean = {part.name: getattr(both.places[place].mean, part.name) for part in fields(Amplitude)}
                group = Group((replace(runs[0], **mean).likelihood,), side.names)
            sides.append(ConditionAmplitude(group))
            scatters.append(np.mean([run.scatter for run in runs]) / len(runs) ** 0.5)
        low, high = Ratio(*sides).interval or (0.0, np.inf)
        balanced, bare = laboratory.truth(axis, measure)
        known = 196.0 / bare * float(np.hypot(scatters[0], scatters[1] * balanced / bare))
        found[place[1]] = 50.0 * (high - low), known
    return found


@dataclass(frozen=True)
class Family:
    """How the laboratories of a family of noise differ from quiet ones; amplitudes as shares of the residual."""

    laws: Sequence[Callable[[np.random.Generator, float], Law]] = ()
    """Each draws a law from the residual's root mean square [m/s2]."""
    rests: tuple[float, float] = (0.3, 1.2)
    """Between which a rest lies [s]."""
    steps: tuple[float, float] = (0.0, 0.0)
    """Between which the step lies [rms of the residual]; zero: too fine to be seen."""
    dithered: bool = True
    """Whether a step drowns in white noise."""
    jittered: bool = False

    def law(self, rng: np.random.Generator, residual: float) -> Law:
        """The law of one channel's noise, from a residual's root mean square [m/s2]."""
        laws = [law(rng, residual) for law in self.laws]
        return lambda rng, time, moving: sum((law(rng, time, moving) for law in laws), np.zeros(len(time)))


def log_uniform(rng: np.random.Generator, low: float, high: float, count: int = 1) -> Floats:
    """Between two limits, their ratios all alike, (count,)."""
    return np.asarray(np.exp(rng.uniform(np.log(low), np.log(high), count)))


def floor(rng: np.random.Generator, residual: float, least: float = 0.1, most: float = 1.0) -> Law:
    """One to three modes of the floor, stationary and Gaussian, of a share of the residual between two limits."""
    count = int(rng.integers(1, 4))
    frequency, damping = rng.uniform(5.0, 40.0, count), log_uniform(rng, 0.005, 0.05, count)
    shares = rng.dirichlet(np.ones(count)) * (residual * log_uniform(rng, least, most).item()) ** 2

    def path(rng: np.random.Generator, time: Floats, moving: Floats) -> Floats:
        size = 2 ** int(np.ceil(np.log2(2000.0 * max(16.0, 1.2 * float(time[-1] - time[0])))))
        f = np.fft.rfftfreq(size, 1.0 / 2000.0)
        resonance = f**4 / ((frequency[:, None] ** 2 - f**2) ** 2 + (2.0 * (damping * frequency)[:, None] * f) ** 2)
        density = resonance / (1.0 + (f / 60.0) ** 6)
        sizes = size * np.sqrt(shares @ (density / density.sum(axis=1, keepdims=True))) / 2.0
        drawn = np.fft.irfft(sizes * (rng.standard_normal((len(f), 2)) @ [1.0, 1.0j]))
        return np.interp(time - time[0], np.arange(size) / 2000.0, drawn)

    return path


def hum(rng: np.random.Generator, residual: float) -> Law:
    """The mains with harmonics, off their nominal frequency by a little, at any phase in each run."""
    mains = rng.choice([50.0, 60.0]) * (1.0 + 1e-3 * rng.uniform(-1.0, 1.0))
    sizes = residual * rng.uniform(0.1, 2.0) * np.array([1.0, *rng.uniform(0.0, 0.5, 2)])

    def path(rng: np.random.Generator, time: Floats, moving: Floats) -> Floats:
        waves = np.sin(2 * np.pi * mains * np.outer(np.arange(1, 4), time) + rng.uniform(0.0, 2 * np.pi, (3, 1)))
        return np.asarray(sizes @ waves)

    return path


def slope(rng: np.random.Generator, residual: float) -> Law:
    """An offset and a slope."""
    offset, rise = residual * np.array([5.0, 1.0]) * rng.uniform(0.1, 1.0, 2)
    return lambda rng, time, moving: offset * rng.standard_normal() + rise * rng.standard_normal() * time


def walk(rng: np.random.Generator, residual: float) -> Law:
    """A random walk."""
    size = 0.3 * residual * rng.uniform(0.1, 1.0)
    return lambda rng, time, moving: size * np.cumsum(rng.standard_normal(len(time))) * np.sqrt(time[1] - time[0])


def roughness(rng: np.random.Generator, residual: float) -> Law:
    """Broadband noise in proportion to the speed of the mechanism."""
    low, high, size = rng.uniform(5.0, 30.0), rng.uniform(60.0, 180.0), residual * rng.uniform(0.1, 0.8)

    def path(rng: np.random.Generator, time: Floats, moving: Floats) -> Floats:
        f = np.fft.rfftfreq(len(time), time[1] - time[0])
        kept = np.fft.irfft(np.fft.rfft(rng.standard_normal(len(time))) * ((f > low) & (f < high)), len(time))
        return size * moving * kept / kept.std()

    return path


FAMILIES = {
    "white": Family(),
    "floor": Family([floor]),
    "floor above the residual": Family([partial(floor, least=1.0, most=5.0)]),
    "hum": Family([hum]),
    "drift": Family([slope, walk]),
    "step with dither": Family(steps=(0.05, 0.5)),
    "step without dither": Family(steps=(0.05, 0.5), dithered=False),
    "rests of 0.05 to 3 s": Family([floor], rests=(0.05, 3.0)),
    "in motion only": Family([roughness]),
    "jitter": Family(jittered=True),
    "all mixed": Family([floor, hum, slope, walk, roughness], (0.05, 3.0), (0.05, 0.5), True, True),
}
"""Families by name."""


def responses(rng: np.random.Generator, course: Course, settling: float, axes: int, highest: float) -> Floats:
    """Acceleration of a base with and without counter-masses at rate FINE from the start of the motion, (2, axes, n).

    Two to four modes up to ``highest`` [Hz] feel the force of the motion, or the share of it that the counter-masses
    leave and a force of another course; sometimes nothing.
    """
    acceleration, speed, _ = course.at(np.arange(0.0, course.end + settling, 1.0 / FINE))
    centrifugal = speed**2 / (speed**2).max() * np.abs(acceleration).max()
    share, other = rng.uniform(0.0, 0.6), rng.uniform(-0.3, 0.3) * rng.random()
    nothing = rng.random() < 0.1
    forces = np.array([(share * acceleration + other * centrifugal) * (not nothing), acceleration])
    count = int(rng.integers(2, 5))
    frequency, damping = log_uniform(rng, 5.0, highest, count), rng.uniform(0.01, 0.08, count)
    shapes, found = rng.standard_normal((axes, count)), np.zeros((2, axes, len(acceleration)))
    for f, zeta, shape in zip(2 * np.pi * frequency, damping, shapes.T, strict=True):
        b, a, _ = cont2discrete((np.array([1.0, 0.0, 0.0]), np.array([1.0, 2.0 * zeta * f, f**2])), 1.0 / FINE, "foh")
        found += shape[:, None] * lfilter(np.ravel(b), a, forces)[:, None]
    level = G0 * log_uniform(rng, 0.05, 1.0).item()
    return found * level / np.sqrt(np.mean(found[1] ** 2, axis=1)).max()


def drawn(family: Family, seed: int) -> Laboratory:
    """The laboratory of a seed."""
    rng = np.random.default_rng([seed, 1313])
    rest = log_uniform(rng, *family.rests).item()
    rate = float(rng.choice([500.0, 1000.0, 2000.0, 5000.0, 10_000.0], p=[0.25, 0.35, 0.25, 0.1, 0.05]))
    axes = "".join(sorted(rng.choice(list("xyz"), int(rng.integers(1, 4)), replace=False)))
    course = Course.drawn(rng)
    signals = responses(rng, course, float(rng.uniform(0.15, 0.6)), len(axes), min(120.0, rate / 7.0))
    power = np.sqrt(np.mean(signals**2, axis=2)).max(axis=1)
    residual = float(power[0] or 0.03 * power[1])
    white = residual * log_uniform(rng, 0.005, 0.2).item()
    step = residual * float(rng.uniform(*family.steps)) or 0.2 * white
    if family.steps[1]:
        white = step * float(rng.uniform(0.5, 1.5) if family.dithered else rng.uniform(0.0, 0.15))
    laws = [family.law(rng, residual) for _ in axes]
    clock = str(rng.choice(["uniform", "nominal", "true"])) if family.jittered else "uniform"
    early = rest * (0.4 if family.jittered else 0.1)
    late = tuple(rng.uniform(-early, early, int(rng.integers(1, 4))) for _ in range(2))
    return Laboratory(
        rng, rest, course, rate, axes, step, white, 0.05 * family.jittered, clock, (late[0], late[1]), signals, laws,
        rng.uniform(-0.3, 0.3, 3), bool(rng.random() < 0.75), _controller(rng, rate),
        METRIC_NAMES[int(rng.choice(3, p=[0.2, 0.5, 0.3]))],
    )  # fmt: skip


def _controller(rng: np.random.Generator, rate: float) -> Controller:
    """One logger for all, or two that start together or not."""
    together, encoders, target, triggered = (bool(one) for one in rng.random(4) < (0.5, 0.6, 0.5, 0.5))
    own = Controller(
        "controller", float(rng.choice([500.0, 1000.0])), rng.uniform(0.0, 0.2) * (not triggered), encoders, target
    )
    return Controller("daq", rate, 0.0, encoders, target) if together or not (encoders or target) else own


def write_campaign(laboratory: Laboratory, folder: Path) -> None:
    """Logs of all runs, ``rig.toml`` and ``runs.csv``, as ``testbench ingest`` reads them."""
    (folder / "rig.toml").write_text(_rig_text(laboratory), encoding="utf-8")
    rows = ["run,file,origin,payload_kg,counter_masses,motion,peak_acceleration_g,repeat"]
    for side, lates in enumerate(laboratory.late):
        for repeat, late in enumerate(lates.tolist(), 1):
            masses = "" if side else "counter_A0A=17.1105;counter_B0B=17.1105"
            conditions = f"3.4116,{masses},{laboratory.course.axis},{laboratory.course.peak / G0:g},{repeat}"
            name = f"{'without' if side else 'with'}{repeat}"
            rows += [
                f"{name},{file},simulated,{conditions}" for file in _write_run(laboratory, folder, name, side, late)
            ]
    (folder / "runs.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")


def _rig_text(laboratory: Laboratory) -> str:
    axes, controller = laboratory.axes, laboratory.controller
    text = [
        f'name = "{laboratory.rate:g} Hz"\nmechanism = "parallelogram-6bar"',
        f'[loggers.daq]\nclock = "{"uniform" if laboratory.recorded_time == "uniform" else "recorded"}"',
        f'rate = "{laboratory.rate:g} Hz"\ndecimals = 6',
        '[sensors.base_acc]\nkind = "accelerometer"\nlogger = "daq"\nunit = "m/s^2"\nattached_to = "base"',
        "channels = { " + ", ".join(f'{axis} = "Acc{axis.upper()}"' for axis in axes) + " }",
        "position = [" + ", ".join(f'"{x:.2f} m"' for x in laboratory.position) + "]",
        f'noise = "{laboratory.white:.3g} m/s^2"',
        f'resolution = "{laboratory.step:.6g} m/s^2"' if laboratory.step_stated else "",
    ]
    if controller.logger != "daq":
        text.append(f'[loggers.controller]\nrate = "{controller.rate:g} Hz"\ndecimals = 6')
    for joint in ("A0", "B0") if controller.encoders else ():
        text.append(f'[sensors.encoder_{joint}]\nkind = "encoder"\njoint = "{joint}"\nunit = "rad"')
        text.append(f'logger = "{controller.logger}"\nchannel = "theta_{joint}"\nresolution = "{ENCODER_STEP} rad"')
    if controller.target:
        text.append(f'[sensors.target]\nkind = "target"\nlogger = "{controller.logger}"\nunit = "m/s^2"')
        text.append('channels = { x = "TargetX", y = "TargetY" }')
    return "\n".join(text)


def _write_run(laboratory: Laboratory, folder: Path, name: str, side: int, late: float) -> list[str]:
    """The logs of one run; the names of their files."""
    rng, time, controller = laboratory.rng, laboratory.time, laboratory.controller
    true = time + rng.uniform(-1.0, 1.0, len(time)) * laboratory.sample_jitter / laboratory.rate
    axes = enumerate(laboratory.axes)
    daq = {f"Acc{axis.upper()} (m/s^2)": laboratory.read(side, i, rng, true, late) for i, axis in axes}
    logs = {"daq": ({} if laboratory.recorded_time == "uniform" else {"Time (s)": time - time[0]}, daq)}
    if laboratory.recorded_time == "true":
        logs["daq"][0]["Time (s)"] = true - true[0]
    own = time if controller.logger == "daq" else np.arange(time[0] - controller.ahead, time[-1], 1.0 / controller.rate)
    if moved := _moved(laboratory, own - late):
        logs.setdefault(controller.logger, ({"Time (s)": own - own[0]}, {}))[1].update(moved)
    for logger, (clock, values) in logs.items():
        columns = clock | values
        head = (
            "# origin: simulated\n" + ("" if clock else f"# rate: {laboratory.rate:g} Hz\n") + ",".join(columns) + "\n"
        )
        line, flat = ",".join(["%.6f"] * len(columns)) + "\n", np.array(list(columns.values())).T.ravel().tolist()
        (folder / f"{name}_{logger}.csv").write_text(head + line * len(next(iter(columns.values()))) % tuple(flat))
    return [f"{name}_{logger}.csv" for logger in logs]


def _moved(laboratory: Laboratory, time: Floats) -> dict[str, Floats]:
    """What the controller logs at instants (n,): angles of both arms, acceleration of the platform, (n,) each."""
    acceleration, _, place = laboratory.course.at(time)
    along, found = laboratory.course.axis == "x", {}
    if laboratory.controller.encoders:
        x, y = HOME[0] + place * along, HOME[1] + place * (not along)
        half = np.arccos(np.hypot(x, y) / 0.3)  # each arm is two links of 0.15 m, elbows outwards
        for joint, angle in (("A0", np.arctan2(y, x) + half), ("B0", np.arctan2(y, x) - half)):
            shown = angle / ENCODER_STEP + 0.3 * laboratory.rng.standard_normal(len(time))
            found[f"theta_{joint} (rad)"] = np.round(shown) * ENCODER_STEP
    if laboratory.controller.target:
        found |= {"TargetX (m/s^2)": acceleration * along, "TargetY (m/s^2)": acceleration * (not along)}
    return found


def analyzed(folder: Path, measure: Measure) -> Analysis:
    """What ingest and analysis make of a campaign. Raises AnalysisError where nothing can be compared."""
    runs = plan_runs(sorted(folder.glob("*_*.csv")), folder / "runs.csv")
    campaign = folder / "campaign"
    campaign.mkdir()
    ingest = Ingest(campaign, load_rig(folder / "rig.toml"))
    for run in runs:
        for outcome in ingest.run(run):
            if outcome.status != "stored":
                raise AnalysisError(outcome.message)
    return analyze(open_campaign(campaign).runs, measure)


@dataclass
class FamilyTally:
    """Statements about a family."""

    two_sided: Tally = field(default_factory=Tally)
    bounds: Tally = field(default_factory=Tally)
    withheld: int = 0
    refused: int = 0
    widths: list[float] = field(default_factory=list)
    """Half widths of two-sided intervals, where the oracle knows any [%]."""
    oracle: list[float] = field(default_factory=list)
    """Of those by who knows the law of the noise [%]."""
    signal: list[float] = field(default_factory=list)
    """Of those by who knows the signal too [%]."""
    missed: list[int] = field(default_factory=list)
    """Seeds of statements that do not hold."""

    def add(
        self, seed: int, laboratory: Laboratory, found: Sequence[Reduction], known: dict[str, tuple[float, float]]
    ) -> None:
        """Count what is stated about a campaign, with half widths of the :func:`oracle`."""
        for one in found:
            axis = laboratory.axes.index(one.axis)
            balanced, bare = laboratory.truth(axis, one.measure)
            bounded = (-np.inf, one.percent) if one.limit == "at_most" and one.percent is not None else None
            if one.doubts or not (between := one.interval or bounded):
                self.withheld += 1
                continue
            low, high = between
            truth = 100.0 * (1.0 - balanced / bare)
            hit = low <= truth <= high
            (self.bounds if one.limit else self.two_sided).add(hit)
            if not hit:
                self.missed.append(seed)
            if one.limit is None and np.isfinite(known[one.axis][0]):
                self.widths.append(0.5 * (high - low))
                self.oracle.append(known[one.axis][0])
                self.signal.append(known[one.axis][1])


def tally(family: Family, seeds: Sequence[int]) -> FamilyTally:
    """Over campaigns of several seeds."""
    found = FamilyTally()
    for seed in seeds:
        laboratory = drawn(family, seed)
        try:
            with in_campaign(laboratory) as analysis:
                known = oracle(laboratory, analysis.pairs[0], analysis.measure)
                found.add(seed, laboratory, analysis.reductions, known)
        except AnalysisError:
            found.refused += 1
    return found


@contextmanager
def in_campaign(laboratory: Laboratory) -> Iterator[Analysis]:
    """The analysis of a campaign in a laboratory, whose runs can be read. Raises AnalysisError where nothing can be
    compared.
    """
    with tempfile.TemporaryDirectory() as folder:
        write_campaign(laboratory, Path(folder))
        yield analyzed(Path(folder), Measure(laboratory.metric))


def reductions(laboratory: Laboratory) -> list[Reduction]:
    """Of a campaign in a laboratory. Raises AnalysisError where nothing can be compared."""
    with in_campaign(laboratory) as analysis:
        return list(analysis.reductions)


def half_widths(family: Family, seed: int, repeats: int) -> dict[str, float]:
    """Of the two-sided intervals of a laboratory with so many runs a side, by axis [%]."""
    laboratory = drawn(family, seed)
    with_masses, without = 0.1 * laboratory.rest * np.random.default_rng(seed).uniform(-1.0, 1.0, (2, repeats))
    found = reductions(replace(laboratory, late=(with_masses, without)))
    return {one.axis: 0.5 * (one.interval[1] - one.interval[0]) for one in found if one.interval and not one.limit}


NARROWED = 8
"""Campaigns of which repeats are compared, briefly too: of four but two intervals are two-sided with one run a side."""


def narrowing(family: Family, seeds: Sequence[int]) -> Iterator[Row]:
    """Half widths of twice as many repeats over those of half as many, medians over the same channels."""
    widths = {repeats: [half_widths(family, seed, repeats) for seed in seeds] for repeats in (1, 2, 4)}
    for few, many in ((1, 2), (2, 4)):
        both = zip(widths[few], widths[many], strict=True)
        shares = [after[axis] / before[axis] for before, after in both for axis in before.keys() & after.keys()]
        note = f"{len(shares)} intervals, noise of the floor"
        yield Row(f"half width of {many} repeats over that of {few}", float(np.median(shares)), "", None, 1.0, note)


def study(count: int, brief: bool) -> Iterator[Row]:
    """Two-sided statements and bounds by family, briefly of three; how repeats narrow the intervals."""
    for name in ("white", "hum", "all mixed") if brief else FAMILIES:
        yield from stated(name, tally(FAMILIES[name], range(count)))
    yield from narrowing(FAMILIES["floor"], range(NARROWED))


def stated(name: str, t: FamilyTally) -> Iterator[Row]:
    """The figures of a family: how many statements hold, and how wide they are."""
    number = t.two_sided.count + t.bounds.count
    note = f"p {_p(t.two_sided):.2g}, withheld {t.withheld} of {number + t.withheld}"
    note += f", {t.refused} campaigns refused" * bool(t.refused)
    if t.widths:
        note += f", half width {np.median(t.widths):.2g} %"
    note += f", missed by seeds {' '.join(map(str, sorted(set(t.missed))[:12]))}" * bool(t.missed)
    yield covered(f"{name}, two-sided", t.two_sided.hits, t.two_sided.count, note)
    yield covered(f"{name}, bounds", t.bounds.hits, t.bounds.count, conservative=True)
    if t.widths:
        ratios = np.median(np.array(t.widths) / [t.oracle, t.signal], axis=1)
        note = f"of the oracle {np.median(t.oracle):.2g} %; {ratios[1]:.2f} times that of one that knows the signal"
        most = WIDER if len(t.widths) >= FEWEST else None
        yield Row(f"{name}, half width over that of the oracle", float(ratios[0]), "", None, most, note)


def _p(t: Tally) -> float:
    return float(binomtest(t.hits, t.count, LEVEL).pvalue) if t.count else 1.0
