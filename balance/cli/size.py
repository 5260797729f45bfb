"""``balance size``: counter-masses for one payload, or sets that only grow for several payloads of one body."""

import sys
from collections.abc import Sequence
from math import inf
from typing import TYPE_CHECKING

import click

from ..results import per_cent_text, table
from . import options
from .framework import EXIT_WITH_FINDINGS, emit_json, emit_table, first_moment, json_option, mass, note, say
from .options import print_responses, response_summary

if TYPE_CHECKING:
    from ..balancing import Sizing
    from ..balancing.sizing_study import SizingStudy
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
@options.limit_option
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
    from ..front_door import size as sized

    model = options.load_mechanism_option(mechanism, payload)
    found = sized(
        model, motion, stock, sites=_sites(model, site, without), limits=options.distinct(limit, "--limit"),
        equal=[[name.strip() for name in group.split(",")] for group in equal], objective=weights, rig=rig, best=best,
        payload_bodies=options.payload_bodies(model, payload),
    )  # fmt: skip
    options.draw(figure, found.plot)
    if as_json:
        emit_json(found.document() | {n: response_summary(r) for n, r in found.responses.items()})
    else:
        _print(found, best)
    sys.exit(EXIT_WITH_FINDINGS if found.has_finding else 0)


def _print(found: "SizingStudy", best: int) -> None:
    """The verdict, the masses by site, the motion before and after; with --all the conditions' residual."""
    from ..balancing.sizing import CounterMass

    say(str(found))
    title = f"Counter-masses for {found.before.name}" + (f" from {found.stock}" if found.stock else "")
    of_table = ("site", "mass", "position", "first_moment", "plates")
    emit_table(title, *table(CounterMass, found.counter_masses, *of_table[: None if found.stock else -1]))
    if found.responses:
        print_responses(found.responses)
    _print_sets(found.sets[1:])
    if len(found.sets) < best:
        say(f"{len(found.sets)} of {best} sets: there are no others, or plates of so many kinds that one is sought.")
    for key in found.left_out:
        say(f"The vibration of the base is without {key}, which the rig has.")
    result = found.best
    if found.verdict.attainable:
        note(
            f"First-moment residual: {first_moment(result.residual())} ({per_cent_text(result.residual_percent())} of "
            "that without counter-masses)."
        )
    for body, value in result.balanced_payloads().items():
        if value is not None:
            say(f"They balance {body} = {mass(value)} kg.")
    note(f"Added: {result.added_mass:.4f} kg, {result.added_inertia:.5f} kg m2 about the joints.")


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


def _print_sets(sets: "Sequence[Sizing]") -> None:
    if sets:
        rows = [
            [str(k), " / ".join(f"{mass(c.mass)}" for c in one.counter_masses), per_cent_text(one.remaining_percent())]
            for k, one in enumerate(sets, 2)
        ]
        emit_table("Next best sets", ["", "masses [kg]", "remain"], rows)


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
