"""A folder with all that a test of one's own machine needs: written anew from a mechanism, and checked whole.

What is written is valid and runs at once on simulated logs; every value that the mechanism does not say is a guess,
marked so, to be edited.
"""

import filecmp
import math
import shutil
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path, PurePath
from string import Template
from typing import Annotated, Any

from balance import datasets
from balance.balancing.conditions import balance_conditions
from balance.balancing.objective import motion_objective
from balance.balancing.sizing import exact_sizing
from balance.closure import Closure
from balance.errors import CounterpoiseError, DataError, ModelError, suggestion
from balance.mechanism.mechanism import Mechanism
from balance.mechanism.mjcf_parser import load_mechanism, mechanism_from_text
from balance.motion import Motion
from balance.motion.motion_files import load_motion, motion_from_table
from balance.results import Key, first_of
from balance.units import G0

from .campaign_plan import Plan, PlannedRun, load_plan
from .errors import RecordingError, RigError
from .ingestion.log_sources import LogReading
from .ingestion.planned_runs import is_run_table, plan_rows
from .ingestion.run_table import RunTableRow, run_table_rows, write_run_table
from .quality.rig_checks import rig_findings, unclocked
from .readers import ReadOptions
from .recording import Recording, Severity
from .rig import Rig, load_rig
from .rig.rig import mechanism_file
from .simulator.run import planned_samples, refuse_bench

RIG, PLAN, RUNS, MOTION = "rig.toml", "plan.toml", "runs.csv", "motion.toml"
_WORKBOOKS = ("runs.xlsx", "runs.xlsm")
"""Names of a run table where there is no RUNS."""
FREQUENCY_HZ, DAMPING = 12.0, 0.05
"""Of the guessed bench on its mounts: natural frequency, and share of critical damping."""
BASE_SHARE = 20.0
"""Guessed mass of the base over that of the mechanism."""
_TURN_DEG, _SLIDE_MM, _HALVINGS = 15.0, 20.0, 6
_PEAK = {True: "10 m/s^2", False: "60 rad/s^2"}
"""Peak acceleration of a joint that slides, and of one that turns."""
_SINGLY = 3
"""Rows or logs without the other up to which each is a problem of its own."""
_RATE_HZ = 1000.0


@dataclass(frozen=True)
class Problem:
    """Something in a project that is missing or contradicts."""

    file: Annotated[str, Key("", "file")]
    message: Annotated[str, Key("", "what, and what to do")]
    is_note: bool = False
    """Whether logs are ingested and analysed without it: it is for simulated ones."""


