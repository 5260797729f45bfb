"""What is missing on which arm, from simulated runs with known truth; refused where they cannot tell."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from balance import datasets
from balance.balancing import stock_plates
from balance.balancing.conditions import balance_conditions
from balance.balancing.sizing import sizing_of_given
from balance.errors import CounterpoiseError
from balance.estimation.first_moment_imbalance import Imbalance, ImbalanceFit, Subspace, combine, with_condition_values
from balance.mechanism.mjcf_parser import load_mechanism, mechanism_from_text
from studies import simulated_runs as memory
from testbench import rig as rigs
from testbench.cli.trim import _verdict
from testbench.errors import AnalysisError
from testbench.rig.bench import Bench
from testbench.trimming import trim_runs
from testbench.trimming.estimators import FIXED_WITHIN, _settled
from testbench.trimming.missing_masses import _unseen_by_torques
from testbench.trimming.problem import TrimProblem
from testbench.trimming.result import Share, Trim, trim_document

from ..coverage import assert_holds
from . import linkages

MISSING = 0.0308090
"""On each arm of the manipulator with 3.4116 kg and the built 17.1105 kg [kg m]."""


@pytest.fixture(scope="module")
def triangle():
    """The triangle with the counter-masses that were built."""
    return memory.scene("triangle")


@pytest.fixture(scope="module")
def repeats(manipulator, triangle):
    """Its runs on one clock, by their seeds."""
    return memory.aligned([triangle.run(seed) for seed in range(5)], manipulator)


def test_the_built_set(repeats):
    """17.11 kg for 3.41 kg: 0.0308 kg m are missing, within the interval, and 0.82 kg an arm at 37.55 mm balance it."""
    found = trim_runs(repeats[:3])
    assert found.source == "wrench+torque"
    assert found.origin == "simulated"
    assert found.verdict == "add"
    for one, added in zip(found.missing, found.addition.counter_masses, strict=True):
        assert one.interval[0] < MISSING < one.interval[1]
        assert one.interval[1] - one.interval[0] < 0.2 * MISSING
        assert added.mass == pytest.approx(0.8205, rel=0.1)
        assert np.linalg.norm(added.position) == pytest.approx(0.03755)


def test_an_addition_that_is_not_the_tables_mass_says_why(repeats):
    """Where a site's interval holds zero, nothing is added there, and the others' masses change with it."""
    found = trim_runs(repeats[:3])
    first, *others = found.missing
    table = {one.site: one.mass.value for one in found.missing}
    assert "only together with" not in _verdict(found, None)
    unknown = replace(first.first_moment, covariance=np.eye(1))
    mass = replace(first.mass, covariance=np.eye(1) / first.lever_arm**2)
    alone = replace(found, missing=(replace(first, first_moment=unknown, mass=mass), *others))
    for added in alone.addition.counter_masses:
        text = (
            f"Add {added.mass:.3f} kg at {added.site} (the table's {table[added.site]:.3f} kg only together with its "
        )
        assert added.mass == 0.0 or f"{text}change at {first.site})" in _verdict(alone, None)
    assert found.predicted_residual < 0.1 * MISSING


def test_masses_that_the_file_has_wrong(manipulator, triangle):
    """On a base that moves the forces hold the mechanism's mass: one that is 6 % low in the file does no harm."""
    parameters = manipulator.parameters * np.r_[0.94, np.ones(9)]
    light = replace(manipulator, parameters=parameters)
    found = trim_runs(memory.aligned([triangle.run(seed) for seed in range(2)], light), source="wrench")
    assert [m.first_moment.value for m in found.missing] == pytest.approx([MISSING, MISSING], abs=5e-4)
    assert any("what the file's masses may be wrong by" in text for text in found.about)


