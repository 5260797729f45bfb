"""``balance simulate``, ``balance conditions`` and ``balance check``."""

from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..results import per_cent_text, plain, table
from . import options
from .framework import FILE, Answer, Word, command, option
from .printing import emit_findings, emit_parts, emit_table, label, mass, say

if TYPE_CHECKING:
    from ..balancing.conditions import Conditions
    from ..closure import Closure, Trajectory
    from ..closure.assembly import Configuration
    from ..dynamics.inverse_dynamics import Response
    from ..dynamics.reactions import Reactions
    from ..mechanism.mechanism import Mechanism


@command(
    epilog="""\b
Examples:
  balance simulate parallelogram-6bar --motion x --payload platform=5kg
  balance simulate parallelogram-6bar --motion triangle -c counter_A0A=24.28kg -c counter_B0B=24.28kg --csv run.csv"""
)
def simulate(
    mechanism: str = options.MECHANISM,
    motion: str = options.MOTION,
    payload: options.Masses = options.PAYLOADS,
    counter: options.Masses = options.COUNTERS,
    rate: str | None = option("Samples per second, with unit [default: 10 kHz].", metavar="RATE"),
    csv: str | None = option("Write the time series as CSV, marked simulated.", FILE, metavar="FILE"),
    parquet: str | None = option("Write the time series as Parquet.", FILE, metavar="FILE"),
    reactions: bool = option("Also forces and moments in the joints and loop closures."),
) -> Answer:
    """Simulate a motion of MECH: shaking force, shaking moment and drive torque.

    Shaking force and moment are what the mechanism exerts on its base, weight excluded, the moment about the origin
    of the base frame; drive torque includes gravity. Reactions include weight and the motors' torque: of a joint, on
    the bodies beyond it and about its origin; of a closure, on the body of its first end.
    """
    from ..dynamics.inverse_dynamics import simulate as respond
    from ..dynamics.reactions import find_reactions
    from ..front_door import follow
    from ..table_files import write_csv_file, write_parquet

    if csv and parquet and Path(csv).resolve() == Path(parquet).resolve():
        raise click.UsageError(f"--csv and --parquet name one file, {csv}: give two names")
    model = options.load_mechanism_option(mechanism, payload).with_counter_mass(counter)
    trajectory = follow(model, motion, rate)
    response = respond(model, trajectory)
    found = find_reactions(model, trajectory, response) if reactions else None
    beyond, left_out = model.beyond_limits(trajectory.q), model.left_out if response.torque else ()
    turning = [name for name, inertia in zip(model.coordinates, model.armature, strict=True) if inertia]
    rotors = [f"the shaking moment of rotors (armature of {', '.join(turning)})"] if turning and response.torque else []
    drives = f"torques and forces of the drives{' and reactions' if found else ''}"
    findings = [
        *(
            ("beyond_limits", f"{exceeded}: the motion is computed as if it had none")
            for exceeded in model.limits_exceeded(trajectory.q)
        ),
        *(("left_out", f"{drives} leave out {what}, which the file has") for what in left_out),
        *(("left_out", f"{what} is not in M, though they count in the torques: {_ROTORS}") for what in rotors),
    ]
    columns = {"time_s": trajectory.time} | response.columns() | (found.columns() if found else {})
    for joint, q, v, a in zip(model.coordinates, trajectory.q.T, trajectory.v.T, trajectory.a.T, strict=True):
        unit = "rad" if model.tree.joints[model.coordinates.index(joint)].revolute else "m"
        columns |= {f"q_{joint}_{unit}": q, f"v_{joint}_{unit}_per_s": v, f"a_{joint}_{unit}_per_s2": a}
    if csv:
        write_csv_file(csv, columns, "# origin: simulated\n")
    if parquet:
        write_parquet(parquet, columns, {"origin": "simulated"})
    document = (
        {"mechanism": model.name, "motion": motion, "samples": len(trajectory.time)}
        | {"closure": {name: getattr(trajectory, key) for name, key in _CLOSURE.items()}}
        | {"beyond_limits": {joint: list(reached) for joint, reached in beyond.items()}}
        | {"idle": list(trajectory.idle), "left_out": [*left_out, *rotors], "coarse_samples": list(trajectory.coarse)}
        | options.response_summary(response)
        | {"drives": response.drives()}
    )
    if found:
        document |= {"reactions": found.summary(), "redundant_constraint_rows": found.redundant}
        document |= {"undetermined": list(found.undetermined)}
    show = partial(_print_motion, model, motion, trajectory, response, found, findings)
    return Answer(document, show, bool(findings), further=("", "closure", "rms", "peak"))


