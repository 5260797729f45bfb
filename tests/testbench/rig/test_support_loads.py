"""The load of the mechanism is shared among its supports, and nothing of it is lost."""

from dataclasses import replace

import numpy as np
import pytest

from testbench.errors import RigError
from testbench.rig import load_rig
from testbench.rig.sensors import support_wrenches, wrench_transport

SUPPORTS = load_rig("parallelogram-6bar").supports
WRENCHES = np.random.default_rng(3).normal(size=(50, 6))


def total(loads: dict[str, np.ndarray]) -> np.ndarray:
    """Wrench about the origin of what all supports carry, (n, 6)."""
    return sum(load @ wrench_transport(np.array(SUPPORTS[name].position)).T for name, load in loads.items())


def test_sum():
    """Over all sensors the wrench is the whole wrench, whatever it is."""
    loads = {name: WRENCHES @ share.T for name, share in support_wrenches(SUPPORTS).items()}
    assert total(loads) == pytest.approx(WRENCHES, abs=1e-12)


def test_only_what_is_measured():
    """A one-axis cell carries along its axis and nothing else; a three-axis one carries no moment."""
    loads = {name: WRENCHES @ share.T for name, share in support_wrenches(SUPPORTS).items()}
    assert not np.any(loads["futek_1"][:, [0, 1, 3, 4, 5]])
    assert not np.any(loads["kistler"][:, 3:])


def test_least_energy():
    """Any other distribution that adds up to the same wrench stores more elastic energy."""
    found = support_wrenches(SUPPORTS)
    rng = np.random.default_rng(5)

    def energy(loads):
        rates = {name: np.array(SUPPORTS[name].axis_stiffness) for name in loads}
        return sum((load[rates[n] > 0] ** 2 / rates[n][rates[n] > 0]).sum() for n, load in loads.items())

    for wrench in WRENCHES[:10]:
        loads = {name: share @ wrench for name, share in found.items()}
        push = {name: rng.normal(size=6) * (np.array(SUPPORTS[name].axis_stiffness) > 0) for name in loads}
        excess = total({name: value[None] for name, value in push.items()})[0]
        other = {name: loads[name] + push[name] - found[name] @ excess for name in loads}
        assert total({n: v[None] for n, v in other.items()})[0] == pytest.approx(wrench)
        assert energy(other) > energy(loads)


def test_stiffer_carries_more():
    """Of two supports side by side the stiffer carries more, in the ratio of their stiffness."""
    stiff = SUPPORTS["kistler"].model_copy(update={"stiffness": 3e8})
    soft = SUPPORTS["kistler"].model_copy(update={"stiffness": 1e8})
    rest = SUPPORTS["k6d40"].model_copy(update={"stiffness": 1.0, "position": stiff.position})
    found = support_wrenches({"stiff": stiff, "soft": soft, "rest": rest})
    force = np.array([1.0, 0.0, 0.0, *np.cross(stiff.position, [1.0, 0.0, 0.0])])
    assert (found["stiff"] @ force)[0] == pytest.approx(0.75, rel=1e-6)
    assert (found["soft"] @ force)[0] == pytest.approx(0.25, rel=1e-6)


@pytest.mark.parametrize("height", [0.0, 0.3])
def test_a_planar_bench_on_a_table(height):
    """Cells along x and y that carry nothing else: force and turning moment are theirs, the rest goes elsewhere."""
    places = ((-0.2, -0.15, height), (0.2, -0.15, height), (0.0, 0.3, height))
    cell = SUPPORTS["kistler"].model_copy(update={"channels": {"x": "x", "y": "y"}, "unloaded": "rest"})
    cells = {f"K{k}": cell.model_copy(update={"position": place}) for k, place in enumerate(places)}
    loads = {name: WRENCHES @ share.T for name, share in support_wrenches(cells).items()}
    carried = sum(load @ wrench_transport(np.array(cells[name].position)).T for name, load in loads.items())
    assert carried[:, [0, 1, 5]] == pytest.approx(WRENCHES[:, [0, 1, 5]], abs=1e-9)
    assert not any(np.any(load[:, 2:]) for load in loads.values())
    silent = {name: one.model_copy(update={"unloaded": ()}) for name, one in cells.items()}
    with pytest.raises(RigError, match=r'say that K0, K1, K2 carry nothing else \(unloaded = "rest"\)'):
        support_wrenches(silent)


def test_too_few():
    """Supports that leave a force uncarried are refused, and such that leave open which moment goes elsewhere."""
    one = SUPPORTS["futek_1"]
    askew = {"one": one, "other": one.model_copy(update={"position": (-0.15, 0.2, 0.0)})}
    with pytest.raises(RigError, match="cannot carry"):
        support_wrenches(askew)


def test_without_a_unit_a_simulated_log_is_in_si():
    """As real logs state their own: the rig need not."""
    column = next(iter(SUPPORTS["kistler"].columns("kistler")))
    silent = replace(column, unit="", calibration=None)
    assert silent.written(np.array([2.0])) == pytest.approx(2.0)
    assert silent.assumed_unit == "N"