def other_bench():
    """A lighter frame, on mounts that are stiffer sideways and softer upright, less damped."""
    text = rigs.load_rig(memory.MANIPULATOR).text
    for old, new in (
        ('mass = "150 kg"', 'mass = "90 kg"'),
        ('"250 kN/m", "400 kN/m"', '"500 kN/m", "150 kN/m"'),
        ('"400 N s/m"', '"250 N s/m"'),
        ('"18 kg m^2"', '"9 kg m^2"'),
    ):
        assert old in text
        text = text.replace(old, new)
    return rigs.rig_from_text(text)


def test_intervals_hold(manipulator, repeats):
    """Intervals hold the truth as often as 95 % promises, over seeds of noise and clocks, on this bench and another."""
    other = memory.scene("triangle", rig=other_bench())
    runs = [*repeats, *memory.aligned([other.run(seed) for seed in range(3)], manipulator)]
    found = [trim_runs([run], source="wrench").missing for run in runs]
    for arm in range(2):
        hits = [one[arm].interval[0] <= MISSING <= one[arm].interval[1] for one in found]
        assert_holds(sum(hits), len(hits))


def test_too_much_is_said(manipulator):
    """Counter-masses that are a kilogram too heavy: a negative first moment is missing, nothing is added."""
    heavy = memory.scene("triangle", masses={"counter_A0A": 18.931, "counter_B0B": 18.931})
    found = trim_runs(memory.aligned([heavy.run(0)], manipulator))
    assert found.verdict == "remove"
    assert all(m.mass.value == pytest.approx(-1.0, abs=0.3) for m in found.missing)
    assert not found.addition.counter_masses


def test_more_to_take_off_than_is_mounted_is_doubtful():
    """A third too much at each site: taken off where the run table has it mounted, doubtful where it has nothing."""
    arm = load_mechanism("serial-2r")
    run = linkages.run(arm, 1, {"counter_link_1": 13.0, "counter_link_2": 2.2}, plate=False, seconds=10.0, rate=250.0)
    assert trim_runs(memory.aligned([run], arm)).verdict == "remove"
    found = trim_runs(memory.aligned([replace(run, conditions={"counter_masses": {}})], arm))
    assert found.verdict == "doubtful"
    assert all(f"{m.site}: at least" in doubt for m, doubt in zip(found.missing, found.doubts(), strict=True))


def test_the_residual_is_that_of_the_mounting_that_is_told(manipulator):
    """A kilogram too much on one arm, one missing on the other: what is told leaves little; adding alone is apart."""
    uneven = memory.scene("triangle", masses={"counter_A0A": 18.931, "counter_B0B": 16.931})
    found = trim_runs(memory.aligned([uneven.run(0)], manipulator), source="wrench")
    document, text = trim_document(found), _verdict(found, None)
    (add,), (less,), only = document["add"], document["remove"], document["only_adding"]
    assert (add["site"], less["site"], found.verdict) == ("counter_B0B", "counter_A0A", "change")
    assert [add["mass_kg"], less["mass_kg"]] == pytest.approx([1.0, 1.0], abs=0.3)
    assert found.changes == {"counter_B0B": add["mass_kg"], "counter_A0A": -less["mass_kg"]}
    assert document["predicted_residual_kgm"] < 0.005 < 0.02 < only["predicted_residual_kgm"]
    assert text.startswith(
        f"At counter_B0B {add['mass_kg']:.3f} kg more, at counter_A0A {less['mass_kg']:.3f} kg less: first-moment "
        f"residual predicted {document['predicted_residual_kgm']:.4f} kg m"
    )
    alone = f"If only adding is possible: {only['add'][0]['mass_kg']:.3f} kg at counter_B0B, residual "
    assert f"{alone}{only['predicted_residual_kgm']:.4f} kg m" in text
    assert all(abs(one.mass.value) < 1e-9 for one in found.remaining())


def test_stock(repeats):
    """From plates of 0.4 kg two go on each arm; plates of 5 kg would do harm, and none is proposed."""
    small = trim_runs(repeats[:1], plates=[stock_plates.Plate("P", 0.4, 8)])
    assert [c.plates for c in small.addition.counter_masses] == [("P", "P"), ("P", "P")]
    large = trim_runs(repeats[:1], plates=[stock_plates.Plate("M", 5.0, 4)])
    assert sum(c.mass for c in large.addition.counter_masses) == 0.0
    assert large.predicted_residual == pytest.approx(MISSING, rel=0.1)


