"""Sweeps: each design as if it were simulated alone, whatever is varied and wherever it is computed."""

import contextlib
import tempfile
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pandas
import pytest

from balance.balancing.sweep import Designs, Problem, Sweep, Variable
from balance.closure import Closure
from balance.dynamics.inverse_dynamics import simulate
from balance.errors import DataError, ModelError
from balance.mechanism.mjcf_parser import mechanism_from_text
from balance.motion.motion_files import load_motion
from balance.task_pool import TaskPool
from tests.balance.models import load
from tests.other_process import OtherProcess

HERE = TaskPool(None)
MASS = Variable("counter_A0A", "mass", np.array([0.0, 1.5, 3.0]))


SITE, JOINT = '<site name="counter_A0A" pos="-0.05 0 0"/>', '<joint name="A0" type="hinge" axis="0 0 1"/>'


ON_BASE = {
    '<body name="B0B" pos="0.25 0 0">': '<site name="ground" pos="0.25 0 0"/><body name="B0B" pos="0.25 0 0">'
    '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><site name="foot" pos="0 0 0"/>',
    "</equality>": '<connect site1="ground" site2="foot"/></equality>',
    "-0.5542843118878877 ": "-0.5542843118878877 0 0 ",
}
"""The rocker's bearing as a closure."""


def problem(counters=None, peaks=True, edit=None) -> Problem:
    """The four-bar on its motion at 500 Hz; each ``edit`` is made to its file first."""
    mechanism = load("four-bar")
    for old, new in (edit or {}).items():
        assert old in mechanism.text
        mechanism = replace(mechanism, text=mechanism.text.replace(old, new))
    mechanism = mechanism_from_text(mechanism.text, "four-bar") if edit else mechanism
    return Problem(mechanism, load_motion("four-bar").sample(500.0), counters or {}, peaks)


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
    ("name", "values", "edit"),
    [
        ("counter_A0A", [-0.05, -0.09], {}),
        ("counter_A0A", [-0.05, -0.09], {SITE: f'<frame pos="0 0.03 0" euler="0 0 40">{SITE}</frame>'}),
        ("counter_A0A", [-0.05, -0.09], {SITE: f'<body name="fixed" pos="0 0.03 0" euler="0 0 40">{SITE}</body>'}),
        ("counter_A0A", [-0.05, -0.09], {JOINT: JOINT.replace("axis", 'pos="0.01 0 0" axis')}),
        ("B_AB", [0.26, 0.27], {}),
        ("ground", [0.25, 0.26], ON_BASE),
        ("AB", [0.1, 0.095], {}),
    ],
)
def test_places_are_as_if_written_in_the_file(name, values, edit):
    """A counter-mass's radius, the end of a loop, a joint: the file with that number gives the same."""
    variable, written = Variable(name, "x", np.array(values)), f'name="{name}" pos="{{}} 0 0"'
    case = problem({"counter_A0A": 2.0}, edit=edit)
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


class Elsewhere(OtherProcess):
    """Workers of another machine, where that folder is not."""

    def results(self, work, tasks):
        """As every pool."""
        with tempfile.TemporaryDirectory() as other, contextlib.chdir(other):
            found = list(super().results(work, tasks))
        yield from found


