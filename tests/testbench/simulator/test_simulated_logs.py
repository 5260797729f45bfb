"""Runs in memory: the same as in a folder, drawn anew for each seed; every effect of the rig that states all shows."""

import re
import tomllib

import numpy as np
import polars
import pytest

from balance.mechanism.mjcf_parser import load_mechanism
from testbench import campaign_plan
from testbench import campaign_plan as plans
from testbench import rig as rigs
from testbench.errors import RigError
from testbench.rig import load_rig, rig_from_text
from testbench.rig.bench import Bench
from testbench.simulator import campaign, simulated_logs
from testbench.simulator.run import simulate_run
from testbench.simulator.sensors import draw_transducers

PLAN = plans.plan_from_text("""
mechanism = "parallelogram-6bar"
seed = 3
[[conditions]]
payload = "5 kg"
motion = "y"
peak_acceleration = "4 g0"
""")
RIG = rigs.load_rig("parallelogram-6bar")
SETTINGS = {
    "floor": "VC-A",
    "roughness": {"force": "0.5 N"},
    "errors": {"k6d40": {"sensitivity": 0.01}, "kistler": {"drift_per_minute": 0.001, "high_pass": "0.05 Hz"}},
}


def restless() -> rigs.Rig:
    """The shipped rig on a floor, with errors of its sensors and a daq that loses samples."""
    stated = Bench.model_validate(SETTINGS)
    daq = RIG.loggers["daq"].model_copy(update={"lost": 0.001, "start_scatter": 0.02})
    changed = RIG.bench.model_copy(update={key: getattr(stated, key) for key in SETTINGS})
    return RIG.model_copy(update={"bench": changed, "loggers": {**RIG.loggers, "daq": daq}})


def test_as_in_a_folder(tmp_path):
    """Logs in memory are the logs in the folder, to the written decimals; the truth has what was drawn of them."""
    rig = restless()
    (run,) = simulated_logs.simulate_logs(PLAN, rig)
    campaign.simulate_campaign(PLAN, rig, tmp_path / "logs")
    log = polars.read_csv(tmp_path / "logs" / "r001_daq.csv", comment_prefix="#")
    assert log["AccY (g)"].to_numpy() == pytest.approx(run.logs["daq"].columns["AccY"], abs=0.51e-5)
    truth = polars.read_parquet(tmp_path / "logs" / "truth" / "r001_daq.instants.parquet")
    assert np.array_equal(truth["true_s"], run.logs["daq"].true_time)
    assert len(truth) == len(log)
    assert not (tmp_path / "logs" / "truth" / "r001_forces.instants.parquet").exists()


def test_seeds():
    """Another seed is another campaign: noise, floor, sensors; the mechanism does the same."""
    rig = restless()
    (one,), (same,), (other,) = (simulated_logs.simulate_logs(PLAN, rig, seed) for seed in (3, None, 4))
    assert np.array_equal(one.logs["forces"].columns["Fx1"], same.logs["forces"].columns["Fx1"])
    assert not np.array_equal(one.bench.motion.acceleration, other.bench.motion.acceleration)
    assert one.loggers["daq"].start != other.loggers["daq"].start
    assert np.array_equal(one.bench.wrench, other.bench.wrench)


def test_recorded_often():
    """One run without chance serves many recordings: the same as simulated for each."""
    rig, (planned,) = restless(), PLAN.runs()
    run = simulate_run(rig, load_mechanism(rig.mechanism), planned, simulated_logs.lead_s(rig))
    for seed in (8, 9):
        again = simulated_logs.record_run(rig, planned, run, draw_transducers(rig, seed), (seed, 0))
        (whole,) = simulated_logs.simulate_logs(PLAN, rig, seed)
        assert np.array_equal(again.logs["daq"].columns["AccX"], whole.logs["daq"].columns["AccX"])


def test_it_shakes_before_the_motion():
    """Where the floor shakes, it does so from a logger's first sample on; the motion starts at zero all the same."""
    (run,) = simulated_logs.simulate_logs(PLAN, restless())
    time, logged = run.bench.time, run.logs["daq"]
    assert time[0] < logged.true_time[0] < 0.0
    assert logged.columns["AccY"][logged.true_time < 0.0].std() > 1.5 * 0.002
    moving = np.abs(run.bench.command.acceleration).max(axis=1) > 0.0
    assert time[moving].min() == pytest.approx(0.15, abs=2e-3)
    assert simulated_logs.lead_s(RIG) == 0.0