def test_without_the_base_accelerometer(manipulator, triangle):
    """On a base that moves the clocks cannot be aligned without it; on one that does not, its absence is a doubt."""
    rig = without_base_accelerometer(rigs.load_rig(memory.MANIPULATOR))
    with pytest.raises(AnalysisError, match="forces is not aligned"):
        trim_runs(memory.aligned([triangle.run(0)], manipulator, rig), source="wrench")
    arm = load_mechanism("serial-2r")
    rig = without_base_accelerometer(rigs.rig_from_text(linkages.rig_text(arm)))
    found = trim_runs(memory.aligned([linkages.run(arm)], arm, rig), source="wrench")
    assert found.verdict == "doubtful"
    assert "no accelerometer on the base" in found.doubts()[0]
    with_one = rigs.rig_from_text(linkages.rig_text(arm))
    for one in (rig, with_one):
        fixed = one.model_copy(update={"bench": Bench(fixed=True)})
        known = trim_runs(memory.aligned([linkages.run(arm)], arm, fixed), source="wrench")
        assert (known.doubts(), known.verdict) == ([], "add")
        assert known.imbalance.values == pytest.approx(found.imbalance.values, abs=1e-6)  # clocks


def without_base_accelerometer(rig):
    """The rig less its accelerometer on the base."""
    return rig.model_copy(update={"sensors": {k: v for k, v in rig.sensors.items() if k != "base_acc"}})


def still(run):
    """The same run with encoders that never move."""
    for name in ("theta1", "theta2"):
        run = memory.with_values(run, name, np.full_like(run.channel(name), run.channel(name)[0]))
    return run


def clipped(run):
    """The same run with a force sensor at the end of its range."""
    return memory.with_values(run, "Fx1", np.clip(200.0 * run.channel("Fx1"), -500.0, 500.0))


@pytest.mark.parametrize(("change", "says"), [(still, "no motion"), (clipped, r"Fx1.*end of its range")])
def test_runs_that_cannot_tell_are_refused(manipulator, triangle, change, says):
    """No motion, a clipped force: refused, saying what is wrong."""
    with pytest.raises(CounterpoiseError, match=says):
        trim_runs(memory.aligned([change(triangle.run(0))], manipulator), source="wrench")


def test_a_run_with_a_clipped_force_is_left_out(manipulator, triangle):
    """Beside one that is whole: the result is that one's, and doubtful by a finding that is documented."""
    found = trim_runs(memory.aligned([triangle.run(0), clipped(triangle.run(1))], manipulator), source="wrench")
    alone = trim_runs(memory.aligned([triangle.run(0)], manipulator), source="wrench")
    assert [(one.code, one.where) for one in found.findings] == [("not_analyzed", "seed1")]
    assert found.verdict == "doubtful"
    assert found.imbalance.values == pytest.approx(alone.imbalance.values)


def test_a_motion_that_does_not_excite_is_refused(manipulator):
    """The y move alone, with one accelerometer on the base, does not tell the arms apart: what to add is said."""
    with pytest.raises(AnalysisError, match=r"cannot tell what is missing.*another direction"):
        trim_runs(memory.aligned([memory.scene("y").run(0)], manipulator))


def test_no_force_channels(manipulator, triangle):
    """A rig without force sensors and torques is refused."""
    rig = rigs.load_rig(memory.MANIPULATOR)
    kept = {k: v for k, v in rig.sensors.items() if v.kind == "encoder"}
    with pytest.raises(AnalysisError, match="neither force sensors nor motor torques"):
        trim_runs(memory.aligned([triangle.run(0)], manipulator, rig.model_copy(update={"sensors": kept})))


