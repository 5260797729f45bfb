"""A machine of one drive, whose torques leave payload and drive inertia open: runs are held against each other."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from studies import lies
from studies.lies import Witnesses
from studies.simulated_runs import with_values
from testbench.campaign_plan import load_plan
from testbench.cross_examination import conditions
from testbench.cross_examination.conditions import TorqueBalance, _gross_torques
from testbench.cross_examination.observation import DRIVE_TERMS, Observation, TorqueEquations
from testbench.project import new_project
from testbench.rig import load_rig

MECHANISM = """<mujoco model="rocker">
  <option gravity="0 0 -9.81"/>
  <custom><text name="payload" data="table"/></custom>
  <worldbody>
    <body name="crank" pos="-0.15 0 0" euler="0 0 90">
      <inertial pos="0.09 0 0" mass="1.2" diaginertia="0.001 0.006 0.006"/>
      <joint name="A0" type="hinge" axis="0 0 1"/>
      <site name="counter_crank" pos="-0.1 0 0"/>
      <body name="table" pos="0.2 0 0" euler="0 0 -81.9964087819">
        <inertial pos="0.12 0 0" mass="2.0" diaginertia="0.005 0.02 0.02"/>
        <joint name="A" type="hinge" axis="0 0 1"/>
        <site name="tableB" pos="0.26 0 0"/>
      </body>
    </body>
    <body name="rocker" pos="0.15 0 0" euler="0 0 100.2078187220">
      <inertial pos="0.11 0 0" mass="1.4" diaginertia="0.001 0.009 0.009"/>
      <joint name="B0" type="hinge" axis="0 0 1"/>
      <site name="counter_rocker" pos="-0.1 0 0"/>
      <site name="rockerB" pos="0.24 0 0"/>
    </body>
  </worldbody>
  <equality><connect site1="tableB" site2="rockerB"/></equality>
  <actuator><motor joint="A0"/></actuator>
</mujoco>
"""
PLAN = """mechanism = "rocker.xml"
repeats = 2
seed = 1
[[conditions]]
payload = ["2 kg", "3.5 kg"]
counter_masses = { counter_crank = "2.9 kg", counter_rocker = "3.9 kg" }
motion = "motion"
"""


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """Eight runs: two payloads, with and without counter-masses, twice; observed once."""
    folder = tmp_path_factory.mktemp("one-drive")
    (folder / "rocker.xml").write_text(MECHANISM, encoding="utf-8")
    new_project(folder / "project", str(folder / "rocker.xml"))
    (folder / "project" / "plan.toml").write_text(PLAN, encoding="utf-8")
    rig = load_rig(folder / "project" / "rig.toml")
    return lies.simulated(rig, load_plan(folder / "project" / "plan.toml"), 3), Witnesses()


def said(found):
    """Payload statements by run: value and ends of the interval [kg]."""
    texts = {s.run: s.witnessed for s in found.statements if s.subject == "payload"}
    return {run: [float(value) for value in re.findall(r"[-\d.]+", text)] for run, text in texts.items()}


def test_intervals_hold_the_payloads(campaign):
    """Of honest runs, each beside what the others carried; nothing contradicts."""
    runs, witnesses = campaign
    found = witnesses.hear(runs)
    assert not found.findings
    assert len(said(found)) == len(runs)
    for run in runs:
        value, low, high = said(found)[run.name]
        assert low < run.conditions["payload_kg"] < high
        assert value == pytest.approx(run.conditions["payload_kg"], abs=0.1)


@pytest.mark.parametrize("wrong", [[0], [1, 6]])
def test_a_payload_unlike_the_other_runs(campaign, wrong):
    """One run, or two, that carried another payload than the run table's: these alone, with both values."""
    runs, witnesses = campaign
    told = list(runs)
    for i in wrong:
        told[i] = lies.about(runs[i], payload_kg=5.5 - runs[i].conditions["payload_kg"])
    found = witnesses.hear(told)
    liars = {runs[i].name for i in wrong}
    assert {(s.run, s.code) for s in found.contradictions} == {(run, "payload_contradiction") for run in liars}
    for i in wrong:
        low, high = said(found)[runs[i].name][1:]
        assert low < runs[i].conditions["payload_kg"] < high


def with_friction(run, peak):
    """Dry friction added to the drive's torque, as a share of its peak."""
    torque, speed = run.channel("tau_A0"), np.gradient(run.channel("q_A0"))
    dry = peak * np.abs(torque).max() * np.tanh(speed / (0.05 * np.abs(speed).max()))
    return with_values(run, "tau_A0", torque + dry)


def test_friction_of_each_run_is_no_payload(campaign):
    """Dry friction that changes from run to run by a tenth of the torque's peak, as temperature makes it."""
    rng = np.random.default_rng(4)
    told = [with_friction(run, rng.uniform(0.0, 0.1)) for run in campaign[0]]
    assert not Witnesses().hear(told).findings


@pytest.mark.parametrize(("factor", "scale", "said"), [(1.0, 0.069, 0), (1.0, 2.1, 0), (1e3, 0.069, 1), (1e3, 1.0, 0)])
def test_drive_inertia_in_place_of_the_model_is_no_gross_torque(campaign, factor, scale, said):
    """A scale of 0.07 with 41 kg, as friction alone may ask of one run; a log in N mm is 1000 times the model's."""
    run = campaign[0][2]
    seen = Witnesses()._observed(with_values(run, "tau_A0", factor * run.channel("tau_A0")))
    one, none = np.ones(1), np.zeros(1)
    alone = TorqueBalance(41.6 * one, scale * one, 10.0 * one, none, (run.name,), ("A0",), one, 5e-4 * one)
    assert len(_gross_torques(seen, alone)) == said


