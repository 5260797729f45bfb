"""Figures: every panel has its unit, and what is simulated says so."""

import io
import re
from dataclasses import replace

import numpy as np
import pytest

from studies import lies
from testbench import figures
from testbench.campaign_plan import load_plan
from testbench.figures.style import origin_of
from testbench.project import new_project
from testbench.published_tables import load_published
from testbench.rig import load_rig
from testbench.store import open_campaign
from testbench.vibration.comparison import compare_campaign
from testbench.vibration.metrics import Measure
from testbench.vibration.reduction import analyze


@pytest.fixture(scope="module")
def runs(brief):
    """The 5 kg runs along x at 3 g0: with counter-masses, without."""
    return open_campaign(brief.campaign).runs[4:6]


def drawn(figure) -> None:
    """Lay the figure out and write it, as a user would."""
    figure.savefig(io.BytesIO(), format="png", dpi=50)


@pytest.mark.parametrize(
    ("name", "panels", "unit"),
    [("base_acceleration", 3, "[m/s2]"), ("motor_torques", 2, "[N m]"), ("force_sensors", 11, "[N")],
)
def test_two_runs(runs, name, panels, unit):
    """A panel for each channel, two lines in each, unit and condition stated, marked as simulated."""
    figure = getattr(figures, name)(*runs)
    drawn(figure)
    visible = [axes for axes in figure.axes if axes.get_visible()]
    assert len(visible) == panels
    assert all(len(axes.lines) == 2 for axes in visible)
    assert all(unit in axes.get_ylabel() + axes.get_title(loc="left") for axes in visible)
    assert figure.get_suptitle().startswith("Simulated: ")
    assert "payload 5 kg, motion x, peak 3 g0" in figure.get_suptitle()


def test_drives_in_the_units_of_their_joints(tmp_path):
    """A drive that slides pushes in newtons, between others that turn."""
    new_project(tmp_path / "test", "scara-quill")
    made = lies.simulated(load_rig(tmp_path / "test" / "rig.toml"), load_plan(tmp_path / "test" / "plan.toml"), 3)
    shown = figures.motor_torques(made[0], made[-1]).axes
    assert [axes.get_ylabel() for axes in shown] == ["torque [N m]", "torque [N m]", "force [N]", "torque [N m]"]
    assert re.search(r"peak [\d.]+ N without, [\d.]+ N with$", shown[2].get_title(loc="left"))


def test_base_acceleration_states_the_reduction(brief, runs):
    """The title of each panel states the reduction that the analysis finds."""
    found = {r.axis: r for r in analyze(runs, Measure()).reductions}
    figure = figures.base_acceleration(*runs)
    for axis, axes in zip("xyz", figure.axes, strict=True):
        assert f"{found[axis].percent:.1f} % [{found[axis].interval[0]:.1f}, " in axes.get_title(loc="left")
        assert axes.patches  # the noise floor


def test_command_performance(runs):
    """The moved axis alone: accelerometer, encoders and target above, what is missing below."""
    figure = figures.command_performance(runs[0])
    drawn(figure)
    assert [len(axes.lines) for axes in figure.axes] == [3, 2]
    assert figure.get_suptitle().startswith("Simulated: ")


def test_reductions(brief):
    """A panel a motion, a point for each axis; analysed, simulated and published values are those of the rows."""
    comparison = compare_campaign(open_campaign(brief.campaign).runs[:4], load_published("kiper2019"), Measure())
    figure = figures.reductions(comparison)
    drawn(figure)
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["motion x", "motion y"]
    published, simulated, analyzed = (list(line.get_ydata()) for line in figure.axes[0].lines[:3])
    rows = sorted((r for r in comparison.rows if r.analyzed.key.motion == "x"), key=lambda r: r.analyzed.axis)
    assert published == [r.published for r in rows]
    assert simulated == [r.simulated for r in rows]
    assert analyzed == [r.analyzed.percent for r in rows]
    assert figure.get_suptitle().startswith("Simulated")


