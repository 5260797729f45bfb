"""A mechanism drawn to scale in its plane, else in x-y, with its counter-masses."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats
from ..balancing.sizing import CounterMass, Sizing
from ..balancing.sizing_study import SizingStudy
from ..closure import Closure
from ..errors import DataError
from ..mechanism.forward_kinematics import Pose, poses
from ..mechanism.mechanism import Mechanism
from . import panels

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STEEL_KG_PER_M2 = 7830.0 * 0.10
"""Counter-masses are drawn as steel discs 100 mm thick: only their area has a meaning [kg/m2]."""
_PLANAR = 1e-3
"""Extent along an axis up to which a mechanism lies in the plane of the others, as a share of its size."""
LINK, PAYLOAD, COUNTER, GROUND = "#3b6ea5", "#2a9d8f", "#e07a3f", "#555555"


def draw_mechanism(
    mechanism: Mechanism, counter_masses: Sequence[CounterMass] = (), q: Floats | None = None, title: str = ""
) -> "Figure":
    """Draw a mechanism at ``q`` (nv,) [rad, m], by default home; discs have the area of the counter-masses."""
    figure, ((axes,),) = panels(6.4, 4.8)
    q = Closure(mechanism).home if q is None else q
    plane = plane_of(mechanism, q[None]) or [0, 1]
    draw_on(axes, mechanism, counter_masses, q, plane)
    right, up = (f"{'xyz'[axis]} [m]" for axis in plane)
    axes.set(title=title or mechanism.name, aspect="equal", xlabel=right, ylabel=up)
    return figure


def draw_sizing(result: Sizing | SizingStudy) -> "Figure":
    """Draw a mechanism with the counter-masses that were found for it."""
    added = f"{sum(counter.mass for counter in result.counter_masses):.4g} kg added; discs as if of steel, 100 mm thick"
    return draw_mechanism(result.after, result.counter_masses, title=f"{result.after.name}\n{added}")


@dataclass(frozen=True)
class Shape:
    """What is drawn of a part of a mechanism."""

    kind: str
    """``link``, ``payload``: a closed polygon; ``stay``: from a joint to its counter-mass; ``counter``: a disc of
    ``radius``; ``pivot``, ``ground``: joints that turn, the latter on the base."""
    points: Floats
    """In base axes, (k, 3, n) [m]."""
    label: str = ""
    radius: float | None = None
    """[m]"""


def shapes(mechanism: Mechanism, masses: Mapping[str, float], q: Floats) -> Iterator[Shape]:
    """Counter-masses [kg] by site, links, joints at configurations ``q`` (n, nv) [rad, m], in the order of drawing."""
    tree, at = mechanism.tree, poses(mechanism.tree, q)
    for site, mass in masses.items():
        place, own = mechanism.site(site), tree.bodies[mechanism.site(site).body]
        ends = np.array([at.position[:, own].T, at.point(own, place.position).T])
        yield Shape("stay", ends)
        yield Shape("counter", ends[1:], f"{mass:.4g} kg at {site}", float(np.sqrt(mass / (np.pi * STEEL_KG_PER_M2))))
    for body, name in enumerate(mechanism.bodies):
        yield Shape("payload" if name in mechanism.payload_bodies else "link", link_points(mechanism, at, body), name)
    for i, joint in enumerate(tree.joints):
        same_place = joint.parent >= 0 and tree.joints[joint.parent].revolute and np.allclose(joint.position, 0.0)
        if joint.revolute and not same_place:  # of a ball joint's hinges the first
            yield Shape("ground" if joint.parent < 0 else "pivot", at.position[None, :, i].transpose(0, 2, 1))
    for loop in mechanism.closed_loops:
        yield Shape("pivot", at.point(loop.first.joint, loop.first.position).T[None])


def plane_of(mechanism: Mechanism, q: Floats) -> list[int] | None:
    """The base's axes to the right and upwards of the plane that it lies in at ``q`` (n, nv) [rad, m]; None of none."""
    at = poses(mechanism.tree, q)
    points = np.concatenate([link_points(mechanism, at, body) for body in range(len(mechanism.bodies))])
    extent = np.ptp(points, axis=(0, 2))
    planes = ([0, 1], [0, 2], [1, 2])
    return next((plane for plane in planes if extent[3 - sum(plane)] <= _PLANAR * extent.max()), None)


