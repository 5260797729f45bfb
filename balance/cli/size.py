"""``balance size``: counter-masses for one payload, or sets that only grow for several payloads of one body."""

import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, partial
from math import inf
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

import click

from . import options
from .framework import EXIT_WITH_FINDINGS, emit_json, emit_table, first_moment, json_option, mass, per_cent
from .options import print_responses, response_summary

if TYPE_CHECKING:
    from ..arrays import Floats
    from ..balancing import Sizing
    from ..balancing.objective import Objective
    from ..balancing.remaining_force import Verdict
    from ..closure import Trajectory
    from ..mechanism.mechanism import Mechanism

Payload = tuple[tuple[str, float], ...]


@click.command(
    epilog="""\b
Examples:
  balance size parallelogram-6bar --payload platform=5kg
  balance size parallelogram-6bar --payload platform=3.4116kg --stock kiper2019
  balance size four-bar --motion four-bar --site counter_A0A --limit counter_A0A=2kg
  balance size five-bar --motion five-bar --objective force --objective torque=2 --json
  balance size parallelogram-6bar -p platform=5kg --motion x --objective vibration --rig parallelogram-6bar
  balance size parallelogram-6bar -p platform=1.451kg -p platform=3.4116kg -p platform=5kg --stock kiper2019

\b
Vibration: of the base on its mounts as the rig has it, the mechanism locked as the motion starts; RMS of the sum of
squares of what the accelerometers on the base measure. The masses that are found are the least of all nearby.

\b
Least is the mean square of the shaking force vector, weight excluded: over the motion given, all samples of a file
or 10 kHz alike; without a motion, of the momentum per root of kinetic energy over the workspace. Of equals the
lightest. Several payloads of one body: sets that only grow with the payload, least in the sum over the payloads.

\b
Stock weighed:  name,mass_kg,quantity
Stock as drawn: name,quantity,shape,material,thickness_mm,length_mm,width_mm,diameter_mm,bore_mm,holes_mm
  shape: rectangle (length, width), disc (diameter) or ring (diameter, bore); the rest is empty
  material: 7075 aluminium, steel or 5000 aluminium; holes_mm: x y diameter; x y diameter, from its middle
  Mass and inertia follow; inertia is about the plate's centre of mass, which is taken to be at the site.

\b
Exit code 3: no masses at these sites balance it completely, or plates leave more than 5 % where other masses would."""
)
@options.mechanism_argument
@options.payload_option
@options.site_option
@click.option("--without", multiple=True, metavar="SITE", help="A site that gets no counter-mass.")
@click.option("--stock", metavar="CSV", help="Make them from these plates: a CSV file as below, or kiper2019.")
@click.option(
    "--limit",
    type=options.NamedQuantity("SITE", "mass", "5kg"),
    multiple=True,
    metavar="SITE=M",
    help="Largest counter-mass at a site.",
)
@click.option("--equal", multiple=True, metavar="SITE,SITE", help="Sites that get equal masses.")
@click.option("--best", type=click.IntRange(1, 100), default=1, show_default=True, help="Sets from stock to list.")
@click.option("--motion", metavar="TOML", help="The motion whose force is made small, and compared before and after.")
@click.option(
    "--objective",
    multiple=True,
    metavar="NAME=WEIGHT",
    help="What is made small: force, moment or torque (of the drives that turn) of the motion; of several the sum of "
    "weight times (RMS / RMS without)^2; vibration too, with --rig [default: force].",
)
@click.option("--rig", metavar="RIG", help="A rig's file, or a shipped one: the base whose vibration is made small.")
@click.option("--closed-form", is_flag=True, help="parallelogram-6bar by its published formula, without Pinocchio.")
@options.figure_option
@json_option
def size(
    mechanism: str,
    payload: Payload,
    site: tuple[str, ...],
    without: tuple[str, ...],
    stock: str | None,
    limit: tuple[tuple[str, float], ...],
    equal: tuple[str, ...],
    best: int,
    motion: str | None,
    objective: tuple[str, ...],
    rig: str | None,
    closed_form: bool,
    figure: str | None,
    as_json: bool,
) -> None:
    """Size the counter-masses that balance MECH, or leave the least shaking force: of any mass, or from stock plates.

    The first line states whether it balances; if not, what remains, and which bodies would need a site. Force balance
    alone raises the shaking moment and the drive torque: --motion shows by how much.
    """
    if best > 1 and not stock:
        raise click.UsageError("--best lists sets of plates: give --stock; of any mass one set is the best")
    if closed_form:
        if site or without or stock or limit or equal or motion or objective or rig or figure:
            raise click.UsageError("--closed-form reads no model: give only --payload and --json with it")
        _closed_form(mechanism, payload, as_json)
        return
    weights = _weights(objective, motion, rig)
    payloads = options.growing_payloads(payload)
    if len(payloads) > 1:
        if limit or equal or without or best > 1 or rig or figure:
            raise click.UsageError(
                "--limit, --equal, --without, --best, --rig and --figure are for one payload of a body"
            )
        from .growing_sets import size_growing

        size_growing(mechanism, payloads, site, stock, (motion, weights), as_json)
        return
    from ..balancing.conditions import balance_conditions
    from ..balancing.remaining_force import verdict_of
    from ..balancing.sizing import exact_sizing
    from ..dynamics.inverse_dynamics import simulate

    model = options.load_mechanism_option(mechanism, payload)
    trajectory = options.follow_motion(model, motion) if motion else None
    conditions, sites, limits = (
        balance_conditions(model),
        _sites(model, site, without),
        options.distinct(limit, "--limit"),
    )
    groups = [[name.strip() for name in group.split(",")] for group in equal]

    def sized(target: "Objective") -> "Sizing":
        return exact_sizing(conditions, model, sites, limits, target, groups)

    left_out: tuple[str, ...] = ()
    if rig and trajectory:
        from ..balancing.base_vibration import least_vibration, load_measured_base, vibration_objective

        measured = load_measured_base(rig)
        stands = PurePath(measured.mechanism).stem
        if stands not in {"", "none", model.name, PurePath(mechanism).stem}:
            raise click.UsageError(
                f"--rig {rig}: is of mechanism {measured.mechanism!r}, not {mechanism!r}: expected a rig of the "
                "mechanism that is sized"
            )
        left_out = tuple(f"bench.{key}" for key in measured.left_out)
        vibration = vibration_objective(model, trajectory, measured, weights)
        any_mass = least_vibration(conditions, model, sites, vibration, sized)
    else:
        from ..balancing.objective import objective_of

        any_mass = sized(objective_of(model, trajectory, weights))
    sets = [any_mass]
    if stock:
        from ..balancing.base_vibration import VibrationObjective, least_vibration_from_stock
        from ..balancing.sizing import best_sets_from_stock
        from ..balancing.stock_plates import load_stock

        plates = load_stock(stock)

        def from_stock(target: "Objective | None") -> "Sequence[Sizing]":
            return best_sets_from_stock(conditions, model, plates, sites, limits, target, groups, best)

        if isinstance(any_mass.objective, VibrationObjective):
            sets = least_vibration_from_stock(sites, any_mass.objective, from_stock)
        else:
            sets = list(from_stock(any_mass.objective))
    result = replace(sets[0], payload_bodies=options.payload_bodies(model, payload))
    verdict = verdict_of(result, any_mass, _samples(trajectory, model) if set(weights) == {"force"} else None)
    responses = (
        {"before": simulate(model, trajectory), "after": simulate(result.after, trajectory)} if trajectory else {}
    )
    if figure:
        from ..figures.mechanism import draw_mechanism, save

        save(draw_mechanism(result.after, result.counter_masses), figure)
    if as_json:
        emit_json(
            _document(result, verdict, motion, weights, sets)
            | ({"rig": rig, "left_out": list(left_out)} if rig else {})
            | {n: response_summary(r) for n, r in responses.items()}
        )
    else:
        _print_verdict(verdict, result, any_mass if stock else None, motion, weights)
        _print_sizing(result, stock, verdict.attainable)
        _print_sets(sets[1:])
        if len(sets) < best:
            click.echo(
                f"{len(sets)} of {best} sets: there are no others, or plates of so many kinds that one is sought."
            )
        if responses:
            print_responses(responses)
        for key in left_out:
            click.echo(f"The vibration of the base is without {key}, which the rig has.")
    sys.exit(EXIT_WITH_FINDINGS if verdict.has_finding or left_out else 0)


