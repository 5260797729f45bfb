"""Records that end or begin in mid-motion are named; honest ones of any length, and motions that repeat, are not."""

from dataclasses import replace

import numpy as np
import pytest

from studies import lies
from studies.lies import Witnesses
from studies.simulated_runs import with_values
from testbench.campaign_plan import load_plan
from testbench.cross_examination.observation import SPEED_RATE_HZ, Observation
from testbench.cross_examination.paths import encoder_paths, record_ends
from testbench.project import new_project
from testbench.rig import load_rig
from testbench.rig.sensors import Torque
from testbench.runs.si_run import SIRun
from testbench.vibration.metrics import Measure
from testbench.vibration.reduction import analyze

ARM = """<mujoco model="arm">
  <option gravity="0 0 0"/>
  <worldbody>
    <body name="upper">
      <inertial pos="0.1 0 0" mass="3" diaginertia="0.01 0.02 0.02"/>
      <joint name="J1" type="hinge" axis="0 0 1"/>
      <site name="counter_upper" pos="-0.15 0 0"/>
      <body name="fore" pos="0.25 0 0">
        <inertial pos="0.08 0 0" mass="2" diaginertia="0.004 0.01 0.01"/>
        <joint name="J2" type="hinge" axis="0 0 1"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="J1"/><motor joint="J2"/></actuator>
</mujoco>
"""
MOTION = """driven = "joints"
joints = ["J1", "J2"]
start = ["0 rad", "0.5 rad"]
peak_acceleration = "40 rad/s^2"
rest = "0.15 s"
moves = [{ joint = "J1", to = ["40 deg", "0 deg"] }, { joint = "J2", to = ["-30 deg", "28.6 deg"] }]
"""
PLAN = """mechanism = "arm.xml"
repeats = 2
seed = 1
[[conditions]]
counter_masses = { counter_upper = "9 kg" }
motion = "swing.toml"
"""


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """Four runs of an own arm, with and without its counter-mass, twice; observed once; four more."""
    folder = tmp_path_factory.mktemp("arm")
    (folder / "arm.xml").write_text(ARM, encoding="utf-8")
    new_project(folder / "project", str(folder / "arm.xml"))
    (folder / "project" / "swing.toml").write_text(MOTION, encoding="utf-8")
    (folder / "project" / "plan.toml").write_text(PLAN, encoding="utf-8")
    rig = load_rig(folder / "project" / "rig.toml")
    plan = load_plan(folder / "project" / "plan.toml")
    return lies.simulated(rig, plan, 3), Witnesses(), lies.simulated(rig, plan, 4)


@pytest.mark.parametrize("cut", [(0,), (1, 3)])
@pytest.mark.parametrize("stored", [True, False])
def test_a_record_cut_in_mid_motion_is_withheld(campaign, cut, stored):
    """By the stored motion, or without it by the other runs; the cut runs alone, and what is made of them."""
    runs = [run if stored else replace(run, inputs={"mechanism": run.inputs["mechanism"]}) for run in campaign[0]]
    assert all(("motion" in run.inputs) is stored for run in runs)
    assert not Witnesses().hear(runs).findings
    rng = np.random.default_rng(len(cut))
    told = [lies.cut_short(run, rng) if i in cut else run for i, run in enumerate(runs)]
    found = Witnesses().hear(told)
    assert {(s.run, s.code) for s in found.contradictions} == {(runs[i].name, "short_record") for i in cut}
    assert all("ends in mid-motion" in s.witnessed for s in found.contradictions)
    analysis = analyze(told, Measure())
    assert all(r.interval is None and "short_record" in r.doubts for r in analysis.reductions)
    given = analyze(told, Measure(), ["short_record"])
    assert any(r.interval is not None and "short_record" in r.doubts for r in given.reductions)


def test_a_gain_is_no_other_mass(campaign):
    """Torques in another unit in one run accuse no repeat of it, of other counter-masses."""
    runs = campaign[0]
    odd = next(i for i, run in enumerate(runs) if run.conditions["counter_masses"])
    torques = [column.channel for column in SIRun.of(runs[odd]).rig.columns_of(Torque)]
    told = list(runs)
    for channel in torques:
        told[odd] = with_values(told[odd], channel, 100.0 * told[odd].channel(channel))
    found = campaign[1].hear(told).contradictions
    assert {(s.run, s.code) for s in found} == {(runs[odd].name, "gain_contradiction")}


