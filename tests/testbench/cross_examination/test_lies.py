"""Each lie about one run of a simulated campaign is found by its code; the honest campaign has no finding."""

import json
import shutil
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from balance.units import G0
from studies import lies
from studies.lies import LIES, LIES_BESIDE_REPEATS, Witnesses
from studies.simulated_runs import with_values
from testbench.cross_examination import sensors
from testbench.cross_examination.conditions import accelerations, exchanged_logs, in_grams, unlike_repeats
from testbench.cross_examination.copies import OneRecording
from testbench.cross_examination.examination import Examination, _since, _whose
from testbench.cross_examination.observation import (
    DRIVE_TERMS,
    ChannelRecord,
    Observation,
    Response,
    TorqueEquations,
)
from testbench.cross_examination.peak_accelerations import Peak
from testbench.cross_examination.repeated_sizes import outlying, repeated_sizes
from testbench.cross_examination.repeated_vibration import repeated_vibration
from testbench.cross_examination.statement import Statement
from testbench.cross_examination.torque_comparison import EXPLAINS, compared
from testbench.rig import load_rig
from testbench.rig.sensors import Accelerometer, Encoder, ForceSensor, Torque, Wrench
from testbench.runs.si_run import SIRun
from testbench.store import open_campaign
from testbench.store.ledger import enter_not_stored, read_ledger
from testbench.vibration.metrics import Measure
from testbench.vibration.reduction import analyze, verdict


@pytest.fixture(scope="module")
def campaign():
    """Four runs of the shipped bench, x and y, with and without counter-masses; observed once."""
    return lies.simulated(load_rig("parallelogram-6bar"), lies.plan(5.0, 24.2626, ["x", "y"], [2.0]), 3), Witnesses()


@pytest.fixture(scope="module")
def deep():
    """The same on the deep bench: floor, roughness, tilt, rotors, elastic modes, faults of sensors and loggers."""
    rig = load_rig("parallelogram-6bar-deep")
    return lies.simulated(rig, lies.plan(3.4116, 17.1105, ["x", "y"], [2.0]), 4), Witnesses()


@pytest.mark.parametrize("bench", ["campaign", "deep"])
def test_an_honest_campaign_has_no_finding(bench, request):
    """No contradiction, and every subject is witnessed without counter-masses but signs of axes that do not move."""
    runs, witnesses = request.getfixturevalue(bench)
    found = witnesses.hear(runs)
    assert not found.findings
    assert all(s.witnessed.startswith("it stays within") for s in found.statements if s.subject == "rest")
    for i in lies.shaking(runs):
        across = {"x": "Y", "y": "X"}[runs[i].conditions["motion"]]
        unsigned = {channel for text in found.unwitnessed(runs[i].name) for channel in text[8:].split(", ")}
        assert {f"Plat{across}"} <= unsigned <= {f"Plat{across}", f"Acc{across}", "AccZ"}


@pytest.mark.parametrize(("name", "motion"), [(name, i % 2) for i, name in enumerate(LIES)])
def test_a_lie_is_found(campaign, name, motion):
    """By the right code about the right run, of x or y; runs that do not lie are not withheld."""
    runs, witnesses = campaign
    changed, liars = LIES[name].tell(runs, lies.shaking(runs)[motion], np.random.default_rng(motion))
    found = witnesses.hear(changed)
    assert lies.is_found(found, LIES[name], liars)
    assert {s.run for s in found.contradictions} <= liars


@pytest.mark.parametrize("name", ["payload of one run", "payload of all runs"])
def test_a_payload_stated_of_its_body(campaign, name):
    """A column ``payload_platform_kg`` says the same as ``payload_kg``, in some runs or in all, honest or not."""
    runs, witnesses = campaign
    changed, _ = LIES[name].tell(runs, lies.shaking(runs)[0], np.random.default_rng(2))
    for stated in (runs, changed):
        for some in (1, len(runs)):
            conditions = [dict(run.conditions) for run in stated[:some]]
            moved = [{"payloads": {"platform": one.pop("payload_kg")}, **one} for one in conditions]
            other = [replace(run, conditions=one) for run, one in zip(stated, moved, strict=False)]
            assert witnesses.hear([*other, *stated[some:]]).statements == witnesses.hear(stated).statements


@pytest.mark.parametrize("name", ["payload of one run", "with and without exchanged", "axes exchanged in one run"])
def test_a_lie_is_found_on_the_deep_bench(deep, name):
    """Among all that the model does not have."""
    runs, witnesses = deep
    changed, liars = LIES[name].tell(runs, lies.shaking(runs)[0], np.random.default_rng(2))
    assert lies.is_found(witnesses.hear(changed), LIES[name], liars)


def test_a_motion_that_command_and_encoders_contradict_is_said_once(campaign):
    """The controller's log of another run: one line, that names both."""
    runs, witnesses = campaign
    log, changed = SIRun.of(runs[0]).rig.columns("controller"), list(runs)
    for column in log:
        values = np.resize(runs[0].channel(column.channel), len(runs[2].channel(column.channel)))
        changed[2] = with_values(changed[2], column.channel, values)
    said = [s for s in witnesses.hear(changed).contradictions if s.code == "motion_contradiction"]
    assert [(s.run, s.witness) for s in said] == [(runs[2].name, "the command and the encoders")]


@pytest.mark.parametrize("factor", [9.81, 1.0 / 9.81, 3.0])
def test_a_run_in_another_unit(campaign, factor):
    """A factor that is near that of two units says which, by the model or by the noise."""
    runs, witnesses = campaign
    for i in lies.shaking(runs)[0], next(i for i in range(len(runs)) if i not in lies.shaking(runs)):
        told = [lies.scaled(run, factor) if n == i else run for n, run in enumerate(runs)]
        found = witnesses.hear(told).contradictions
        assert {(s.run, s.code) for s in found} <= {
            (runs[i].name, "gain_contradiction"),
            (runs[i].name, "flat_channel"),
        }
        assert any("as of m/s^2 read as g" in s.witnessed for s in found) is (factor == 9.81)


def test_a_torque_that_is_reversed_in_all_runs(campaign):
    """No run has it right: the model alone is the witness, as of forces."""
    runs, witnesses = campaign
    found = witnesses.hear([with_values(run, "tau1", -run.channel("tau1")) for run in runs])
    named = {(s.run, s.channel) for s in found.contradictions if s.code == "sign_contradiction"}
    assert {channel for _, channel in named} == {"tau1"}
    assert {run for run, _ in named} >= {runs[i].name for i in lies.shaking(runs)}


def test_a_base_that_is_not_stated_accuses_no_sensor(campaign):
    """A stiff base of a rig that states its weight alone: a frame on four feet is assumed, and is no witness."""
    head, _, _ = campaign[0][0].rig.partition("[bench]")
    runs = [lies.scaled(replace(run, rig=f"{head}[bench]\nweight = true\n"), 1e-3) for run in campaign[0]]
    about = [s for s in Witnesses().hear(runs).statements if (s.channel or "").startswith("Acc")]
    assert not any(s.code or s.witness == "the model of the motion" for s in about)