def test_runs_of_two_mountings_are_refused(manipulator, triangle):
    """Runs with other counter-masses are of another mechanism."""
    other = triangle.run(1)
    other = replace(other, conditions={**other.conditions, "counter_masses": {}})
    said = (
        "counter-masses none, that of .* counter_A0A 17.1105 kg, counter_B0B 17.1105 kg: expected runs of one mounting"
    )
    with pytest.raises(AnalysisError, match=said):
        trim_runs(memory.aligned([triangle.run(0), other], manipulator), source="wrench")


def test_a_payload_that_is_stated_by_its_body_is_the_same(manipulator, triangle):
    """``payload_platform_kg`` in one run table, ``payload_kg`` in another."""
    one = triangle.run(1)
    stated = {k: v for k, v in one.conditions.items() if k != "payload_kg"}
    other = replace(one, conditions={**stated, "payloads": {"platform": one.conditions["payload_kg"]}})
    assert trim_runs(memory.aligned([triangle.run(0), other], manipulator), source="wrench").missing


def test_zero_is_the_mounting_of_a_run_that_names_none(manipulator, triangle):
    """A site with a payload of 0 kg, and one that is not named."""
    other = triangle.run(1)
    other = replace(other, conditions={**other.conditions, "payloads": {"counter_A0A": 0.0}})
    assert trim_runs(memory.aligned([triangle.run(0), other], manipulator), source="wrench").missing


@pytest.mark.parametrize("name", ["four-bar", "serial-2r"])
def test_other_mechanisms_by_wrench(name):
    """A linkage and an arm on a force plate: what their counter-masses lack, within the interval."""
    mechanism = load_mechanism(name)
    found = trim_runs(memory.aligned([linkages.run(mechanism, seconds=9.0)], mechanism))
    masses = np.linalg.lstsq(*_system(mechanism, found), rcond=None)[0]
    for one, mass in zip(found.missing, masses, strict=True):
        moment = mass * np.linalg.norm(one.position)
        assert one.interval[0] < moment < one.interval[1]
        assert one.interval[1] - one.interval[0] < 0.1 * abs(moment)


def _system(mechanism, found):
    """B and -A pi of the balance conditions A pi + B m = 0."""
    columns = [
        found.conditions.matrix @ (mechanism.with_counter_mass({m.site: 1.0}).pi - mechanism.pi) for m in found.missing
    ]
    return np.array(columns).T, -found.conditions.values(mechanism)


@pytest.mark.parametrize(("mounted", "shaken"), [({"counter_link_1": 1.0, "counter_link_2": 0.3}, False), ({}, True)])
def test_a_serial_arm_by_torque(mounted, shaken):
    """Motor torques of an arm tell what both its joints lack, with 1 kg mounted at each; and on a base that moves, as
    its accelerometers show.
    """
    mechanism = load_mechanism("serial-2r")
    run = linkages.run(mechanism, 1, mounted, plate=False, seconds=10.0, rate=250.0, shaken=shaken)
    rig = rigs.rig_from_text(run.rig).model_copy(update={"bench": Bench(coupling="moving")})
    found = trim_runs(memory.aligned([run], mechanism, rig))
    assert found.source == "torque"
    masses = np.linalg.lstsq(*_system(mechanism.with_counter_mass(mounted), found), rcond=None)[0]
    for one, mass in zip(found.missing, masses, strict=True):
        moment = mass * np.linalg.norm(one.position)
        assert one.interval[0] < moment < one.interval[1]
        assert one.first_moment.value == pytest.approx(moment, rel=0.1)