def draw_on(
    axes: "Axes", mechanism: Mechanism, counter_masses: Sequence[CounterMass], q: Floats, plane: Sequence[int] = (0, 1)
) -> None:
    """Draw links, pivots, payload and counter-masses at ``q`` (nv,) [rad, m] on axes of equal scale.

    ``plane``: which of the base's axes are to the right and upwards.
    """
    from matplotlib.patches import Circle

    box = {"fc": "white", "ec": "none", "alpha": 0.7, "pad": 1.0}
    for one in shapes(mechanism, {counter.site: counter.mass for counter in counter_masses}, q[None]):
        flat = one.points[:, plane, 0]
        centre = (float(flat[:, 0].mean()), float(flat[:, 1].mean()))
        if one.kind in ("link", "payload"):
            colour = PAYLOAD if one.kind == "payload" else LINK
            axes.plot(*np.vstack([flat, flat[:1]]).T, color=colour, lw=4, solid_capstyle="round", alpha=0.9, zorder=3)
            axes.annotate(one.label, centre, (7, 5), textcoords="offset points", color=colour, fontsize=9, zorder=6,
                          bbox=box)  # fmt: skip
        elif one.kind == "stay":
            axes.plot(*flat.T, color=COUNTER, lw=3, zorder=2)
        elif one.radius is not None:
            axes.add_patch(Circle(centre, one.radius, color=COUNTER, alpha=0.55, lw=0, zorder=2))
            mass = one.label.partition(" at ")[0]
            axes.annotate(mass, centre, ha="center", va="center", fontsize=9, zorder=7, bbox=box)
        else:
            ground = one.kind == "ground"
            axes.plot(*centre, "^" if ground else "o", ms=11 if ground else 6, mfc="white", mec=GROUND, mew=1.6,
                      zorder=5)  # fmt: skip


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


def link_points(mechanism: Mechanism, at: Pose, body: int) -> Floats:
    """Points of a link worth joining: its joint, its children's joints, where loops close, (k, 3, n) [m].

    Where there are no two of them the origins of bodies fixed to it and its sites too, and where those are in one place
    its own centre of mass, whatever it carries. In the order of their angles about their middle at the first sample,
    in the base's axes along which they are furthest apart, from one of them on that is the same at every sample.
    """
    joint = mechanism.tree.bodies[body]
    points = [at.position[:, child] for child, j in enumerate(mechanism.tree.joints) if j.parent == joint]
    if mechanism.tree.joints[joint].revolute:
        points.append(at.position[:, joint])
    ends = [end for loop in mechanism.closed_loops for end in (loop.first, loop.second) if end.joint == joint]
    points += [at.point(end.joint, end.position) for end in ends]
    if len(points) < 2:
        fixed = [name for name, (index, _) in mechanism.own_mass.items() if index == body]
        places = [mechanism.frames[name][1] for name in fixed if name != mechanism.bodies[body]]
        sites = [site for site in mechanism.sites.values() if site.body == body and not site.name.startswith("counter")]
        points += [at.point(joint, place) for place in (*places, *(site.position for site in sites))]
    if len(points) < 2 or np.allclose(points, points[0], rtol=0.0, atol=1e-9):
        own = [row for index, row in mechanism.own_mass.values() if index == body and row[0] > 0.0]
        points += [at.point(joint, row[1:4] / row[0]) for row in own[:1]]
    found = np.array([point.T for point in points or [at.position[:, joint]]])
    off = found[:, :, 0] - found[:, :, 0].mean(axis=0)
    x, y = np.sort(np.argsort(np.ptp(off, axis=0), kind="stable")[1:])
    order = np.argsort(np.arctan2(off[:, y], off[:, x]))
    return found[np.roll(order, -int(np.argmin(order)))]