def test_a_reversed_sensor_is_found_where_no_other_run_shakes():
    """The balanced run of the pair shows noise alone: the model, right in all but the sign, is the only witness.

    A rig that states a base of other stiffness accuses no sensor: its model opposes the readings otherwise.
    """
    rig = lies.slimmed(load_rig("parallelogram-6bar"))
    runs, witnesses = lies.simulated(rig, lies.plan(3.4116, 17.1105, ["y"], [1.0]), 6), Witnesses()
    (shaking,) = lies.shaking(runs)
    changed, liars = LIES["accelerometer reversed"].tell(runs, shaking, np.random.default_rng(0))
    found = witnesses.hear(changed)
    assert {s.run for s in found.contradictions if s.code == "sign_contradiction"} == liars
    for stiffness in ("20 kN/m", "80 kN/m", "2000 kN/m"):
        text = rig.text.replace('"250 kN/m", "400 kN/m", "250 kN/m"', ", ".join([f'"{stiffness}"'] * 3))
        assert text != rig.text
        honest = witnesses.hear([replace(run, rig=text) for run in runs])
        assert "sign_contradiction" not in {s.code for s in honest.contradictions}


@pytest.fixture(scope="module")
def repeats(tmp_path_factory):
    """Three runs of a five-bar each side, as `testbench new` describes it; observed once."""
    return lies.simulated(*lies.five_bar(tmp_path_factory.mktemp("project") / "five-bar"), 1), Witnesses()


@pytest.mark.parametrize("name", list(LIES_BESIDE_REPEATS))
def test_a_lie_is_found_beside_repeats(repeats, name):
    """By the right code about the right run, and every channel that it concerns; the honest campaign has no finding."""
    runs, witnesses = repeats
    assert not witnesses.hear(runs).findings
    changed, liars = LIES_BESIDE_REPEATS[name].tell(runs, lies.shaking(runs)[0], np.random.default_rng(1))
    found = witnesses.hear(changed)
    assert {(s.run, s.code) for s in found.contradictions} == {
        (r, c) for r in liars for c in LIES_BESIDE_REPEATS[name].codes
    }
    about = {(s.channel, s.stated) for s in found.contradictions if s.run == min(liars)}
    both = name in {"encoders in degrees", "axes exchanged in one run", "accelerometer turned in one run"}
    assert len(about) == 2 if both else about
    about_one_torque = name.startswith("torque")
    assert found.doubts(liars, "AccY") == (() if about_one_torque else tuple(LIES_BESIDE_REPEATS[name].codes))
    if name == "encoders in degrees":
        assert all("deg where the rig says rad" in s.witnessed for s in found.contradictions)


@pytest.fixture(scope="module")
def partly(tmp_path_factory):
    """Two five-bar runs with all counter-masses, two without, one with those of one side alone; observed once."""
    rig, planned = lies.five_bar(tmp_path_factory.mktemp("project") / "five-bar")
    (whole,) = planned.conditions
    half = {site: mass for site, mass in whole.counter_masses.items() if "left" in site}
    planned = planned.model_copy(update={"repeats": 2})
    runs = lies.simulated(rig, planned, 1)
    one = planned.model_copy(
        update={"repeats": 1, "conditions": [whole.model_copy(update={"counter_masses": half, "also_without": False})]}
    )
    (odd,) = lies.simulated(rig, one, 2)
    return [*runs, replace(odd, path=odd.path.with_name("r009.h5"))]


@pytest.mark.parametrize("turned", [False, True])
def test_one_side_was_never_mounted(partly, turned):
    """The torques, beside those of the other runs, name the run and what it carried, whatever the order of the runs."""
    witnesses, odd = Witnesses(), partly[-1]
    assert not witnesses.hear(partly).findings
    told = lies.about(odd, counter_masses=partly[0].conditions["counter_masses"], repeat=3)
    found = witnesses.hear([told, *partly[-2::-1]] if turned else [*partly[:-1], told]).contradictions
    assert {(s.run, s.code) for s in found} == {("r009", "counter_mass_contradiction")}
    carried = odd.conditions["counter_masses"]
    assert " and ".join(f"{m:g} kg at {site}" for site, m in carried.items()) in {s.witnessed for s in found}


@pytest.mark.parametrize("factor", [0.8, 1.2])
def test_the_gain_of_one_torque(partly, factor):
    """One drive's torque in one run: by how much, and that channel of that run alone."""
    for liar in (0, 2):
        values = factor * partly[liar].channel("tau_A_left")
        told = [with_values(run, "tau_A_left", values) if n == liar else run for n, run in enumerate(partly)]
        found = Witnesses().hear(told).contradictions
        assert {(s.run, s.channel, s.code) for s in found} == {(partly[liar].name, "tau_A_left", "gain_contradiction")}
        times = [float(s.witnessed.split()[0]) for s in found if "beside" in s.witness]
        assert times == [pytest.approx(factor, abs=0.04)]


def _two_joint_arm(name, speed, stated, carried, gain, rng):
    """A run of an arm of two drives, by its equations of motion; an elastic mode and noise are in no model."""
    t = np.linspace(0.0, 4.0, 1001)
    angle = [0.5 * np.sin(2 * np.pi * speed * t + i) + 0.3 * np.sin(3.4 * np.pi * speed * t + 2 * i) for i in (0, 1)]
    rate = [np.gradient(q, t) for q in angle]
    turning, products = [np.gradient(v, t) for v in rate], []
    for j, (q, v, a) in enumerate(zip(angle, rate, turning, strict=True)):
        level, coupled, still = np.cos(q), np.cos(angle[0] - angle[1]) * turning[1 - j], 0.0 * t
        model = 2.0 * a + 0.8 * coupled + 0.8 * np.sin(angle[0] - angle[1]) * rate[1 - j] ** 2 + 14.7 * level
        payload, site = 0.4 * a + 0.3 * coupled + 3.9 * level, 0.09 * a - 2.9 * level
        sites, dry = [site if j == k else still for k in (0, 1)], np.tanh(v / 0.05)
        torque = model + 2.0 * payload + 0.3 * a + 0.4 * v + 0.8 * dry + 0.1 * j
        torque += sum(carried.get(key, 0.0) * own for key, own in zip(("left", "right"), sites, strict=True))
        torque += 0.04 * np.std(model) * np.sin(12.6 * np.pi * speed * t + j) + rng.normal(0.0, 0.02, t.size)
        columns = np.column_stack(
            [(1.0 if j else gain) * torque, model, payload, *sites, still, 1.0 + still, a, v, dry]
        )
        products.append(columns.T @ columns)
    names = ("torque", "model", "payload", "left", "right", "base", *DRIVE_TERMS)
    equations = TorqueEquations(("j1", "j2"), names, np.array([products]))
    return Observation(name, {"payload_kg": 2.0, "counter_masses": stated}, None, torque=equations)


@pytest.mark.parametrize("speed", [1.5, 0.5, 0.3])
@pytest.mark.parametrize(
    ("carried", "gain", "told"),
    [({"left": 4.0, "right": 4.0}, 1.0, ""), ({"right": 4.0}, 1.0, "masses"), ({}, 1.0, "masses"),
     ({"left": 4.0, "right": 4.0}, 1.15, "gain")],
)  # fmt: skip
def test_a_run_that_is_gentler_or_faster_than_the_others(speed, carried, gain, told):
    """Down to a tenth of their accelerations it is told apart as any other run; an honest one is not."""
    rng, both = np.random.default_rng(1), {"left": 4.0, "right": 4.0}
    runs = [_two_joint_arm("odd", speed, both, carried, gain, rng)]
    runs += [_two_joint_arm(f"r{i}", 1.0, mounted, mounted, 1.0, rng) for i in range(3) for mounted in (both, {})]
    found = compared(runs).unlike
    assert list(found) == (["odd"] if told else [])
    if told == "masses":
        assert found["odd"].masses == carried
    if told == "gain":
        assert (found["odd"].joint, found["odd"].gain) == ("j1", pytest.approx(gain, abs=0.03))