@pytest.mark.parametrize("at", [0.1, 1.0])
def test_one_accelerometer_tells_no_turning(at, monkeypatch):
    """A base that only translates: wherever its accelerometer is, what is missing is the same.

    Clipped, it is refused.
    """
    arm, torques, places = load_mechanism("serial-2r"), linkages._base_torques, ((at, -0.2),)
    plane = np.array([1.0, 1.0, 0.0])  # translations
    monkeypatch.setattr(linkages, "PLACES", places)
    monkeypatch.setattr(linkages, "_base_torques", lambda m, p, *of: torques(m, p, *(one * plane for one in of)))
    run = linkages.run(arm, 1, plate=False, seconds=10.0, rate=250.0, shaken=True)
    first = run.channel("ax0") / (0.03 + 0.04 * -0.2)  # less what the turning adds
    for name, part in (("ax0", 0.03), ("ay0", -0.02)):
        run = memory.with_values(run, name, part * first)
    limit = f'unit = "m/s^2"\nrange = "{0.5 * np.abs(part * first).max()} m/s^2"'
    rig, clipped = (
        rigs.rig_from_text(text).model_copy(update={"bench": Bench(coupling="moving")})
        for text in (run.rig, run.rig.replace('unit = "m/s^2"', limit))
    )
    found = trim_runs(memory.aligned([run], arm, rig))
    assert [m.first_moment.value for m in found.missing] == pytest.approx([0.735, 0.099], rel=5e-3)
    assert all(m.first_moment.half_width() < 0.01 * m.first_moment.value for m in found.missing)
    with pytest.raises(AnalysisError, match="end of its range"):
        trim_runs(memory.aligned([memory.with_values(run, "ax0", np.clip(first, -1.0, 1.0))], arm, clipped))


def _off_the_line(amplitude):
    """What a run of an amplitude [rad] finds, of an arm whose second centre is off the line of the file; which
    condition that is, its value [kg m], and the file.
    """
    mechanism = load_mechanism("serial-2r")
    conditions = balance_conditions(mechanism)
    values = conditions.values(mechanism)
    across = next(k for k in range(conditions.rank) if "mcy[link_2]" in conditions.text(k))
    values[across] = 0.01 * np.abs(values).max()
    built = with_condition_values(conditions, mechanism, values)
    run = linkages.run(built, plate=False, seconds=10.0, rate=250.0, amplitude=amplitude)
    return trim_runs(memory.aligned([run], mechanism)), np.eye(conditions.rank)[across], values[across], mechanism


def test_what_a_run_tells_better_than_the_file_is_the_runs():
    """Of a centre across its link, though the run does not tell the other's so well, which is taken from the file."""
    found, across, value, _ = _off_the_line(0.1)
    assert any(FIXED_WITHIN in text for text in found.about)
    assert not found.imbalance.is_fixed(across)
    one = found.imbalance.estimate(across)
    assert abs(one.value - value) < one.half_width() < 1.1 * value


def test_a_centre_off_the_line_of_the_file_is_in_the_interval():
    """In a small motion gravity tells little of where a centre lies across its link: that is taken from the file, and
    how wrong that may be, a hundredth of the largest first moment, is in the interval.
    """
    found, across, value, mechanism = _off_the_line(0.05)
    assert found.imbalance.is_fixed(across)
    assert any(FIXED_WITHIN in text for text in found.about)
    second = found.missing[1]
    assert second.interval[0] < mechanism.parameters[1, 1] < second.interval[1]
    assert second.first_moment.half_width() < value * 1.5
    budget = found.budgets[1]
    assert budget.standard_uncertainty == pytest.approx(second.first_moment.standard_uncertainty)
    (by_file,) = (c for c in budget.contributions if c.evaluation == "B")
    assert by_file.source == "what is taken from the mechanism's file"


def test_what_the_file_tells_has_a_width():
    """A hanging arm, balanced along its site, whose small swings tell nothing of its centre across: what the file may
    be wrong by is in what is predicted, and were the rest certain, the arm would not be called balanced.
    """
    arm = load_mechanism("serial-1r")
    home, conditions = float(arm.home[0]), balance_conditions(arm)
    arm = replace(arm, gravity=9.81 * np.array([np.cos(home), np.sin(home), 0.0]))
    largest, site = conditions.values(arm)[0], arm.counter_sites[0]
    mounted = {site: largest / arm.lever_arm(site)}
    run = linkages.run(arm, counter_masses=mounted, plate=False, seconds=20.0, amplitude=0.1)
    found = trim_runs(memory.aligned([run], arm))
    along, across = np.eye(2)
    assert found.imbalance.is_fixed(across)
    assert found.values[1][1] is None
    deviation = found.imbalance.covariance[1, 1] ** 0.5
    assert deviation == pytest.approx(0.01 * largest / np.sqrt(3.0))
    sure = replace(found.imbalance, values=0.0 * along, covariance=np.diag([1e-12, deviation**2]))
    certain = replace(found, imbalance=sure)
    assert certain.predicted_residual_interval == pytest.approx((0.0, 1.96 * deviation), rel=1e-3, abs=1e-6)
    assert certain.residual_share > 0.01
    assert certain.verdict != "balanced"


