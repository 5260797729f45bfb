"""What ``import balance`` offers: each function takes names, files or objects, and quantities as texts with units.

The commands call the same functions. A mechanism is a ``Mechanism``, a shipped name or a file; a motion likewise, a
``Motion`` that :func:`load_motion` gives.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from .closure import Closure, Trajectory
from .datasets import KINDS, FileDigest, dataset_names, files_read
from .dynamics import inverse_dynamics
from .dynamics.inverse_dynamics import Response
from .errors import DataError, ModelError
from .mechanism.mechanism import Mechanism
from .mechanism.mjcf_parser import load_mechanism
from .motion import Motion
from .task_pool import HERE, TaskPool
from .units import si

if TYPE_CHECKING:  # what each function needs is imported when it is called: a command starts as quickly as without
    from .balancing.conditions import Conditions
    from .balancing.methods import Methods, MethodSettings
    from .balancing.nested_sizing import NestedSizing
    from .balancing.sizing import Sizing
    from .balancing.sizing_study import SizingStudy
    from .balancing.sweep import Designs, Problem
    from .balancing.tolerance import Tolerance, ToleranceAnalysis
    from .balancing.tradeoff import Front
    from .closure.assembly import Configuration
    from .drives.harmonic_balance import SteadyRotation
    from .engines.free_forces import FreeForces
    from .linkages.equivalence_method import LinkageBalance
    from .rotors.results import Influence
    from .rotors.rotor import Correction

_KINDS = "mechanism motion stock rig plan drive engine linkage rotor springs"
FOLDERS = dict(KINDS[kind] for kind in _KINDS.split())

_Study = TypeVar("_Study", "SizingStudy", "NestedSizing")


def shipped(kind: str) -> list[str]:
    """Names of what is shipped, of a ``kind``: mechanisms, motions, stock, rigs, plans, drives, engines, linkages ...

    >>> import balance
    >>> "four-bar" in balance.shipped("mechanisms")
    True
    """
    if kind not in FOLDERS:
        raise DataError(f"{kind!r} is nothing that is shipped: expected one of {', '.join(FOLDERS)}")
    return dataset_names(kind, FOLDERS[kind])


def load(name: str | Path) -> Mechanism:
    """A mechanism: a shipped name or a file in MJCF, URDF or SDF, whose loops MuJoCo's ``connect`` and ``weld`` close.

    Raises DataError for a name that is neither, ModelError for a file that cannot be understood.

    >>> import balance
    >>> mechanism = balance.load("parallelogram-6bar").with_payload(platform="5 kg")
    >>> round(mechanism.total_mass, 4)
    8.271
    """
    return load_mechanism(name)


def load_motion(name: str | Path) -> Motion:
    """A motion: a shipped name or a TOML file, with way-points or samples.

    >>> import balance
    >>> round(balance.load_motion("x").duration, 3)
    0.891
    """
    from .motion import motion_files  # late, with what checks input files: much is asked without a motion

    return motion_files.load_motion(name)


def _mechanism(mechanism: Mechanism | str | Path) -> Mechanism:
    return mechanism if isinstance(mechanism, Mechanism) else load_mechanism(mechanism)


def _motion(motion: object) -> Motion:
    """The motion that is meant. Raises DataError for what is none."""
    if not isinstance(motion, Motion | str | Path):
        such = "a shipped name, a file, or what balance.load_motion gives"
        where = "; balance.simulate takes a Trajectory" if isinstance(motion, Trajectory) else ""
        raise DataError(f"motion: of type {type(motion).__name__}: expected {such}{where}")
    return motion if isinstance(motion, Motion) else load_motion(motion)


def _name(motion: Motion | str | Path) -> str:
    return motion.source if isinstance(motion, Motion) else str(motion)


def _distinct(*files: Sequence[FileDigest]) -> tuple[FileDigest, ...]:
    return tuple(dict.fromkeys(chain(*files)))


def _masses(masses: Mapping[str, float | str] | None) -> dict[str, float]:
    return {name: si(value, "mass") for name, value in (masses or {}).items()}


def follow(
    mechanism: Mechanism | str | Path, motion: Motion | str | Path, rate: float | str | None = None
) -> Trajectory:
    """Positions, velocities and accelerations of all joints along a motion, its loops closed at each sample.

    ``rate`` of sampling [Hz], 10 kHz unless given; DataError for another than that of a motion of samples. Raises
    ClosureError where the mechanism cannot go there, or is singular.

    >>> import balance
    >>> balance.follow("four-bar", "four-bar", rate="1 kHz").residual < 1e-9
    True
    """
    described = _motion(motion)
    samples = described.sample_as_asked(None if rate is None else si(rate, "frequency"))
    coarse = tuple(samples.coarse) if described.recorded else ()
    return replace(Closure(_mechanism(mechanism)).follow(samples), coarse=coarse, samples=samples)


def assemble(mechanism: Mechanism | str | Path) -> list[Configuration]:
    """The closed configurations of a mechanism: the ways in which its loops can be put together, home first.

    >>> import balance
    >>> [one.branch for one in balance.assemble("four-bar")]
    ['A', 'B']
    """
    return Closure(_mechanism(mechanism), search=True).without_idle().configurations()


def conditions(mechanism: Mechanism | str | Path, momentum: str = "linear") -> Conditions:
    """The balance conditions of a mechanism: linear equations in its inertial parameters, found from its model.

    ``momentum`` that is to stay zero: ``linear``, ``planar`` (with the angular one about z) or ``all``. They are the
    row space of the momentum regressor over closed states, in reduced row echelon form (what Berkof and
    Lowen 1969 find in symbols). A notebook shows them as mathematics.

    >>> import balance
    >>> print(balance.conditions("four-bar").text(0))
    mcx[A0A] + crank m[AB] + crank/rocker mcx[B0B] = 0
    """
    from .balancing.conditions import balance_conditions

    return balance_conditions(_mechanism(mechanism), momentum)


def size(
    mechanism: Mechanism | str | Path,
    motion: Motion | str | Path | None = None,
    stock: str | None = None,
    *,
    sites: Sequence[str] = (),
    limits: Mapping[str, float | str] | None = None,
    equal: Sequence[Sequence[str]] = (),
    objective: Mapping[str, float] | None = None,
    rig: str | None = None,
    best: int = 1,
    payload_bodies: Sequence[str] = (),
    added: float | str | None = None,
    given: Mapping[str, float | str] | None = None,
) -> SizingStudy:
    """Counter-masses that balance a mechanism, or leave the least shaking force: of any mass, or from stock plates.

    ``motion``: over which the force is made small; without one, over the workspace. ``stock``: plates, a shipped name
    or a CSV file. ``sites``: where masses may be mounted [default: those named counter...]. ``limits``: largest mass by
    site, ``{"counter_A0A": "5 kg"}``. ``equal``: groups of sites of equal masses. ``added``: what may be added in all,
    2.5 or ``"2.5 kg"``. ``best``: sets from stock to give. ``objective``: weights of force, moment, torque, and
    vibration with a ``rig``: least is the sum of weight times (RMS / RMS without counter-masses)^2, so that newtons and
    newton metres compare.
    ``payload_bodies``: of which the payload is stated that the counter-masses would balance. ``given``: masses by site
    that are not sized, but judged beside those that would be, as ``balance report --counter`` does.
    Least squares within bounds, from plates by mixed-integer search with a proven bound.

    >>> import balance
    >>> mechanism = balance.load("parallelogram-6bar").with_payload(platform="5 kg")
    >>> sizing = balance.size(mechanism, stock="kiper2019")
    >>> sizing.table()[["site", "mass_kg"]].round(4).values.tolist()
    [['counter_A0A', 24.2626], ['counter_B0B', 24.2626]]
    """
    from .balancing.sizing_study import study_sizing

    return _sized(mechanism, motion, lambda model, trajectory, name: study_sizing(
        model, trajectory, motion=name, sites=sites, stock=stock, limits=_masses(limits), equal=equal, best=best,
        weights=objective, rig=rig, payload_bodies=payload_bodies, given=_masses(given),
        added=None if added is None else si(added, "mass"),
    ))  # fmt: skip


def _sized(
    mechanism: Mechanism | str | Path,
    motion: Motion | str | Path | None,
    study: Callable[[Mechanism, Trajectory | None, str | None], _Study],
) -> _Study:
    """A study of a mechanism along a motion of this name, where there is one, with the files that were read."""
    model, moved = _mechanism(mechanism), None if motion is None else _motion(motion)
    trajectory, name = (None, None) if moved is None else (follow(model, moved), _name(motion or ""))
    with files_read() as files:
        found = study(model, trajectory, name)
    return replace(found, files=_distinct(model.files, moved.files if moved else (), files))


def size_nested(
    mechanism: Mechanism | str | Path,
    payloads: Sequence[Mapping[str, float | str]],
    motion: Motion | str | Path | None = None,
    stock: str | None = None,
    *,
    sites: Sequence[str] = (),
    limits: Mapping[str, float | str] | None = None,
    equal: Sequence[Sequence[str]] = (),
    objective: Mapping[str, float] | None = None,
    added: float | str | None = None,
    fixed: bool = False,
    given: Mapping[str, float | str] | None = None,
) -> NestedSizing:
    """Counter-masses for several payloads: sets that only grow from one to the next, or one ``fixed`` set for all.

    ``payloads``: for each the masses of bodies, ``[{"platform": "1.45 kg"}, {"platform": "5 kg"}]``. A fixed set is for
    a machine that carries them in turn; so are masses that are ``given``, which are judged, not sized. Least is the sum
    over the payloads of what ``size`` makes small; the other arguments are as there, ``limits``, ``equal`` and
    ``added`` of each set. Least squares within bounds and totals, from plates by mixed-integer search with a proven
    bound.

    >>> import balance
    >>> payloads = [{"platform": "1.451 kg"}, {"platform": "5 kg"}]
    >>> nested = balance.size_nested("parallelogram-6bar", payloads, limits={"counter_A0A": "20 kg"})
    >>> [round(one.mass, 3) for one in nested.counter_masses if one.site == "counter_A0A"]
    [10.099, 20.0]
    """
    from .balancing.nested_sizing import study_nested

    return _sized(mechanism, motion, lambda model, trajectory, name: study_nested(
        model, [_masses(one) for one in payloads], trajectory, motion=name, sites=sites, stock=stock,
        limits=_masses(limits), equal=equal, weights=objective, fixed=fixed, given=_masses(given),
        added=None if added is None else si(added, "mass"),
    ))  # fmt: skip


def write_report(
    sizing: SizingStudy | NestedSizing,
    path: str | Path,
    tolerances: Mapping[str, float | str] | Sequence[Tolerance] = (),
) -> Path:
    """Write the page of counter-masses that were sized on a motion, a name ending in .html, as ``balance report`` does.

    Verdict, sizing, conditions, the motion with and without them, the mechanism moving; it reads without network. Of
    several payloads (:func:`size_nested`) each has its part. ``tolerances`` as :func:`tolerance` takes them: what
    mechanisms made within them keep.

    >>> import balance
    >>> sizing = balance.size("four-bar", "four-bar", given={"counter_A0A": "1.07 kg"})
    >>> balance.write_report(sizing, "report.html", {"counter_A0A.mass": "5 g"}).name
    'report.html'
    """
    from .report.design_page import design_page
    from .report.page import writable

    path = writable(path, (".html",))
    if sizing.trajectory is None:
        raise DataError(f"{path}: the page shows a motion: size the counter-masses on one, balance.size(MECH, MOTION)")
    return design_page(sizing, _tolerances(tolerances)).write(path)


def animate(
    mechanism: Mechanism | str | Path,
    motion: Motion | str | Path,
    path: str | Path,
    counter_masses: Mapping[str, float | str] | None = None,
) -> Path:
    """Write a mechanism in motion, to scale: a page (.html), a video (.mp4) or a still (.png, .svg, .pdf).

    With ``counter_masses`` by site it is shown side by side without and with them, the shaking force as an arrow, as
    ``balance animate`` does.

    >>> import balance
    >>> balance.animate("four-bar", "four-bar", "four-bar.svg", {"counter_A0A": "1.07 kg"}).name
    'four-bar.svg'
    """
    from .report import video

    model = _mechanism(mechanism)
    path = video.writable_animation(path)
    video.write_animation(path, model, _name(motion), follow(model, motion), _masses(counter_masses))
    return path


def check(mechanism: Mechanism | str | Path, counter_masses: Mapping[str, float | str]) -> Sizing:
    """What given counter-masses, by site, leave unbalanced over the workspace.

    >>> import balance
    >>> found = balance.check("four-bar", {"counter_A0A": "1 kg", "counter_B0B": "1.37 kg"})
    >>> round(found.remaining_percent(), 1)
    4.5
    """
    from .balancing.sizing import sizing_of_given

    model = _mechanism(mechanism)
    found, masses = conditions(model), _masses(counter_masses)
    model.with_counter_mass(masses)  # refuses what no counter-mass is
    try:
        return sizing_of_given(found, model, masses, objective=found.objective)
    except ModelError:  # massless bodies move alone: the momentum has no measure, the conditions have
        return sizing_of_given(found, model, masses)


def simulate(
    mechanism: Mechanism | str | Path, motion: Motion | Trajectory | str | Path, rate: float | str | None = None
) -> Response:
    """Shaking force (n, 3) [N], shaking moment (n, 3) [N m] and drive torques (n,) [N m, N] along a motion.

    What the mechanism exerts on its base, weight excluded: F = -d(linear momentum)/dt, M = -d(angular momentum)/dt
    about the base frame's origin. ``rate`` of sampling [Hz], as :func:`follow` takes it; a ``Trajectory`` has its own
    instants: of :func:`follow`, or as encoders recorded it (``testbench.AlignedRun.trajectory``).

    >>> import balance
    >>> response = balance.simulate("four-bar", "four-bar", rate="1 kHz")
    >>> round(response.rms()["Fx_N"], 2)
    9.07
    """
    model = _mechanism(mechanism)
    trajectory = motion if isinstance(motion, Trajectory) else follow(model, motion, rate)
    if len(model.coordinates) != trajectory.q.shape[1]:
        raise ModelError(
            f"the trajectory is of {trajectory.mechanism}, with {trajectory.q.shape[1]} coordinates: {model.name} has "
            f"{len(model.coordinates)}"
        )
    return inverse_dynamics.simulate(model, trajectory)


def tradeoff(
    mechanism: Mechanism | str | Path,
    motion: Motion | str | Path,
    sites: Sequence[str] = (),
    limits: Mapping[str, float | str] | None = None,
    points: int = 300,
    added: float | str | None = None,
) -> Front:
    """What less shaking force costs in shaking moment, drive torque and added mass, over a motion.

    At most about ``points`` points, spread evenly; ``limits`` by site; ``added``: what may be added in all, 2.5 or
    ``"2.5 kg"``.

    >>> import balance
    >>> front = balance.tradeoff("four-bar", "four-bar", points=10)
    >>> front.points[0].force < 1e-9 < front.points[-1].force
    True
    """
    from .balancing.tradeoff import Front, tradeoff_front

    model = _mechanism(mechanism)
    most = None if added is None else si(added, "mass")
    front = tradeoff_front(model, follow(model, motion), sites, _masses(limits), points, most)
    return Front(model.name, _name(motion), front)


def _part(name: str) -> tuple[str, str, str]:
    """Name, part and dimension of ``counter_A0A.mass`` or ``A.x``."""
    owner, _, part = name.rpartition(".")
    if not owner or part not in {"mass", "x", "y", "z"}:
        raise DataError(f"{name!r}: expected the mass or a coordinate of a site or body: NAME.mass, NAME.x, .y or .z")
    return owner, part, "mass" if part == "mass" else "length"


def tolerance(
    mechanism: Mechanism | str | Path,
    motion: Motion | str | Path,
    tolerances: Mapping[str, float | str] | Sequence[Tolerance],
    counter_masses: Mapping[str, float | str] | None = None,
    draws: int = 20_000,
    seed: int = 1,
    pool: TaskPool = HERE,
) -> ToleranceAnalysis:
    """Shaking force that mechanisms made within tolerances keep; errors are drawn evenly within them (JCGM 101).

    ``tolerances``: largest errors of ``SITE.mass``, ``BODY.x`` and the like, with a unit or in ``%`` of the value.

    >>> import balance
    >>> found = balance.tolerance("four-bar", "four-bar", {"counter_A0A.mass": "20 g"}, {"counter_A0A": "1.07 kg"})
    >>> found.percentiles["95"] > found.nominal
    True
    """
    from .balancing.tolerance import analyze_tolerances

    problem = _problem(mechanism, motion, counter_masses)
    return analyze_tolerances(problem, _tolerances(tolerances), draws, seed, pool)


def _tolerances(given: Mapping[str, float | str] | Sequence[Tolerance]) -> Sequence[Tolerance]:
    from .balancing.tolerance import Tolerance

    if isinstance(given, Mapping):
        return [Tolerance.of(*_part(name)[:2], error) for name, error in given.items()]
    return given


def _problem(
    mechanism: Mechanism | str | Path, motion: Motion | str | Path, counter_masses: Mapping[str, float | str] | None
) -> Problem:
    from .balancing.sweep import Problem

    return Problem(_mechanism(mechanism), _motion(motion).sample_as_asked(None), _masses(counter_masses))


def sweep(
    mechanism: Mechanism | str | Path,
    motion: Motion | str | Path,
    vary: Mapping[str, Sequence[float | str]],
    counter_masses: Mapping[str, float | str] | None = None,
) -> Designs:
    """Shaking force, moment and torque of all combinations of masses and places, on one motion.

    ``vary``: values of ``SITE.mass``, ``BODY.mass``, ``SITE.x`` and the like.

    >>> import balance
    >>> found = balance.sweep("four-bar", "four-bar", {"counter_A0A.mass": ["0 kg", "1 kg", "2 kg"]})
    >>> found.table()["counter_A0A_mass_kg"].tolist()
    [1.0, 2.0, 0.0]
    """
    import numpy as np

    from .balancing.sweep import Designs, Sweep, Variable, joined

    variables = tuple(
        Variable(*_part(name)[:2], np.array([si(value, _part(name)[2]) for value in values]))
        for name, values in vary.items()
    )
    parts = [columns for _, columns in Sweep(_problem(mechanism, motion, counter_masses), variables).run(HERE)]
    return Designs(joined(parts), tuple(variable.column for variable in variables))


def methods(
    mechanism: Mechanism | str | Path, motion: Motion | str | Path, settings: MethodSettings | None = None
) -> Methods:
    """The named methods of balancing a mechanism side by side: residual, cost and needs of each.

    Springs, counter-masses, counter-inertias, mirror images, active masses; published conditions beside derived ones.

    >>> import balance
    >>> balance.methods("serial-1r", "serial-1r").table()["method"].tolist()[:2]
    ['as it is', 'springs']
    """
    from .balancing.closed_forms import compare_conditions
    from .balancing.methods import Methods, compare_methods

    model = _mechanism(mechanism)
    outcomes = compare_methods(model, follow(model, motion), settings)
    return Methods(model, _name(motion), tuple(outcomes), tuple(compare_conditions(conditions(model))))


def linkage(name: str | Path) -> LinkageBalance:
    """A planar linkage balanced completely: counter-masses for the force, gears for the moment.

    A shipped name or a TOML file; the method of equivalence, body by body from the leaves of its reduction tree.

    >>> import balance
    >>> balance.linkage("dwell").residual() < 1e-12
    True
    """
    from .linkages.equivalence_method import balance_linkage
    from .linkages.linkage_files import load_linkage

    return balance_linkage(load_linkage(name))


def rotor(name: str | Path) -> Correction:
    """The corrections in its planes that balance a rigid rotor with stated unbalances (ISO 21940).

    >>> import balance
    >>> balance.rotor("three-masses").residual() < 1e-12
    True
    """
    from .rotors.rotor import correct_planes
    from .rotors.rotor_files import load_rotor

    described = load_rotor(name)
    return correct_planes(described.unbalances, described.planes)


def influence(runs: str | Path | Mapping[str, Any], method: str = "least-squares") -> Influence:
    """Correction weights from trial runs, by influence coefficients: any planes, sensors and speeds.

    ``runs``: a shipped name, a TOML file or its keys as ``tomllib`` reads them; what ``to_toml`` of
    ``testbench.rotating.vectors`` writes are runs of it. ``method`` makes small the sum of squares of the readings
    (``least-squares``), their sum (``robust``) or the largest (``min-max``). A row of the table is a plane: its weights
    in all, still on and to be added [g or g mm, deg], with 95 % intervals where the readings have some. Raises
    DataError for a trial weight of too little effect.

    >>> import balance
    >>> found = balance.influence("two-plane-maker")
    >>> found.table()[["plane", "add.magnitude_g"]].shape, found.findings
    ((2, 2), [])
    """
    from .rotors.influence_coefficients import METHODS
    from .rotors.results import Influence
    from .rotors.trial_runs import load_trial_runs, trial_runs_from_table

    loaded = trial_runs_from_table(runs, "runs") if isinstance(runs, Mapping) else load_trial_runs(runs)
    if method not in METHODS:
        raise DataError(f"method: {method!r}: expected {', '.join(METHODS)}")
    return Influence(loaded, loaded.solve(method))


def engine(name: str | Path, orders: int = 8) -> list[FreeForces]:
    """Free forces and moments of an engine by order of its speed, per omega^2 [kg m, kg m2], about its middle.

    >>> import balance
    >>> [one.force.order for one in balance.engine("in-line-4", orders=4) if one.force.largest > 1e-9]
    [2, 4]
    """
    from .engines.engine_files import load_engine
    from .engines.free_forces import free_forces

    return free_forces(load_engine(name), orders)


def drive(name: str | Path, *, flywheel_for: float | None = None, side: str = "crank") -> list[SteadyRotation]:
    """Steady rotations of a motor-driven machine of one degree of freedom, by harmonic balance.

    At each speed of its file; one at which the machine stalls is left out with a warning.

    ``flywheel_for``: a coefficient of speed fluctuation, such as 0.05. Each machine then has the smallest flywheel on
    the shaft of this ``side``, crank or motor, with which its fastest rotation fluctuates by no more: the last of the
    rotation's ``machine.inertias``, zero where none is needed. That a start from standstill does not end there is a
    warning. Raises CounterpoiseError where it stalls at all of them.

    >>> import balance
    >>> rotation = balance.drive("four-bar-dc")[0]
    >>> 0.0 < rotation.fluctuation() < 1.0
    True
    """
    from .drives import DriveError
    from .drives.drive_files import load_drive
    from .drives.harmonic_balance import flywheel_for as sized_flywheel
    from .drives.harmonic_balance import steady_rotations
    from .drives.results import reach_findings
    from .drives.time_integration import rotations_from_rest

    described = load_drive(name)
    found: list[SteadyRotation] = []
    refused: list[str] = []
    for machine in described.machines(described.load_mechanism()):
        try:
            if flywheel_for is None:
                found += steady_rotations(machine)
                continue
            machine = machine.with_flywheel(sized_flywheel(machine, flywheel_for, side=side).inertia, side)
            begin = machine.reduced.direction * described.table.start_angle
            solutions, reached, why = rotations_from_rest(machine, begin)
            found += solutions
            refused += reach_findings(solutions, reached, why, ", with the flywheel") if solutions else [str(why)]
        except DriveError as error:
            refused.append(str(error))
    if refused and not found:
        raise DriveError(refused[0])
    for one in refused:
        warnings.warn(one, stacklevel=2)
    return found