@pytest.mark.parametrize(
    ("peaks", "titles"),
    [((3.0,), [""]), ((1.0, 2.0, 3.0), [f"{s} along {a}" for s in ("base_acc", "2nd") for a in "xyz"])],
)
def test_reductions_of_an_analysis_alone(runs, peaks, titles):
    """What was analysed, its intervals, and nothing else in the legend; no wider than a page, however many sensors.

    Sensors and axes share a panel where each has a point, which is named below it; else each has one, at most three in
    a row.
    """
    analysis = analyze(runs, Measure())
    second = tuple(replace(r, sensor="2nd") for r in analysis.reductions)
    rows = [
        replace(r, key=replace(r.key, peak_acceleration_g=peak, payload_kg=None))
        for r in (*analysis.reductions, *second)
        for peak in peaks
    ]
    figure = figures.reductions(replace(analysis, reductions=tuple(rows)))
    drawn(figure)
    assert [axes.get_title(loc="left") for axes in figure.axes] == titles
    assert figure.get_suptitle().startswith("Simulated campaign: reduction of base acceleration, motion x\n")
    assert figure.get_figwidth() <= 9.0
    first = [r.percent for r in rows] if len(titles) == 1 else [analysis.reductions[0].percent] * len(peaks)
    assert list(figure.axes[0].lines[2].get_ydata()) == first
    (below,) = figure.axes[0].child_axes
    named = [f"\n{r.sensor} {r.axis}" for r in rows] if len(titles) == 1 else ["\n"]
    assert [label.get_text() for label in below.get_xticklabels()] == named
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["analysed from simulated logs"]


def test_what_is_no_number_is_drawn_as_such(runs):
    """Bounds and what is withheld have marks of their own; payloads by name are below the peak accelerations."""
    analysis = analyze(runs, Measure())
    sound = analysis.reductions[0]
    key = replace(sound.key, payload_kg=None, payloads=(("tip", 0.1), ("tool", 5.0)))
    rows = [
        replace(sound, key=key, **changed)
        for changed in (
            {},
            {"limit": "at_least"},
            {"limit": "at_most", "interval": None},
            {"interval": None, "doubts": ("counter_mass_contradiction",)},
        )
    ]
    figure = figures.reductions(replace(analysis, reductions=tuple(rows)))
    drawn(figure)
    (axes,), (legend,) = figure.axes, figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [
        "analysed from simulated logs", "at least", "at most", "withheld"
    ]  # fmt: skip
    found = np.array([line.get_ydata() for line in axes.lines[2:6]])
    values = [sound.percent, sound.interval[0], sound.percent, sound.percent]
    np.testing.assert_array_equal(found, np.where(np.eye(4, dtype=bool), values, np.nan))
    (below,) = axes.child_axes
    assert below.get_xlabel() == "peak acceleration [g0], payload"
    assert [label.get_text() for label in below.get_xticklabels()] == ["\ntip 0.1 kg\ntool 5 kg"]


@pytest.mark.parametrize(("peak", "before"), [(None, ""), (3.0, "\n")])
def test_sets_of_counter_masses_are_told_apart(runs, peak, before):
    """Without payload and peak acceleration too: each point stands above the number of its set, which the title has."""
    analysis = analyze(runs, Measure())
    sound = analysis.reductions[0]
    key = replace(sound.key, payload_kg=None, peak_acceleration_g=peak)
    sets = [{"counter_A0A": 4.3}, {"counter_A0A": 1.2, "counter_B0B": 2.4}]
    rows = [replace(sound, key=key, counter_masses=masses, percent=50.0 + i) for i, masses in enumerate(sets)]
    figure = figures.reductions(replace(analysis, reductions=tuple(rows)))
    drawn(figure)
    (axes,), ((below,),) = figure.axes, [axes.child_axes for axes in figure.axes]
    assert [label.get_text() for label in below.get_xticklabels()] == [f"{before}set 1", f"{before}set 2"]
    assert below.get_xlabel() == "peak acceleration [g0], " * bool(peak) + "counter-masses"
    np.testing.assert_array_equal(axes.lines[2].get_xydata(), np.column_stack([below.get_xticks(), [50.0, 51.0]]))
    assert "\nset 1: counter_A0A 4.3 kg\nset 2: counter_A0A 1.2 kg, counter_B0B 2.4 kg" in figure.get_suptitle()


def test_payloads_with_a_name_and_without_are_told_apart(runs):
    """Two payloads of the mechanism with one on a body besides: two groups, each with both masses below it."""
    analysis = analyze(runs, Measure())
    sound = analysis.reductions[0]
    rows = [
        replace(sound, key=replace(sound.key, payload_kg=mass, payloads=named))
        for mass in (1.451, 5.0)
        for named in ((), (("BD", 3.0),))
    ]
    figure = figures.reductions(replace(analysis, reductions=tuple(rows)))
    (below,) = figure.axes[0].child_axes
    assert [label.get_text() for label in below.get_xticklabels()] == [
        "\n1.451 kg", "\n1.451 kg\nBD 3 kg", "\n5 kg", "\n5 kg\nBD 3 kg"
    ]  # fmt: skip


def test_origin(runs):
    """Measured runs carry no mark; a mixture names both."""
    measured = replace(runs[0], origin="measured")
    assert origin_of([measured]) == ""
    assert origin_of([measured, runs[1]]) == "Measured and Simulated: "
    assert origin_of([replace(runs[0], origin="unstated")]) == "Origin unstated: "