def test_masses_alone_are_in_no_first_moment():
    """A quill that rises: its 0.7 kg are a condition of their own, in kg, and no part of what is left in kg m."""
    arm = load_mechanism("scara-quill")
    conditions = balance_conditions(arm)
    values, every = conditions.values(arm), np.eye(conditions.rank)
    known = Imbalance(conditions, values, 1e-8 * every, Subspace.all_values(conditions), every, 0.0)
    missing = tuple(known.missing(arm, arm.counter_sites))
    shares = (Share("torque", missing, 0.0),)
    whole = conditions.residual("kg m")
    found = Trim(conditions, arm, ("r1",), "simulated", shares, missing, known, (), (), unbalanced=whole)
    assert conditions.units[-1] == "kg"
    assert values[-1] == pytest.approx(0.7)
    assert found.predicted_residual == pytest.approx(0.0, abs=1e-9)
    assert found.predicted_residual_interval[1] == pytest.approx(1.96e-4 * np.hypot(1.0, 0.25), rel=1e-3)
    assert found.residual_share == pytest.approx(1.0, rel=1e-3)
    *_, last = trim_document(found)["conditions"]
    assert last["value_kg"] == pytest.approx(0.7)
    one = SimpleNamespace(unloaded=arm, mechanism=arm)
    assert TrimProblem([one], conditions, [], None).largest == pytest.approx([*[whole] * 6, 0.7])


TURNTABLE = """
<mujoco model="turntable"><compiler angle="radian"/><worldbody>
<body name="table"><inertial mass="5.2" pos="0.04 0 0" diaginertia="0.04 0.1 0.1"/>
<joint name="J" axis="0 0 1"/>{}</body>
</worldbody><equality><connect site1="end" site2="tip"/></equality>
<actuator><motor joint="J"/><motor joint="J1"/></actuator><keyframe><key name="home" qpos="0 {}"/></keyframe></mujoco>
"""
CRANK = """<body name="crank" pos="0.06 0 0.15"><inertial mass="0.8" pos="0.06 0 0" diaginertia="1e-4 1e-3 1e-3"/>
<joint name="J1" axis="0 -1 0"/><body name="coupler" pos="0.12 0 0"><inertial mass="0.8" pos="0.15 0 0"
diaginertia="1e-4 1e-2 1e-2"/><joint name="J2" axis="0 -1 0"/><site name="end" pos="0.3 0 0"/></body></body>"""
ROCKER = """<body name="rocker" pos="0.38 0 0.15"><inertial mass="0.9" pos="0.1 0 0" diaginertia="1e-4 4e-3 4e-3"/>
<joint name="J3" axis="0 -1 0"/><site name="tip" pos="0.2 0 0"/></body>"""


