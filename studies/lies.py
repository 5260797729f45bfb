"""Lies about runs: how often the cross-examination finds each, and how often it suspects an honest campaign.

A campaign is simulated, then one statement about one of its runs is made false, or some recorded values. It is found if
a contradiction with the right code names a run that lies.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, cast

import numpy as np

from testbench.campaign_plan import Plan, load_plan, plan_from_text
from testbench.cross_examination import Examination, Observation, hear, observe
from testbench.ingestion.run_inputs import run_inputs
from testbench.kinematics.encoder_motion import mechanism_of
from testbench.project import new_project
from testbench.recording import Conditions, UniformClock
from testbench.rig import Rig, load_rig
from testbench.rig.sensors import Encoder, Torque
from testbench.runs.si_run import SIRun
from testbench.simulator.simulated_logs import MemoryRun, simulate_logs, stored

from .simulated_runs import with_values
from .table import Row

Campaign = list[MemoryRun]
PLAN = """mechanism = "parallelogram-6bar"
repeats = {repeats}
[[conditions]]
payload = "{payload} kg"
counter_masses = {{ counter_A0A = "{mass} kg", counter_B0B = "{mass} kg" }}
motion = {motions}
peak_acceleration = {peaks}
"""
REPEATS = "five-bar, repeats"
WITHOUT_FORCES_AND_PLATFORM = ("platform_acc", "k6d40", "kistler", "futek_1", "futek_2")


def plan(payload: float, mass: float, motions: Sequence[str], peaks: Sequence[float], repeats: int = 1) -> Plan:
    """A plan of one payload [kg] with counter-masses [kg] on each arm and without, peaks in g0."""
    listed = str([f"{peak} g0" for peak in peaks]).replace("'", '"')
    text = PLAN.format(
        repeats=repeats, payload=payload, mass=mass, motions=str(list(motions)).replace("'", '"'), peaks=listed
    )
    return plan_from_text(text)


def simulated(rig: Rig, planned: Plan, seed: int) -> Campaign:
    """The runs of a plan in memory."""
    runs = [stored(one, rig, f"{one.planned.name}.h5") for one in simulate_logs(planned, rig, seed)]
    folders = [rig.folder] if rig.folder else []
    return [replace(run, inputs=run_inputs(rig, run.conditions, folders)[0]) for run in runs]


def slimmed(rig: Rig) -> Rig:
    """A rig with a base accelerometer, encoders, torques and a target alone."""
    parts = [
        p
        for p in rig.text.split("\n[")
        if not any(
            p.startswith(f"sensors.{n}]") or p.startswith(f"bench.errors.{n}]") for n in WITHOUT_FORCES_AND_PLATFORM
        )
    ]
    return load_rig("\n[".join(parts))


@dataclass(frozen=True)
class Lie:
    """What is made false."""

    tell: Callable[[Campaign, int, np.random.Generator], tuple[Campaign, set[str]]]
    """Of a campaign and the number of a run: the campaign with the lie, and the runs that it names."""
    codes: frozenset[str]
    """Of the findings that find it."""


def about(run: MemoryRun, **conditions: Any) -> MemoryRun:  # noqa: ANN401
    """The run with other conditions in the run table."""
    return replace(run, conditions=cast("Conditions", {**run.conditions, **conditions}))


def _one(change: Callable[[MemoryRun, np.random.Generator], MemoryRun]) -> Callable[..., tuple[Campaign, set[str]]]:
    def tell(runs: Campaign, i: int, rng: np.random.Generator) -> tuple[Campaign, set[str]]:
        return [*runs[:i], change(runs[i], rng), *runs[i + 1 :]], {runs[i].name}

    return tell


def _pair(runs: Campaign, i: int) -> int:
    """The run that differs from the i-th in the counter-masses alone."""
    own = {**runs[i].conditions, "counter_masses": None}
    return next(k for k, run in enumerate(runs) if k != i and {**run.conditions, "counter_masses": None} == own)


def _exchange_masses(runs: Campaign, i: int, rng: np.random.Generator) -> tuple[Campaign, set[str]]:
    k, changed = _pair(runs, i), list(runs)
    for a, b in ((i, k), (k, i)):
        changed[a] = about(runs[a], counter_masses=runs[b].conditions["counter_masses"])
    return changed, {runs[i].name, runs[k].name}


def _all(change: Callable[[MemoryRun, np.random.Generator], MemoryRun]) -> Callable[..., tuple[Campaign, set[str]]]:
    return lambda runs, i, rng: ([change(run, rng) for run in runs], {run.name for run in runs})


def other_payload(run: MemoryRun, rng: np.random.Generator) -> MemoryRun:
    """A payload that is wrong by 1 to 2 kg."""
    own, off = run.conditions["payload_kg"], float(rng.uniform(1.0, 2.0))
    return about(run, payload_kg=own - off if own > 2.5 and rng.random() < 0.5 else own + off)


def other_peak(run: MemoryRun, rng: np.random.Generator) -> MemoryRun:
    """A peak acceleration that is another number of half g0."""
    own = run.conditions["peak_acceleration_g"]
    return about(run, peak_acceleration_g=float(rng.choice([p for p in (0.5, 1.0, 1.5, 2.0, 3.0, 4.0) if p != own])))


def other_motion(run: MemoryRun, rng: np.random.Generator) -> MemoryRun:
    """The other motion."""
    return about(run, motion="y" if run.conditions["motion"] == "x" else "x")


def exchanged_axes(run: MemoryRun, rng: np.random.Generator) -> MemoryRun:
    """Two channels of the accelerometer on the base exchanged."""
    x, y = run.channel("AccX"), run.channel("AccY")
    return with_values(with_values(run, "AccX", y), "AccY", x)


def turned(run: MemoryRun, rng: np.random.Generator) -> MemoryRun:
    """The accelerometer on the base turned by 90 degrees about its axis z, either way."""
    x, y, way = run.channel("AccX"), run.channel("AccY"), float(rng.choice([-1.0, 1.0]))
    return with_values(with_values(run, "AccX", way * y), "AccY", -way * x)


def scaled(run: MemoryRun, factor: float) -> MemoryRun:
    """All channels of the accelerometer on the base times a factor."""
    for channel in ("AccX", "AccY", "AccZ"):
        run = with_values(run, channel, factor * run.channel(channel))
    return run


def flat(run: MemoryRun, rng: np.random.Generator) -> MemoryRun:
    """Nothing but the noise of the logger, or nothing at all, from the accelerometer on the base."""
    noise = float(rng.choice([0.0, 1e-4]))
    for channel in ("AccX", "AccY", "AccZ"):
        run = with_values(run, channel, np.round(noise * rng.standard_normal(len(run.channel(channel))), 5))
    return run


def stuck(run: MemoryRun, rng: np.random.Generator) -> MemoryRun:
    """One axis keeps the value that it has at some instant of the first half."""
    channel = f"Acc{rng.choice(['X', 'Y', 'Z'])}"
    values = run.channel(channel).copy()
    begin = int(rng.uniform(0.2, 0.5) * len(values))
    values[begin:] = values[begin]
    return with_values(run, channel, values)


def ramp(run: MemoryRun, rng: np.random.Generator) -> MemoryRun:
    """One axis drifts by 1 g over the run."""
    channel = str(rng.choice(["AccX", "AccY", "AccZ"]))
    values = run.channel(channel)
    return with_values(run, channel, values + np.linspace(0.0, 1.0, len(values)))


def reversed_sign(run: MemoryRun, rng: np.random.Generator) -> MemoryRun:
    """The channel along the motion reversed."""
    channel = "Acc" + run.conditions["motion"].upper()
    return with_values(run, channel, -run.channel(channel))


def reversed_sensor(run: MemoryRun, rng: np.random.Generator) -> MemoryRun:
    """The accelerometer on the base reversed: all axes."""
    return scaled(run, -1.0)


def other_torque(run: MemoryRun, rng: np.random.Generator) -> MemoryRun:
    """The torque of one drive halved or doubled."""
    channel = str(rng.choice(["tau1", "tau2"]))
    return with_values(run, channel, rng.choice([0.5, 2.0]) * run.channel(channel))


def of_the_pair(runs: Campaign, i: int, rng: np.random.Generator) -> tuple[Campaign, set[str]]:
    """The accelerometer on the base as in the run with the other counter-masses."""
    k, run = _pair(runs, i), runs[i]
    for channel in ("AccX", "AccY", "AccZ"):
        run = with_values(run, channel, np.resize(runs[k].channel(channel), run.channel(channel).shape))
    return [*runs[:i], run, *runs[i + 1 :]], {runs[i].name, runs[k].name}


def turned_force(run: MemoryRun, rng: np.random.Generator) -> MemoryRun:
    """A force channel along the motion reversed."""
    channel = f"F{run.conditions['motion']}{rng.integers(1, 3)}"
    return with_values(run, channel, -run.channel(channel))


def copied(runs: Campaign, i: int, rng: np.random.Generator) -> tuple[Campaign, set[str]]:
    """A run under another name, as it is or written anew: cut, in another unit and resolution, resampled."""
    copy = replace(runs[i], path=runs[i].path.with_name(f"{runs[i].name}b.h5"))
    how, data, groups = int(rng.integers(4)), dict(copy.provenance["data"]), []
    for group in copy.groups:
        for key in group.keys:
            values = data[f"{group.path}/{key}"]
            if how == 1:
                values = values[rng.integers(1, 60) :] if key != "Time" else values
            elif how == 2 and key != "Time":
                values = np.round(1.02 * values, 4)
            elif how == 3:
                at = np.linspace(0.0, len(values) - 1.0, round(0.9 * len(values)))
                values = np.interp(at, np.arange(len(values)), values)
            data[f"{group.path}/{key}"] = values
        length = min(len(data[f"{group.path}/{key}"]) for key in group.keys)
        for key in group.keys:
            data[f"{group.path}/{key}"] = data[f"{group.path}/{key}"][-length:]
        rate = (group.rate_hz or 1.0) * (0.9 if how == 3 else 1.0)
        clock = UniformClock(rate) if isinstance(group.clock, UniformClock) else group.clock
        groups.append(replace(group, samples=length, rate_hz=rate, clock=clock))
    copy = replace(copy, groups=tuple(groups), provenance={"data": data}, conditions={**copy.conditions, "repeat": 9})
    return [*runs, copy], {copy.name}


def cut_short(run: MemoryRun, rng: np.random.Generator) -> MemoryRun:
    """All logs of a run stopped while the encoders move, between a fifth and nine tenths of their way."""
    data, encoders = dict(run.provenance["data"]), SIRun.of(run).rig.columns_of(Encoder)
    moved = np.abs(np.diff(np.column_stack([run.channel(column.channel) for column in encoders]), axis=0)).sum(axis=1)
    moved, span = np.convolve(moved, np.ones(9), "same"), np.cumsum(moved) / moved.sum()
    instants = np.flatnonzero((moved > 0.3 * moved.max()) & (span[: len(moved)] > 0.2) & (span[: len(moved)] < 0.9))
    share, groups = float(rng.choice(instants)) / len(moved), []
    for group in run.groups:
        count = round(share * group.samples)
        for key in group.keys:
            data[f"{group.path}/{key}"] = data[f"{group.path}/{key}"][:count]
        groups.append(replace(group, samples=count))
    return replace(run, groups=tuple(groups), provenance={"data": data})


def reversed_encoder(run: MemoryRun, rng: np.random.Generator) -> MemoryRun:
    """One encoder counts the other way from where it starts."""
    channel = str(rng.choice([column.channel for column in SIRun.of(run).rig.columns_of(Encoder)]))
    values = run.channel(channel)
    return with_values(run, channel, 2.0 * values[0] - values)


def in_degrees(run: MemoryRun, rng: np.random.Generator) -> MemoryRun:
    """All encoders in degrees, which the rig calls radians."""
    for column in SIRun.of(run).rig.columns_of(Encoder):
        run = with_values(run, column.channel, np.rad2deg(run.channel(column.channel)))
    return run


def weak_torque(runs: Campaign, i: int, rng: np.random.Generator) -> tuple[Campaign, set[str]]:
    """The torque of one drive 10 to 25 % off, either way, in a run with or without counter-masses."""
    k = int(rng.choice([i, _pair(runs, i)]))
    channel = str(rng.choice([column.channel for column in SIRun.of(runs[k]).rig.columns_of(Torque)]))
    factor = 1.0 + rng.choice([-1.0, 1.0]) * rng.uniform(0.1, 0.25)
    liar = with_values(runs[k], channel, factor * runs[k].channel(channel))
    return [liar if n == k else run for n, run in enumerate(runs)], {liar.name}


def one_site_less(runs: Campaign, i: int, rng: np.random.Generator) -> tuple[Campaign, set[str]]:
    """A counter-mass that was mounted in one run is not in its line of the run table."""
    k = _pair(runs, i)
    stated = runs[k].conditions["counter_masses"]
    left = str(rng.choice(sorted(stated)))
    liar = about(runs[k], counter_masses={site: mass for site, mass in stated.items() if site != left})
    return [liar if n == k else run for n, run in enumerate(runs)], {liar.name}


def never_mounted(runs: Campaign, i: int, rng: np.random.Generator) -> tuple[Campaign, set[str]]:
    """A further run without counter-masses, filed as a repeat with those of the pair: never a copy of another."""
    k = _pair(runs, i)
    liar = replace(runs[i], path=runs[k].path, conditions=runs[k].conditions)
    return [liar if n == k else run for n, run in enumerate(runs) if n != i], {liar.name}


PAYLOAD, COUNTER = frozenset({"payload_contradiction"}), frozenset({"counter_mass_contradiction"})
GAIN = frozenset({"gain_contradiction"})
LIES = {
    "payload of one run": Lie(_one(other_payload), PAYLOAD),
    "payload of all runs": Lie(
        _all(lambda run, rng: about(run, payload_kg=run.conditions["payload_kg"] + 1.6)), PAYLOAD
    ),
    "peak acceleration of one run": Lie(_one(other_peak), frozenset({"acceleration_contradiction"})),
    "motion of one run": Lie(_one(other_motion), frozenset({"motion_contradiction"})),
    "with and without exchanged": Lie(_exchange_masses, COUNTER),
    "axes exchanged in one run": Lie(_one(exchanged_axes), frozenset({"axis_contradiction"})),
    "axes exchanged in all runs": Lie(_all(exchanged_axes), frozenset({"axis_contradiction"})),
    "gain halved in one run": Lie(_one(lambda run, rng: scaled(run, 0.5)), GAIN),
    "gain doubled in one run": Lie(_one(lambda run, rng: scaled(run, 2.0)), GAIN),
    "logs copied as repeats": Lie(copied, frozenset({"copied_run"})),
    "accelerometer flat": Lie(_one(flat), frozenset({"flat_channel"})),
    "accelerometer of another run": Lie(of_the_pair, frozenset({"copied_run"})),
    "one axis stuck": Lie(_one(stuck), frozenset({"flat_channel"})),
    "torque of one drive": Lie(
        _one(other_torque), frozenset({"gain_contradiction", "payload_contradiction", "torque_contradiction"})
    ),
    "ramp of 1 g on one axis": Lie(_one(ramp), frozenset({"level_drift"})),
    "sign of an accelerometer": Lie(_one(reversed_sign), frozenset({"sign_contradiction"})),
    "accelerometer reversed": Lie(_one(reversed_sensor), frozenset({"sign_contradiction"})),
    "force channel turned": Lie(_one(turned_force), frozenset({"force_sign"})),
    "record cut in mid-motion": Lie(_one(cut_short), frozenset({"short_record"})),
    "accelerometer reversed in all runs": Lie(_all(reversed_sensor), frozenset({"sign_contradiction"})),
    "accelerometer turned in one run": Lie(_one(turned), frozenset({"axis_contradiction"})),
    "accelerometer turned in all runs": Lie(_all(turned), frozenset({"axis_contradiction"})),
}


ENCODERS = frozenset({"encoder_contradiction"})
LIES_BESIDE_REPEATS = {
    "counter-masses never mounted": Lie(never_mounted, COUNTER),
    "one counter-mass not in the run table": Lie(one_site_less, COUNTER),
    "torque of one drive 10 to 25 % off": Lie(weak_torque, GAIN),
    "encoder of one run reversed": Lie(_one(reversed_encoder), ENCODERS),
    "encoders in degrees": Lie(_all(in_degrees), ENCODERS),
    "axes exchanged in one run": LIES["axes exchanged in one run"],
    "record cut in mid-motion": LIES["record cut in mid-motion"],
    "accelerometer turned in one run": LIES["accelerometer turned in one run"],
}
"""Told of three repeats, each side, of a machine whose motion drives its joints."""


class Witnesses:
    """Observations of runs, each made once."""

    def __init__(self) -> None:
        self._seen: dict[int, tuple[MemoryRun, Observation]] = {}
        self._mechanism: Any = None

    def hear(self, runs: Campaign) -> Examination:
        """The examination of a campaign."""
        return hear([self._observed(run) for run in runs])

    def _observed(self, run: MemoryRun) -> Observation:
        if id(run) not in self._seen:
            self._seen[id(run)] = run, observe(SIRun.of(run), lambda: self._of(run))
        return self._seen[id(run)][1]

    def _of(self, run: MemoryRun) -> Any:  # noqa: ANN401
        self._mechanism = self._mechanism or mechanism_of(SIRun.of(run), None)
        return self._mechanism


def is_found(examination: Examination, lie: Lie, liars: set[str]) -> bool:
    """Whether a finding with a right code names a run that lies."""
    return any(s.code in lie.codes and {s.run, *s.others} & liars for s in examination.contradictions)


def accuses(examination: Examination, liars: set[str]) -> bool:
    """Whether a finding names a run that does not lie."""
    return not {s.run for s in examination.contradictions} <= liars


def applies(name: str, runs: Campaign) -> bool:
    """Whether a campaign has what a lie needs."""
    rig = SIRun.of(runs[0]).rig
    return "force" not in name or bool(rig.supports)


def shaking(runs: Campaign) -> list[int]:
    """Runs without counter-masses, which shake the base: those with them may show less than its noise."""
    return [i for i, run in enumerate(runs) if not run.conditions["counter_masses"]]


def drawn_rig(rng: np.random.Generator) -> Rig:
    """A small rig on a bench of its own: mass, mounts, place of the accelerometer, rates and starts drawn at random."""
    rig = slimmed(load_rig("parallelogram-6bar"))
    mass, stiff, damp = rng.uniform(100.0, 200.0), rng.uniform(0.7, 1.4, 3), rng.uniform(0.7, 1.8, 3)
    words = {
        'mass = "150 kg"': f'mass = "{mass:.0f} kg"',
        'stiffness = ["250 kN/m", "400 kN/m", "250 kN/m"]': "stiffness = "
        + _listed(np.array([250.0, 400.0, 250.0]) * stiff, "kN/m"),
        'damping = ["400 N s/m", "600 N s/m", "400 N s/m"]': "damping = "
        + _listed(np.array([400.0, 600.0, 400.0]) * damp, "N s/m"),
        'position = ["0.20 m", "-0.10 m", "0 m"]': "position = " + _listed(rng.uniform(-0.2, 0.2, 3), "m"),
        'rate = "5 kHz"': f'rate = "{rng.choice([1, 2, 5])} kHz"',
        'rate = "1 kHz"\nstart = "-0.100 s"': f'rate = "{rng.choice([500, 1000])} Hz"\n'
        f'start = "-{rng.uniform(0.05, 0.3):.3f} s"',
    }
    text = rig.text
    for old, new in words.items():
        assert old in text, old
        text = text.replace(old, new)
    return load_rig(text)


def _listed(values: Sequence[float] | np.ndarray, unit: str) -> str:
    return "[" + ", ".join(f'"{value:.3f} {unit}"' for value in values) + "]"


def drawn_pair(rng: np.random.Generator) -> Plan:
    """A pair of runs of any payload, with counter-masses that nearly balance it, and without."""
    payload = float(rng.uniform(1.5, 5.0))
    mass = 10.0917 + (payload - 1.451) * 3.993 * float(rng.uniform(0.9, 1.1))
    return plan(
        round(payload, 2), round(mass, 3), [str(rng.choice(["x", "y"]))], [float(rng.choice([1.0, 1.5, 2.0, 3.0]))]
    )


def five_bar(folder: Path) -> tuple[Rig, Plan]:
    """What `testbench new --from five-bar` writes, with three repeats."""
    new_project(folder, "five-bar")
    planned = load_plan(folder / "plan.toml")
    return load_rig(folder / "rig.toml"), planned.model_copy(update={"repeats": 3})


BENCHES: dict[str, Callable[[np.random.Generator, Path], tuple[Rig, Plan]]] = {
    "shipped": lambda rng, folder: (load_rig("parallelogram-6bar"), drawn_plan(rng)),
    "deep": lambda rng, folder: (load_rig("parallelogram-6bar-deep"), drawn_plan(rng)),
    "random, a pair": lambda rng, folder: (drawn_rig(rng), drawn_pair(rng)),
    REPEATS: lambda rng, folder: five_bar(folder / "five-bar"),
}


def drawn_plan(rng: np.random.Generator) -> Plan:
    """One payload, with the counter-masses that balance it and without, both motions, up to two peaks and repeats."""
    payload, mass = [(1.451, 10.0917), (3.4116, 17.1105), (5.0, 24.2626)][int(rng.integers(3))]
    peaks = sorted(rng.choice([1.0, 2.0, 3.0, 4.0 if payload < 2.0 else 2.5], int(rng.integers(1, 3)), replace=False))
    return plan(payload, mass, ["x", "y"], [float(p) for p in peaks], int(rng.integers(1, 3)))


def study(count: int, brief: bool) -> Iterator[Row]:
    """Share of lies that are found, and of honest campaigns that are suspected, by bench."""
    for bench, draw in list(BENCHES.items())[: 1 if brief else None]:
        lies = LIES_BESIDE_REPEATS if bench == REPEATS else LIES
        found: dict[str, list[bool]] = {name: [] for name in lies}
        suspected, accused = list[bool](), list[bool]()
        for seed in range(count):
            rng = np.random.default_rng([seed, 913])
            with TemporaryDirectory() as folder:
                runs, witnesses = simulated(*draw(rng, Path(folder)), seed), Witnesses()
            suspected.append(bool(witnesses.hear(runs).contradictions))
            for name, lie in lies.items():
                if applies(name, runs):
                    told, liars = lie.tell(runs, int(rng.choice(shaking(runs))), rng)
                    heard = witnesses.hear(told)
                    found[name].append(is_found(heard, lie, liars))
                    accused.append(accuses(heard, liars))
        yield Row(
            f"{bench}: honest campaigns with a finding",
            sum(suspected) / count,
            "",
            None,
            0.05,
            f"{sum(suspected)} of {count}",
        )
        share = sum(accused) / len(accused)
        yield Row(f"{bench}: lies for which an honest run is named too", share, "", None, None,
                  f"{sum(accused)} of {len(accused)}")  # fmt: skip
        for name, hits in found.items():
            if hits:
                yield Row(
                    f"{bench}: {name}, found", sum(hits) / len(hits), "", 0.95, None, f"{sum(hits)} of {len(hits)}"
                )