HEAVY, LIGHT = {"left": 4.0, "right": 4.0}, {"left": 2.9, "right": 3.1}


def _arms(odd, seed, *, count=3):
    """Runs of a two-joint arm without counter-masses and with two sets, ``count`` each, the first of them ``odd``."""
    rng = np.random.default_rng(seed)
    first = _two_joint_arm("odd", 1.0, *odd, 1.0, rng)
    return [first] + [_two_joint_arm(f"r{i}{len(m)}{sum(m.values()):g}", 1.0, m, m, 1.0, rng)
                      for i in range(count) for m in (HEAVY, LIGHT, {})]  # fmt: skip


@pytest.mark.parametrize(("stated", "carried"), [(HEAVY, LIGHT), (LIGHT, HEAVY), (LIGHT, {}), ({}, LIGHT)])
def test_another_set_of_counter_masses_than_stated(stated, carried):
    """Of two similar ones too: that one is named, and nothing confirms the stated one."""
    found = compared(runs := _arms((stated, carried), 2))
    assert {run: one.masses for run, one in found.unlike.items()} == {"odd": carried}
    assert found.confirmed == {run.name for run in runs[1:]}


def test_counter_masses_that_no_run_states():
    """Within three standard deviations of what the scatter of the other runs leaves of a mass."""
    found = compared(_arms((HEAVY, {"left": 5.0, "right": 4.0}), 3)).unlike
    assert list(found) == ["odd"]
    assert found["odd"].masses == pytest.approx({"left": 5.0, "right": 4.0}, abs=0.1)


def test_honest_arms_are_seldom_suspected():
    """FALSE_ALARMS is 1 in 100 campaigns: of 60 two or more are one in ten thousandth; all masses are confirmed."""
    found = [compared(_arms((HEAVY, HEAVY), seed)) for seed in range(60)]
    assert sum(bool(one.unlike) for one in found) <= 2
    assert all(len(one.confirmed) == 10 for one in found if not one.unlike)


def test_sets_that_torques_do_not_tell_apart_are_not_confirmed():
    """Half a gram more at one site is below the noise: a run that states it is neither wrong nor confirmed."""
    runs = _arms((HEAVY | {"left": 4.0005}, HEAVY), 4)
    found = compared(runs)
    assert not found.unlike
    assert not {run.name for run in runs if run.counter_masses.get("left", 0.0) >= 4.0} & found.confirmed


def test_a_run_that_nothing_explains():
    """Torques of another machine beside the model's in one run: said, with how much more is left than in its peers."""
    runs = _arms((HEAVY, HEAVY), 5, count=4)
    odd = _two_joint_arm("odd", 1.0, HEAVY, HEAVY, 1.0, np.random.default_rng(5))
    products = odd.torque.products.copy()
    products[..., 0, 0] *= 1.05  # a share of the torque that is in no column
    odd.torque = replace(odd.torque, products=products)
    found = compared([odd, *runs[1:]]).unlike
    assert [(run, one.masses, one.joint) for run, one in found.items()] == [("odd", None, "")]
    assert found["odd"].times > EXPLAINS


@pytest.mark.parametrize(("rate", "most"), [(0.05, 0.065), (0.01, 0.017)])
def test_false_alarms_of_outlying_values(rate, most):
    """Of 3000 normal samples each, to three standard deviations of the count; two far ones of ten are found."""
    for count in (5, 12):
        samples = np.random.default_rng(count).normal(size=(3000, count))
        assert np.mean([outlying(values, rate).any() for values in samples]) < most
    values = np.append(np.random.default_rng(1).normal(size=10), [30.0, 40.0])
    assert np.flatnonzero(outlying(values, rate)).tolist() == [10, 11]


@pytest.mark.parametrize("factor", [1.0, 1.3, 0.77])
def test_a_gain_that_repeats_show(factor):
    """Of one channel in one of three repeats of four conditions, 2 % of scatter: that alone; else none."""
    rig, rng, runs = load_rig("parallelogram-6bar"), np.random.default_rng(7), []
    columns = [column for column in rig.columns() if column.sensor in rig.base_accelerometers][:2]
    channels = tuple(column.channel for column in columns)
    shapes = np.cumsum(rng.normal(size=(4, 400, 2)), axis=1) + 5.0 * np.sin(np.arange(400) / 7.0)[None, :, None]
    for i in range(12):
        gains = np.exp(rng.normal(0.0, 0.02, 2)) * ([1.0, factor] if i == 4 else [1.0, 1.0])
        seen = Observation(f"r{i}", {"payload_kg": 1.0 + i % 4, "motion": "x"}, rig)
        seen.vibrations[channels] = gains * shapes[i % 4] + rng.normal(0.0, 0.1, (400, 2))
        for column in columns:
            record = ChannelRecord(column, "daq", np.zeros(8), 1e3, False, None, False, 0.1, 0.0, 9.0)
            seen.records[column.channel] = record
        runs.append(seen)
    found = [s for s in repeated_sizes(runs) if s.code]
    assert [(s.run, s.channel) for s in found] == ([("r4", channels[1])] if factor != 1.0 else [])


@pytest.mark.parametrize("degrees", [0.02, 0.05, 0.2])
def test_steps_of_an_encoder_are_no_acceleration(campaign, degrees):
    """A peak by rounded encoders: what it leaves open holds that of the others, and the motion is as stored."""
    run = campaign[0][0]
    (exact, _), rounded = Witnesses()._observed(run).peak_joint_acceleration, run
    for column in SIRun.of(run).rig.columns_of(Encoder):
        step = np.radians(degrees)
        rounded = with_values(rounded, column.channel, step * np.round(run.channel(column.channel) / step))
    seen = Witnesses()._observed(rounded)
    peak = seen.peak_joint_acceleration[0]
    assert peak.least < exact.most
    assert peak.most > exact.least
    assert not [s for s in accelerations(seen) if s.code]


def test_logs_of_one_logger_exchanged(logs_of_an_arm):
    """Of the accelerometer's logger alone, between a run with counter-masses and one without: both, each the other."""
    runs = logs_of_an_arm
    assert not unlike_repeats(runs) or all(s.code is None for s in unlike_repeats(runs))
    told = [replace(run, records=dict(run.records)) for run in runs]
    daq = [channel for channel, record in runs[0].records.items() if record.column.logger == "daq"]
    for channel in daq:
        told[0].records[channel], told[1].records[channel] = runs[1].records[channel], runs[0].records[channel]
    found = [s for s in unlike_repeats(told) if s.code]
    assert {(s.run, s.others) for s in found} == {("r0", ("r1",)), ("r1", ("r0",))}
    assert all("logs of daq exchanged" in s.witnessed and "log" in s.advice for s in found)


@pytest.fixture
def logs_of_an_arm():
    """Three repeats with counter-masses and three without, sizes of five channels on two loggers, 3 % of scatter."""
    rig, rng, runs = load_rig("parallelogram-6bar"), np.random.default_rng(6), []
    columns = [
        c for c in rig.columns() if c.sensor in rig.base_accelerometers or isinstance(rig.sensors[c.sensor], Torque)
    ]
    for i in range(6):
        masses = {} if i % 2 else {"counter_A_left": 6.0}
        seen = Observation(f"r{i}", {"payload_kg": 2.0, "motion": "x", "counter_masses": masses}, rig)
        for column in columns:
            size = (3.0 if i % 2 else 1.0) if column.logger == "daq" else (0.4 if i % 2 else 1.0)
            size *= np.exp(rng.normal(0.0, 0.03))
            seen.records[column.channel] = ChannelRecord(
                column, column.logger, np.zeros(8), 1000.0, False, None, False, 1e-4, 0.0, size
            )
        runs.append(seen)
    return runs