def test_exchanged_masses_of_repeats(campaign):
    """The torques tell which two of four runs."""
    runs, witnesses, _ = campaign
    told, liars = lies.LIES["with and without exchanged"].tell(runs, 0, np.random.default_rng(1))
    found = witnesses.hear(told)
    assert {(s.run, s.code) for s in found.contradictions} == {(r, "counter_mass_contradiction") for r in liars}
    assert len(liars) == 2
    assert all(found.why_unwitnessed(r).startswith("its masses are contradicted") for r in liars)


@pytest.mark.parametrize("lie", ["with and without exchanged", "axes exchanged in one run", "gain halved in one run"])
def test_what_contradicts_is_no_noise_of_other_conditions(campaign, lie):
    """Another condition has the intervals that it has alone."""
    runs, _, more = campaign
    again = [
        replace(r, path=r.path.with_name(f"{r.name}b.h5"), conditions={**r.conditions, "motion": "again"}) for r in more
    ]
    told, _ = lies.LIES[lie].tell(runs, 0, np.random.default_rng(1))
    alone = {r.axis: r.interval for r in analyze(again, Measure()).reductions}
    both = {r.axis: r.interval for r in analyze([*told, *again], Measure()).reductions if r.key.motion == "again"}
    assert both == alone
    assert any(alone.values())


def test_torques_do_not_part_the_noise_of_conditions(campaign):
    """In another unit in one run they spoil no number of the base, which stays as it is."""
    runs, _, more = campaign
    again = [
        replace(r, path=r.path.with_name(f"{r.name}b.h5"), conditions={**r.conditions, "motion": "again"}) for r in more
    ]
    told = list(runs)
    for column in SIRun.of(runs[0]).rig.columns_of(Torque):
        told[0] = with_values(told[0], column.channel, 100.0 * told[0].channel(column.channel))
    both, honest = (analyze([*some, *again], Measure()) for some in (told, runs))
    assert "gain_contradiction" in {finding.code for finding in both.findings}
    assert [r.interval for r in both.reductions] == [r.interval for r in honest.reductions]


def bump(duration):
    """Speeds of one joint, 100 a second, that turns and rests again."""
    return np.sin(np.pi * np.linspace(0.0, 1.0, round(100 * duration))) ** 2


def seen(name, *parts, motion="swing", stored=None):
    """A run whose encoder shows speeds one after the other, and noise."""
    speeds = np.concatenate([np.atleast_1d(part) for part in parts])[:, None]
    noise = np.random.default_rng(len(name)).normal(0.0, 0.005, speeds.shape)
    one = Observation(name, {"motion": motion}, load_rig("parallelogram-6bar"), encoders=("q",))
    one.encoder_speeds = (speeds + noise).astype(np.float32)
    one.commanded_speeds = {} if stored is None else {"q": stored}
    return one


REST = np.zeros(40)
SWING = np.concatenate([REST, bump(0.4), REST, -bump(0.7), REST, bump(0.5), REST])
PICKS = np.concatenate([REST, np.tile(np.concatenate([bump(0.4), REST[:10], -bump(0.4), REST[:10]]), 10), REST])
TURNS = np.sin(2.0 * np.pi * np.arange(1000) / 80.0)
STEADY = np.concatenate([REST, np.linspace(0.0, 1.0, 30), np.ones(600), np.linspace(1.0, 0.0, 30), REST])