def _weights(texts: Sequence[str], motion: str | None, rig: str | None) -> dict[str, float]:
    """What is made small, with weights."""
    from ..balancing.objective import QUANTITIES

    found: dict[str, float] = {}
    for text in texts:
        name, _, number = text.partition("=")
        try:
            weight = float(number or "1")
        except ValueError:
            weight = -1.0
        if name not in {*QUANTITIES, "vibration"} or name in found or not 0.0 < weight < inf:
            names = ", ".join([*QUANTITIES, "vibration"])
            raise click.UsageError(f"--objective {text!r}: expected {names}, each once, or NAME=WEIGHT")
        found[name] = weight
    if bool(rig) != ("vibration" in found):
        raise click.UsageError("--objective vibration and --rig RIG go together")
    if found and motion is None:
        raise click.UsageError("--objective is of a motion: give --motion")
    return found or {"force": 1.0}


def _samples(trajectory: "Trajectory | None", model: "Mechanism") -> "Callable[[Mechanism], Floats]":
    """The force along a motion, or the momentum over the workspace, of a mechanism."""
    from ..balancing.objective import workspace_momentum
    from ..dynamics.inverse_dynamics import simulate

    if trajectory is not None:
        return lambda one: simulate(one, trajectory).force
    rows = cache(partial(workspace_momentum, model))  # found where something remains
    return lambda one: rows() @ one.pi