_ROTORS = "the file does not say how they turn; where it matters give a rotor a body of its own, coupled to the joint"
_CLOSURE = {"residual_m": "residual", "condition": "condition", "branch": "branch"}
_DRIVES = ["joint", "peak", "RMS", "peak speed", "power [W]", "braking [W]"]
_DRIVEN = "RMS over the whole motion, rests included; speed and power at the joint, without gear and motor losses."


def _print_motion(
    model: "Mechanism",
    motion: str,
    trajectory: "Trajectory",
    response: "Response",
    found: "Reactions | None",
    findings: list[tuple[str, str]],
) -> None:
    """Force, moment and drives' torques, reactions where they are asked for, and what the motion exceeds."""
    from ..dynamics.inverse_dynamics import NOTHING
    from ..dynamics.regressor import rounding_of_force

    peak, rms = response.peak(), response.rms()
    squares = (response.force**2).sum(axis=1)
    force, largest = float(squares.mean() ** 0.5), float(squares.max() ** 0.5)
    rounding = rounding_of_force(model, trajectory)
    if largest <= rounding:
        say(
            f"{model.name} puts 0 N on its base in motion {motion}: its force is balanced (simulated, weight excluded)."
        )
    else:
        say(
            f"{model.name} shakes its base with {force:.4g} N RMS in motion {motion}, {largest:.4g} N peak "
            "(simulated, weight excluded)."
        )
    of_drives = {name for name in rms if name.startswith(("torque_", "drive_force_"))}
    shown = {
        n: value
        for n, value in rms.items()
        if n not in of_drives and peak[n] > max(NOTHING, rounding * n.startswith("F"))
    }
    rows = [[label(name), f"{value:.4g}", f"{peak[name]:.4g}"] for name, value in shown.items()]
    others = "" if len(shown) + len(of_drives) == len(rms) else "All others are zero."
    emit_table("", ["component", "RMS", "peak"], rows, others)
    if response.torque:
        loads = []
        for joint, load in response.drives().items():
            *sizes, power, least = ((label(key)[:-1].partition(" [")[2], value) for key, value in load.items())
            shown_sizes = [f"{value:.4g} {unit}" for unit, value in sizes]
            loads.append([joint, *shown_sizes, f"{power[1]:.4g}", f"{max(-least[1], 0.0):.4g}"])
        emit_table("Drives", _DRIVES, loads, _DRIVEN)
    if found:
        _print_reactions(found)
    options.tell_idle(trajectory.idle)
    if not response.torque:
        say("No drive torque: the file has no <actuator> that names the driven joints.")
    emit_findings(findings)


def _print_reactions(found: "Reactions") -> None:
    """Sizes of the forces and moments in joints and closures, and which of them rigid bodies do not determine."""
    sizes = {name: dict(list(sizes.items())[:2]) for name, sizes in found.summary().items()}
    title = "reactions, weight and motors' torque included"
    emit_parts({title: sizes}, (title,))
    if found.redundant:
        open_ones = dict[str, list[str]]()
        for name in found.undetermined:
            joint, _, component = name.removeprefix("reaction_").rpartition("_")[0].rpartition("_")
            open_ones.setdefault(joint, []).append(component)
        listed = ", ".join(f"{' '.join(components)} of {joint}" for joint, components in open_ones.items())
        say(
            f"{found.redundant} constraint row{'s' * (found.redundant > 1)} of the closures "
            f"{'are' if found.redundant > 1 else 'is'} redundant: rigid bodies do not determine {listed}; those of "
            "least squares are given."
        )
    if found.couplings:
        say(
            "Couplings are torques and forces along their coordinates: what teeth press with, and load bearings by, "
            "depends on where they mesh and is not in these (balance linkage has it)."
        )