@pytest.mark.parametrize("pool", [HERE, OtherProcess(None), Elsewhere(None)])
def test_a_sweep_goes_on_where_it_ended(tmp_path, monkeypatch, pool):
    """Parts that are there are read, not computed; another sweep does not go into that folder."""
    monkeypatch.setattr("balance.balancing.sweep.PART", 2)
    monkeypatch.chdir(tmp_path)
    expected = swept(problem(), MASS)
    chosen = dict(Sweep(problem(), (MASS,), Path(), lambda columns: {"least": columns["rms_F_N"].min()}).run(pool))
    assert chosen == {2: {"least": expected["rms_F_N"][:2].min()}, 1: {"least": expected["rms_F_N"][2]}}
    whole = swept(problem(), MASS, folder=tmp_path)
    np.testing.assert_array_equal(whole["rms_F_N"], expected["rms_F_N"])
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
    ("variables", "refusal", "edit"),
    [
        ((Variable("nowhere", "mass", np.ones(1)),), r"body 'nowhere': there are A0A, AB, B0B, B_A", {}),
        ((Variable("rod", "x", np.ones(1)),), r"no site or body with a place 'rod'", {}),
        ((Variable("A0", "x", np.ones(1)),), r"'A0', which is a joint of body A0A; A0A\.x is that of the body", {}),
        ((MASS, MASS), r"counter_A0A.mass is varied twice", {}),
        ((Variable("AB", "x", np.ones(1)),), r"AB.x: four-bar has a site and a body of", {"counter_A0A": "AB"}),
        (
            (Variable("counter_A0A", "x", np.ones(1)),), r"place 'counter_A0A'",
            {SITE: SITE.replace('pos="', 'size="1" type="capsule" fromto="0 1 0 ')},
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_varied_is_refused(variables, refusal, edit):
    """By name, with what there is."""
    with pytest.raises(ModelError, match=refusal):
        swept(problem(edit=edit), *variables)


def test_places_in_a_urdf_are_refused():
    """Of such a file masses are varied, places are not: it says so."""
    inertia = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    link = f'<link name="{{}}"><inertial><mass value="1"/>{inertia}</inertial></link>'
    joint = '<joint name="j" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint>'
    arm = mechanism_from_text(f'<robot name="r">{link.format("a")}{link.format("b")}{joint}</robot>', "arm")
    given = Problem(arm, problem().samples)
    given.check((Variable("b", "mass", np.ones(1)),))
    site = '<link name="counter"/><joint name="k" type="fixed"><parent link="b"/><child link="counter"/></joint>'
    with_site = mechanism_from_text(f'<robot name="r">{link.format("a")}{link.format("b")}{joint}{site}</robot>', "arm")
    Problem(with_site, problem().samples).check((Variable("counter", "mass", np.ones(1)),))  # a link that is a site
    with pytest.raises(ModelError, match=r"b\.x: arm is a URDF or SDF file; places are varied in MJCF files only"):
        given.check((Variable("b", "x", np.ones(1)),))


A, B, C, D, E = "link_a_mass_kg", "b_x_m", "c_mass_kg", "d_z_m", "e_mass_kg"


@pytest.mark.parametrize(
    ("varied", "drawn", "hidden", "best"),
    [
        ({A: [0, 1, 2]}, ["link_a, mass [kg]"], "", None),
        ({C: [5], A: [0, 1, 2]}, ["link_a, mass [kg]"], "", None),
        ({A: [0, 1, 2], B: [0, 3]}, ["link_a, mass [kg]", "b, x [m]"], "", None),
        ({A: [0, 1, 2], B: [0, 3]}, ["link_a, mass [kg]", "b, x [m]"], "", (2, 3)),
        ({A: [0, 1, 9, 9.1], B: [0, 3]}, ["link_a, mass [kg]", "b, x [m]"], "", None),
        ({C: [5], A: [0, 1, 2], B: [0, 3], D: [-1, 4], E: [7, 2, 1]}, ["link_a, mass [kg]", "b, x [m]"],
         "d, z; e, mass", None),
    ],
)  # fmt: skip
def test_a_picture_hides_no_design_and_invents_none(varied, drawn, hidden, best):
    """A cell a place, of the least over the variables that it does not show, which the title names; the best marked.

    Where there is room, cells are written out.
    """
    grid = np.array(list(product(*varied.values())), float)
    value = np.random.default_rng(3).uniform(1.0, 9.0, len(grid))
    value[-1 if best else 0] = 0.5 if best else value[0]
    columns = dict(zip(varied, grid.T, strict=True))
    figure = Designs(columns | {"rms_F_N": value}, tuple(varied)).plot()
    axes, *bar = figure.axes
    names = [name for name in (A, B) if name in varied]
    places = np.column_stack([columns[name] for name in names])
    each = np.unique(places, axis=0)
    least = np.array([value[(places == place).all(axis=1)].min() for place in each])
    *line, star = axes.lines
    at = columns[names[0]][value.argmin()], columns[B][value.argmin()] if bar else value.min()
    assert star.get_xydata()[0] == pytest.approx(at, abs=0)
    assert [axes.get_xlabel(), axes.get_ylabel()] == [*drawn, "shaking force RMS [N]"][:2]
    assert all(f"= {columns[name][value.argmin()]:.4g} {name.rsplit('_')[-1]}" in
               star.get_label().replace("\n", " ") for name in varied)  # fmt: skip
    assert axes.get_title() == "simulated" + (f"; at each place the least over {hidden}" if hidden else "")
    figure.draw_without_rendering()
    box, radius = axes.get_window_extent(), 0.5 * star.get_markersize() * figure.dpi / 72.0
    assert np.all(np.abs(axes.transData.transform(at) - box.get_points().mean(axis=0)) + radius <= 0.5 * box.size)
    if bar:
        (mesh,) = axes.collections
        np.testing.assert_array_equal(mesh.get_array().T.ravel(), least)
        assert bar[0].get_ylabel() == "shaking force RMS [N]"
        written = {text.get_position(): text.get_text() for text in axes.texts if text.get_text()}
        others = {tuple(place): f"{one:.3g}" for place, one in zip(each, least, strict=True) if one > value.min()}
        assert written == ({} if 9.1 in varied[A] else others)
    else:
        np.testing.assert_array_equal(line[0].get_ydata(), least)
