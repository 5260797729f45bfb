"""Sensors as they are: drawn from the stated scatter, once a campaign, and true of every run."""

import numpy as np
import pytest

from balance.mechanism.mjcf_parser import load_mechanism
from testbench.errors import RigError
from testbench.rig import Rig, load_rig
from testbench.rig.bench import Bench
from testbench.simulator.sensors import draw_transducers, support_signals, transduced_signals

RIG = load_rig("parallelogram-6bar")
TIME = np.arange(20_000) / 10_000.0


def with_errors(**errors) -> Rig:
    """The shipped rig with errors of its sensors."""
    stated = Bench.model_validate({"errors": errors})
    return RIG.model_copy(update={"bench": RIG.bench.model_copy(update={"errors": stated.errors})})


def seen(rig: Rig, channel: str, values) -> dict[str, np.ndarray]:
    """All channels at zero but one."""
    found = {column.channel: np.zeros_like(TIME) for column in rig.columns()}
    return found | {channel: values}


def test_sensitivity():
    """Factors scatter about one as stated; the channel shows the product, others of the rig nothing."""
    rig, wave = with_errors(k6d40={"sensitivity": 0.01}), np.sin(9 * TIME)
    drawn = [draw_transducers(rig, seed)["k6d40"] for seed in range(300)]
    factors = np.array([np.diag(d.sensitivity) for d in drawn])
    assert factors.std() == pytest.approx(0.01, rel=0.05)
    assert factors.mean() == pytest.approx(1.0, abs=1e-3)
    found = transduced_signals({"k6d40": drawn[0]}, seen(rig, "Fx1", wave), TIME)
    assert found["Fx1"] == pytest.approx(factors[0, 0] * wave)
    assert not any(np.any(v) for name, v in found.items() if name != "Fx1")


def test_cross():
    """A channel sees others of its sensor; between force and moment as a share of the ranges."""
    rig = with_errors(k6d40={"cross": 0.02})
    matrices = np.array([draw_transducers(rig, seed)["k6d40"].sensitivity for seed in range(400)])
    assert (np.diagonal(matrices, axis1=1, axis2=2) == 1.0).all()
    assert matrices[:, 0, 1].std() == pytest.approx(0.02, rel=0.15)
    assert matrices[:, 3, 0].std() == pytest.approx(0.02 * 20.0 / 500.0, rel=0.15)
    assert matrices[:, 0, 3].std() == pytest.approx(0.02 * 500.0 / 20.0, rel=0.15)


def test_offset_and_drift():
    """Preload and drift are shares of the range: one from the first instant on, the other with time."""
    rig = with_errors(kistler={"offset": 0.01, "drift_per_minute": 0.006})
    drawn = [draw_transducers(rig, seed)["kistler"] for seed in range(300)]
    assert np.std([d.offset for d in drawn]) == pytest.approx(20.0, rel=0.1)
    assert np.std([d.drift for d in drawn]) == pytest.approx(0.2, rel=0.1)
    found = transduced_signals({"kistler": drawn[0]}, seen(rig, "Fx2", np.zeros_like(TIME)), TIME - 0.5)["Fx2"]
    assert found[0] == pytest.approx(drawn[0].offset[0])
    assert found[-1] - found[0] == pytest.approx(drawn[0].drift[0] * TIME[-1])


def test_high_pass():
    """An AC-coupled sensor forgets a load that stays."""
    rig = with_errors(kistler={"high_pass": "1 Hz"})
    load_of = np.where(TIME > 0.1, 10.0, 0.0)
    found = transduced_signals(draw_transducers(rig, 1), seen(rig, "Fx2", load_of), TIME)["Fx2"]
    assert found[1010] == pytest.approx(10.0, rel=0.01)
    assert found[11_000] == pytest.approx(10.0 * np.exp(-2 * np.pi), rel=0.01)


def test_no_errors():
    """A sensor without errors shows what it is exposed to."""
    rig, wave = with_errors(k6d40={}), np.sin(9 * TIME)
    assert np.array_equal(transduced_signals(draw_transducers(rig, 1), seen(rig, "Fx1", wave), TIME)["Fx1"], wave)
    assert draw_transducers(RIG, 1) == {}


def test_each_drawn_for_itself():
    """What is drawn of one sensor does not depend on the others."""
    one, both = (
        with_errors(base_acc={"sensitivity": 0.01}),
        with_errors(k6d40={"sensitivity": 0.01}, base_acc={"sensitivity": 0.01}),
    )
    assert np.array_equal(
        draw_transducers(one, 5)["base_acc"].sensitivity, draw_transducers(both, 5)["base_acc"].sensitivity
    )
    assert not np.array_equal(
        draw_transducers(one, 5)["base_acc"].sensitivity, draw_transducers(one, 6)["base_acc"].sensitivity
    )


@pytest.mark.parametrize(
    ("errors", "said"),
    [
        ({"base_ac": {"sensitivity": 0.01}}, r"no sensor 'base_ac'.*base_acc"),
        ({"motor_A0": {"offset": 0.01}}, r"motor_A0.*'tau1' has no range"),
    ],
)
def test_refused(errors, said):
    """A sensor that is not there, or a share of a range that is not stated, is refused."""
    with pytest.raises(RigError, match=said):
        draw_transducers(with_errors(**errors), 1)


def test_stated_cross_talk():
    """Where the rig itself states a cross-talk matrix, readings = crosstalk @ loads."""
    from testbench.campaign_plan import PlannedRun
    from testbench.simulator.run import simulate_run

    matrix = ((1.0, 0.02, 0.0), (0.0, 1.0, 0.03), (0.01, 0.0, 1.0))
    mixed = RIG.sensors["kistler"].model_copy(update={"crosstalk": matrix})
    rig = RIG.model_copy(update={"sensors": {**RIG.sensors, "kistler": mixed}})
    done = simulate_run(RIG, load_mechanism(RIG.mechanism), PlannedRun("r", 5.0, {}, "x", 9.81, 1))
    plain, read = support_signals(RIG, done), support_signals(rig, done)
    loads = np.array([plain[name] for name in ("Fx2", "Fy2", "Fz2")])
    np.testing.assert_allclose([read[name] for name in ("Fx2", "Fy2", "Fz2")], np.array(matrix) @ loads, 1e-6, 1e-12)
    assert np.array_equal(read["Fx1"], plain["Fx1"])