@pytest.mark.parametrize(
    ("one", "other", "stored", "said"),
    [
        (SWING, SWING, None, ""),
        (SWING[30:-35], SWING, SWING, ""),
        (SWING[:160], SWING, None, "ends in mid-motion"),
        (SWING[150:], SWING, None, "begins"),
        (SWING[:75], SWING[:150], None, ""),
        (SWING[:200], None, SWING, "ends in mid-motion"),
        (SWING[140:205], None, SWING, "begins and ends"),
        (SWING[:110], None, SWING, "ends in mid-motion"),
        (SWING[:110], SWING, None, ""),
        (SWING[30:-35], np.concatenate([SWING, bump(0.9), REST]), None, ""),
        (TURNS[:370], TURNS, None, ""),
        (TURNS[:370], np.concatenate([REST, TURNS, REST]), np.concatenate([REST, TURNS, REST]), ""),
        (STEADY[:300], STEADY, STEADY, ""),
        (bump(3.0)[:150], SWING, SWING, ""),
        (PICKS[:170], PICKS, None, ""),
        (PICKS[:60], PICKS, PICKS, "ends in mid-motion"),
        (TURNS[20:140], np.concatenate([REST, TURNS, REST]), None, ""),
        (SWING, np.tile(SWING, 3), np.tile(SWING, 3), ""),
    ],
    ids=["whole", "hardly any rest", "cut", "begun late", "all cut", "by the motion", "both ends",
         "a move less by the motion", "a move less than a run that goes home", "goes home", "turns on",
         "turns of a whole record", "steady", "another motion", "one cycle and a part of ten",
         "a part of a cycle", "a turn and a half", "one of three swings"],
)  # fmt: skip
def test_where_a_record_ends(one, other, stored, said):
    """Beside another run of the motion, or the motion that is stored."""
    runs = [seen("r1", one, stored=stored), *([] if other is None else [seen("r22", other)])]
    found = record_ends(runs)
    assert [s.run for s in found] == (["r1"] if said else [])
    assert all(said in s.witnessed for s in found)
    assert not record_ends([seen("r1", one), seen("r22", SWING, motion="another")])


def test_an_accelerometer_alone_is_compared_with_its_repeats():
    """Without encoders; of records that are cut before they are kept nothing is said."""

    def shaken(name, samples, begin=0):
        one = Observation(name, {"motion": "swing"}, load_rig("parallelogram-6bar"))
        t = np.arange(samples) / 100.0
        envelope = np.exp(-2.0 * np.abs(t - 1.0)) * (t > 0.4) * (t < 1.8)
        values = np.column_stack([envelope * np.sin(40.0 * t), 0.5 * envelope * np.cos(40.0 * t)])
        noise = np.random.default_rng(len(name)).normal(0.0, 0.01, values.shape)
        one.vibrations = {("x", "y"): (values + noise)[begin:].astype(np.float32)}
        return one

    assert not record_ends([shaken("r1", 300), shaken("r22", 260)])
    (late,) = record_ends([shaken("r1", 300, 100), shaken("r22", 300)])
    (early,) = record_ends([shaken("r1", 110), shaken("r22", 300)])
    assert (early.run, late.run) == ("r1", "r1")
    assert "ends in mid-motion" in early.witnessed
    assert "begins in mid-motion" in late.witnessed
    assert not record_ends([shaken("r1", 110), shaken("r22", 3000)])


def _move(distance: float, seconds: float) -> np.ndarray:
    """Speeds of a smooth move between two rests of a second."""
    time, rest = np.arange(0.0, seconds, 1.0 / SPEED_RATE_HZ), np.zeros(int(SPEED_RATE_HZ))
    return np.concatenate([rest, distance / seconds * (1.0 - np.cos(2.0 * np.pi * time / seconds)), rest])


def _lagging(speeds: np.ndarray, seconds: float) -> np.ndarray:
    """What a position loop of first order makes of speeds (n, k)."""
    share, found = 1.0 - np.exp(-1.0 / (SPEED_RATE_HZ * seconds)), np.zeros_like(speeds)
    for i in range(1, len(speeds)):
        found[i] = found[i - 1] + share * (speeds[i] - found[i - 1])
    return found