_BRANCHES = 4
"""Columns of a table of closed configurations that fit a line."""


@command(
    epilog="""\b
Examples:
  balance assemble four-bar
  balance assemble five-bar --json"""
)
def assemble(mechanism: str = options.MECHANISM) -> Answer:
    """Close the loops of MECH, and list the ways in which it can be put together.

    Branch A is found from the file's keyframe, or else from its zero configuration; the others have the same driven
    coordinates, and are sought from random starts. A keyframe named home with one of them chooses it, of a URDF the key
    home of the YAML file beside it.
    """
    from ..closure import Closure
    from ..closure.assembly import CLOSED_LIMIT

    closure = Closure(options.load_mechanism_option(mechanism, {}), search=True)
    model, found = closure.mechanism, closure.without_idle().configurations()
    tolerance = CLOSED_LIMIT * closure.length
    document = {
        "mechanism": model.name,
        "dof": closure.dof,
        "idle": list(closure.idle),
        "loops": len(model.loops),
        "start": model.branch,
        "tolerance_m": tolerance,
        "configurations": [
            {"branch": one.branch, "residual_m": one.residual, "distance": one.distance}
            | {"beyond_limits": sorted(model.beyond_limits(one.q[None]))}
            | {"q": dict(zip(model.coordinates, one.q.tolist(), strict=True))}
            for one in found
        ],
    }
    return Answer(document, lambda: _print_configurations(closure, found, tolerance))


def _print_configurations(closure: "Closure", found: "list[Configuration]", tolerance: float) -> None:
    """The closed configurations side by side, and the keyframe that chooses each."""
    model = closure.mechanism
    say(
        f"{model.name} can be put together in {len(found)} way{'s' * (len(found) != 1)}: degrees of freedom "
        f"{closure.dof}, loops {len(model.loops)}, A is found from {model.branch!r}."
    )
    for start in range(0, len(found), _BRANCHES):
        part = found[start : start + _BRANCHES]
        rows = []
        for i, (joint, elementary) in enumerate(zip(model.coordinates, model.tree.joints, strict=True)):
            unit, rounding = ("rad", 1e-9) if elementary.revolute else ("m", 1e-9 * closure.length)
            rows.append([joint, unit, *(f"{one.q[i] if abs(one.q[i]) > rounding else 0.0:.6g}" for one in part)])
        rows.append(["largest residual", "m, rad", *(f"{one.residual:.2g}" for one in part)])
        title = f"Closed configurations of {model.name}"
        emit_table(title, ["joint", "unit", *(one.branch for one in part)], rows)
    urdf = "<robot" in model.text
    options.tell_idle(closure.idle)
    say(f"Closed means a residual of at most {tolerance:.2g} m or rad.")
    say(
        "The key home of the YAML file beside the URDF chooses one:"
        if urdf
        else "A keyframe chooses one; without ball joints its qpos has the coordinates in this order:"
    )
    for one in found:
        values = [f"{value:.12g}" for value in one.q]
        named = ", ".join(f"{name}: {value}" for name, value in zip(model.coordinates, values, strict=True))
        home = f"home: {{{named}}}" if urdf else f"<key name='home' qpos='{' '.join(values)}'/>"
        click.echo(f"  {one.branch}: {home}")


BALANCED_KGM = 1e-6
"""First-moment residual up to which a mechanism is called balanced [kg m]."""