def new_project(folder: Path, mechanism: str | None, loggers: int = 2) -> list[str]:
    """Write a project into a new or empty folder, from a mechanism file or a shipped one; names of the files.

    Raises RigError for a folder that is in use, ModelError for a mechanism that cannot be read.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise RigError(f"{folder}: exists and is not empty; name a new folder")
    path = datasets.find_dataset(mechanism or "parallelogram-6bar", "mechanisms", ".xml")
    model = load_mechanism(path)
    suffix = next((s for tag, s in (("<robot", ".urdf"), ("<sdf", ".sdf")) if tag in model.text), ".xml")
    file = f"{path.stem}{suffix}"
    moved = _motion_text(model)
    texts = {
        file: model.text,
        MOTION: moved,
        PLAN: _plan_text(file, model, motion_from_text(moved)),
        RIG: _rig_text(file, model, loggers),
        "README.md": _aligned(
            _template("README.md", name=model.name, mechanism=file, motion=MOTION, plan=PLAN, rig=RIG, runs=RUNS)
        ),
    }
    mechanism_from_text(model.text, file)  # what is written can be read
    made = not folder.exists()
    folder.mkdir(parents=True, exist_ok=True)
    try:
        for name, text in texts.items():
            (folder / name).write_text(text, encoding="utf-8")
        names = load_rig(folder / RIG).loggers
        runs = load_plan(folder / PLAN).runs()
        write_run_table(
            folder / RUNS,
            [(f"{run.name}_{name}.csv", run.name, "measured", run.conditions) for run in runs for name in names],
        )
    except BaseException:
        if made:
            shutil.rmtree(folder, ignore_errors=True)
        raise
    return [*texts, RUNS]


def _aligned(text: str) -> str:
    """A text whose commands have what they are for behind them, in one column."""
    lines = [line.partition("  # ") for line in text.splitlines()]
    width = max(len(command.rstrip()) for command, found, _ in lines if found)
    return "".join(f"{c.rstrip():{width}}  # {why.strip()}\n" if found else f"{c}\n" for c, found, why in lines)


def motion_from_text(text: str) -> Motion:
    """A motion from the text of its file."""
    from balance.input_files import toml_tables

    return motion_from_table(toml_tables(text, MOTION), MOTION)


def _motion_text(model: Mechanism) -> str:
    """Driven joints there and back one after the other, as far as the mechanism can go; rests of half a second."""
    joints = model.driven
    if not joints:
        raise RigError(
            f"{model.name} has no driven joint: name its motors, by <actuator> in an MJCF, name_mot: [JOINT] in the "
            f"YAML file of a URDF (joints: {', '.join(model.coordinates)})"
        )
    slides = [not model.tree.joints[model.coordinate_index(joint)].revolute for joint in joints]
    beyond, reason = "", ""
    for share in (0.5**halvings for halvings in range(_HALVINGS)):
        text = _moves_text(model, slides, share)
        try:
            q = Closure(model).follow(motion_from_text(text).sample(_RATE_HZ)).q
        except CounterpoiseError as error:
            reason = str(error)
            continue
        if not model.beyond_limits(q):
            return text
        beyond = beyond or text
    if beyond:  # where its home is beyond them already: `check` says so
        return beyond
    raise RigError(
        f"{model.name}: its driven joints {', '.join(joints)} cannot move from its home configuration: {reason}"
    )


def _moves_text(model: Mechanism, slides: list[bool], share: float) -> str:
    starts, moves = [], []
    for joint, slide in zip(model.driven, slides, strict=True):
        factor, unit, size = (1e3, "mm", share * _SLIDE_MM) if slide else (math.degrees(1.0), "deg", share * _TURN_DEG)
        index = model.coordinate_index(joint)
        home, (low, high) = factor * float(model.home[index]), factor * model.limits[index]
        starts.append(f'"{home:.9g} {unit}"')
        ends = [end for end in (size, -size) if low <= home + end <= high] or [size, -size]
        listed = ", ".join(f'"{end:g} {unit}"' for end in [*ends, 0])
        moves.append(f'    {{ joint = "{joint}", to = [{listed}] }},')
    peaks = [f'"{_PEAK[slide]}"' for slide in slides]
    return _template(
        MOTION, name=model.name, joints=", ".join(map(repr_text, model.driven)), starts=", ".join(starts),
        peak=peaks[0] if len(set(peaks)) == 1 else f"[{', '.join(peaks)}]", moves="\n".join(moves),
    )  # fmt: skip


def repr_text(name: str) -> str:
    """A name as a TOML string."""
    escaped = name.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def _plan_text(file: str, model: Mechanism, motion: Motion) -> str:
    """Two repeats with the counter-masses of least shaking force, and without."""
    masses = {}
    if model.counter_sites:
        objective = motion_objective(model, Closure(model).follow(motion.sample(_RATE_HZ)))
        sized = exact_sizing(balance_conditions(model), model, (), objective=objective)
        masses = {c.site: c.mass for c in sized.counter_masses if c.mass > 0.0}
    listed = ", ".join(f'{repr_text(site)} = "{mass:.6g} kg"' for site, mass in masses.items())
    payload = model.payload_bodies[0] if len(model.payload_bodies) == 1 else None
    carried = ""
    if payload and model.mass(payload) > 0.0:
        carried = (
            f'payload = "{model.mass(payload):.6g} kg"                # all that {payload} carries, itself included\n'
        )
    if masses:
        mounted = f"counter_masses = {{ {listed} }}"
    elif model.counter_sites:
        mounted = f'# counter_masses = {{ {repr_text(model.counter_sites[0])} = "0.1 kg" }}  # least force: without any'
    else:
        mounted = "# counter_masses: none: name sites counter... in the mechanism's file, where masses can be mounted"
    return _template(PLAN, name=model.name, mechanism=repr_text(file), payload=carried, counter_masses=mounted)


def _rig_text(file: str, model: Mechanism, loggers: int) -> str:
    base = BASE_SHARE * max(model.total_mass, 0.1)
    stiffness = f"{base * (2.0 * math.pi * FREQUENCY_HZ) ** 2 / 4.0:.4g}"
    damping = f"{2.0 * DAMPING * base * 2.0 * math.pi * FREQUENCY_HZ / 4.0:.4g}"
    joints = ""
    for joint in model.driven:
        slide = not model.tree.joints[model.coordinate_index(joint)].revolute
        unit, load, fine = ("m", "N", "1e-6 m") if slide else ("rad", "N m", "1e-5 rad")
        joints += _template(
            "joint.toml", name="".join(c if c.isalnum() or c == "_" else "_" for c in joint), joint=repr_text(joint),
            logger="controller" if loggers > 1 else "daq", unit=unit, resolution=fine, load=load,
            angle=repr_text(f"q_{joint}"), torque=repr_text(f"tau_{joint}"),
        )  # fmt: skip
    down = max(range(3), key=lambda i: abs(model.gravity[i])) if model.gravity.any() else 1

    def below(depth: float, *place: float) -> str:
        values = list(place)
        values.insert(down, depth if model.gravity[down] > 0.0 else -depth)
        return ", ".join(f'"{value:g} m"' for value in values)

    places = [below(0.5, a, b) for a in (-0.4, 0.4) for b in (-0.3, 0.3)]
    mounts = "".join(_template("mount.toml", place=p, stiffness=stiffness, damping=damping) for p in places)
    return _template(
        RIG, name=model.name, mechanism=repr_text(file), controller=_template("controller.toml") * (loggers > 1),
        joints=joints, mass=f"{base:.4g}", centre=below(0.2, 0.0, 0.0), inertia=f"{base * 0.1:.4g}", mounts=mounts,
    )  # fmt: skip


def _template(file: str, /, **values: str) -> str:
    """A text of the folder ``project_files`` with these values in place of their names."""
    return Template((Path(__file__).with_name("project_files") / file).read_text(encoding="utf-8")).substitute(values)


def project_problems(folder: Path, logs: Sequence[Path] = ()) -> list[Problem]:
    """All that is missing in a project's folder, or contradicts, at once, and what is to be known before simulating.

    ``logs``: files that the run table's rows must name, and that must be named; their headers, or those of the logs in
    the folder that the table names, are held against the rig's channels.
    """
    if not folder.is_dir():
        raise RigError(f"{folder}: no such folder; `testbench new {folder}` writes one")
    return list(_problems(folder, [path for path in logs if not is_run_table(path)]))


def _problems(folder: Path, logs: Sequence[Path]) -> Iterator[Problem]:
    read: dict[str, Any] = {}
    runs = RUNS if (folder / RUNS).exists() else next((name for name in _WORKBOOKS if (folder / name).exists()), RUNS)
    for file, reader in ((RIG, load_rig), (PLAN, load_plan), (runs, run_table_rows)):
        try:
            if not (folder / file).exists():
                raise RigError("not there: `testbench new` writes one into a new folder; copy it here and edit it")
            if (folder / file).is_dir():
                raise RigError("is a folder: expected a file")
            read[file] = reader(folder / file)
        except (CounterpoiseError, OSError) as error:
            yield from _rows(folder, file, error, file == PLAN and not (folder / PLAN).exists())
    rig, plan, model = read.get(RIG), read.get(PLAN), None
    if (stating := rig or plan) is not None:
        try:
            model = load_mechanism(mechanism_file(stating.mechanism, folder) or stating.mechanism)
        except CounterpoiseError as error:
            yield from _rows(folder, stating.mechanism, error)
    if rig is not None and "bench" in rig.model_fields_set:
        try:
            rig.bench.elastic()
        except DataError as error:
            yield from _rows(folder, RIG, error)
    if rig is not None and rig.under_base:
        yield Problem(RIG, rig.under_base)
    planned = [] if plan is None else plan.runs()
    if plan is not None:
        yield from _plan_problems(plan, planned, rig, model)
    rows, wrong = read.get(runs, ([], []))
    if wrong:
        yield from _rows(folder, runs, RigError("\n".join(wrong)))
    yield from _missing_logs(folder, runs, rows, logs, whole=runs in read and not wrong)
    given = [path for path in logs if path.name != runs]
    held = given or [path for path in dict.fromkeys(folder / row.file for row in rows) if path.is_file()]
    yield from _log_problems(rig, [] if wrong else rows, held, runs)
    yield from _one_recording([path for path in held if path.name in {PurePath(row.file).name for row in rows}], runs)
    try:
        plan_rows(rows, given or [folder / row.file for row in rows], folder / runs)
    except RigError as error:
        yield from _rows(folder, runs, error)
    # a plan is simulated, and so what it needs is no note: it comes first
    stated = [(PLAN, f"{run.name}: ", run) for run in planned]
    stated += [(runs, f"line {row.line}: ", _run(row)) for row in rows]
    yield from _condition_problems(folder, rig, model, stated)


def _plan_problems(
    plan: Plan, planned: Sequence[PlannedRun], rig: Rig | None, model: Mechanism | None
) -> Iterator[Problem]:
    """A mechanism that is not the rig's, and runs that compare nothing."""
    if rig is not None and plan.mechanism != rig.mechanism:
        yield Problem(PLAN, f"mechanism is {plan.mechanism!r}, that of {RIG} {rig.mechanism!r}: make them the same")
    if model is not None and not any(run.counter_masses for run in planned):
        sites = ", ".join(model.counter_sites) or "none yet: name sites counter... in its file"
        yield Problem(PLAN, f"no run has counter-masses, so nothing can be compared: put some on sites ({sites})")


