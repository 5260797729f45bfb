"""A mechanism in motion for a page, to scale: links, pivots, counter-masses, centre of mass and shaking force.

Mechanisms in one of the planes x-y, x-z and y-z are seen face-on; others obliquely, or as is asked for, the direction
of gravity downwards, and then only lengths across the line of sight are to scale. Azimuth is where the viewer stands,
counted from x towards y where z is up: about the upward direction, from x, or from y where x is nearly upright.
"""

import base64
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Floats
from ..closure import Trajectory
from ..dynamics.inverse_dynamics import simulate
from ..dynamics.regressor import first_moment, rounding_of_force
from ..figures.mechanism import plane_of, shapes
from ..mechanism.mechanism import Mechanism
from .page import Page

FRAMES = 160
"""Most pictures of one motion."""
WIDTH = 1000.0
"""Of the drawing [its units]; coordinates are kept to a tenth of one."""
_MARGIN = 60.0
_LONGEST_ARROW = 0.3
"""Of the largest shaking force, as a share of the mechanism's size."""
_HEAD = 0.03
"""Length of an arrow's head, as a share of the mechanism's size."""
OBLIQUE = np.radians(30.0), np.radians(20.0)
"""Azimuth and elevation from which a spatial mechanism is seen where nothing else is asked for [rad]."""
_VIEW = "seen from azimuth {:.0f}°, elevation {:.0f}°, to scale only across the line of sight"


Designs = Mapping[str, tuple[Mechanism, Mapping[str, float]]]
"""By label the mechanism as it moves, and its counter-masses [kg] by site."""