@command(
    epilog="""\b
Examples:
  balance conditions parallelogram-6bar
  balance conditions four-bar --counter counter_A0A=1.074kg --json
  balance conditions parallelogram-6bar-full --momentum planar
  balance conditions four-bar --moment"""
)
def conditions(
    mechanism: str = options.MECHANISM,
    payload: options.Masses = options.PAYLOADS,
    counter: options.Masses = options.COUNTERS,
    momentum: str | None = option(
        "Which momentum stays zero: linear; planar: the angular one about z too; all: all three angular ones too.  "
        "[default: linear]",
        Word(["linear", "planar", "all"]),
    ),
    moment: bool = option("Force and moment together (all momenta), and whether positive masses can meet both."),
) -> Answer:
    """Find the conditions that balance MECH, and their present values.

    MECH is the name of a shipped mechanism or a MJCF, URDF or SDF file. Balanced is where every left-hand side is
    zero; mcx[A] is the first moment of mass of body A about its joint, along x of its frame as in the file, m[A] its
    mass. With --moment the exit code is 3 where no positive masses, wherever they are added on the bodies, can meet all
    conditions.
    """
    from ..balancing.feasibility import feasibility
    from ..balancing.sizing import BodyMoment, body_moments
    from ..front_door import conditions as found_conditions

    momentum = momentum or ("all" if moment else "linear")
    model = options.load_mechanism_option(mechanism, payload).with_counter_mass(counter)
    found = found_conditions(model, momentum)
    model = found.mechanism
    possible = feasibility(found) if moment else None
    moments = body_moments(found, model) if momentum == "linear" and "kg" not in found.units else None
    document = {
        "mechanism": model.name,
        "branch": model.branch,
        "momentum": momentum,
        "dof": found.dof,
        "moving_mass_kg": model.total_mass,
        "idle": list(found.idle),
        "loops": len(model.loops),
        "residual_m": found.closure_residual,
        "rank": found.rank,
        "rank_by": found.rank_by,
        "rank_in_doubt": found.in_doubt,
        "rank_to_the_letter": found.rank_to_the_letter,
        "rank_rational": found.rank_rational,
        "singular_value_gap": list(found.singular_values),
        "conditions": found.document(),
        "first_moments": None if moments is None else plain(moments),
        "balanced": found.is_balanced(BALANCED_KGM),
        "balanced_tolerance_kgm": BALANCED_KGM,
    } | ({"positive_masses": asdict(possible)} if possible else {})
    cannot_be = possible is not None and possible.status != "possible"

    def show() -> None:
        _print_conditions(found, momentum)
        if moments:
            note = "Added all together these meet the conditions, as other shares do; the mass that gives them on BODY "
            note += "counts too where the conditions have m[BODY]."
            emit_table("First moments missing", *table(BodyMoment, moments, "body", "missing"), note)
        if momentum == "linear" and moments is None:
            say("No first moment meets the conditions on masses alone: balance size leaves the least.")
        if possible:
            possibilities = {
                "possible": "Positive masses at suitable places of the bodies meet all of them.",
                "undecided": "Whether positive masses can meet all of them was not decided: the solver proves neither.",
                "forbidden": f"Positive masses cannot meet all of them. They ask for\n  {possible.text}\n"
                f"which no mass on any body lowers; it is {possible.value:.4g} now. Only bodies that move or turn the "
                "other way can, such as counter-rotating inertias.",
            }
            say(possibilities[possible.status])

    return Answer(document, show, cannot_be, further=("",))


def _print_conditions(found: "Conditions", momentum: str) -> None:
    """Whether it is balanced, the conditions with their values."""
    model = found.mechanism
    left = ", ".join(f"{found.residual(unit):.4g} {unit}" for unit in ("kg m", *sorted({*found.units} - {"kg m"})))
    say(
        f"{'Balanced' if found.is_balanced(BALANCED_KGM) else 'Not balanced'}: first-moment residual {left}, of "
        f"{found.rank} condition{'s' * (found.rank != 1)} on {momentum} momentum."
    )
    rows = _condition_rows(found, model)
    named = f"With {', '.join(f'{name} = {length:.6g} m' for name, length in model.lengths.items())}"
    emit_table(f"Conditions of {model.name}", ["condition", "now", "unit"], rows, named if model.lengths else "")
    options.tell_idle(found.idle)
    if found.in_doubt:
        (kept, dropped), exact = found.singular_values, found.rank_to_the_letter
        has = f"{exact} conditions" if exact else "more conditions, how many cannot be decided"
        rational = f", {found.rank_rational} in exact arithmetic"
        say(
            f"Rank in doubt: singular values up to {dropped:.3g} were taken for rounding of the file's numbers, beside "
            f"{kept:.3g}. To the letter the file has {has}"
            f"{' in extended precision' if found.rank_rational is None else rational}. Write equal lengths and angles "
            "with the same digits, all sixteen of them; others further apart."
        )


