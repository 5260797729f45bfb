"""Many designs on one motion: force, moment and torque of each, exactly, from a few responses.

Along a given motion force, moment and torque are affine in the inertial parameters: one response for each parameter
that designs change gives those of all designs as products of matrices. A varied joint or end of a loop changes the
motion: designs of one geometry share their responses.
"""

import hashlib
import json
import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats
from ..closure import Closure, Trajectory
from ..dynamics.inverse_dynamics import simulate
from ..errors import DataError, ModelError
from ..mechanism.loop_constraints import Loop
from ..mechanism.mechanism import Mechanism, mass_at
from ..mechanism.mjcf_compiler import tags
from ..mechanism.mjcf_parser import mechanism_from_text
from ..motion import Samples
from ..results import Shown, with_units
from ..table_files import read_parquet, write_parquet
from ..task_pool import TaskPool

if TYPE_CHECKING:
    import pandas

AXES = "xyz"
QUANTITIES = ("force", "moment", "torque")
PART = 20_000
"""Designs of one task, and rows of one file of results, at most."""
_PEAKS_AT_ONCE = 30_000_000
"""Designs times samples of one task, at most, where peaks are sought: what is lost if it is stopped."""
MANIFEST = "_sweep.json"
"""What a folder of results is of; readers of Parquet pass over names that begin so."""
GEOMETRIES = 32
"""Geometries of one task, where each has few designs."""
_VALUES_AT_ONCE = 2**15
"""Samples times designs that are looked at together: so few that they stay in the processor's cache."""


@dataclass(frozen=True)
class Variable:
    """A quantity of the mechanism that designs differ in."""

    name: str
    """A site or a body."""
    part: str
    """``mass``: counter-mass at the site, or mass of the body [kg]; ``x``, ``y``, ``z``: its place in its body [m]."""
    values: Floats
    """(n,) [kg or m]"""

    @property
    def column(self) -> str:
        """Heading of its column, unit included."""
        return f"{self.name}_{self.part}_{'kg' if self.part == 'mass' else 'm'}"