def _missing_logs(
    folder: Path, runs: str, rows: Sequence[RunTableRow], logs: Sequence[Path], whole: bool
) -> Iterator[Problem]:
    """Rows of the run table without a log; logs without a row, if the table could be read ``whole``."""
    there = {path.name for path in logs} | {row.file for row in rows if (folder / row.file).is_file()}
    named = {PurePath(row.file).name for row in rows}
    missing = [row for row in rows if row.file not in there and PurePath(row.file).name not in there]
    if logs:
        for row in missing[: None if len(missing) <= _SINGLY else 1]:
            hint = suggestion(row.file, there - named) or ": add the log, or remove the row"
            more = f" (as lines {', '.join(str(one.line) for one in missing[1:])})" * (len(missing) > _SINGLY)
            yield Problem(runs, f"line {row.line}: names {row.file}, which is not among the logs{more}{hint}")
        unnamed = sorted({path.name for path in logs if path.name != runs} - named) if whole else []
        if len(unnamed) > _SINGLY:
            yield Problem(runs, f"no line names {', '.join(unnamed)}: add a line for each, or leave those logs out")
        for name in unnamed if len(unnamed) <= _SINGLY else ():
            yield Problem(runs, f"no line names {name}: add one, or leave that log out")
    elif missing and len(missing) < len(rows):
        files = ", ".join(row.file for row in missing)
        yield Problem(runs, f"names {files}, not in the folder: add the logs, or remove their rows")


