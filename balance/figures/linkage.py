"""A planar linkage drawn to scale in its start position: links, joints, counter-masses, and its gears."""

from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats
from ..linkages.equivalence_method import Assembly, LinkageBalance
from ..linkages.linkage import GROUND
from ..linkages.moment_balance import GearResult
from . import panels
from .mechanism import COUNTER, LINK, STEEL_KG_PER_M2
from .mechanism import GROUND as GROUND_COLOUR

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

GEAR, COUNTER_GEAR = "#8a5aa5", "#2a9d8f"


def draw_linkage(result: LinkageBalance) -> "Figure":
    """Draw a balanced linkage; gears by their pitch circles, counter-masses as discs of steel 100 mm thick.

    Raises ModelError or ClosureError where a place or angle is not given, or it cannot be closed.
    """
    linkage, start = result.linkage, result.start
    figure, ((axes,),) = panels(7.2, 5.6)
    for name, body in linkage.bodies.items():
        points = [_place(result, start, j.name, name) for j in linkage.joints.values() if j.joins(name) and j.revolute]
        points = points or [start.point(name, np.zeros(2))]
        middle = np.mean(points, axis=0)
        round_it = sorted(points, key=lambda at: float(np.arctan2(*(at - middle)[::-1])))
        axes.plot(*np.array([*round_it, round_it[0]]).T, color=LINK, lw=4, alpha=0.9, zorder=3)
        axes.annotate(body.name, middle, (6, 5), textcoords="offset points", color=LINK, zorder=6)
    for body_name, counter in result.counters():
        pivot = result.joint_point(result.tree[body_name], body_name).at(result.values)
        at = [start.point(body_name, pivot), start.point(body_name, pivot + counter.position)]
        axes.plot(*np.array(at).T, color=COUNTER, lw=2, zorder=2)
        _circle(axes, at[1], np.sqrt(counter.mass / (np.pi * STEEL_KG_PER_M2)), COUNTER, f"{counter.symbol}")
    for gear in result.gears.values():
        _draw_gear(axes, result, start, gear)
    for joint in linkage.joints.values():
        at_joint = _place(result, start, joint.name, joint.ends[1].body)
        mark = ("^" if joint.joins(GROUND) else "o") if joint.revolute else "s"
        axes.plot(*at_joint, mark, ms=8, mfc="white", mec=GROUND_COLOUR, mew=1.5, zorder=5)
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title=linkage.title)
    return figure


def _place(result: LinkageBalance, start: Assembly, joint: str, body: str) -> Floats:
    return start.point(body, result.joint_point(joint, body).at(result.values))


def _draw_gear(axes: "Axes", result: LinkageBalance, start: Assembly, gear: GearResult) -> None:
    """Pitch circles of both gears; where the counter-gear's pivot is not given apart from its axis, the name alone."""
    pivot, axis = (start.point(gear.carrier, at) for at in gear.centres(result))
    distance, teeth = float(np.linalg.norm(pivot - axis)), gear.gear.teeth
    if distance == 0.0:
        place = (float(axis[0]), float(axis[1]))
        axes.annotate(gear.gear.name, place, (-6, -12), textcoords="offset points", color=GEAR, ha="right", zorder=6)
        return
    for at, count, colour, mark in ((axis, teeth[0], GEAR, ""), (pivot, teeth[1], COUNTER_GEAR, "*")):
        _circle(axes, at, distance * count / sum(teeth), colour, f"{gear.gear.name}{mark}")


def _circle(axes: "Axes", at: Floats, radius: float, colour: str, name: str) -> None:
    from matplotlib.patches import Circle

    centre = (float(at[0]), float(at[1]))
    axes.add_patch(Circle(centre, float(radius), facecolor=colour, alpha=0.25, edgecolor=colour, lw=1.5, zorder=2))
    axes.annotate(name, (centre[0], centre[1] + float(radius)), ha="center", va="bottom", fontsize=8, color=colour)