@pytest.mark.parametrize("gain", [1.0, 0.4, 2.5])
def test_friction_is_no_gain_of_a_balanced_joint(gain):
    """Its torque follows the speed in part, and dry friction is larger: beside friction the factor is the gain."""
    t, rng = np.linspace(0.0, 8.0, 8000, endpoint=False), np.random.default_rng(0)
    model, v, one = (
        0.1 * np.cos(2.0 * np.pi * t - 0.5) + 0.05 * np.sin(14.0 * t),
        np.cos(2.0 * np.pi * t),
        np.ones(8000),
    )
    dry = np.tanh(v / 0.05)
    torque = gain * (model + 0.18 * dry + 0.03 * v + 0.02) + rng.normal(0.0, 0.03, 8000)
    columns = np.column_stack([torque, model, 0.0 * one, 0.0 * one, one, np.gradient(v, t), v, dry])
    products = np.array([part.T @ part for part in np.split(columns, 8)])[:, None]
    names = ("torque", "model", "payload", "base", *DRIVE_TERMS)
    seen = Observation("r1", {"payload_kg": 0.8}, None, torque=TorqueEquations(("J2",), names, products))
    found, uncertainty = conditions._factor_beside_friction(seen, 0)
    assert found == pytest.approx(gain, abs=4.0 * uncertainty)
    assert uncertainty < 0.02


def test_too_few_runs_say_nothing(campaign):
    """Two runs, of which either may be wrong: nothing witnesses a payload, and doctor says so."""
    runs, witnesses = campaign
    found = witnesses.hear(runs[:2])
    assert not said(found)
    for run in runs[:2]:
        assert "payload" in found.unwitnessed(run.name)
        assert "drive inertia" in found.reasons[run.name]["payload"]


def without_bench(runs):
    """Runs whose rig does not describe the base."""
    return [replace(run, rig=run.rig.partition("[bench]")[0]) for run in runs]


@pytest.mark.parametrize(("scale", "wrong"), [(1.2, True), (0.2, False), (4.0, False)])
def test_other_masses_must_make_sense_of_the_torques(monkeypatch, scale, wrong):
    """A negative scale, as horizontal arms show by chance: other masses are named only if they fit in size."""
    one = np.ones(1)
    stated = TorqueBalance(-one, -3.0 * one, one, one, ("a",), ("J",), 0.03 * one, 0.3 * one)
    monkeypatch.setattr(
        conditions, "_alone", lambda seen, masses: replace(stated, payload=2.0 * one, scale=scale * one)
    )
    seen, other = SimpleNamespace(counter_masses={}, conditions={"payload_kg": 2.0}), {"counter": 6.0}
    assert conditions._fitting_masses(seen, stated, [other]) == (other if wrong else {})


def test_axes_are_compared_with_repeats(campaign):
    """Axes exchanged in one run are found there by the repeat, and by other runs which of the two is wrong."""
    runs, witnesses = without_bench(campaign[0]), Witnesses()
    honest = witnesses.hear(runs)
    assert not honest.findings
    assert all("axis of base_acc" not in honest.unwitnessed(run.name) for run in runs)
    assert all("sign of base_acc" in honest.unwitnessed(run.name) for run in runs)
    for i in (2, 7):
        told = [lies.exchanged_axes(run, None) if run is runs[i] else run for run in runs]
        found = witnesses.hear(told)
        assert {(s.run, s.channel, s.code) for s in found.contradictions} == {
            (runs[i].name, channel, "axis_contradiction") for channel in ("AccX", "AccY")
        }


def test_signs_are_compared_with_repeats(campaign):
    """One axis reversed in one run, with counter-masses or without: found there by its repeat and other runs."""
    runs, witnesses = without_bench(campaign[0]), Witnesses()
    for i in (2, 7):
        told = [with_values(run, "AccX", -run.channel("AccX")) if run is runs[i] else run for run in runs]
        found = witnesses.hear(told)
        assert {(s.run, s.channel, s.code) for s in found.contradictions} == {
            (runs[i].name, "AccX", "sign_contradiction")
        }
    pair = witnesses.hear([with_values(runs[2], "AccX", -runs[2].channel("AccX")), runs[3]])
    assert {(s.run, s.others) for s in pair.contradictions} == {
        (runs[2].name, (runs[3].name,)),
        (runs[3].name, (runs[2].name,)),
    }


def test_of_two_repeats_alone_either_may_be_wrong(campaign):
    """Both are named, each with the other; a run without a repeat has no witness of its accelerometer's axes."""
    runs, witnesses = without_bench(campaign[0]), Witnesses()
    found = witnesses.hear([lies.exchanged_axes(runs[2], None), runs[3]])
    assert {(s.run, s.others) for s in found.contradictions} == {
        (runs[2].name, (runs[3].name,)),
        (runs[3].name, (runs[2].name,)),
    }
    assert "axis" in witnesses.hear([runs[2]]).unwitnessed(runs[2].name)
