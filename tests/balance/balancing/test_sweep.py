"""Sweeps: each design as if it were simulated alone, whatever is varied and wherever it is computed."""

import numpy as np
import pandas
import pytest

from balance.balancing.sweep import Problem, Sweep, Variable
from balance.closure import Closure
from balance.dynamics.inverse_dynamics import simulate
from balance.errors import DataError, ModelError
from balance.mechanism.mjcf_parser import mechanism_from_text
from balance.motion.motion_files import load_motion
from balance.task_pool import TaskPool
from tests.balance.models import load

HERE = TaskPool(None)
MASS = Variable("counter_A0A", "mass", np.array([0.0, 1.5, 3.0]))


def problem(counters=None, peaks=True) -> Problem:
    """The four-bar on its motion at 500 Hz."""
    return Problem(load("four-bar"), load_motion("four-bar").sample(500.0), counters or {}, peaks)


def swept(case: Problem, *variables: Variable, folder=None) -> dict[str, np.ndarray]:
    """All results, in the order of the grid."""
    parts = [columns for _, columns in Sweep(case, variables, folder).run(HERE)]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def alone(mechanism, samples) -> dict[str, float]:
    """RMS and peak values of one mechanism, by inverse dynamics."""
    response = simulate(mechanism, Closure(mechanism).follow(samples))
    found = {f"rms_{name}": value for name, value in response.rms().items()}
    found |= {f"peak_{name}": value for name, value in response.peak().items()}
    for name, vector in (("F_N", response.force), ("M_Nm", response.moment)):
        size = np.linalg.norm(vector, axis=1)
        found |= {f"rms_{name}": float(np.sqrt(np.mean(size**2))), f"peak_{name}": float(size.max())}
    return found


def assert_same(columns, row: int, expected: dict[str, float]) -> None:
    """Relative to the largest force or moment: 1e-9, as responses are differences of simulations."""
    for name, value in expected.items():
        assert columns[name][row] == pytest.approx(value, rel=1e-9, abs=1e-9), name


def test_masses_of_sites_and_bodies():
    """Every combination equals its own simulation; the last variable varies first."""
    case = problem({"counter_B0B": 0.7})
    payload = Variable("AB", "mass", np.array([0.5, 1.1]))
    columns = swept(case, MASS, payload)
    assert columns["counter_A0A_mass_kg"].tolist() == [0.0, 0.0, 1.5, 1.5, 3.0, 3.0]
    for row in range(6):
        masses = {"counter_A0A": columns["counter_A0A_mass_kg"][row], "counter_B0B": 0.7}
        single = case.mechanism.with_payload({"AB": columns["AB_mass_kg"][row]}).with_counter_mass(masses)
        assert_same(columns, row, alone(single, case.samples))
        assert columns["added_mass_kg"][row] == pytest.approx(masses["counter_A0A"] + 0.7)


@pytest.mark.parametrize(
    ("variable", "written"),
    [
        (Variable("counter_A0A", "x", np.array([-0.05, -0.09])), 'name="counter_A0A" pos="{} 0 0"'),
        (Variable("B_AB", "x", np.array([0.26, 0.27])), 'name="B_AB" pos="{} 0 0"'),
        (Variable("AB", "x", np.array([0.1, 0.095])), 'name="AB" pos="{} 0 0"'),
    ],
)
def test_places_are_as_if_written_in_the_file(variable, written):
    """A counter-mass's radius, the end of a loop, a joint: the file with that number gives the same."""
    case = problem({"counter_A0A": 2.0})
    columns = swept(case, variable)
    text = case.mechanism.text
    for row, place in enumerate(variable.values):
        old = written.format(f"{variable.values[0]:g}")
        assert old in text
        other = mechanism_from_text(text.replace(old, written.format(repr(float(place)))), "four-bar")
        assert_same(columns, row, alone(other.with_counter_mass({"counter_A0A": 2.0}), case.samples))


def test_rms_alone_is_the_same():
    """Without peaks, the same RMS values and no peaks."""
    whole, brief = swept(problem(), MASS), swept(problem(peaks=False), MASS)
    assert not any(name.startswith("peak") for name in brief)
    for name in brief:
        np.testing.assert_array_equal(brief[name], whole[name])


def test_a_sweep_goes_on_where_it_ended(tmp_path, monkeypatch):
    """Parts that are there are read, not computed; another sweep does not go into that folder."""
    monkeypatch.setattr("balance.balancing.sweep.PART", 2)
    whole = swept(problem(), MASS, folder=tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "_sweep.json",
        "part-00000.parquet",
        "part-00001.parquet",
    ]
    assert len(pandas.read_parquet(tmp_path)) == len(whole["rms_F_N"])
    (tmp_path / "part-00001.parquet").unlink()
    again = swept(problem(), MASS, folder=tmp_path)
    for name, values in whole.items():
        np.testing.assert_array_equal(again[name], values)
    with pytest.raises(DataError, match="holds another sweep"):
        swept(problem({"counter_B0B": 1.0}), MASS, folder=tmp_path)


@pytest.mark.parametrize(
    ("variables", "refusal"),
    [
        ((Variable("nowhere", "mass", np.ones(1)),), r"no site or moving body 'nowhere': there are A0A, AB, B0B, B_A"),
        ((Variable("rod", "x", np.ones(1)),), r"no site or body with a place 'rod'"),
        ((MASS, MASS), r"counter_A0A.mass is varied twice"),
    ],
)
def test_what_cannot_be_varied_is_refused(variables, refusal):
    """By name, with what there is."""
    with pytest.raises(ModelError, match=refusal):
        swept(problem(), *variables)


def test_places_in_a_urdf_are_refused():
    """Of such a file masses are varied, places are not: it says so."""
    inertia = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    link = f'<link name="{{}}"><inertial><mass value="1"/>{inertia}</inertial></link>'
    joint = '<joint name="j" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint>'
    arm = mechanism_from_text(f'<robot name="r">{link.format("a")}{link.format("b")}{joint}</robot>', "arm")
    given = Problem(arm, problem().samples)
    given.check((Variable("b", "mass", np.ones(1)),))
    with pytest.raises(ModelError, match=r"b\.x: arm is a URDF or SDF file; places are varied in MJCF files only"):
        given.check((Variable("b", "x", np.ones(1)),))
