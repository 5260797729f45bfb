"""What deceives is found by the test that looks for it; honest records pass, and their values are right."""

from dataclasses import replace

import numpy as np
import pytest

from balance.mechanism.mjcf_parser import load_mechanism, mechanism_from_text
from studies.joint_records import Maker
from testbench.cli.identify import print_result
from testbench.identification import JointRecord, identify
from testbench.identification.model_tests import law_terms
from testbench.kinematics.smoothing_and_derivatives import Grid

from . import arms

MAKER = Maker()
ARM = load_mechanism("two-joint-arm-a0")


def identified(kind: str, seed: int):
    """Of a drawn case, without the other methods; and the case."""
    case = MAKER.case(kind, seed)
    return identify(case.records, case.mechanism, others=False), case


@pytest.mark.parametrize(
    ("kind", "seed", "code"),
    [
        ("law", 3, "feedback_law"),
        ("hand", 2, "outside_torque"),
        ("lost_counts", 2, "slip"),
        ("encoder_slip", 5, "encoder_jump"),
        ("sign", 3, "torque_sign"),
        ("scale_known", 1, "torque_scale"),
        ("angle_scale", 0, "angle_scale"),
    ],
)
def test_what_deceives_is_named(kind, seed, code):
    """Each is doubtful for its own reason; a scale with the command that takes it off."""
    result, _ = identified(kind, seed)
    assert result.verdict == "doubtful"
    doubts = {doubt.code: doubt.text for doubt in result.doubts}
    assert code in doubts
    if code == "torque_scale":
        scale = result.tests.scale
        known = f'--uncertainty "{100.0 * scale.half_width() / scale.value:.2g} %" --coverage-factor 2 --reason'
        assert f'SENSOR --sensitivity "{scale.value:.4g} N m/(N m)" {known}' in doubts[code]


@pytest.mark.parametrize(("seed", "verdict"), [(4, "usable"), (5, "usable up to a torque scale")])
def test_honest_records_pass(seed, verdict, capsys):
    """With a known mass the scale is closed, without it is not; the true values lie within; the verdict comes first."""
    result, case = identified("honest", seed)
    print_result(result)
    shown = capsys.readouterr().out
    assert shown.startswith(f"Verdict: {verdict}; ")
    assert result.tests.motion is not None
    assert (result.tests.scale is not None) == case.closed == ("torques' scale is not checked" not in shown)
    assert result.doubts == []
    assert result.verdict == verdict
    for names, value in case.truth.values():
        low, high = result.value(names).interval
        assert low <= value <= high


def dahl(speed: np.ndarray, step: float, way: float) -> np.ndarray:
    """Dahl's presliding at one N m: z' = (v - |v| z) / way, by many small steps of Euler's."""
    z, found = 0.0, []
    for v in np.repeat(speed, 10):
        z += 0.1 * step * (v - abs(v) * z) / way
        found.append(z)
    return np.array(found[9::10])


@pytest.mark.parametrize(
    ("extra", "law", "amount", "size"),
    [
        (lambda v: 0.0 * v, None, 0.0, 1.0),
        (lambda v: 0.3 * np.exp(-((v / 0.25) ** 2)) * np.sign(v), "low_speed", 0.3, 0.25),
        (lambda v: 0.3 * np.exp(-((v / 1.2) ** 2)) * np.sign(v), "low_speed", 0.3, 1.2),
        (lambda v: 0.4 * (dahl(v, 0.005, 0.02) - np.sign(v)), "hysteresis", -0.4, 0.02),
        (lambda v: 0.03 * v * np.abs(v), "quadratic", 0.03, 1.0),
        (lambda v: 0.08 * np.abs(v), "directional", 0.08, 1.0),
    ],
)
def test_the_form_of_friction(extra, law, amount, size):
    """Dry and viscous friction is found without bias; what is more is named, with its size between those tried."""
    time, rng = np.arange(0.0, 15.0, 0.005), np.random.default_rng(2)
    sizes, omegas, phases = np.array([[0.9, 2.1, 0.3], [0.4, 5.3, 1.0], [0.15, 11.0, 2.0]]).T[:, :, None]
    angle = omegas * time + phases
    q, v, a = (
        np.sum(one, 0)
        for one in (sizes * np.sin(angle), sizes * omegas * np.cos(angle), -sizes * omegas**2 * np.sin(angle))
    )
    torque = 0.3 * a + 9.81 * 0.6 * np.sin(q) + 0.4 * np.sign(v) + 0.3 * v + extra(v) + rng.normal(0.0, 0.03, len(v))
    record = JointRecord(
        "arm", "simulated", Grid(0.0, 0.005, len(time)), np.rint(q[:, None] / 2e-5) * 2e-5, torque[:, None]
    )
    result = identify([record], MAKER.mechanisms[0], others=False)
    laws = [test.law for test in result.friction]
    assert [one.kind for one in laws] == [law] * (law is not None)
    assert len(result.other_friction) == len(laws)
    assert all(text.startswith("friction of J1 is not Coulomb + viscous: ") for text in result.other_friction)
    assert all(one.size == pytest.approx(size, rel=0.1) for one in laws)
    known = [("mcx[link_1]", 0.6), ("coulomb[J1]", 0.4), ("viscous[J1]", 0.3), *((one.name, amount) for one in laws)]
    for name, value in known:
        one = result.value({name: 1.0})
        assert one.interval[0] <= value <= one.interval[1], name
        assert one.value == pytest.approx(value, rel=0.015 if name in dict(known[:3]) else 0.1)
    for test in result.friction:
        undecided = (replace(test, at_end=True), replace(test, law=test.law._replace(size=9.9)))
        at_end, left_out = replace(result, friction=undecided).other_friction
        assert "size is at the end of what is tried: coulomb[J1] and viscous[J1] are not determined" in at_end
        if test.law.has_size:
            assert "left out, as the record is doubtful with it too" in left_out