@pytest.mark.parametrize(
    ("told", "expected"),
    [
        ({}, {}),
        ({0: 1, 1: 0}, {"r0": ("r1",), "r1": ("r0",)}),  # with and without counter-masses
        ({0: 2, 2: 0}, {"r0": ("r2",), "r2": ("r0",)}),  # another payload
        ({4: 3, 3: 4}, {"r4": ("r3",), "r3": ("r4",)}),  # both
        ({0: 7}, {"r0": ()}),
    ],
)
def test_the_channel_that_tells_conditions_best_decides(told, expected):
    """Logs of an accelerometer of which counter-masses change one axis alone; torques tell whose they are, by 12 %."""
    runs = _sized_runs(np.random.default_rng(3), 3, 0.015, CONDITIONS_OF_SIZES)
    records = [dict(run.records) for run in runs]
    for to, of in told.items():
        records[to] |= {c: one for c, one in runs[of].records.items() if one.column.logger == "daq"}
    found = exchanged_logs([replace(run, records=one) for run, one in zip(runs, records, strict=True)])
    assert {s.run: s.others for s in found} == expected
    assert all("between" in s.witnessed if s.others else "may belong to another run" in s.witnessed for s in found)
    assert {s.code for s in found} <= {"counter_mass_contradiction" if told.get(0) != 2 else "copied_run"}
    both = [replace(run, records=runs[{0: 1, 1: 0}.get(i, i)].records) for i, run in enumerate(runs)]
    assert not exchanged_logs(both)  # the run table's rows, or the masses: no logger's logs


def test_logs_of_honest_repeats_are_their_own():
    """At most 1 in 100 of campaigns whose sizes scatter by 1 to 10 %, and differ by a third between conditions."""
    rng, alarms = np.random.default_rng(8), 0
    for i in range(100):
        sizes = np.exp(rng.normal(0.0, 0.3, (4, 5)))
        alarms += bool(exchanged_logs(_sized_runs(rng, 2 + i % 2, (0.01, 0.03, 0.1)[i % 3], sizes)))
    assert alarms <= 1


CONDITIONS_OF_SIZES = np.array([
    [1.0, 1.0, 1.0, 1.0, 1.0], [1.0, 0.97, 0.15, 1.12, 1.0], [1.4, 1.35, 1.45, 1.4, 1.5], [1.4, 1.3, 0.16, 1.6, 1.5],
])  # fmt: skip
"""Of three axes of an accelerometer and two torques: light and heavy, each without and with counter-masses [-]."""