@pytest.mark.parametrize(
    ("parts", "qpos"), [(CRANK + ROCKER, "0.6 -0.168428 1.310191"), (ROCKER + CRANK, "1.310191 0.6 -0.168428")]
)
def test_residuals_are_those_of_the_definition_in_any_order_of_bodies(parts, qpos):
    """A four-bar on a turntable: conditions by hand, and by Lagrange the combination least elsewhere."""
    model = mechanism_from_text(TURNTABLE.format(parts, qpos), "turntable")
    conditions = balance_conditions(model)
    mass, moment = ({b: x[k] for b, x in zip(model.bodies, model.parameters, strict=True)} for k in (0, 1))
    by_hand = np.array([[1.0, 0.0, 0.0, -1.6], [0.0, 1.0, 0.0, 0.6], [0.0, 0.0, 1.0, 1.5]])
    carried = [0.06 * (mass["crank"] + mass["coupler"]) + 0.38 * mass["rocker"], 0.12 * mass["coupler"], 0.0]
    left = by_hand @ [moment[b] for b in ("table", "crank", "coupler", "rocker")] + carried
    lacking, error = [], []
    for body in range(4):
        own, others = by_hand[:, [body]], np.delete(by_hand, body, axis=1)
        system = np.block([[others @ others.T, own], [own.T, np.zeros((1, 1))]])
        weights = np.linalg.solve(system, [0.0, 0.0, 0.0, 1.0])[:3]
        lacking.append(abs(weights @ left))
        error.append(np.linalg.norm(weights @ by_hand))  # of first moments known alike, each to 1e-4 kg m
    of_moments = np.diag(np.tile([0.0, 1e-8, 0.0, 0.0, *[0.0] * 6], 4))
    covariance, every = conditions.matrix @ of_moments @ conditions.matrix.T, np.eye(conditions.rank)
    values = conditions.values()
    known = Imbalance(conditions, values, covariance, Subspace.all_values(conditions), every, 0.0)
    found = Trim(conditions, model, ("r",), "simulated", (), (), known, (), (), unbalanced=conditions.residual("kg m"))
    most = max(a + 1.96e-4 * e for a, e in zip(lacking, error, strict=True))
    assert found.unbalanced == pytest.approx(max(lacking), rel=1e-6)
    assert found.residual_with(sizing_of_given(conditions, model, {}))[0] == pytest.approx(max(lacking), rel=1e-6)
    assert found.residual_share == pytest.approx(most / max(lacking), rel=1e-5)


@pytest.mark.parametrize(("amplitude", "seconds"), [(0.25, 6.0), (1.0, 9.0)], ids=["little", "nearly all"])
def test_intervals_do_not_depend_on_the_order_of_bodies(amplitude, seconds):
    """By torque, with what the file tells, and of two sources together; equal as far as equations of a condition of
    1e4 are, squared. So is whether the file is asked where torques tell nearly all.
    """
    text = datasets.find_dataset("four-bar", "mechanisms", ".xml").read_text("utf-8")
    head, crank = text.split('<body name="A0A">')
    crank, rocker = crank.split('<body name="B0B" pos="0.25 0 0">')
    rocker, tail = rocker.split("</body>", 1)
    turned = f'{head}<body name="B0B" pos="0.25 0 0">{rocker}</body><body name="A0A">{crank}{tail}'
    angles = text.partition('qpos="')[2].partition('"')[0].split()
    turned = turned.replace(" ".join(angles), " ".join([angles[2], *angles[:2]]))
    run = linkages.run(load_mechanism("four-bar"), seconds=seconds, amplitude=amplitude, plate=False)
    widths, by_file = [], []
    for model in (load_mechanism("four-bar"), mechanism_from_text(turned, "four-bar")):
        found = trim_runs(memory.aligned([run], model), sites=["counter_A0A", "counter_B0B"])
        by_file.append(any(FIXED_WITHIN in line for line in found.about))
        both = combine([found.imbalance] * 2).imbalance.missing(model, ["counter_A0A", "counter_B0B"])
        widths.append([one.first_moment.half_width() for one in (*found.missing, *both)])
    assert by_file == [amplitude < 0.5] * 2
    assert widths[0] == pytest.approx(widths[1], rel=1e-7)