SLIDE = """<mujoco model="slide"><compiler angle="radian"/><worldbody><body name="carriage">
<joint name="S" type="slide" axis="0.8 0 0.6"/><inertial pos="0 0 0" mass="3" diaginertia="1 1 1"/>
<body name="arm"><joint name="R" type="hinge" axis="0 -1 0"/><inertial pos="0.1 0 0" mass="2" diaginertia="1 1 1"/>
</body></body></worldbody><actuator><motor name="MS" joint="S"/><motor name="MR" joint="R"/></actuator></mujoco>"""


@pytest.mark.parametrize("more", [0.0, 0.8])
def test_what_no_motion_separates_is_no_doubt(more, capsys):
    """An arm on an inclined slide: its mass and the armature are one; torques of Lagrange by hand, `more` Stribeck."""
    time, rng = np.arange(0.0, 16.0, 0.005), np.random.default_rng(2)
    sizes = np.array([[0.05, 0.03, 0.015], [0.5, 0.25, 0.1]])
    omegas = np.array([[2.2, 5.1, 9.7], [1.7, 4.3, 8.1]])
    angle = omegas * time[:, None, None] + rng.uniform(0.0, 6.0, (2, 3))
    waves = (sizes * np.sin(angle), sizes * omegas * np.cos(angle), -sizes * omegas**2 * np.sin(angle))
    q, v, a = (np.sum(one, 2) for one in waves)
    mass, moment, inertia, weight = 5.2, 0.3, 0.065, 9.81
    along, across = (moment * (0.6 * np.cos(q[:, 1]) - 0.8 * np.sin(q[:, 1])), moment * np.cos(q[:, 1]))
    centrifugal = moment * (0.6 * np.sin(q[:, 1]) + 0.8 * np.cos(q[:, 1])) * v[:, 1] ** 2
    slide = mass * (a[:, 0] + 0.6 * weight) + along * a[:, 1] - centrifugal
    torque = np.column_stack([slide, inertia * a[:, 1] + along * a[:, 0] + weight * across])
    dry, sizes = np.array([6.0, 0.28]), np.array([0.06, 0.35])
    torque += dry * np.sign(v) * (1.0 + more * np.exp(-((v / sizes) ** 2))) + [9.0, 0.1] * v
    torque += rng.normal(0.0, [0.25, 0.012], torque.shape)
    step = np.array([5e-6, 1.5e-4])
    record = JointRecord("run", "simulated", Grid(0.0, 0.005, len(time)), np.rint(q / step) * step, torque)
    result = identify([record], mechanism_from_text(SLIDE, "slide"), others=False)
    print_result(result)
    assert result.verdict == "usable up to a torque scale"
    assert "separates m[carriage] + m[arm] from offset[S], armature[S]" in capsys.readouterr().out
    assert [test.law.kind for test in result.friction] == ["low_speed"] * (2 if more else 0)
    assert len(result.other_friction) == len(result.friction)
    for names, value in [
        ({"m[carriage]": 1.0, "m[arm]": 1.0, "armature[S]": 1.0}, mass),
        ({"mcx[arm]": 1.0}, moment),
        ({"Iyy[arm]": 1.0, "armature[R]": 1.0}, inertia),
        ({"coulomb[S]": 1.0}, 6.0),
        ({"coulomb[R]": 1.0}, 0.28),
    ]:
        assert result.value(names).value == pytest.approx(value, rel=0.02), names


def test_a_brake_is_a_stall():
    """A motor that pulls for two seconds at a joint that rests: neither weight nor friction explains its torque."""
    (record,) = MAKER.case("honest", 5).records
    q, torque = record.q.copy(), record.torque.copy()
    begin = 300 + int(np.argmin(np.abs(record.rates(5.0).v[300:-300, 0])))  # where the motion turns
    end = begin + round(2.0 / record.grid.step)
    q = np.insert(q, begin, np.repeat(q[begin : begin + 1], end - begin, axis=0), axis=0)
    torque = np.insert(torque, begin, np.full((end - begin, 1), np.abs(torque).max()), axis=0)
    held = replace(record, grid=replace(record.grid, count=len(q)), q=q, torque=torque)
    seconds, pull = identify([held], MAKER.mechanisms[0], others=False).tests.stalls["J1"]
    assert 0.5 < seconds < 2.5
    assert pull > 0.2 * np.abs(record.torque).max()