def _sized_runs(rng, repeats, scatter, sizes):
    rig, runs = load_rig("parallelogram-6bar"), []
    columns = [
        c for c in rig.columns() if c.sensor in rig.base_accelerometers or isinstance(rig.sensors[c.sensor], Torque)
    ]
    for i in range(4 * repeats):
        heavy, masses = i % 4 > 1, {"counter_A_left": 6.0} if i % 2 else {}
        conditions = {"payload_kg": 1.0 + heavy, "motion": "x", "counter_masses": masses, "repeat": i // 4}
        runs.append(seen := Observation(f"r{i}", conditions, rig))
        for column, size in zip(columns, sizes[i % 4] * np.exp(rng.normal(0.0, scatter, 5)), strict=True):
            record = ChannelRecord(column, "", np.zeros(8), 1e3, False, None, False, 1e-4, 0.0, float(size))
            seen.records[column.channel] = record
    return runs


def test_the_prompt_shows_the_verdict_and_what_contradicts(campaign):
    """However many statements there are; none of them is elided."""
    runs, witnesses = campaign
    found = witnesses.hear([lies.about(run, payload_kg=3.4) for run in runs])
    shown = repr(found).splitlines()
    assert shown[0] == f"Examination: {found.verdict(found.runs)}"
    assert shown[1:-1] == [one.message for one in found.findings]


def _mounted(run, axes, signs):
    """The run with the accelerometer on the base mounted so that each channel shows one of ``axes``, with its sign."""
    values = [run.channel(f"Acc{axis}") for axis in axes]
    for channel, sign, shown in zip(("AccX", "AccY", "AccZ"), signs, values, strict=True):
        run = with_values(run, channel, sign * shown)
    return run


@pytest.mark.parametrize(
    ("axes", "signs", "shown"),
    [
        ("YXZ", (1, -1, 1), "AccX {0} what AccY {1}, AccY {0} the opposite of what AccX {1}"),
        ("YXZ", (1, 1, -1), "each {0} what the other {1}"),
        ("ZXY", (1, 1, 1), "AccX"),
    ],
)
def test_a_turned_accelerometer(campaign, repeats, axes, signs, shown):
    """By the model and by repeats alone; where two axes hardly shake, the model tells of the one that does."""
    for runs, witnesses in (campaign, repeats):
        i = lies.shaking(runs)[0]
        told = [_mounted(run, axes, signs) if n == i else run for n, run in enumerate(runs)]
        about = witnesses.hear(told).contradictions
        assert {s.run for s in about} == {runs[i].name}
        assert any(s.code == "axis_contradiction" for s in about)
        if axes == "YXZ":
            assert any(shown.format("follows", "should show") in s.witnessed for s in about)
    found = [s for s in repeated_vibration([witnesses._observed(run) for run in told]) if s.code]
    assert {s.run for s in found} == {runs[i].name}
    assert {s.channel for s in found if s.code == "axis_contradiction"} >= {"AccX", "AccY"}
    assert any(shown.format("shows", "shows") in s.witnessed for s in found)


def test_a_run_that_the_model_shows_to_be_wrong_is_no_witness(repeats):
    """One axis reversed from the first of two repeats on: none before is named, as most repeats would have it."""
    runs, witnesses = repeats
    first = lies.shaking(runs)[1]
    told = [with_values(run, "AccX", -run.channel("AccX")) if n >= first else run for n, run in enumerate(runs)]
    found = witnesses.hear(told).contradictions
    assert {(s.run, s.channel) for s in found} >= {(told[first].name, "AccX")}
    assert {s.run for s in found} <= {run.name for run in told[first:]}


@pytest.mark.parametrize(
    ("signs", "named", "sides"),
    [
        ("..xxxx", "123456", "r002 and r003: one side is inverted, r001, r002 or r003, r004, r005, r006"),
        ("xxxx..", "123456", "r004 and r005: one side is inverted, r005, r006 or r001, r002, r003, r004"),
        (".. xxx", "12456", "r002 and r004: one side is inverted, r001, r002 or r004, r005, r006"),
        (".....x", "6", ""),
        ("..x...", "3", ""),
        (".x.x..", "24", ""),
        ("......", "", ""),
    ],
)
def test_no_majority_tells_which_side_of_a_change_is_right(signs, named, sides):
    """Without a model both sides are named, the smaller first, and where it changed; a space is noise alone."""
    rng = np.random.default_rng(0)
    shaking, column = rng.normal(0.0, 1.0, (2000, 2)), SimpleNamespace(column=SimpleNamespace(component="x"))
    runs = []
    for i, sign in enumerate(signs, 1):
        shown = rng.normal(0.0, 0.1, shaking.shape)
        shown[:, 0] += {".": 1.0, "x": -1.0, " ": 0.0}[sign] * shaking[:, 0]
        seen = Observation(f"r{i:03}", {"motion": "x", "repeat": i}, None, records={"AccX": column})
        runs.append(replace(seen, vibrations={("AccX", "AccY"): shown}))
    found = [s for s in repeated_vibration(runs) if s.code]
    assert {s.run for s in found} == {f"r00{n}" for n in named}
    assert {s.witnessed for s in found if s.changed} == ({f"AccX changes its sign between {sides}"} if sides else set())
    said = Examination(tuple(run.name for run in runs), tuple(found), {run.name: {} for run in runs})
    verdict = said.verdict(said.runs)
    assert verdict == f"AccX changes its sign between {sides}." if sides else "changes" not in verdict


def _axes_of(readings, expected):
    """A run and its response: an accelerometer of as many axes that reads so, against what the model expects (n, k)."""
    columns = tuple(
        SimpleNamespace(channel=f"Acc{a}", component=a, sensor="a", dimensions=("acceleration",), commanded=False)
        for a in "XYZ"[: expected.shape[1]]
    )
    seen = SimpleNamespace(name="r1", rig=SimpleNamespace(base_accelerometers={}, supports={}, sensors={}))
    return seen, Response(columns, np.full(len(columns), 1e-3), readings, expected)


@pytest.mark.parametrize(("degrees", "said"), [(20, "as the rig"), (50, ""), (90, "AccY follows the opposite of")])
def test_axes_that_follow_nothing_are_not_as_the_rig_states(degrees, said):
    """Of two axes turned by 50 degrees each correlates 0.64 with its own and 0.77 with the other: neither is stated."""
    expected = np.random.default_rng(0).normal(0.0, 1.0, (4000, 2))
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    seen, one = _axes_of(expected @ np.array([[c, -s], [s, c]]), expected)
    others = sensors._Others([(seen, one)])
    axes, signs = sensors._exchanged(seen, one, others), sensors._signs(seen, one, others)
    assert bool(axes) == bool(said)
    assert all(said in s.witnessed and bool(s.code) == (degrees == 90) for s in axes)
    assert {s.channel for s in signs} == ({"AccX", "AccY"} if degrees == 20 else set())


@pytest.mark.parametrize(
    ("ratio", "late", "turned", "gain", "found"),
    [
        (1.0, 90, False, 1.0, False),
        (0.8, 90, False, 1.0, False),
        (0.8, -90, False, 1.5, False),
        (0.8, 0, True, 1.0, True),
        (0.8, 0, True, 2.0, False),
    ],
)
def test_beside_a_crank_that_turns(ratio, late, turned, gain, found):
    """A quarter period of phase, as a base of other stiffness near resonance makes, is no turn by 90 degrees.

    A turn exchanges the sizes of the axes, too; one that is not as large as the model's is not told.
    """
    angle = 2.0 * np.pi * 4.0 * np.arange(4000) / 200.0
    expected = np.column_stack([np.cos(angle), ratio * np.sin(angle)])
    readings = gain * np.column_stack([np.cos(angle - np.radians(late)), ratio * np.sin(angle - np.radians(late))])
    readings = readings + np.random.default_rng(0).normal(0.0, 1e-3, readings.shape)
    seen, one = _axes_of(readings[:, ::-1] * np.array([1.0, -1.0]) if turned else readings, expected)
    axes = sensors._exchanged(seen, one, sensors._Others([(seen, one)]))
    assert [s.code for s in axes] == ["axis_contradiction"] * (2 if found else 0)


def test_three_axes_that_are_turned_about_their_diagonal():
    """By the model; the sign of each is told."""
    expected = np.random.default_rng(0).normal(0.0, 1.0, (4000, 3))
    seen, one = _axes_of(expected[:, [2, 0, 1]] * np.array([1.0, -1.0, -1.0]), expected)
    found = sensors._exchanged(seen, one, sensors._Others([(seen, one)]))
    assert {(s.channel, s.code) for s in found} == {(f"Acc{a}", "axis_contradiction") for a in "XYZ"}
    what = "AccX follows what AccZ, AccY follows the opposite of what AccX, AccZ follows the opposite of what AccY"
    assert {s.witnessed.replace(" should show", "") for s in found} == {f"axes exchanged: {what}"}


def test_a_stored_mechanism_that_cannot_be_read(repeats):
    """It is a finding of each run that holds it, with what is wrong in it and where."""
    file, text = repeats[0][0].inputs["mechanism"]
    told = [replace(run, inputs={"mechanism": (file, text.replace("hinge", "hinj"))}) for run in repeats[0][:2]]
    found = Witnesses().hear(told).contradictions
    assert {(s.run, s.code) for s in found} == {(run.name, "unread_mechanism") for run in told}
    assert all("invalid keyword: 'hinj'" in s.finding.message and "--mechanism" in s.advice for s in found)


@pytest.mark.parametrize(
    ("key", "factor", "liars"),
    [("counter_masses", 1e3, 1), ("counter_masses", 1e-3, 1), ("payload_kg", 1e3, 1), ("payload_kg", 1e-3, 1),
     ("counter_masses", 1e3, 9), ("payload_kg", 2e3, 9)],
)  # fmt: skip
def test_grams_for_kilograms(campaign, key, factor, liars):
    """Told of the run table, against the other runs or, of all runs, against the mechanism; no sensor is dead."""
    told, names = [], set[str]()
    for run in campaign[0]:
        stated = run.conditions[key]
        masses = {site: factor * mass for site, mass in stated.items()} if isinstance(stated, dict) else factor * stated
        names |= {run.name} if masses and len(names) < liars else set()
        told.append(lies.about(run, **{key: masses}) if run.name in names else run)
    found = Witnesses().hear(told).contradictions
    code = "payload_contradiction" if key == "payload_kg" else "counter_mass_contradiction"
    assert {(s.run, s.code) for s in found} == {(run, code) for run in names}
    assert all("grams for kilograms" in s.witnessed for s in found)


@pytest.mark.parametrize(
    ("masses", "mechanism", "marked"),
    [
        ([1451.0, 3412.0, 5000.0], 30.0, [1451.0, 3412.0, 5000.0]),
        ([1.451, 1451.0, 3412.0], 30.0, [1451.0, 3412.0]),
        ([1451.0, 2.0, 1.0], 30.0, [1451.0]),
        ([1.451, 1451.0], 0.0, [1451.0]),
        ([0.005, 5.0, 5.0], 10.0, [0.005]),
        ([0.004, 5.0, 5.0], 10.0, []),
        ([0.004, 0.005, 4.5], 10.0, []),
        ([3.0, 3.0], 0.02, []),
        ([250.0, 250.0], 5.0, []),
        ([1.5, 1500.0, 1500.0, 1500.0], 20.0, [1500.0, 1500.0, 1500.0]),
        ([2.0, 2000.0, 2000.0], 5000.0, [2.0]),
        ([0.02, 0.02, 20.0, 20.0, 20.0], 30.0, [0.02, 0.02]),
    ],
)
def test_which_masses_may_be_in_grams(masses, mechanism, marked):
    """A thousandth, or a thousandfold, is like the others or like the mechanism; light payloads and arms are honest."""
    runs = [Observation(f"r{i}", {"payload_kg": m}, None, mechanism_kg=mechanism) for i, m in enumerate(masses)]
    found = in_grams(runs)
    assert [runs[int(s.run[1:])].conditions["payload_kg"] for s in found] == marked
    assert not [s.witnessed for s in found if "e+" in s.witnessed]


def test_an_encoder_is_compared_with_other_runs(repeats):
    """Where no motion is stored, by most of the other runs."""
    runs = [replace(run, inputs={"mechanism": run.inputs["mechanism"]}) for run in repeats[0]]
    told, liars = LIES_BESIDE_REPEATS["encoder of one run reversed"].tell(runs, 0, np.random.default_rng(1))
    found = Witnesses().hear(told)
    assert {(s.run, s.code) for s in found.contradictions} == {(*liars, "encoder_contradiction")}


@pytest.mark.parametrize("liars", [slice(0, 1), slice(None)])
def test_one_encoder_of_another_scale(repeats, liars):
    """It is named beside the other, in one run or all; torques along it tell no masses."""
    runs = repeats[0]
    name, other = (column.channel for column in SIRun.of(runs[0]).rig.columns_of(Encoder))
    told = [with_values(run, name, 2.0 * run.channel(name)) for run in runs[liars]]
    heard = Witnesses().hear([*told, *runs[len(told) :]])
    found = heard.contradictions
    assert {(s.run, s.code) for s in found} == {(run.name, "encoder_contradiction") for run in told}
    assert all(heard.why_unwitnessed(run.name).startswith("its encoders are contradicted") for run in told)
    assert all(f"2 times as far, unlike {other}:" in s.witnessed for s in found)
    assert {(s.subject, s.channel) for s in found} == {("encoder scale", name)}
    assert {"or the motion of the run table" in s.witnessed for s in found} == {told == [*told, *runs[len(told) :]]}


@pytest.mark.parametrize("change", ["slower", "farther", "exchanged"])
def test_encoders_beside_the_stored_motion(repeats, change):
    """A motion that was another than the stored one, farther than that, or of the other joint."""
    runs = repeats[0]
    names = [column.channel for column in SIRun.of(runs[0]).rig.columns_of(Encoder)]
    first, second = (runs[0].channel(name) for name in names[:2])
    at = np.arange(len(first))
    shown = {
        "slower": [np.interp(0.6 * at, at, first), np.interp(0.6 * at, at, second)],
        "farther": [first[0] + 1.3 * (first - first[0]), second[0] + 1.3 * (second - second[0])],
        "exchanged": [first[0] + second - second[0], second[0] + first - first[0]],
    }[change]
    liar = with_values(with_values(runs[0], names[0], shown[0]), names[1], shown[1])
    found = Witnesses().hear([liar, *runs[1:]]).contradictions
    code = "encoder_contradiction" if change == "exchanged" else "motion_contradiction"
    assert {(s.run, s.code) for s in found if "stored" in s.witness} == {(liar.name, code)}
    assert {s.run for s in found} == {liar.name}


@pytest.mark.parametrize(("peak", "contradicts"), [(1.0, False), (0.75, True), (1.35, True)])
def test_the_stored_motion_has_another_peak(repeats, peak, contradicts):
    """Where the run table states no peak acceleration, the encoders' is held against that of the motion's file."""
    (seen,) = [Witnesses()._observed(repeats[0][0])]
    seen = replace(seen, wanted_peaks=tuple(peak * value for value in seen.wanted_peaks))
    (found,) = accelerations(seen)
    assert (found.code == "motion_contradiction") == contradicts
    assert found.witness == "the encoders"


def test_witnessed_payload(campaign):
    """By the torques, whatever the run table states: 5 kg, within what the model leaves."""
    runs, witnesses = campaign
    changed = LIES["payload of all runs"].tell(runs, 0, np.random.default_rng(1))[0]
    torque = witnesses.hear(changed).torque
    np.testing.assert_allclose(torque.payload, 5.0, atol=0.1)
    np.testing.assert_allclose(torque.scale, 1.0, atol=0.03)


def test_repeats_are_no_copies():
    """The same motion and the same bench, with noise of its own; the same runs again are copies, and count as none."""
    rig = lies.slimmed(load_rig("parallelogram-6bar"))
    runs, witnesses = lies.simulated(rig, lies.plan(5.0, 24.2626, ["x"], [3.0], repeats=3), 5), Witnesses()
    assert not witnesses.hear(runs).findings
    again, names = lies.copied(runs, 1, np.random.default_rng(0))
    found = witnesses.hear(again)
    assert found.copied == names
    assert [s.others for s in found.contradictions] == [(runs[1].name,)]


def test_a_copy_under_an_earlier_name(campaign):
    """The run whose payload its torques contradict is the copy, wherever it stands."""
    runs, witnesses = campaign
    false = replace(runs[0], path=runs[0].path.with_name("a.h5"), conditions={**runs[0].conditions, "payload_kg": 2.0})
    found = witnesses.hear([false, *runs])
    assert found.copied == {"a"}
    assert {s.others for s in found.contradictions if s.code == "copied_run"} == {(runs[0].name,)}


@pytest.mark.parametrize(("kinds", "log"), [((Accelerometer,), "daq"), ((Wrench, ForceSensor), "forces")])
def test_one_of_several_logs_is_that_of_another_run(campaign, kinds, log):
    """The run whose motion its channels do not fit holds the copy, by its file; the advice is not about sensors."""
    runs, witnesses = campaign
    first = lies.shaking(runs)[0]
    to = next(i for i in lies.shaking(runs) if runs[i].conditions["motion"] != runs[first].conditions["motion"])
    for of, liar in ((first, to), (to, first)):
        changed = list(runs)
        for column in (c for kind in kinds for c in SIRun.of(runs[of]).rig.columns_of(kind)):
            changed[liar] = with_values(changed[liar], column.channel, runs[of].channel(column.channel))
        for i, name in ((of, "one.csv"), (liar, "two.csv")):
            sources = [{"name": name, "groups": [log]}]
            changed[i] = replace(changed[i], provenance={**changed[i].provenance, "sources": sources})
        found = witnesses.hear(changed)
        about, name = found.about(runs[liar].name), runs[of].name
        assert found.contradictions == tuple(about)
        (copy,) = (s for s in about if s.code == "copied_run")
        assert f" holds in two.csv channels of one.csv, of {name}, with which all else agrees" in copy.witnessed
        assert {s.subject for s in about} & {"axis", "sign", "gain"}
        assert {s.advice for s in about} == {copy.advice}


def test_a_sensor_that_is_wrong_in_both_does_not_tell_whose_log_it_is():
    """The axis of a turned sensor contradicts in the original too, and no channel fits the one run alone."""
    runs = tuple(Observation(n, {"payload_kg": p}, None, {"F": f"{n}.csv"}) for n, p in ("a1", "b2"))
    one = OneRecording(runs, ("F",), whole=False)
    wrong = [Statement(name, "axis", "F", "", "", "", "axis_contradiction") for name in "ab"]
    assert {s.run for s in _whose([one], wrong)[0]} == {"a", "b"}
    assert {s.run for s in _whose([one], wrong[:1])[0]} == {"a", "b"}, "nothing is known of F in b"
    fits = Statement("b", "axis", "F", "", "", "")
    assert [(s.run, s.others) for s in _whose([one], [wrong[0], fits])[0]] == [("a", ("b",))]


@pytest.mark.parametrize(
    ("payloads", "contradicted", "blamed", "said"),
    [
        ([1.0, 2.0], "a", {"a": ("b",)}, "a holds the log of b, with which all else agrees"),
        ([1.0, 2.0], "b", {"b": ("a",)}, "b holds the log of a, with which all else agrees"),
        ([1.0, 2.0], "", {"a": ("b",), "b": ("a",)}, "nothing tells whose, and none of them counts"),
        ([1.0, 2.0], "ab", {"a": ("b",), "b": ("a",)}, "nothing tells whose, and none of them counts"),
        ([1.0, 1.0], "", {"b": ("a",)}, "b and a hold one log: the same noise of F; of one condition, they count once"),
        ([1.0, 2.0, 2.0], "b", {"a": ("b", "c"), "b": ("a", "c"), "c": ("a", "b")}, "nothing tells"),
        ([1.0, 2.0, 3.0], "ac", {"a": ("b",), "c": ("b",)}, "holds the log of b, with which all else agrees"),
    ],
)
def test_whose_log_it_is(payloads, contradicted, blamed, said):
    """That of the one run which nothing contradicts; where that does not tell, all are named and none is blamed."""
    conditions = [{"payload_kg": payload, "repeat": i} for i, payload in enumerate(payloads)]
    runs = tuple(Observation(name, c, None) for name, c in zip("abc", conditions, strict=False))
    found = OneRecording(runs, ("F",), whole=True).statements(contradicted)
    assert {s.run: s.others for s in found} == blamed
    assert all(said in s.witnessed for s in found)


@pytest.mark.parametrize("liar", [0, 3])
def test_a_log_put_together_of_two_runs(campaign, liar):
    """Forces of one run, accelerations of another: of each what is its own, wherever it stands; neither is blamed."""
    runs, witnesses = campaign
    sources, mixed = dict(zip(("forces", "daq"), runs[1:3], strict=True)), runs[liar]
    for logger, source in sources.items():
        for column in load_rig("parallelogram-6bar").columns(logger):
            values = np.resize(source.channel(column.channel), len(mixed.channel(column.channel)))
            mixed = with_values(mixed, column.channel, values)
    found = witnesses.hear([*runs[:liar], mixed, *runs[liar + 1 :]])
    assert found.copied == {mixed.name}
    said = {s.others: s.witnessed for s in found.contradictions if s.code == "copied_run"}
    assert set(said) == {(source.name,) for source in sources.values()}
    assert all(f"{mixed.name} holds in " in text for text in said.values())
    assert "AccX" not in said[sources["forces"].name,]
    assert "Fx1" not in said[sources["daq"].name,]


def test_a_fast_motion_in_the_band_is_no_copy():
    """Torques that repeat a fast motion far above their noise; one logger's file filed twice is a copy of its own."""
    rig = lies.slimmed(load_rig("parallelogram-6bar"))
    runs, witnesses = lies.simulated(rig, lies.plan(5.0, 24.2626, ["x"], [3.0], repeats=2), 5), Witnesses()
    fast, filed = list(runs), list(runs)
    for i, run in enumerate(runs):
        for channel in ("tau1", "tau2"):
            torque = run.channel(channel)
            motion = np.random.default_rng(0).normal(0.0, 2.0, len(torque))
            motion[: len(motion) // 4] = 0.0
            fast[i] = with_values(fast[i], channel, torque + motion)
    assert not witnesses.hear(fast).copied
    filed[1] = with_values(runs[1], "AccX", runs[0].channel("AccX"))
    assert witnesses.hear(filed).copied == {runs[1].name}


def test_exchanged_readings_are_no_flat_channel(campaign):
    """Accelerometer logs of a run with and one without counter-masses, exchanged: both runs, and no sensor blamed."""
    runs, witnesses = campaign
    one = lies.shaking(runs)[0]
    two = next(k for k, r in enumerate(runs) if k != one and r.conditions["motion"] == runs[one].conditions["motion"])
    changed = list(runs)
    for to, of in ((one, two), (two, one)):
        for channel in ("AccX", "AccY", "AccZ"):
            changed[to] = with_values(changed[to], channel, runs[of].channel(channel))
    found = witnesses.hear(changed)
    assert {s.run for s in found.contradictions if s.code == "counter_mass_contradiction"} == {
        runs[one].name,
        runs[two].name,
    }
    assert not any(s.code == "flat_channel" for s in found.contradictions)


@pytest.mark.parametrize(("correlation", "flat"), [(-0.2, False), (0.92, False), (0.995, True)])
def test_a_wrong_model_of_the_base_blames_no_sensor(correlation, flat):
    """Noise alone where the model expects vibration: only where the model is right in a run that the sensor shows.

    At 0.92 it lacks 0.24 m/s2 of the 0.6, and expects less than that of the counter-masses' run: it cannot tell.
    """
    columns = [SimpleNamespace(channel="AccX", dimensions=("acceleration",), commanded=False)]

    def gains(reading, expected, correlation):
        values = {"readings": reading, "expected": expected, "correlation": correlation, "noise": 0.0006}
        return SimpleNamespace(
            columns=columns, witnessed=np.array([True]), **{k: np.array([v]) for k, v in values.items()}
        )

    heard = [(SimpleNamespace(name="with"), gains(0.0015, 0.2, -0.2)),
             (SimpleNamespace(name="without"), gains(0.6, 0.6, correlation))]  # fmt: skip
    assert sensors._Others(heard).is_flat(*heard[0], 0) is flat


@pytest.mark.parametrize(
    ("conditions", "advised"),
    [
        ({"peak_acceleration_rad_s2": 30.0}, None),
        ({"peak_acceleration_rad_s2": 42.0}, None),
        ({"peak_acceleration_rad_s2": 60.0}, "correct peak_acceleration_rad_s2 in"),
        ({"peak_acceleration_g": 2.0}, None),
        ({"peak_acceleration_g": 3.0}, "correct peak_acceleration_g in"),
    ],
)
def test_peak_acceleration(conditions, advised):
    """Of joints the largest of one or that along the leg, 30 and 30 sqrt(2) rad/s2; advice names the column used."""
    seen = Observation("r001", conditions, load_rig("parallelogram-6bar"))
    seen.peak_joint_acceleration, seen.peak_acceleration = (
        (Peak(30.0), Peak(30.0 * 2.0**0.5)),
        {"command": Peak(2.0 * G0)},
    )
    (statement,) = accelerations(seen)
    assert (statement.code is None) == (advised is None)
    assert (statement.advice or "").startswith(advised or "")


def test_numbers_obey(campaign):
    """A copy counts once; a payload marks; a gain withholds what it spoils, until it is accepted, and stays marked."""
    runs, _ = campaign
    rng = np.random.default_rng(0)
    pair = runs[:2]
    (honest,) = {r.n for r in analyze(pair, Measure()).reductions}
    copied = analyze(lies.copied(pair, 0, rng)[0], Measure())
    assert {r.n for r in copied.reductions} == {honest}
    assert "copied_run" in {f.code for f in copied.findings}
    found = analyze([lies.about(run, payload_kg=3.4) for run in pair], Measure())
    assert all(r.doubts == ("payload_contradiction",) and r.interval for r in found.reductions)
    names = ", ".join(sorted(run.name for run in pair))
    assert verdict(found.reductions, found.examination).endswith(f"; {names} doubtful: payload_contradiction.")
    assert found.examination is not None
    accepted = replace(found.examination, accepted=frozenset({"payload_contradiction"}))
    assert "doubtful" not in verdict(found.reductions, accepted)
    halved = [runs[0], lies.scaled(runs[1], 0.5), *runs[2:]]

    def of_x(accept):
        """Along x, of the run with the gain."""
        reductions = analyze(halved, Measure(), accept).reductions
        return next(r for r in reductions if runs[1].name in r.runs and r.axis == "x")

    withheld, given = of_x([]), of_x(["gain_contradiction"])
    assert withheld.interval is None
    assert "withheld" in withheld.text
    assert given.interval is not None
    assert given.doubts == withheld.doubts == ("gain_contradiction",)


def test_doctor(brief, command):
    """Nothing to say of the brief campaign; a code that nobody knows is a wrong command line."""
    code, out, _ = command("doctor", brief.campaign, "--json")
    told = json.loads(out)
    assert (code, told["findings"]) == (0, [])
    assert len(told["runs"]) == 8
    assert all(run["statements"] for run in told["runs"])
    assert command("doctor", brief.campaign, "r404")[0] == 1
    assert "no such contradiction" in command("analyze", brief.campaign, "--accept", "nonsense")[2]


def test_doctor_repeats_what_ingest_found(command, tmp_path):
    """A clipped sensor with its run, and a run not stored, in the first line and in the document; exit code 3."""
    wave = np.clip(np.sin(np.arange(4000) * 0.02) + np.random.default_rng(0).normal(0.0, 0.02, 4000), -0.6, 0.6)
    rows = "\n".join(f"{i / 1000},{value:.4f}" for i, value in enumerate(wave))
    (tmp_path / "r001.csv").write_text(f"t (s),AccX (g)\n{rows}\n", encoding="utf-8")
    (tmp_path / "rig.toml").write_text(
        'mechanism = "none"\n[loggers.r001]\n[sensors.acc]\nkind = "accelerometer"\nlogger = "r001"\n'
        'channels = { x = "AccX" }\nposition = ["0 m", "0 m", "0 m"]\n',
        encoding="utf-8",
    )
    made = command("ingest", tmp_path / "r001.csv", "--rig", tmp_path / "rig.toml", "-o", tmp_path / "c")
    assert made[0] == 3, made
    code, out, _ = command("doctor", tmp_path / "c")
    assert code == 3
    assert "Found by ingest: clipping_suspected." in out.splitlines()[0]
    assert "clipping_suspected: r001: AccX" in out
    enter_not_stored(tmp_path / "c", "r002.h5", "its log was not given")
    out = command("doctor", tmp_path / "c")[1]
    assert "Found by ingest: clipping_suspected, not_stored." in out.splitlines()[0]
    assert "not_stored: r002: is in the run table and not stored: its log was not given" in out
    told = json.loads(command("doctor", tmp_path / "c", "--json")[1])["as_read"]
    assert [one["code"] for one in told] == ["not_stored", "clipping_suspected"]
    assert len(json.loads(command("doctor", tmp_path / "c", "r001", "--json")[1])["as_read"]) == 1


def test_doctor_enters_what_a_person_accepts(pair_built, command, monkeypatch, tmp_path):
    """With name and reason, in the ledger, for the runs that have it; then nobody need accept it again."""
    shutil.copytree(pair_built.campaign, tmp_path / "c")
    runs = ("r001", "r002")
    stated = Statement("r002", "payload", None, "8 kg", "5 kg", "the drives", "payload_contradiction")
    found = Examination(runs, (stated,), {run: {} for run in runs})
    monkeypatch.setattr("testbench.cross_examination.examine", lambda runs, *_: found.decided(runs))
    words = ("doctor", tmp_path / "c", "--accept", "payload_contradiction", "--by", "A. Kaya")
    assert command(*words)[0] == 2
    assert found.decided(open_campaign(tmp_path / "c").runs).open_findings
    assert command(*words, "--reason", "weighed again")[0] == 3
    entry = read_ledger(tmp_path / "c").entries[-1]
    assert {key: entry.details[key] for key in ("code", "by", "reason")} == {
        "code": "payload_contradiction", "by": "A. Kaya", "reason": "weighed again"
    }  # fmt: skip
    assert not found.decided(open_campaign(tmp_path / "c").runs).open_findings
    (shown,) = json.loads(command("doctor", tmp_path / "c", "--json")[1])["accepted"]
    assert (shown["code"], shown["by"], shown["runs"]) == ("payload_contradiction", "A. Kaya", ["r002"])
    again = (*words, "--reason", "again")
    assert command(*again, "--accept", "flat_channel")[0] == 1
    for hostile in ("a\x1b[31mb", "\udcff", "x" * 3000, "\u202eb"):
        assert command(*words, "--reason", hostile)[0] == 2
    assert read_ledger(tmp_path / "c").entries[-1] == entry, "an acceptance that is refused leaves nothing"


def _on_sign(wrong):
    """Of each run whether its sensor is reversed; . agrees, x is, a space says nothing."""
    return [
        Statement(f"r{i:03}", "sign", "AccX", "as in the rig", "reversed" if is_wrong == "x" else "as in the rig",
                  "the model", "sign_contradiction" if is_wrong == "x" else None)
        for i, is_wrong in enumerate(wrong, 1) if is_wrong != " "
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("wrong", "between"),
    [("...xxxxx", "r003 and r004"), (". .x x x", "r003 and r004"), ("...xx.xx", ""), (".......x", ""), ("xxxxxxxx", ""),
     ("   xxxxx", "")],
)  # fmt: skip
def test_what_changed_from_a_run_on(wrong, between):
    """Of a sensor that is reversed in two runs or more, and right in none after them, both runs are named."""
    found = [s for s in _since(_on_sign(wrong), [f"r{i:03}" for i in range(1, 9)]) if s.code]
    assert {s.changed for s in found} == {between}
    assert {f"between {between};" in s.advice for s in found} == {bool(between)}


def test_doctor_names_runs_and_channels(brief, command, monkeypatch):
    """In the first line and in a row for each contradiction, however many witnesses; the table stays narrow."""
    names = [f"r{i:03}" for i in range(1, 9)]
    masses = ("r002", "counter-masses", None, "none by the run table")
    said = [
        Statement(*masses, "9 kg", by, "counter_mass_contradiction") for by in ("the torques, " * 20, "its repeats")
    ]
    found = Examination(tuple(names), (*said, *_since(_on_sign("...xxxxx"), names)), {name: {} for name in names})
    monkeypatch.setattr("testbench.cross_examination.examine", lambda *arguments: found)
    first, *lines = command("doctor", brief.campaign)[1].splitlines()
    assert "6 of 8 runs contradict" in first
    assert first.endswith("other runs: r002 (counter-masses); r004, r005, r006 and 2 more (sign of AccX).")
    rows = [line for line in lines if line.startswith("r00") and "_" in line]
    assert [row.split()[0] for row in rows] == ["r002", "r004,"]
    assert max(map(len, rows)) < 90
    assert "r004, r005, r006, r007, r008" in rows[1]
    assert sum("find what changed between r003 and r004" in line for line in lines) == 1


def test_doctor_says_once_what_nothing_witnesses(brief, command, monkeypatch):
    """Runs that share it stand in one line."""
    names = [f"r00{i}" for i in range(1, 9)]
    silent = Examination(tuple(names), (), {name: {"torque": "no torque sensor"} for name in names})
    monkeypatch.setattr("testbench.cross_examination.examine", lambda *arguments: silent)
    lines = [line for line in command("doctor", brief.campaign)[1].splitlines() if "not confirmed" in line]
    assert [line.split(": ")[0] for line in lines] == [", ".join(names)]


def test_doctor_of_runs_that_cannot_be_examined(brief, command, monkeypatch):
    """It says so, run by run, and ends as findings do."""
    unknown = Examination(
        (), (), {}, unexamined=dict.fromkeys([f"r00{i}" for i in range(1, 9)], "stored without a rig")
    )
    monkeypatch.setattr("testbench.cross_examination.examine", lambda *arguments: unknown)
    code, out, _ = command("doctor", brief.campaign)
    assert code == 3
    assert "None of 8 runs can be examined" in out
    assert "r001, r002, r003, r004, r005, r006, r007, r008: not examined: stored without a rig" in out
    assert json.loads(command("doctor", brief.campaign, "r002", "--json")[1])["unexamined"].keys() == {"r002"}
