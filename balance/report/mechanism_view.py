"""A mechanism in the browser: dragged by hand or in a motion, with masses at its sites, and what it does to its base.

Shaking force, moment and torque are linear in the masses at the sites: what a kilogram at each does is computed once a
motion, and each wish of the page is a product of that.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from ..arrays import Floats
from ..balancing.objective import workspace_states
from ..balancing.sizing import chosen_sites
from ..balancing.sizing_study import study_sizing
from ..closure import Closure, Trajectory
from ..dynamics.inverse_dynamics import NOTHING, Response, simulate
from ..dynamics.regressor import first_moment
from ..errors import ClosureError, CounterpoiseError, DataError
from ..figures.balancing import titled
from ..figures.mechanism import STEEL_KG_PER_M2
from ..mechanism.mechanism import Mechanism
from ..motion import DEFAULT_RATE_HZ, Motion, Samples
from ..motion.motion_files import load_motion
from ..units import parse
from .design_page import plotted_response
from .loopback import Loopback
from .moving import OBLIQUE, drawn_points, moving
from .page import Page, document_of

SIDES = ("without counter-masses", "as sized by balance size", "as mounted here")
LONGEST_S = 10.0
"""Of a move of one joint."""
SPANS = 800
"""Of a time series."""
_RANGE, _STROKE, _PEAK, _RAMP = np.pi, 0.35, 5.0, 0.25
"""Reach of a coordinate by hand, stroke and peak acceleration of a move [rad, lengths of the mechanism]; its ramp."""
_DIMENSIONS = {"rad": ("angle", "angular acceleration"), "m": ("length", "acceleration")}
"""Of a coordinate and of its acceleration, by its unit."""
_SMALL, _STIFF = 1e-6, 1e-3
"""Step of a difference, and how much coordinates that need not move resist being dragged [rad, lengths]."""
SECTIONS = (
    ("masses", "Counter-masses"), ("motion", "The mechanism"), ("series", "Time series"), ("hand", "By hand"),
)  # fmt: skip


@dataclass(frozen=True)
class _Driven:
    """A motion, what the mechanism does in it, and what a kilogram at each site adds."""

    name: str
    trajectory: Trajectory
    without: Response
    units: tuple[Response, ...]
    """With 1 kg at each site alone."""
    sized: tuple[float, ...]
    """Counter-masses of balance size [kg]."""
    about: str
    """What balance size says of them."""

    def response(self, masses: Sequence[float]) -> Response:
        """With masses at all sites [kg]."""

        def mixed(part: Callable[[Response], Floats]) -> Floats:
            bare = part(self.without)
            return sum((m * (part(one) - bare) for m, one in zip(masses, self.units, strict=True) if m), bare)

        torque = {joint: mixed(lambda one, joint=joint: one.torque[joint]) for joint in self.without.torque}  # type: ignore[misc]
        return replace(
            self.without, force=mixed(lambda one: one.force), moment=mixed(lambda one: one.moment), torque=torque
        )

    @cached_property
    def shown(self) -> list[str]:
        """Components that are not zero throughout, whatever is mounted."""
        peaks = [one.peak() for one in (self.without, *self.units)]
        return [name for name in peaks[0] if max(peak[name] for peak in peaks) > NOTHING]


@dataclass(eq=False)
class MechanismView:
    """What the page of a mechanism is made of and asks for; words of requests are texts with units."""

    mechanism: Mechanism
    motions: Sequence[str] = ()
    """Shipped motions or files; moves of single joints are offered besides."""
    sites: Sequence[str] = ()
    unmounted: str = field(default="", init=False)
    """Why nothing can be mounted, where nothing can."""
    reach: Floats = field(init=False)
    """Least and largest value of each coordinate by hand: limits of the file, or half a turn, (dof, 2) [rad, m]."""

    def __post_init__(self) -> None:
        self._lock, self.closure = Lock(), Closure(self.mechanism).without_idle()
        try:
            self.sites = chosen_sites(self.mechanism, self.sites)
        except CounterpoiseError as error:
            if self.sites:
                raise
            self.unmounted = str(error)
        self._free = self.closure.independent_coordinates()
        self.joints = [self.mechanism.coordinates[i] for i in self._free]
        self.units = ["rad" if self.mechanism.tree.joints[i].revolute else "m" for i in self._free]
        self.scales = np.array([1.0 if unit == "rad" else self.closure.length for unit in self.units])
        self.stroke = _STROKE
        self.start = self.closure.home[self._free]
        limits = self.mechanism.limits[self._free]
        about = self.start[:, None] + np.outer(self.scales, [-_RANGE, _RANGE])
        self.reach = np.where(np.isfinite(limits), limits, about)
        if not self.joints:
            raise DataError(f"{self.mechanism.name}: no joint can move: there is nothing to view")
        for part in () if self.motions else (1.0, -1.0, 0.3, -0.3, 0.1, -0.1):  # as far as there is room
            self.stroke = part * _STROKE
            with suppress(ClosureError):
                self.closure.follow(self._move(0, "", "").sample(1e3))
                break

    def server(self, port: int = 0) -> Loopback:
        """A server of all this, for this machine alone. Raises ClosureError where its first motion cannot be made."""
        self.response({})
        return Loopback({"": lambda _: self.page().html(), "response": self.response, "pose": self.pose}, port=port)

    def page(self) -> Page:
        """The page, with the first motion."""
        moves = [
            {"name": f"{joint} alone", "stroke": f"{self.stroke * x:.3g} {unit}", "peak": f"{_PEAK * x:.3g} {unit}/s2"}
            for joint, x, unit in zip(self.joints, self.scales, self.units, strict=True)
        ]  # fmt: skip
        first, pose = self.response({}), self.pose({})
        heaviest = 2.0 * max([*first["masses_kg"]["sized"], 0.5 * self.mechanism.total_mass])
        masses = [{"name": site, "unit": "kg", "low": 0.0, "high": heaviest} for site in self.sites]
        coordinates = [
            {"name": joint, "unit": unit, "low": float(low), "high": float(high)}
            for joint, unit, (low, high) in zip(self.joints, self.units, self.reach, strict=True)
        ]
        data = {
            "runs": first["runs"], "motions": [first["moving"]], "response": first, "pose": pose, "masses": masses,
            "coordinates": coordinates, "choices": [*({"name": name} for name in self.motions), *moves],
            "together": True, "disc_kg_per_m2": np.pi * STEEL_KG_PER_M2,
        }  # fmt: skip
        here, document = Path(__file__), document_of({"mechanism": self.mechanism.name, "unmounted": self.unmounted})
        page, script = here.with_name("mechanism_view.html"), here.with_name("mechanism_view.js")
        return Page(page, document, data, {"sections": SECTIONS}, script)

    @lru_cache(4)  # noqa: B019 - as long as the program runs
    def _driven(self, choice: int, stroke: str, peak: str) -> _Driven:
        """A motion by its place in the list of the page. Raises LookupError for none, and what following it raises."""
        if choice < len(self.motions):
            name, motion = self.motions[choice], load_motion(self.motions[choice])
        else:
            place = choice - len(self.motions)
            name, motion = f"{self.joints[place]} alone", self._move(place, stroke, peak)
        trajectory = self.closure.follow(motion.sample(DEFAULT_RATE_HZ))
        without = simulate(self.mechanism, trajectory)
        units = tuple(simulate(self.mechanism.with_counter_mass({site: 1.0}), trajectory) for site in self.sites)
        masses, about = (0.0,) * len(self.sites), self.unmounted
        if self.sites:
            try:
                found = study_sizing(self.mechanism, trajectory, motion=name, sites=self.sites)
                masses, about = tuple(one.mass for one in found.counter_masses), str(found).splitlines()[0]
            except CounterpoiseError as error:
                about = f"Nothing is sized: {error}"
        return _Driven(name, trajectory, without, units, masses, about)

    def _move(self, place: int, stroke: str, peak: str) -> Motion:
        """There and back of one coordinate, the others at rest."""
        scale, (kind, rate) = self.scales[place], _DIMENSIONS[self.units[place]]
        length = parse(stroke, kind) if stroke else self.stroke * scale
        largest = parse(peak, rate) if peak else _PEAK * scale
        if length == 0.0 or not largest > 0.0:
            raise DataError(f"stroke {stroke}, peak {peak}: expected a stroke other than zero, a peak above zero")
        away = self.start.copy()
        away[place] += length
        there_and_back, sliding = np.array([self.start, away, self.start]), tuple(unit == "m" for unit in self.units)
        motion = Motion(there_and_back, np.full(2, largest), _RAMP, 0.0, tuple(self.joints), sliding=sliding)
        if motion.duration > LONGEST_S:
            raise DataError(f"the move takes {motion.duration:.3g} s: expected at most {LONGEST_S:g} s")
        return motion

    def _masses(self, words: Mapping[str, str], sized: Sequence[float]) -> dict[str, float]:
        """Of each site [kg]: as the page states it, or as sized. Raises UnitError, ModelError for what is no mass."""
        stated = [words.get(f"mass{i}", "") for i in range(len(self.sites))]
        each = [parse(text, "mass") if text else mass for text, mass in zip(stated, sized, strict=True)]
        masses = dict(zip(self.sites, each, strict=True))
        self.mechanism.with_counter_mass(masses)
        return masses

    @staticmethod
    def _seen_from(words: Mapping[str, str]) -> tuple[float, float]:
        azimuth, elevation = (words.get(name, "") for name in ("azimuth", "elevation"))
        return (parse(azimuth, "angle"), parse(elevation, "angle")) if azimuth and elevation else OBLIQUE

    def response(self, words: Mapping[str, str]) -> dict[str, Any]:
        """What the mechanism does in a motion with masses at its sites, for the page: numbers, series, pictures."""
        with self._lock:
            driven = self._driven(int(words.get("motion", "0")), words.get("stroke", ""), words.get("peak", ""))
        masses = self._masses(words, driven.sized)
        sized, here = (driven.response(some) for some in (driven.sized, list(masses.values())))
        each = dict(zip(SIDES, (driven.without, sized, here), strict=True))
        mounted = {site: mass for site, mass in masses.items() if mass > 0.0}
        designs = {SIDES[0]: (self.mechanism, {}), SIDES[2]: (self.mechanism.with_counter_mass(masses), mounted)}
        forces = {label: each[label].force for label in designs}
        name = f"motion {driven.name}"
        drawn = moving(name, driven.trajectory, designs, forces, self._seen_from(words))
        return document_of({
            "about": driven.about, "motion": driven.name,
            "masses_kg": {"sized": driven.sized, "mounted": list(masses.values())},
            "rms_force_N": {label: float(np.sqrt((one.force**2).sum(axis=1).mean())) for label, one in each.items()},
            "responses": [
                {"component": " ".join(titled(component)[:1]), "unit": titled(component)[1],
                 "rms": [one.rms()[component] for one in each.values()],
                 "peak": [one.peak()[component] for one in each.values()]} for component in driven.shown
            ],
            "runs": [plotted_response(label, label, label != SIDES[0], one, driven.shown, SPANS).as_dict()
                     for label, one in each.items()], "moving": drawn,
        })  # fmt: skip

    def _at_rest(self, at: Floats) -> Trajectory:
        """With its driven coordinates (dof,) [rad, m], as one sample. Raises ClosureError where it does not close."""
        still = np.zeros((1, len(at)))
        return self.closure.follow(Samples(np.zeros(1), at[None], still, still, tuple(self.joints)))

    def _dragged(self, first: Trajectory, words: Mapping[str, str], points: Callable[[Floats], Floats]) -> Trajectory:
        """At rest where a place of the drawing is nearest to where it is wanted; of equals the one that moves least.

        ``grip0``, ``grip1`` and ``share`` name the place, between two of ``points``; ``right`` and ``up`` how far it
        is to go.
        """
        ends, share = [int(words[name]) for name in ("grip0", "grip1")], float(words["share"])
        start, stiffness = first.q[0, self._free], _STIFF * self.closure.length / self.scales

        def place(q: Floats) -> Floats:
            return points(np.concatenate([first.q, q]))[1:, ends].transpose(0, 2, 1) @ [1.0 - share, share]

        wanted = place(first.q)[0] + [parse(words[name], "length") for name in ("right", "up")]

        def gap(at: Floats) -> Floats:
            try:
                here = place(self._at_rest(at).q)[0]
            except ClosureError:
                here = np.full(2, np.inf)  # a shorter step is taken
            return np.concatenate([here - wanted, stiffness * (at - start)])

        def rates(at: Floats) -> Floats:
            here = self._at_rest(at)
            moved = place(np.concatenate([here.q, here.q + _SMALL * here.per_drive[0].T]))
            return np.vstack([(moved[1:] - moved[0]).T / _SMALL, np.diag(stiffness)])

        low, high = self.reach.T
        found = least_squares(
            gap, np.clip(start, low, high), rates, (low, high), x_scale=self.scales, xtol=_SMALL, max_nfev=30
        )
        return self._at_rest(found.x)

    def pose(self, words: Mapping[str, str]) -> dict[str, Any]:
        """The mechanism at rest with its coordinates as the page states them, or dragged from there.

        Its centre of mass, and what its drives hold it with, weight and payload included.
        """
        stated = [words.get(f"at{i}", "") for i in range(len(self.joints))]
        at = [
            parse(text, _DIMENSIONS[unit][0]) if text else float(home)
            for text, unit, home in zip(stated, self.units, self.start, strict=True)
        ]
        masses = self._masses(words, (0.0,) * len(self.sites))
        mounted, seen_from = self.mechanism.with_counter_mass(masses), self._seen_from(words)
        with self._lock:
            found, around = self._at_rest(np.array(at)), workspace_states(self.mechanism, self.closure)
            if "share" in words:
                found = self._dragged(found, words, drawn_points(mounted, masses, seen_from, around))
        centre = first_moment(mounted, found.q)[0] / mounted.total_mass
        drawn = moving(
            "by hand", found, {"by hand": (mounted, masses)}, {"by hand": np.zeros((1, 3))}, seen_from, around
        )
        drives = {name: values[0] for name, values in simulate(mounted, found).columns().items() if name[0] not in "FM"}
        return document_of({
            "moving": drawn, "at": found.q[0, self._free], "centre_m": centre,
            "at_rest": [[*titled(name), value] for name, value in drives.items()],
            "beyond": self.mechanism.limits_exceeded(found.q),
        })  # fmt: skip