def _condition_rows(found: "Conditions", model: "Mechanism") -> list[list[str]]:
    """The conditions with their values for a mechanism."""
    values = zip(found.values(model), found.units, strict=True)
    return [[found.text(i), f"{value:+.6g}", unit] for i, (value, unit) in enumerate(values)]


@command(
    epilog="""\b
Examples:
  balance check parallelogram-6bar -p platform=3.4116kg -c counter_A0A=17.1105kg -c counter_B0B=17.1105kg"""
)
def check(
    mechanism: str = options.MECHANISM,
    payload: options.Masses = options.PAYLOADS,
    counter: options.Masses = options.COUNTERS,
) -> Answer:
    """Residual imbalance of MECH with given counter-masses, and the payload that they would balance.

    The first line states how much of the momentum remains: its RMS over the workspace, as balance size measures it.
    Exit code 3: not balanced completely.
    """
    if not counter:
        raise click.UsageError("missing counter-masses to check: give --counter SITE=M")
    from ..dynamics.inverse_dynamics import shaking_force_per_acceleration
    from ..front_door import check as checked
    from ..units import G0

    model = options.load_mechanism_option(mechanism, payload)
    bodies = options.payload_bodies(model, payload)
    result = replace(checked(model, counter), payload_bodies=bodies)
    found, remaining = result.conditions, result.remaining_percent() if result.objective else None
    balanced = result.is_complete() if result.objective else result.is_balanced(BALANCED_KGM)
    payloads, nearest = result.balanced_payloads(), {body: result.nearest_payload(body) for body in bodies}
    force = [shaking_force_per_acceleration(state, bodies[0]) if bodies else None for state in (model, result.after)]
    before, after = (None if value is None else value * G0 for value in force)
    left = f"{per_cent_text(remaining)} of the RMS momentum remains over the workspace"
    if remaining is None:
        why = "there was none without them" if result.objective else "bodies without mass can move alone"
        left = f"first-moment residual {result.residual():.4g} kg m; the RMS momentum has no measure: {why}"
    document = {
        "mechanism": model.name,
        "balanced": balanced,
        "remaining_percent": remaining,
        "residual_first_moment_kgm": result.residual(),
        "residual_percent": result.residual_percent(),
        "conditions": found.document(result.after),
        "balanced_payload_kg": payloads,
        "nearest_payload_kg": {body: near and near[0] for body, near in nearest.items()},
        "nearest_payload_remaining_percent": {body: near and near[1] for body, near in nearest.items()},
        "shaking_force_N_per_g": after,
        "shaking_force_without_counter_masses_N_per_g": before,
        "g0_m_per_s2": G0,
    }

    def show() -> None:
        say("Balanced completely over the workspace." if balanced else f"Not balanced completely: {left}.")
        masses = ", ".join(f"{c.site} {mass(c.mass)} kg" for c in result.counter_masses)
        rows = _condition_rows(found, result.after)
        emit_table(f"Conditions of {model.name} with {masses}", ["condition", "now", "unit"], rows)
        for body, value in payloads.items():
            near, asked = nearest[body], f"(asked: {mass(model.mass(body))} kg)"
            if value is None and near is not None:
                say(
                    f"They would balance no {body} exactly; nearest is {mass(near[0])} kg, which leaves "
                    f"{per_cent_text(near[1])} of the RMS momentum {asked}."
                )
            else:
                say(f"They would balance {body} = {'none' if value is None else mass(value) + ' kg'} {asked}.")
        if before is not None and after is not None:
            say(
                f"Shaking force: {after:.4g} N per g0 of {bodies[0]} acceleration, "
                f"{before:.4g} N without counter-masses (g0 = {G0} m/s2)."
            )

    return Answer(document, show, not balanced, further=("",))