def _sites(model: "Mechanism", sites: tuple[str, ...], without: tuple[str, ...]) -> list[str]:
    """Sites that may carry counter-masses."""
    from ..balancing.sizing import chosen_sites

    names = chosen_sites(model, sites)
    for name in without:
        if name not in names:
            raise click.UsageError(f"--without {name!r}: it is none of the sites to be sized, {', '.join(names)}")
    if set(names) <= set(without):
        raise click.UsageError("--without leaves no site to be sized")
    return [name for name in names if name not in without]


def _document(
    result: "Sizing", verdict: "Verdict", motion: str | None, weights: dict[str, float], sets: "Sequence[Sizing]"
) -> dict[str, Any]:
    from ..balancing.sizing import sizing_document

    unit = f"_{result.objective.unit}" if result.objective and motion and len(weights) == 1 else ""
    document: dict[str, Any] = {
        "balanced": verdict.balanced,
        "attainable_with_any_mass": verdict.attainable,
        "objective": {"weights": weights, "over": "workspace" if motion is None else "motion", "motion": motion},
        f"rms_before{unit}": verdict.before,
        f"rms{unit}": verdict.after,
        f"rms_bound{unit}": verdict.least,
        "remaining_percent": result.remaining_percent(),
        "remaining_directions": [
            {"direction": one.direction.tolist(), f"rms_before{unit}": one.before, f"rms{unit}": one.after}
            for one in verdict.directions
        ],
        "sites_needed": [
            {"body": one.body, "alternatives": list(one.alternatives), f"rms{unit}": one.after}
            for one in verdict.needed
        ],
    }
    if len(sets) > 1:
        document["sets"] = [
            {"counter_masses": sizing_document(one)["counter_masses"], "remaining_percent": one.remaining_percent()}
            for one in sets
        ]
    return sizing_document(result) | document


def _print_verdict(
    verdict: "Verdict", result: "Sizing", any_mass: "Sizing | None", motion: str | None, weights: dict[str, float]
) -> None:
    """First whether it balances; then what remains, and what would remove it.

    ``any_mass`` are the best masses of any size, where plates are asked for.
    """
    from ..balancing.objective import MADE_SMALL

    where = "over the workspace" if motion is None else f"in motion {motion}"
    if verdict.balanced:
        click.echo(f"Balanced completely {where}.")
        return
    unit = {"N": "N", "Nm": "N m", "m_per_s2": "m/s2"}.get(result.objective.unit if result.objective else "", "")
    what = "momentum" if motion is None else " and ".join(MADE_SMALL[name] for name in weights)
    sizes = f" ({verdict.after:.4g} {unit} of {verdict.before:.4g} {unit})" if unit else ""
    click.echo(
        f"Not balanced completely: {_share(verdict.after, verdict)} of the RMS {what} remains {where}{sizes}; "
        f"{_proof(verdict, any_mass is not None)}"
    )
    for one in verdict.directions:
        if one.after > 1e-6 * verdict.before:
            along = ", ".join(f"{x:.3g}" for x in one.direction)
            after, before = (f"{x:.4g} {unit}" if unit else _share(x, verdict) for x in (one.after, one.before))
            click.echo(f"  along ({along}): {after}, without counter-masses {before}")
    if any_mass:
        least = "balance it completely" if verdict.attainable else f"leave {per_cent(any_mass.remaining_percent())}"
        click.echo(f"Masses of other sizes at these sites would {least}.")
    for k, site in enumerate(verdict.needed):
        bodies = " or ".join([site.body, *site.alternatives])
        left = f"{_share(site.after, verdict)} would" if site.after else "nothing would"
        start = f"With a site on body {bodies} as well" if k else f"With a site on body {bodies}, at the right place"
        click.echo(f"{start}: {left} remain.")
    if verdict.directions and not verdict.attainable and not verdict.needed:
        click.echo("No counter-mass on any body would lessen it.")