def test_a_scale_leaves_ratios_and_verdict():
    """Torques that read 30 % too much: every first moment is 30 % too large, their ratio and the verdict stay."""
    record = arms.record(ARM, seed=3, rate=100.0)
    one, other = (identify([replace(record, torque=s * record.torque)], ARM, others=False) for s in (1.0, 1.3))
    assert one.verdict == other.verdict == "usable up to a torque scale"
    assert other.first_moments()[0].value == pytest.approx(1.3 * one.first_moments()[0].value, rel=1e-6)
    for left, right in zip(one.moment_ratios(), other.moment_ratios(), strict=True):
        assert right.value == pytest.approx(left.value, rel=1e-6, abs=1e-9)
        assert right.interval == pytest.approx(left.interval, rel=1e-5, abs=1e-9)


def mounted(radius: float) -> np.ndarray:
    """Inertial parameters of 2 kg on the first link and 1 kg on the second, 0.12 m behind their joints."""
    own = np.array([1.0, -0.12, 0.0, 0.0, 0.0, 0.0, 0.12**2, 0.0, 0.0, 0.12**2 + radius**2])
    return np.concatenate([2.0 * own, own])


@pytest.mark.parametrize(
    ("scales", "radius", "stated"),
    [
        ((1.03, 0.98), 0.0, 0.0),
        ((1.03, 1.03), 0.0, 0.0),
        ((1.0, 1.0), 0.04, 0.0),
        ((1.0, 1.0), 0.04, 0.04),
        ((0.98, 1.0), 0.0, 0.04),
    ],
)
def test_each_torque_has_a_scale(scales, radius, stated):
    """Of two drives, by what was mounted in a run: apart, or one if equal, each sensor named; whatever its inertia."""
    bare, loaded = (arms.record(ARM, seed=s, noise=0.01, beyond=b) for s, b in ((1, 0.0), (2, mounted(radius))))
    records = [
        replace(record, torque=record.torque * scales, mounted=known, sensors=("motor_1", "motor_2"))
        for record, known in ((bare, np.zeros(0)), (loaded, mounted(stated)))
    ]
    tests = identify(records, ARM, "ls", others=False).tests
    assert tests.scales.closed
    assert (tests.scale is not None) == (scales[0] == scales[1])
    for one, value in zip(tests.scales.each.values(), scales, strict=True):
        assert one.value == pytest.approx(value, abs=0.005)
        assert one.half_width() < 0.005
    doubts = [doubt for doubt in tests.doubts if doubt.code == "torque_scale"]
    named = [f"motor_{k + 1}" for k, value in enumerate(scales) if value != 1.0]
    assert [name for name in ("motor_1", "motor_2") if any(name in doubt.text for doubt in doubts)] == named
    assert not {"slip", "angle_scale"} & {doubt.code for doubt in tests.doubts}
    assert all(high > radius**2 - stated**2 for _, high in tests.scales.radii_of_gyration.values())


def test_what_adds_up_widens_the_intervals():
    """White noise leaves the covariance as it is; the same noise slowed down makes the motion stray, and widens it."""
    record = arms.record(ARM, seed=5, noise=0.05, rate=100.0)
    slow = np.cumsum(np.random.default_rng(1).normal(0.0, 0.01, record.torque.shape), axis=0)
    white, drifting = (identify([r], ARM, others=False) for r in (record, replace(record, torque=record.torque + slow)))
    assert white.tests.motion.factor < 1.5
    assert white.tests.motion.probability > 0.01
    assert drifting.tests.motion.factor > 1.5
    value = drifting.first_moments()[0]
    plain = drifting.identified.estimate(
        drifting.identified.identifiability.vector({"mcx[link_1]": 1, "m[link_2]": 0.3})
    )
    assert value.estimate.half_width() == pytest.approx(plain.half_width() * drifting.tests.motion.factor**0.5)


def test_terms_of_a_law():
    """Weights, springs and dampers are among the first terms of one joint, those of the others with two."""
    time = np.arange(0.0, 20.0, 0.01)
    q = np.column_stack([np.sin(time), 1.3 * np.sin(1.7 * time + 0.4)])
    v = np.gradient(q, time, axis=0)
    for joints in (1, 2):
        x, w = q[:, :joints], v[:, :joints]
        made = 2.0 * np.sin(x.sum(axis=1)) - 3.0 * (x[:, 0] - 0.2) - 0.4 * w[:, -1]
        terms = law_terms(x, w, 0)[:, : 6 + 4 * (joints - 1) + 2]
        left = made - terms @ np.linalg.lstsq(terms, made, rcond=None)[0]
        assert np.abs(left).max() < 1e-6 * np.abs(made).max()