def test_force_sensors_feel_the_floor():
    """Newton for the bare base holds with floor and roughness: springs and dampers work against the moving floor."""
    run = next(simulated_logs.simulate_logs(PLAN, restless())).bench
    own = run.motion.acceleration @ (run.base.mass - run.mechanism_inertia).T
    mounts = run.motion.velocity @ run.base.damping.T + run.motion.displacement @ run.base.stiffness.T
    floor = own + mounts - run.transmitted_wrench
    assert np.abs(floor[:, :3]).max() > 1.0
    spectrum = np.abs(np.fft.rfft(floor[:, 1])) ** 2
    f = np.fft.rfftfreq(len(floor), run.step)
    assert spectrum[(f >= 3.9) & (f <= 80.1)].sum() > 0.999 * spectrum.sum()


PLAIN, DEEP = load_rig("parallelogram-6bar"), load_rig("parallelogram-6bar-deep")
NEW = {"coupling", "weight", "tilt", "floor", "planes", "rotors", "roughness", "modes", "errors"}


def test_the_same_bench_with_more():
    """Sensors, mounts and base are those of the plain rig; every effect that a bench can have is stated."""
    plain, deep = tomllib.loads(PLAIN.text), tomllib.loads(DEEP.text)
    assert deep["sensors"]["base_acc"].pop("high_pass") == "0.3 Hz"
    assert deep["sensors"] == plain["sensors"]
    assert {key: value for key, value in deep["bench"].items() if key not in NEW} == plain["bench"]
    assert deep["bench"].keys() >= NEW
    for name, logger in plain["loggers"].items():
        assert {key: deep["loggers"][name][key] for key in logger} == logger


def test_every_effect_shows():
    """Taking out any effect of the deep rig changes what the sensors would show: none is stated and then forgotten."""
    planned = campaign_plan.plan_from_text("""
    mechanism = "parallelogram-6bar"
    [[conditions]]
    payload = "5 kg"
    motion = "x"
    peak_acceleration = "2 g0"
    """)

    (run,) = planned.runs()
    mechanism, lead = load_mechanism(DEEP.mechanism), simulated_logs.lead_s(DEEP)

    def logs(stand, bench) -> list[np.ndarray]:
        recorded = simulated_logs.record_run(stand, run, bench, draw_transducers(stand, 1), (1, 0))
        return [values for log in recorded.logs.values() for values in log.columns.values()]

    still = simulate_run(DEEP, mechanism, run, lead)
    whole = logs(DEEP, still)
    for key in sorted(NEW):
        without = DEEP.bench.model_copy(update={key: getattr(PLAIN.bench, key)})
        rig = DEEP.model_copy(update={"bench": without})
        drawn_later = key in ("errors", "floor", "roughness")
        less = logs(rig, still if drawn_later else simulate_run(rig, mechanism, run, lead))
        assert any(len(a) != len(b) or not np.array_equal(a, b) for a, b in zip(whole, less, strict=True)), key


def test_plan_of_repeats():
    """The deep plan has the published conditions, each three times."""
    published = {
        (r.payload, r.motion, r.peak_acceleration, bool(r.counter_masses))
        for r in campaign_plan.load_plan("kiper2019").runs()
    }
    runs = campaign_plan.load_plan("kiper2019-deep").runs()
    assert {(r.payload, r.motion, r.peak_acceleration, bool(r.counter_masses)) for r in runs} == published
    assert [run.repeat for run in runs[:4]] == [1, 2, 3, 1]
    assert len(runs) == 3 * len(published)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('floor = "VC-A"', 'floors = "VC-A"', r"bench\.floors: unknown key; did you mean 'floor'"),
        ("[bench.rotors.A0]", "[bench.rotors.A0]\nmass = 1", r"bench\.rotors\.A0\.mass: unknown key"),
        ("sensitivity = 0.015", "sensitivities = 0.015", r"bench\.errors\.base_acc\.sensitivities.*'sensitivity'"),
        ("sensitivity = 0.015", "sensitivity = 1.5", r"bench\.errors\.base_acc\.sensitivity: 1\.5"),
        ("damping = 0.015", "damping = 0", r"bench\.modes\[0\]\.damping: 0"),
        ('AC = "22 mm"', 'AC = "22"', r"bench\.planes\.AC: '22' has no unit"),
        ('jitter = "40 us"', 'jitter = "-40 us"', r"loggers\.controller\.jitter: .*zero or more"),
        ('low_pass = "2 kHz"', 'low_pass = "0 Hz"', r"loggers\.daq\.low_pass.*more than zero"),
        ("lost = 0.0005", "lost = 1.0", r"loggers\.controller\.lost"),
        ('coupling = "moving"', 'coupling = "loose"', r"bench\.coupling: 'loose': expected"),
    ],
)
def test_wrong_value(old, new, said):
    """A wrong key or value is blamed on its place."""
    assert old in DEEP.text
    with pytest.raises(RigError, match=re.compile(said)):
        rig_from_text(DEEP.text.replace(old, new, 1))