def _share(value: float, verdict: "Verdict") -> str:
    """Part of what is made small without counter-masses."""
    return per_cent(100.0 * value / verdict.before)


def _proof(verdict: "Verdict", stock: bool) -> str:
    """How near the masses are to the best."""
    what = "choice of these plates leaves" if stock else "masses at these sites leave"
    if verdict.least is None:
        return f"no other {what} less nearby, where it is linear in the masses; a bound is not known."
    if verdict.after <= verdict.least * (1.0 + 1e-6):
        return f"no other {what} less."
    return f"not proven to be the least, which is above {_share(verdict.least, verdict)}."


def _print_sets(sets: "Sequence[Sizing]") -> None:
    if sets:
        rows = [
            [str(k), " / ".join(f"{mass(c.mass)}" for c in one.counter_masses), per_cent(one.remaining_percent())]
            for k, one in enumerate(sets, 2)
        ]
        emit_table("Next best sets", ["", "masses [kg]", "remain"], rows)


def _print_sizing(result: "Sizing", stock: str | None, attainable: bool) -> None:
    """Masses by site; the conditions' residual where masses can meet them."""
    rows = [
        [c.site, mass(c.mass), f"{c.position[0] * 1e3:.2f}", f"{c.first_moment[0]:.5f}", " + ".join(c.plates) or "-"]
        for c in result.counter_masses
    ]
    emit_table(
        f"Counter-masses for {result.before.name}" + (f" from {stock}" if stock else ""),
        ["site", "mass [kg]", "x in its body [mm]", "first moment [kg m]", "plates"],
        rows,
    )
    if attainable:
        click.echo(
            f"First-moment residual  {first_moment(result.residual())}  ({per_cent(result.residual_percent())} of that "
            "without counter-masses)"
        )
    for body, value in result.balanced_payloads().items():
        if value is not None:
            click.echo(f"Balanced payload       {body} = {mass(value)} kg")
    click.echo(f"Added                  {result.added_mass:.4f} kg, {result.added_inertia:.5f} kg m2 about the joints")


def _closed_form(mechanism: str, payload: tuple[tuple[str, float], ...], as_json: bool) -> None:
    """Size the manipulator by the published formula from the published inputs."""
    from ..balancing import closed_forms

    if mechanism != "parallelogram-6bar" or [name for name, _ in payload] != ["platform"]:
        raise click.UsageError("--closed-form is for parallelogram-6bar with --payload platform=M")
    published = closed_forms.published_sizing()
    m1, p1, m2, p2, r, p_cm = (published[key] for key in ("m1_kg", "p1_m", "m2_kg", "p2_m", "r_m", "p_cm_m"))
    first = closed_forms.manipulator_first_moment(m1, p1, m2, p2, r, payload[0][1])
    counter = closed_forms.manipulator_counter_mass(first, p_cm)
    if as_json:
        sites = [
            {"site": site, "mass_kg": counter, "position_m": [p_cm, 0.0, 0.0],
             "first_moment_kgm": [counter * p_cm, 0.0, 0.0], "plates": []}
            for site in ("counter_A0A", "counter_B0B")
        ]  # fmt: skip
        emit_json(
            {
                "mechanism": mechanism,
                "method": "closed form, printed",
                "counter_masses": sites,
                "residual_first_moment_kgm": None,
                "residual_percent": None,
                "balanced_payload_kg": dict(payload),
                "added_mass_kg": 2 * counter,
                "added_inertia_kgm2": None,
            }
        )
        return
    click.echo(
        f"{mass(counter)} kg on each arm at {p_cm * 1e3:.2f} mm, by the published closed form "
        "m_cm p_cm = -(m1 p1 + (m2 + m5) r + m2 p2); no model was evaluated."
    )