def _condition_problems(
    folder: Path, rig: Rig | None, model: Mechanism | None, stated: Iterable[tuple[str, str, PlannedRun]]
) -> Iterator[Problem]:
    """What the runs, each its file, its place there and itself, say of motions and masses; once a file."""
    said = set()
    motions, missing = dict[tuple[object, ...], list[Problem]](), list[str]()
    for file, where, run in stated:
        moved = (run.motion, run.peak_acceleration, run.turning)
        if moved not in motions:
            motions[moved] = list(_motion_problems(folder, rig, model, run, missing)) if run.motion else []
        carried = [] if model is None else [Problem("", message) for message in run.contradictions(model)]
        for problem in [*carried, *motions[moved]]:
            found = (problem.file or file, problem.message)
            if found not in said:
                said.add(found)
                message = problem.message if problem.file else f"{where}{problem.message}"
                yield Problem(found[0], message, problem.is_note and (file != PLAN or problem.file in missing))


def _log_problems(rig: Rig | None, rows: Sequence[RunTableRow], logs: Sequence[Path], table: str) -> Iterator[Problem]:
    """Logs that cannot be opened, and what their headers lack of the rig's channels, run by run; once for all runs.

    Without rows that name them it is not known which logs are of one run.
    """
    recordings, runs, opened = dict[str, Recording](), dict[str, list[Recording]](), dict[str, ReadOptions]()
    try:
        reading = LogReading(rig=rig)
    except RecordingError as error:
        yield Problem(RIG, str(error))
        return
    for path in logs:
        try:
            opened[path.name], recordings[path.name] = reading.opened(path)
        except (RecordingError, OSError) as error:
            yield Problem(path.name, str(error).removeprefix(f"{path.name}: "))
    for name, options in opened.items():
        if (told := options.description) is not None:
            findings = told.with_normal_as_notes(reading.checked(told, recordings[name].findings))
            yield from (Problem(name, one.message) for one in findings if one.code == "channel_not_found")
    named = [(PurePath(row.file).name, row.run or PurePath(row.file).stem) for row in rows]
    incomplete = {run for name, run in named if name not in recordings}
    if recordings and (incomplete or recordings.keys() - {name for name, _ in named}):
        every = reversed(recordings.values())  # of each kind one log shows what the rig lacks
        kinds = {frozenset((c.label, c.unit) for g in one.groups for c in g.channels): one for one in every}
        runs["the logs"] = [*kinds.values()]
    for name, run in named:
        if name in recordings:
            runs.setdefault(run, []).append(recordings[name])
    said: dict[tuple[str, str | None, str], tuple[str, list[str]]] = {}
    for run, held in runs.items():
        for one in () if rig is None else [*rig_findings(rig, held), *unclocked(rig, held)]:
            unsure = "sensor_not_recorded" if run in incomplete else "logger_twice" if run == "the logs" else None
            if one.severity > Severity.NOTE and one.code != unsure:
                message = f"{one.channel}: {one.message}" if one.channel else one.message
                key = (one.code, one.channel, one.message.partition(":")[0])
                said.setdefault(key, (message, []))[1].append(run)
    for (code, *_), (message, where) in said.items():
        yield Problem(table if code == "logger_twice" else RIG, f"{first_of(where, 4)}: {message}")