TURN = np.linspace(0.0, 40.0 * np.pi, 1000)
SINES = np.column_stack([np.sin(TURN), np.cos(TURN)])
MOVE = np.column_stack([_move(1.0, 0.4), _move(0.5, 0.4)])
BY_HAND = np.vstack([np.column_stack([_move(3.0, 0.8), _move(-2.0, 0.8)]), MOVE])
PART = np.column_stack([MOVE[:, 0], np.r_[_move(0.5, 0.1), _move(-0.3, 0.2)][: len(MOVE)]])
SHOWN = {
    "a part of what repeats": (SINES[:300], SINES, {}),
    "a loop that lags": (_lagging(MOVE, 0.067), MOVE, {}),
    "moved by hand before": (BY_HAND, MOVE, {}),
    "another motion": (np.column_stack([_move(1.0, 1.6), _move(0.5, 1.6)]), MOVE,
                       {"q0": "motion: the path of another motion", "q1": "path of another motion"}),
    "farther": (1.3 * MOVE, MOVE, {"q0": "1.3 times as far", "q1": "1.3 times as far"}),
    "one farther": (MOVE * [1.0, 1.3], MOVE, {"q1": "encoder scale: 1.3 times as far, unlike q0: another scale or unit "
                                                     "of this encoder, or the motion of the run table is another"}),
    "one in mm": (MOVE * [1.0, 1000.0], MOVE, {"q1": "encoder unit: 1e+03 times as far: the log is in mm where the rig "
                                                     "says m"}),
    "one in m": (MOVE * [1.0, 1e-3], MOVE, {"q1": "the log is in m where the rig says mm"}),
    "one reversed, one farther": (MOVE * [-1.0, 1.5], MOVE, {"q0": "encoder sign: reversed", "q1": "1.5 times as far"}),
    "one in degrees, one unlike": (PART * [np.rad2deg(1.0), 1.0], MOVE,
                                   {"q0": "the log is in deg", "q1": "path of another motion or joint"}),
    "the other joint": (MOVE[:, ::-1], MOVE,
                        {"q0": "that of q1, exchanged in the rig or the log", "q1": "encoder joint: "}),
}  # fmt: skip


def _moved(name, shown, stored=None):
    """A run whose encoders q0 and q1 show these speeds (n, 2)."""
    one = Observation(name, {"motion": "m"}, None, encoders=("q0", "q1"))
    one.encoder_speeds = shown.astype(np.float32)
    one.commanded_speeds = {} if stored is None else dict(zip(one.encoders, stored.T, strict=True))
    return one


@pytest.mark.parametrize("case", SHOWN)
def test_encoders_beside_the_stored_path(case):
    """Honest records that are parts, late or longer are none of another motion; what is one is told, with the joint."""
    shown, wanted, messages = SHOWN[case]
    found = [s for s in encoder_paths([_moved("r1", shown, wanted)]) if s.code]
    assert len(found) == len(messages)
    for channel, message in messages.items():
        assert [message in f"{s.subject}: {s.witnessed}" for s in found if s.channel == channel] == [True]


@pytest.mark.parametrize(
    ("liar", "messages"),
    [
        (lambda speeds: speeds, {"q0": "they agree", "q1": "they agree"}),
        (lambda speeds: speeds * [1.0, -1.0], {"q0": "they agree", "q1": "reversed"}),
        (lambda speeds: speeds * [1.0, np.rad2deg(1.0)], {"q0": "they agree", "q1": "the log is in deg"}),
        (lambda speeds: speeds * [1.0, 2.0], {"q0": "they agree", "q1": "times as far, unlike q0"}),
        (lambda speeds: speeds[:, ::-1], {"q0": "that of q1", "q1": "that of q0"}),
        (lambda speeds: 2.0 * speeds, {}),
        (lambda speeds: np.cumsum(speeds, axis=0) / 10.0, {}),
    ],
    ids=["honest", "reversed", "in degrees", "twice as far", "exchanged", "all twice as far", "another motion"],
)
def test_encoders_beside_other_runs(liar, messages):
    """Of repeats that differ by 0.3 %: what contradicts is told, nothing is said of another motion or without most."""
    phase, envelope = np.linspace(0.0, 20.0, 800), np.sin(np.linspace(0.0, np.pi, 800)) ** 2
    speeds = np.column_stack([envelope * np.sin(phase), envelope * np.sin(1.6 * phase + 1.0)])
    honest, texts = [_moved(f"r{i}", (1.0 + 0.003 * i) * speeds) for i in range(3)], []
    for runs in ([*honest, _moved("odd", liar(speeds))], [_moved("odd", liar(speeds)), *honest[::-1]]):
        said = encoder_paths(runs)
        assert {s.run for s in said if s.code} <= {"odd"}
        assert sum(s.run != "odd" and s.witnessed == "they agree" for s in said) == 6
        about = [s for s in said if s.run == "odd"]
        assert len(about) == len(messages)
        for channel, message in messages.items():
            assert [message in s.witnessed for s in about if s.channel == channel] == [True]
        texts.append([s.witnessed for s in about])
    assert texts[0] == texts[1], "in whatever order"
    two = [_moved("r1", speeds), _moved("r2", speeds), _moved("r3", liar(speeds)), _moved("r4", liar(speeds))]
    assert not [s for s in encoder_paths(two) if s.code], "two against two"
