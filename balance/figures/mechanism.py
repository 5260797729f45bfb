"""A mechanism drawn to scale in its plane x-y, with its counter-masses."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats
from ..balancing import CounterMass, Sizing
from ..balancing.sizing_study import SizingStudy
from ..closure import Closure
from ..errors import DataError
from ..mechanism import forward_kinematics
from ..mechanism.mechanism import Mechanism
from ..mechanism.sparse_components import Vector, dense

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STEEL_KG_PER_M2 = 7830.0 * 0.10
"""Counter-masses are drawn as steel discs 100 mm thick: only their area has a meaning [kg/m2]."""
LINK, PAYLOAD, COUNTER, GROUND = "#3b6ea5", "#2a9d8f", "#e07a3f", "#555555"


def draw_mechanism(
    mechanism: Mechanism, counter_masses: Sequence[CounterMass] = (), q: Floats | None = None, title: str = ""
) -> "Figure":
    """Draw a mechanism at ``q`` (nv,) [rad, m], by default home; discs have the area of the counter-masses."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.8), layout="constrained")
    axes = figure.add_subplot()
    draw_on(axes, mechanism, counter_masses, Closure(mechanism).home if q is None else q)
    axes.set_title(title or mechanism.name)
    axes.set_aspect("equal")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.grid(alpha=0.25)
    return figure


def draw_sizing(result: Sizing | SizingStudy) -> "Figure":
    """Draw a mechanism with the counter-masses that were found for it."""
    return draw_mechanism(result.after, result.counter_masses)


def draw_on(axes: "Axes", mechanism: Mechanism, counter_masses: Sequence[CounterMass], q: Floats) -> None:
    """Draw links, pivots, payload and counter-masses at ``q`` (nv,) [rad, m] on axes of equal scale."""
    at = forward_kinematics.pose(mechanism.tree, q[:, None])
    for body, name in enumerate(mechanism.bodies):
        colour = PAYLOAD if name in mechanism.payload_bodies else LINK
        _draw_link(axes, link_points(mechanism, at, body)[:, :2, 0], name, colour)
    for joint, elementary in enumerate(mechanism.tree.joints):
        if elementary.revolute:
            ground = elementary.parent < 0
            axes.plot(*_flat(at.position[joint]), "^" if ground else "o", ms=11 if ground else 6, mfc="white",
                      mec=GROUND, mew=1.6, zorder=5)  # fmt: skip
    for loop in mechanism.closed_loops:
        axes.plot(*_flat(at.point(loop.first.joint, loop.first.position)), "o", ms=6, mfc="white", mec=GROUND, mew=1.6,
                  zorder=5)  # fmt: skip
    for counter in counter_masses:
        _draw_counter_mass(axes, mechanism, at, counter)


def refuse_unknown_ending(path: str | Path) -> None:
    """Raise DataError, listing the endings, for a path whose ending is no format of figures."""
    from matplotlib.backend_bases import FigureCanvasBase

    known = FigureCanvasBase.get_supported_filetypes()
    if Path(path).suffix.lstrip(".").lower() not in known:
        raise DataError(f"{Path(path).name}: cannot draw this kind of file: expected one of {', '.join(sorted(known))}")


def save(figure: "Figure", path: str | Path) -> None:
    """Save a figure in the format of the path's ending. Raises DataError, listing the endings, for an unknown one."""
    refuse_unknown_ending(path)
    figure.savefig(path, dpi=160)


def link_points(mechanism: Mechanism, at: forward_kinematics.Pose, body: int) -> Floats:
    """Points of a link worth joining: its joint, its children's joints, where loops close, (k, 3, n) [m].

    In the order of their angles about their middle in the plane x-y at the first sample.
    """
    joint = mechanism.tree.bodies[body]
    points = [at.position[child] for child, j in enumerate(mechanism.tree.joints) if j.parent == joint]
    if mechanism.tree.joints[joint].revolute:
        points.append(at.position[joint])
    ends = [end for loop in mechanism.closed_loops for end in (loop.first, loop.second) if end.joint == joint]
    points += [at.point(end.joint, end.position) for end in ends]
    if len(points) < 2:
        sites = [site for site in mechanism.sites.values() if site.body == body and not site.name.startswith("counter")]
        points += [at.point(joint, site.position) for site in sites]
    found = np.array([dense(point, at.count) for point in points or [at.position[joint]]])
    off = found[:, :2, 0] - found[:, :2, 0].mean(axis=0)
    return found[np.argsort(np.arctan2(off[:, 1], off[:, 0]))]


def _flat(point: Vector) -> Floats:
    """In the plane x-y, (2,) [m]."""
    return dense(point, 1)[:2, 0]


def _draw_link(axes: "Axes", points: Floats, name: str, colour: str) -> None:
    centre = points.mean(axis=0)
    axes.plot(*np.vstack([points, points[:1]]).T, color=colour, lw=4, solid_capstyle="round", alpha=0.9, zorder=3)
    box = {"fc": "white", "ec": "none", "alpha": 0.7, "pad": 1.0}
    axes.annotate(name, centre, (7, 5), textcoords="offset points", color=colour, fontsize=9, zorder=6, bbox=box)


def _draw_counter_mass(axes: "Axes", mechanism: Mechanism, at: forward_kinematics.Pose, counter: CounterMass) -> None:
    """A disc, and the stay from the joint to it."""
    from matplotlib.patches import Circle

    joint = mechanism.tree.bodies[mechanism.site(counter.site).body]
    pivot, place = _flat(at.position[joint]), _flat(at.point(joint, counter.position))
    axes.plot(*np.array([pivot, place]).T, color=COUNTER, lw=3, zorder=2)
    radius = np.sqrt(counter.mass / (np.pi * STEEL_KG_PER_M2))
    centre = (float(place[0]), float(place[1]))
    axes.add_patch(Circle(centre, radius, color=COUNTER, alpha=0.55, lw=0, zorder=2))
    axes.annotate(f"{counter.mass:.2f} kg", centre, ha="center", va="center", fontsize=9, zorder=7)