def test_intervals_of_torque_hold():
    """Over seeds of noise, of an arm whose torques and encoders share a logger: unbiased, and as often as promised."""
    arm = load_mechanism("serial-2r")
    runs = [linkages.run(arm, seed, plate=False, seconds=10.0, rate=250.0) for seed in range(16)]
    found = [trim_runs(memory.aligned([run], arm)) for run in runs]
    masses = np.linalg.lstsq(*_system(arm, found[0]), rcond=None)[0]
    for k, mass in enumerate(masses):
        every = [one.missing[k] for one in found]
        away = [one.first_moment.value - mass * one.lever_arm for one in every]
        assert abs(np.mean(away)) < 4.0 * np.std(away, ddof=1) / len(away) ** 0.5
        assert_holds(sum(abs(by) < one.first_moment.half_width() for by, one in zip(away, every, strict=True)), 16)


@pytest.mark.parametrize("mounted", [{}, {"counter_link_1": 5.0, "counter_link_2": 0.9}])
def test_of_a_chain_what_is_missing_lies_along_its_sites(mounted):
    """Centres off the lines of the sites, which no mass there meets: the zero along each line, whatever is mounted."""
    mechanism = load_mechanism("serial-2r")
    conditions = balance_conditions(mechanism)
    values = conditions.values(mechanism)
    values[[k for k in range(conditions.rank) if "mcy" in conditions.text(k)]] = [0.02, -0.01]
    built = with_condition_values(conditions, mechanism, values)
    run = linkages.run(built, counter_masses=mounted, plate=False, seconds=10.0, rate=250.0, amplitude=0.4)
    found = trim_runs(memory.aligned([run], mechanism))
    second = mechanism.parameters[1, 1]
    arms = [np.linalg.norm(one.position) for one in found.missing]
    length = conditions.coefficients(0)["m[link_2]"]
    lacking = second / arms[1] - mounted.get("counter_link_2", 0.0)
    along = values[0] + length * second / arms[1] - mounted.get("counter_link_1", 0.0) * arms[0]
    for one, truth in zip(found.missing, (along, lacking * arms[1]), strict=True):
        assert one.interval[0] < truth < one.interval[1]
        assert one.first_moment.half_width() < 0.01


def test_what_no_motion_shows_by_torque():
    """An arm lying flat: the first joint's torque holds no first moment of the first link, however it moves."""
    flat = replace(load_mechanism("serial-2r"), gravity=np.array([0.0, 0.0, -9.81]))
    run = linkages.run(flat, plate=False, seconds=10.0, rate=250.0)
    with pytest.raises(AnalysisError, match=r"do not show mcx\[link_1\].* whatever the motion.*--from vibration"):
        trim_runs(memory.aligned([run], flat))


@pytest.mark.parametrize(
    ("gravity", "unseen"), [([0.0, 0.0, -9.81], ["mcx[table]", "mcy[table]"]), ([0.0, -9.81, 0.0], [])]
)
def test_what_no_motion_of_a_turntable_shows_by_torque(gravity, unseen):
    """Of loops too: nothing of what balances about the table's axis, where that lies along gravity."""
    model = mechanism_from_text(TURNTABLE.format(CRANK + ROCKER, "0.6 -0.168428 1.310191"), "turntable")
    model = replace(model, gravity=np.array(gravity))
    found = _unseen_by_torques(SimpleNamespace(mechanism=model, conditions=balance_conditions(model)))
    assert [text.partition(" ")[0] for text in found] == unseen


@pytest.mark.parametrize(("away", "widened"), [(3.0, 36.0), (0.0, 0.0)])
def test_values_that_do_not_settle_widen_the_interval(away, widened):
    """Rounds that jump to and fro by six: its square is in the covariance, or nothing where they settle."""
    conditions = balance_conditions(load_mechanism("serial-1r"))
    every = np.eye(conditions.rank)
    known = Imbalance(conditions, every[0] * away, every, Subspace.all_values(conditions), every, 0.0)

    def about(values):
        return [], None, ImbalanceFit(replace(known, values=-values), np.zeros(0), None)

    *_, found = _settled(([], None, ImbalanceFit(known, np.zeros(0), None)), about)
    assert found.imbalance.covariance == pytest.approx(np.diag([1.0 + widened, 1.0]))