def moving(
    name: str,
    trajectory: Trajectory,
    designs: Designs,
    forces: Mapping[str, Floats] | None = None,
    seen_from: tuple[float, float] = OBLIQUE,
    around: Floats | None = None,
) -> dict[str, Any]:
    """A motion of one mechanism for the page's script, a panel for each design.

    ``designs``: by label the mechanism as it moves and its counter-masses [kg] by site, which are in it already.
    ``forces``: by label the shaking force along the trajectory (n, 3) [N], by default the model's. ``seen_from``:
    azimuth and elevation [rad], for spatial mechanisms. ``around``: further configurations (k, nv) [rad, m] for which
    there is to be room.
    """
    step = max(1, -(-len(trajectory.time) // FRAMES))
    frames = np.arange(0, len(trajectory.time), step)
    forces = forces or {label: simulate(mechanism, trajectory).force for label, (mechanism, _) in designs.items()}
    peaks = {label: float(np.linalg.norm(force, axis=1).max()) for label, force in forces.items()}
    for label, (mechanism, _) in designs.items():
        peaks[label] *= peaks[label] > rounding_of_force(mechanism, trajectory)
    forces, largest = {label: force * (peaks[label] > 0.0) for label, force in forces.items()}, max(peaks.values())
    room_for = trajectory.q[frames] if around is None else np.concatenate([trajectory.q[frames], around])
    view, along = _view(next(iter(designs.values()))[0], room_for, seen_from)
    each = {label: _picture(mechanism, masses, room_for, view) for label, (mechanism, masses) in designs.items()}
    extent = np.concatenate([points.reshape(-1, 2) for points, _ in each.values()])
    low, size = extent.min(axis=0), np.ptp(extent, axis=0)
    arrow = _LONGEST_ARROW * float(size.max()) / (largest or 1.0)
    scale = (WIDTH - 2.0 * _MARGIN) / (float(size[0]) + 2.0 * arrow * largest)
    room = _MARGIN + scale * arrow * largest
    height = float(size[1]) * scale + 2.0 * room

    def drawn(points: Floats) -> Floats:
        """Coordinates of the drawing, y downwards, (..., 2)."""
        off = (points - low) * scale
        return np.stack([room + off[..., 0], height - room - off[..., 1]], axis=-1)

    panels = []
    for label, (places, parts) in each.items():
        force, in_frames = forces[label][frames] @ view.T, places[: len(frames)]
        arrows = _arrow(in_frames[:, -1], arrow * force, _HEAD * float(size.max()))
        parts = [{**shape, "radius": shape["radius"] * scale} if "radius" in shape else shape for shape in parts]
        last = in_frames.shape[1] - 1
        parts.append({"kind": "centre", "points": [last]})
        parts.append({"kind": "force", "points": [last, last + 1, last + 2, last + 1, last + 3]})
        points = np.concatenate([in_frames, arrows], axis=1)
        tenths = np.rint(10.0 * drawn(points)).astype("<i2")
        panels.append({
            "label": label, "shapes": parts, "count": points.shape[1],
            "points": base64.b64encode(tenths.tobytes()).decode("ascii"),
            "first": (0.1 * tenths[0].astype(float)).tolist(),
            "largest_N": peaks[label],
            "force_N": [float(f"{value:.4g}") for value in np.linalg.norm(forces[label][frames], axis=1)],
        })  # fmt: skip
    metre = 10.0 ** np.floor(np.log10(0.5 * float(size.max())))
    return {
        "name": name, "time": [float(f"{t:.6g}") for t in trajectory.time[frames]], "width": WIDTH, "height": height,
        "panels": panels, "scale_bar_m": float(metre), "scale_bar": float(metre * scale),
        "view": f"seen along {along}" if along else _VIEW.format(*np.degrees(seen_from)), "arrow_N": largest,
        "flat": bool(along),
    }  # fmt: skip


def drawn_points(
    mechanism: Mechanism, masses: Mapping[str, float], seen_from: tuple[float, float], around: Floats
) -> Callable[[Floats], Floats]:
    """From configurations (n, nv) [rad, m] to the points of :func:`moving` across the view, (n, k, 2) [m].

    They are numbered as in the first configuration.
    """
    view, _ = _view(mechanism, around, seen_from)
    return lambda q: _picture(mechanism, masses, q, view)[0]


def pictures(panel: Mapping[str, Any]) -> Floats:
    """Points of a panel of :func:`moving` in every picture, (frames, k, 2) [units of the drawing]."""
    raw = np.frombuffer(base64.b64decode(panel["points"]), "<i2")
    return raw.reshape(-1, panel["count"], 2) / 10.0


def _arrow(tail: Floats, along: Floats, head: float) -> Floats:
    """Tip of an arrow and the ends of its barbs, (n, 3, 2) [m], from ``tail`` (n, 2) as long as ``along`` (n, 2)."""
    back = -along * np.minimum(0.4, head / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300))
    across = 0.5 * back[:, ::-1] * [1.0, -1.0]
    tip = tail + along
    return np.stack([tip, tip + back + across, tip + back - across], axis=1)


def _view(mechanism: Mechanism, q: Floats, seen_from: tuple[float, float]) -> tuple[Floats, str]:
    """Directions to the right and upwards, (2, 3); the axis along which a planar mechanism is seen, else nothing."""
    plane = plane_of(mechanism, q)
    if plane is not None:
        return np.eye(3)[plane], "xyz"[3 - sum(plane)]
    weight = float(np.linalg.norm(mechanism.gravity))
    up = -mechanism.gravity / weight if weight > 0.0 else np.array([0.0, 0.0, 1.0])
    first = np.cross(up, np.cross(np.eye(3)[int(abs(up[0]) > 0.9)], up))
    first /= np.linalg.norm(first)
    azimuth, elevation = seen_from
    away = -np.cos(azimuth) * first - np.sin(azimuth) * np.cross(up, first)
    return np.array([np.cross(away, up), np.cos(elevation) * up + np.sin(elevation) * away]), ""


def _picture(
    mechanism: Mechanism, masses: Mapping[str, float], q: Floats, view: Floats
) -> tuple[Floats, list[dict[str, Any]]]:
    """Links, pivots, counter-masses at ``q`` (frames, nv) [rad, m]: points (frames, k, 2) [m], and shapes by index.

    The centre of mass is the last point.
    """
    points: list[Floats] = []
    drawn: list[dict[str, Any]] = []
    for one in shapes(mechanism, masses, q):
        places = list(range(len(points), len(points) + len(one.points)))
        label, radius = {"label": one.label} if one.label else {}, {"radius": one.radius} if one.radius else {}
        drawn.append({"kind": one.kind, "points": places, **label, **radius})
        points.extend(view @ point for point in one.points)
    points.append(view @ (first_moment(mechanism, q) / mechanism.total_mass).T)
    return np.array(points).transpose(2, 0, 1), drawn


def designs_of(mechanism: Mechanism, masses: dict[str, float]) -> Designs:
    """A mechanism without counter-masses, and with those given [kg] by site where there are some."""
    found: dict[str, tuple[Mechanism, Mapping[str, float]]] = {"without counter-masses": (mechanism, {})}
    return found | ({"with counter-masses": (mechanism.with_counter_mass(masses), masses)} if masses else {})


def animation_page(name: str, motion: str, drawn: Mapping[str, Any]) -> Page:
    """A page of a moving mechanism alone, ``drawn`` by :func:`moving`."""
    document, about = {"mechanism": name, "motion": motion}, {"sections": (), "motion": motion}
    return Page(Path(__file__).with_name("animation.html"), document, {"motions": [drawn]}, about)