@dataclass(frozen=True)
class Problem:
    """A mechanism with counter-masses on a motion."""

    mechanism: Mechanism
    """Without its counter-masses."""
    samples: Samples
    counter_masses: Mapping[str, float] = field(default_factory=dict)
    """By site [kg]; where the mass of a site is varied, that takes its place."""
    peaks: bool = True
    """Whether peak values are found too: they take every sample of every design."""
    quantities: frozenset[str] = frozenset(QUANTITIES)
    """Which of QUANTITIES are found."""

    def check(self, variables: Sequence[Variable]) -> None:
        """Raise ModelError for a variable that the mechanism does not have, is given twice, or is impossible."""
        if not variables:
            raise ModelError("nothing is varied: expected one variable at least")
        places = [(v.name, v.part) for v in variables]
        for variable in variables:
            sites = {name for name, site in self.mechanism.sites.items() if site.body >= 0}
            if variable.part != "mass" and not (next(tags(self.mechanism.text))["tag"] == "mujoco"):
                raise ModelError(
                    f"{variable.name}.{variable.part}: {self.mechanism.name} is a URDF or SDF file; places are varied "
                    "in MJCF files only, masses in all: write the mechanism as MJCF"
                )
            known = sites.union(self.mechanism.own_mass) if variable.part == "mass" else self._placed
            if variable.name not in known:
                what = "site or moving body" if variable.part == "mass" else "site or body with a place"
                raise ModelError(
                    f"{self.mechanism.name} has no {what} {variable.name!r}{self._meant(variable)}: there are "
                    f"{', '.join(sorted(known))}"
                )
            if variable.name in sites.intersection(b for b in self.mechanism.own_mass if self.mechanism.mass(b) > 0.0):
                raise ModelError(
                    f"{variable.name}.{variable.part}: {self.mechanism.name} has a site and a body of that name: give "
                    "one of them another name"
                )
            if places.count((variable.name, variable.part)) > 1:
                raise ModelError(f"{variable.name}.{variable.part} is varied twice: give its values once")
            least = 0.0 if variable.part == "mass" else -np.inf
            if not (len(variable.values) and np.isfinite(variable.values).all() and variable.values.min() >= least):
                raise ModelError(f"{variable.name}.{variable.part}: expected finite values, masses of zero or more")

    def results(self, variables: Sequence[Variable], designs: Floats) -> dict[str, Floats]:
        """RMS and peak values of each design of (n, variables) [kg or m], by column, (n,) [N, N m, kg]."""
        moved = [i for i, v in enumerate(variables) if self.moves(v)]
        if not moved:
            return self._on_one_motion(variables, designs)
        found: dict[str, Floats] = {}
        geometries, group = np.unique(designs[:, moved], axis=0, return_inverse=True)
        others = [i for i in range(len(variables)) if i not in moved]
        for k, geometry in enumerate(geometries):
            places = {(variables[i].name, variables[i].part): float(x) for i, x in zip(moved, geometry, strict=True)}
            rows = np.flatnonzero(group.ravel() == k)
            changed = self.with_points(places)
            part = changed._on_one_motion([variables[i] for i in others], designs[rows][:, others])
            for name, values in part.items():
                found.setdefault(name, np.empty(len(designs)))[rows] = values
        return found

    def with_points(self, places: Mapping[tuple[str, str], float]) -> "Problem":
        """With points of the file at other places, such as ``{("A", "x"): 0.12}`` [m]: the file as if so written."""
        root = ElementTree.fromstring(self.mechanism.text)
        for (name, axis), place in places.items():
            for element in _points(root):
                if element.get("name") == name:
                    at = (element.get("pos") or "0 0 0").split()
                    at[AXES.index(axis)] = repr(float(place))
                    element.set("pos", " ".join(at))
        given = self.mechanism
        anew = mechanism_from_text(ElementTree.tostring(root, encoding="unicode"), given.name)
        masses = {body: given.mass(body) for body in given.own_mass if given.mass(body) != anew.mass(body)}
        mounted = {name: mass for name, mass in given.payload.items() if name not in masses}
        return replace(self, mechanism=anew.with_payload(mounted | masses))

    def place(self, name: str, axis: str) -> float:
        """Where the file has a site or a body, along one axis of the body that carries it [m]."""
        for element in _points(ElementTree.fromstring(self.mechanism.text)):
            if element.get("name") == name:
                return float((element.get("pos") or "0 0 0").split()[AXES.index(axis)])
        raise ModelError(f"{self.mechanism.name} states no place of {name!r}")

    def _meant(self, variable: Variable) -> str:
        """What is said of the name of a joint in place of that of the body that it moves."""
        if variable.name not in self.mechanism.coordinates:
            return ""
        index, tree = self.mechanism.coordinate_index(variable.name), self.mechanism.tree
        body = next(name for name, at in zip(self.mechanism.bodies, tree.bodies, strict=True) if index in tree.path(at))
        return f", which is a joint of body {body}; {body}.{variable.part} is that of the body, with its joint"

    @cached_property
    def trajectory(self) -> Trajectory:
        """The closed motion."""
        return Closure(self.mechanism).follow(self.samples)

    @cached_property
    def _responses(self) -> "dict[bytes, Responses]":
        """By their directions: parts of a sweep that change the same parameters share them."""
        return {}

    @cached_property
    def _placed(self) -> set[str]:
        """Bodies and sites whose place the mechanism's MJCF file states: of sites, not a default or ``fromto``."""
        points = _points(ElementTree.fromstring(self.mechanism.text))
        return {e.get("name", "") for e in points if e.tag == "body" or e.get("pos")} - {""}

    def moves(self, variable: Variable) -> bool:
        """Whether a variable changes the motion: any place but that of a site where no loop closes, and not driven."""
        if variable.part == "mass":
            return False
        site = self.mechanism.sites.get(variable.name)
        if site is None or site.body < 0 or self.samples.point == variable.name:
            return True
        joint = self.mechanism.tree.bodies[site.body]
        closed = [loop for loop in self.mechanism.loops if isinstance(loop, Loop)]
        ends = [end for loop in closed for end in (loop.first, loop.second) if end.joint == joint]
        return any(np.allclose(end.position, site.position, rtol=0.0, atol=1e-12) for end in ends)

    def _directions(self, variables: Sequence[Variable], designs: Floats) -> tuple[Floats, Floats]:
        """What designs change: coefficients (n, k) of directions (k, 10 nb) in the inertial parameters."""
        mechanism, count = self.mechanism, len(designs)
        column = {(v.name, v.part): designs[:, i] for i, v in enumerate(variables)}
        coefficients, directions = list[Floats](), list[Floats]()
        for name in dict.fromkeys(v.name for v in variables):
            varied = column.get((name, "mass"))
            if name not in mechanism.sites:
                row, own = mechanism.own_mass[name]
                coefficients.append(column[name, "mass"] / own[0] - 1.0)
                directions.append(_one_body(mechanism, row, own))
                continue
            site, fixed = mechanism.site(name), self.counter_masses.get(name, 0.0)
            mass = np.full(count, fixed) if varied is None else varied
            unit = np.tile(site.unit_mass(), (count, 1))
            if any((name, axis) in column for axis in AXES):
                place = np.tile(site.position[:, None], count)
                for axis in (axis for axis in AXES if (name, axis) in column):
                    stated = self.place(name, axis)
                    moved = self.with_points({(name, axis): stated + 1.0}).mechanism.site(name).position
                    place += np.outer(moved - site.position, column[name, axis] - stated)
                unit = mass_at(place, site.radius_of_gyration, site.axis)
                coefficients += list((mass[:, None] * unit - fixed * site.unit_mass()).T)
                directions += [_one_body(mechanism, site.body, row) for row in np.eye(unit.shape[1])]
            else:
                coefficients.append(mass - fixed)
                directions.append(_one_body(mechanism, site.body, site.unit_mass()))
        used = [k for k, values in enumerate(coefficients) if values.any()]
        shape = len(used), mechanism.pi.size
        return np.array([coefficients[k] for k in used]).reshape(-1, count).T, np.reshape(
            [directions[k] for k in used], shape
        )

    def _on_one_motion(self, variables: Sequence[Variable], designs: Floats) -> dict[str, Floats]:
        coefficients, directions = self._directions(variables, designs)
        mounted = self.mechanism.with_counter_mass(self.counter_masses)
        if (responses := self._responses.get(key := directions.tobytes())) is None:
            responses = self._responses[key] = Responses.along(mounted, self.trajectory, directions)
        varied = {v.name: designs[:, i] for i, v in enumerate(variables) if v.part == "mass"}
        fixed = sum(mass for name, mass in self.counter_masses.items() if name not in varied)
        added = sum((mass for name, mass in varied.items() if name in mounted.sites), np.full(len(designs), fixed))
        return responses.levels(coefficients, self.peaks, self.quantities) | {"added_mass_kg": added}


