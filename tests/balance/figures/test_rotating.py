"""Polygons, polar diagrams and order plots: names and legends lie on nothing, what is drawn is what was found."""

import numpy as np
import pytest
from matplotlib.text import Text

from balance.engines import free_forces
from balance.engines.engine_files import load_layout
from balance.figures.rotating import draw_orders, draw_polygons, draw_readings
from balance.rotors.results import READING, WEIGHT, Influence
from balance.rotors.rotor import Plane, Unbalance, correct_planes, polygons
from balance.rotors.trial_runs import load_trial_runs


def test_names_of_a_polygon_stand_outside_it():
    """Of a convex one each name is farther from the middle than its side; of a short side too."""
    unbalances = [Unbalance("a", 3.0, 0.1), Unbalance("b", 2.0j, 0.1), Unbalance("c", -0.1 + 0.05j, 0.1)]
    found = correct_planes(unbalances, [Plane("left", 0.0), Plane("right", 0.4)])
    drawn = [p for p in polygons(found) if "Unbalances" in p.title]
    figure = draw_polygons(found)
    figure.draw_without_rendering()
    axes = figure.axes[-1]
    names = {text.get_text(): text for text in axes.texts if text.get_text()}
    corners = axes.transData.transform([(1e3 * v.real, 1e3 * v.imag) for v in drawn[0].vertices])
    middle = corners.mean(axis=0)
    for name, start, end in zip([*drawn[0].names], corners, corners[1:], strict=False):
        box = names[name].get_window_extent()
        at = np.array([0.5 * (box.x0 + box.x1), 0.5 * (box.y0 + box.y1)])
        assert np.linalg.norm(at - middle) > np.linalg.norm(0.5 * (start + end) - middle)


@pytest.mark.parametrize("name", ["in-line-3", "v8-90-crossplane"])
def test_legends_of_order_plots_lie_above_the_bars(name):
    """The highest bar ends below the legend."""
    engine = load_layout(name)
    free = free_forces.free_forces(engine, 8)
    turn = free_forces.residual_over_turn(engine, free_forces.balance_shafts(free[:2], 0.0, 3.0), 1.0, engine.middle)
    figure = draw_orders(free, engine.name, 1.0, ("m r omega^2", "m r omega^2 a"), turn)
    figure.draw_without_rendering()
    for axes in figure.axes[:2]:
        tops = [patch.get_window_extent().y1 for patch in axes.patches if patch.get_height() > 0.0]
        assert max(tops) < axes.get_legend().get_window_extent().y0
        assert "ω²" in axes.get_ylabel()


@pytest.mark.parametrize("name", ["feese-2004", "two-plane-maker", "goodman-1964", "pavelek-2016", "one-plane-maker"])
def test_tips_of_vectors_lie_within_the_frame(name):
    """All readings and weights, and their names."""
    runs = load_trial_runs(name)
    solution = runs.solve("least-squares")
    figure = draw_readings(Influence(runs, solution))
    figure.draw_without_rendering()
    for axes in figure.axes:
        rim = axes.get_window_extent()
        for text in filter(Text.get_text, axes.texts):
            from_middle = text.get_window_extent().corners() - rim.get_points().mean(axis=0)
            assert np.hypot(*from_middle.T).max() < 0.5 * rim.width, text
    readings, weights = figure.axes
    assert readings.get_rmax() > 1.05 * READING[runs.reading][2] * np.abs(solution.coefficients.initial).max()
    assert weights.get_rmax() > 1.05 * WEIGHT[runs.weight][2] * np.abs(solution.weights).max()