def _one_recording(logs: Sequence[Path], table: str) -> Iterator[Problem]:
    """Logs of the table that hold the same bytes in two files; those that cannot be read are said before."""
    others: dict[int, list[Path]] = defaultdict(list)
    for path in {(path.resolve(), path.name): path for path in logs}.values():
        with suppress(OSError):
            same, holds = others[path.stat().st_size], path.stat().st_size > 0
            twin = next((other for other in same if holds and filecmp.cmp(other, path, shallow=False)), None)
            same.append(path)
            if twin is not None:
                message = f"{twin.name} and {path.name} are one recording (byte for byte)"
                yield Problem(table, f"{message}: bring the missing log of one of them")


def _rows(folder: Path, file: str, error: Exception, is_note: bool = False) -> Iterator[Problem]:
    """A problem for each line of an error, without the file's name, which stands beside it."""
    for line in str(error).splitlines():
        for start in (f"{folder / file}: ", f"{file}: ", f"{file}, "):
            line = line.removeprefix(start)
        yield Problem(file, line.replace("``", "'"), is_note)


def _run(row: RunTableRow) -> PlannedRun:
    """What a row of the run table states, as a run to be made; without a motion its name is empty."""
    stated = row.conditions
    turning = stated.get("peak_acceleration_rad_s2")
    linear = stated.get("peak_acceleration_g")
    return PlannedRun(
        row.run or row.file,
        stated.get("payload_kg"),
        stated.get("counter_masses", {}),
        stated.get("motion", ""),
        turning if linear is None else linear * G0,
        stated.get("repeat", 1),
        turning is not None,
        stated.get("payloads", {}),
    )


def _motion_problems(
    folder: Path, rig: Rig | None, model: Mechanism | None, run: PlannedRun, missing: list[str]
) -> Iterator[Problem]:
    """Why a run's motion cannot be simulated; without a file where the run is to be named.

    Files of motions that are not there are added to ``missing``; the shipped ones are listed with the first.
    """
    own = run.motion if run.motion.endswith(".toml") else f"{run.motion}.toml"
    try:
        motion = load_motion(next((path for path in (folder / run.motion, folder / own) if path.is_file()), run.motion))
    except DataError as error:
        if (folder / own).exists():
            yield from _rows(folder, own, error)
        else:
            missing.append(own)
            names = datasets.dataset_names("motions", ".toml")
            shipped = f" ({', '.join(names)})" if own == missing[0] else ""
            to_simulate = f"to simulate them too, write {own} in this folder, or name a shipped motion{shipped}"
            files = sorted(path.stem for path in folder.glob("*.toml") if path.name not in {RIG, PLAN})
            near = suggestion(own.removesuffix(".toml"), [*names, *files])
            yield Problem(own, f"not there: its runs are analysed, and not simulated; {to_simulate}{near}", True)
        return
    if rig is None or model is None:
        return
    try:
        samples = planned_samples(rig, run, motion)
        for exceeded in model.limits_exceeded(Closure(model).follow(samples).q):
            yield Problem("", f"motion {run.motion!r}: {exceeded}", True)
    except DataError as error:
        yield Problem("", f"motion {run.motion!r}: {error}", True)
    except CounterpoiseError as error:
        yield Problem("", f"motion {run.motion!r}: {model.name} cannot follow it: {error}", True)
    else:
        try:
            refuse_bench(rig, model, run, samples)
        except (RigError, DataError) as error:
            yield from _rows(folder, RIG, error, True)
        except ModelError:  # of what the run carries: stated with that
            return