@dataclass(frozen=True)
class Responses:
    """Force, moment and torques along a motion, and their change along directions of the inertial parameters."""

    names: tuple[str, ...]
    """Of the components: three of force, three of moment, the drives."""
    values: Floats
    """As the mechanism is, then per unit of each direction, (components, n, 1 + k) [N, N m; ...]."""

    @classmethod
    def along(cls, mechanism: Mechanism, trajectory: Trajectory, directions: Floats) -> "Responses":
        """One simulation for each of the ``directions`` (k, 10 nb) [kg, kg m, kg m2]."""
        base = simulate(mechanism, trajectory)
        columns = [np.stack(list(base.columns().values()))]
        size = max(float(np.abs(mechanism.pi).max()), 1e-3)
        for direction in directions:
            step = size / float(np.abs(direction).max())
            changed = replace(mechanism, parameters=mechanism.parameters + step * direction.reshape(-1, 10))
            values = np.stack(list(simulate(changed, trajectory).columns().values()))
            columns.append((values - columns[0]) / step)
        return cls(tuple(base.columns()), np.stack(columns, axis=2))

    def levels(self, coefficients: Floats, peaks: bool, quantities: Collection[str]) -> dict[str, Floats]:
        """RMS and, with ``peaks``, peak of each component and of the vectors F and M, of designs (n, k)."""
        designs = np.column_stack([np.ones(len(coefficients)), coefficients])
        groups = {
            name: members for name, members in self._groups.items() if QUANTITIES[min(members[0] // 3, 2)] in quantities
        }
        found = {f"rms_{name}": np.linalg.norm(designs @ self._factors[name].T, axis=1) for name in groups}
        if peaks:
            vectors = [members for members in groups.values() if len(members) > 1 or members[0] >= 6]
            largest = {key: peak for members in vectors for key, peak in self._peaks(designs, members).items()}
            found |= {f"peak_{name}": largest[tuple(members)] for name, members in groups.items()}
        return found

    @cached_property
    def _groups(self) -> dict[str, list[int]]:
        """Components of the vectors F and M, and each component alone."""
        return {"F_N": [0, 1, 2], "M_Nm": [3, 4, 5]} | {name: [i] for i, name in enumerate(self.names)}

    @cached_property
    def _factors(self) -> dict[str, Floats]:
        """Of each group a triangle whose product with a design has the RMS value as its norm, (1 + k, 1 + k)."""
        samples, size = self.values.shape[1:]
        flat = {name: self.values[members].reshape(-1, size) for name, members in self._groups.items()}
        return {name: np.linalg.qr(values).R / np.sqrt(samples) for name, values in flat.items()}

    def _peaks(self, designs: Floats, members: list[int]) -> dict[tuple[int, ...], Floats]:
        """Largest absolute value over the samples of each of some components, and largest norm of all, (n,) each."""
        squares = np.zeros((len(members) + 1, len(designs)))
        block = max(1, _VALUES_AT_ONCE // self.values.shape[1])
        rows = [(k, self.values[i].T) for k, i in enumerate(members) if self.values[i].any()]
        for start in range(0, len(designs), block):
            part, total = slice(start, start + block), None
            for k, row in rows:
                values = designs[part] @ row
                np.square(values, out=values)
                squares[k, part] = values.max(axis=1)
                total = values if total is None else np.add(total, values, out=total)
            if total is not None:
                squares[-1, part] = total.max(axis=1)
        return dict(zip([*((i,) for i in members), tuple(members)], np.sqrt(squares), strict=True))


def _one_body(mechanism: Mechanism, row: int, parameters: Floats) -> Floats:
    """A change of the parameters (10,) of one body, as one of all, (10 nb,) [kg, kg m, kg m2]."""
    change = np.zeros_like(mechanism.parameters)
    change[row] = parameters
    return change.ravel()


def _points(root: ElementTree.Element) -> Iterator[ElementTree.Element]:
    return (element for tag in ("body", "site") for element in root.iter(tag))


def _all(columns: dict[str, Floats]) -> dict[str, Floats]:
    return columns


@dataclass(frozen=True)
class Sweep:
    """All designs of a grid, their results in memory or in a folder, a file a part."""

    problem: Problem
    variables: tuple[Variable, ...]
    folder: Path | None = None
    """Where results are kept; a sweep that was interrupted goes on there."""
    chosen: Callable[[dict[str, Floats]], dict[str, Floats]] = _all
    """What of a part's columns is handed on, such as its best designs; called where the part is computed."""

    @cached_property
    def ordered(self) -> tuple[Variable, ...]:
        """The variables, the last one varying first: designs of one geometry follow each other."""
        return tuple(sorted(self.variables, key=lambda v: not self.problem.moves(v)))

    @property
    def size(self) -> int:
        """Number of designs: of all combinations."""
        return math.prod(len(variable.values) for variable in self.variables)

    @cached_property
    def designs_per_part(self) -> int:
        """Of one task, and rows of one file: whole geometries where places are varied that change the motion."""
        masses = [len(v.values) for v in self.variables if not self.problem.moves(v)]
        of_one_geometry = int(np.prod(masses))
        if len(masses) == len(self.variables) or of_one_geometry > PART:
            most = _PEAKS_AT_ONCE // len(self.problem.samples.time) if self.problem.peaks else PART
            return min(PART, max(1, most))
        return of_one_geometry * max(1, GEOMETRIES // of_one_geometry)

    def run(self, pool: TaskPool) -> Iterator[tuple[int, dict[str, Floats]]]:
        """Compute each part that is not yet in the folder; its number of designs and what is chosen, as they are ready.

        A worker that sees the folder writes its parts there; else they are written here. Raises DataError where the
        folder holds another sweep.
        """
        self.problem.check(self.variables)
        size, step = self.size, self.designs_per_part
        parts = [slice(start, min(start + step, size)) for start in range(0, size, step)]
        left = parts if self.folder is None else self._left(parts)
        for part in (part for part in parts if part not in left):
            yield part.stop - part.start, self.chosen(read_parquet(self._path(part)))
        for place, (is_whole, columns) in pool.results(partial(self._part, self._stamp), left):
            if is_whole:
                self._write(left[place], columns)
            yield left[place].stop - left[place].start, self.chosen(columns) if is_whole else columns

    def _part(self, stamp: int | None, part: slice) -> tuple[bool, dict[str, Floats]]:
        """Whether all columns are handed on, to be written; else what is chosen of them."""
        places = np.unravel_index(np.arange(part.start, part.stop), [len(v.values) for v in self.ordered])
        varied = {v.column: v.values[at] for v, at in zip(self.ordered, places, strict=True)}
        columns = varied | self.problem.results(self.ordered, np.column_stack(list(varied.values())))
        if self._stamp != stamp:
            return True, columns
        if self.folder is not None:
            self._write(part, columns)
        return False, self.chosen(columns)

    @property
    def _stamp(self) -> int | None:
        """When this run wrote the folder's manifest [ns]: where another is seen, it is another folder."""
        manifest = None if self.folder is None else self.folder / MANIFEST
        return manifest.stat().st_mtime_ns if manifest and manifest.is_file() else None

    def _write(self, part: slice, columns: Mapping[str, Floats]) -> None:
        path = self._path(part)
        unfinished = path.with_suffix(".unfinished")
        write_parquet(unfinished, columns)
        unfinished.replace(path)

    def _path(self, part: slice) -> Path:
        assert self.folder is not None
        return self.folder / f"part-{part.start // self.designs_per_part:05d}.parquet"

    def _left(self, parts: Sequence[slice]) -> list[slice]:
        """Parts that are not in the folder, which is made or must be that of the same sweep."""
        assert self.folder is not None
        self.folder.mkdir(parents=True, exist_ok=True)
        manifest, own = self.folder / MANIFEST, self._manifest()
        before = next((path for path in (manifest, self.folder / "sweep.json") if path.is_file()), None)
        if before and json.loads(before.read_text(encoding="utf-8")) != own:
            raise DataError(f"{self.folder}: holds another sweep ({before.name} differs): name another folder")
        manifest.write_text(json.dumps(own, indent=2) + "\n", encoding="utf-8")
        return [part for part in parts if not self._path(part).is_file()]

    def _manifest(self) -> dict[str, object]:
        problem = self.problem
        digest = hashlib.sha256(problem.mechanism.text.encode() + problem.mechanism.pi.tobytes())
        for values in (problem.samples.time, problem.samples.position, problem.samples.acceleration):
            digest.update(np.ascontiguousarray(values).tobytes())
        return {
            "mechanism": problem.mechanism.name,
            "mechanism_and_motion_sha256": digest.hexdigest(),
            "counter_masses_kg": dict(problem.counter_masses),
            "peaks": problem.peaks,
            "quantities": sorted(problem.quantities),
            "variables": {v.column: [float(x) for x in v.values] for v in self.ordered},
            "designs_per_part": self.designs_per_part,
        }


def joined(parts: Sequence[Mapping[str, Floats]]) -> dict[str, Floats]:
    """The columns (n,) of all parts of a sweep, each in the unit of its name [kg, m, N, N m]."""
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


@dataclass(frozen=True)
class Designs(Shown, figure="balance.figures.balancing:draw_sweep"):
    """All designs of a sweep, a row each.

    >>> import balance
    >>> designs = balance.sweep("four-bar", "four-bar", {"counter_A0A.mass": ["1 kg", "2 kg"]})
    >>> designs.varied
    ('counter_A0A_mass_kg',)
    """

    columns: Mapping[str, Floats]
    """(n,) by name, the unit at its end: variables, then RMS and peak values."""
    varied: tuple[str, ...]
    """Columns of the variables."""
    ranked_by: str = "rms_F_N"
    """Column whose least value is the best."""

    def table(self) -> "pandas.DataFrame":
        """The designs, the best first."""
        import pandas

        return with_units(pandas.DataFrame(dict(self.columns)).sort_values(self.ranked_by, ignore_index=True))
