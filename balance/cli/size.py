"""``balance size``: counter-masses for one payload, or for several payloads of one body."""

from collections.abc import Sequence
from math import inf
from typing import TYPE_CHECKING, Any

import click

from ..results import along_axes, counted, per_cent_text, plain, table
from . import options
from .framework import Answer, command, option
from .options import print_responses, response_summary
from .printing import Detail, emit_table, mass, say

if TYPE_CHECKING:
    from ..balancing.nested_sizing import NestedSizing
    from ..balancing.sizing_study import SizingStudy
    from ..mechanism.mechanism import Mechanism

STOCK = option("Make them from these plates: a CSV file, or kiper2019.", metavar="CSV")
WITHOUT = option("A site that gets no counter-mass.", metavar="SITE")
EQUAL = option("Sites that get equal masses.", metavar="SITE,SITE")
OBJECTIVE = option(
    "What is made small: force, moment or torque (of the drives that turn) of the motion; of several the sum of "
    "weight times (RMS / RMS without)^2; vibration too, with --rig [default: force].",
    metavar="NAME=WEIGHT",
)
FIXED = option("One set for all payloads, which the machine carries in turn, instead of sets that only grow.")
RIG = option("A rig's file, or a shipped one: the base whose vibration is made small.", metavar="RIG")


@command(
    epilog="""\b
Examples:
  balance size parallelogram-6bar --payload platform=5kg
  balance size parallelogram-6bar --payload platform=3.4116kg --stock kiper2019
  balance size four-bar --motion four-bar --site counter_A0A --limit counter_A0A=2kg
  balance size four-bar --motion four-bar --added 1.2kg
  balance size five-bar --motion five-bar --objective force --objective torque=2 --json
  balance size parallelogram-6bar -p platform=5kg --motion x --objective vibration --rig parallelogram-6bar
  balance size parallelogram-6bar -p platform=1.451kg -p platform=3.4116kg -p platform=5kg --stock kiper2019
  balance size parallelogram-6bar -p platform=1.451kg -p platform=5kg --fixed --limit counter_A0A=15kg

\b
Vibration: of the base on its mounts as the rig has it, the mechanism locked as the motion starts; RMS of the sum of
squares of what the accelerometers on the base measure. The masses that are found are the least of all nearby.

\b
Least is the mean square of the shaking force vector, weight excluded: over the motion given, all samples of a file
or 10 kHz alike; without a motion, of the momentum per root of kinetic energy over the workspace. Of equals the
lightest. Several payloads of one body: sets that only grow with the payload, or with --fixed one set for all, least
in the sum over the payloads; limits and equal masses hold for each set.

\b
Exit code 3: no masses at these sites balance it completely, or plates leave more than 5 % where other masses would.""",
    file=("stock", "stock/kiper2019"),
)
def size(
    mechanism: str = options.MECHANISM,
    payload: options.Pairs = options.PAYLOADS_OF_ONE_BODY,
    site: tuple[str, ...] = options.SITES,
    without: tuple[str, ...] = WITHOUT,
    stock: str | None = STOCK,
    limit: options.Masses = options.LIMITS,
    added: float | None = options.ADDED,
    equal: tuple[str, ...] = EQUAL,
    best: int = option("Sets from stock to list.", click.IntRange(1, 100), default=1),
    motion: str | None = option("The motion whose force is made small, and compared before and after.", metavar="TOML"),
    objective: tuple[str, ...] = OBJECTIVE,
    rig: str | None = RIG,
    fixed: bool = FIXED,
    closed_form: bool = option("parallelogram-6bar by its published formula, without Pinocchio."),
    figure: str | None = options.FIGURE,
) -> Answer:
    """Size the counter-masses that balance MECH, or leave the least shaking force: of any mass, or from stock plates.

    The first line states whether it balances, or what remains; a table where further sites would help. Force balance
    alone raises the shaking moment and the drive torque: --motion shows by how much.
    """
    from ..balancing.nested_sizing import NestedSizing

    if best > 1 and not stock:
        raise click.UsageError("--best lists sets of plates: give --stock; of any mass one set is the best")
    if closed_form:
        others = (site, without, stock, limit, equal, motion, objective, rig, figure, fixed)
        if any(others) or added is not None:
            raise click.UsageError("--closed-form reads no model: give only --payload and --json with it")
        return _closed_form(mechanism, payload)
    payloads = growing(payload)
    if len(payloads) > 1 and (best > 1 or figure):
        raise click.UsageError("--best and --figure are for one payload of a body")
    found = sized(mechanism, payloads, motion, stock, site, without, limit, added, equal, objective, rig, fixed, best)
    if isinstance(found, NestedSizing):
        published = _published(found) if found.stock == "kiper2019" and not (site or limit or equal or fixed) else {}
        return Answer(found.document() | published, lambda: _print_nested(found, published), found.has_finding)
    options.draw(figure, found.plot)
    document = found.document() | {n: response_summary(r) for n, r in found.responses.items()}
    at_sites = [
        f"{name} = {mass(value)} kg" for name, value in payloads[0].items() if name not in found.before.own_mass
    ]
    beside = f", with {', '.join(at_sites)}" if at_sites else ""
    return Answer(document, lambda: _print(found, best, beside), found.has_finding, further=("", "objective"))


def sized(
    mechanism: str,
    payloads: Sequence[options.Masses],
    motion: str | None,
    stock: str | None,
    site: tuple[str, ...],
    without: tuple[str, ...],
    limit: options.Masses,
    added: float | None,
    equal: tuple[str, ...],
    objective: tuple[str, ...],
    rig: str | None,
    fixed: bool,
    best: int = 1,
    given: options.Masses | None = None,
) -> "SizingStudy | NestedSizing":
    """Counter-masses for one payload, or for several which rise, by the options of a command; or those ``given``."""
    from ..front_door import load, size, size_nested

    if len(payloads) > 1 and rig:
        raise click.UsageError("--rig is for one payload of a body")
    if len(payloads) == 1 and fixed:
        raise click.UsageError("--fixed is for several payloads of one body: give --payload again, one for each")
    models = [options.load_mechanism_option(mechanism, payload) for payload in payloads]
    asked: dict[str, Any] = {
        "stock": stock, "sites": () if given else _sites(models[0], site, without), "limits": limit, "added": added,
        "equal": _groups(equal), "objective": _weights(objective, motion, rig), "given": given,
    }  # fmt: skip
    if len(payloads) > 1:  # of the mechanism as filed: a payload at a site is added to what is there
        return size_nested(load(mechanism), payloads, motion, fixed=fixed, **asked)
    bodies = options.payload_bodies(models[0], payloads[0])
    return size(models[0], motion, rig=rig, best=best, payload_bodies=bodies, **asked)


def _print(found: "SizingStudy", best: int, beside: str) -> None:
    """The verdict, the masses by site, the motion before and after; what sites lack; with --all the rest."""
    from ..balancing.sizing import BodyMoment, CounterMass
    from ..balancing.sizing_study import REACHES

    say(str(found))
    title = f"Counter-masses for {found.before.name}" + (f" from {found.stock}" if found.stock else "")
    of_table = ("site", "mass", "position", "first_moment", "plates")
    emit_table(title, *table(CounterMass, found.counter_masses, *of_table[: None if found.stock else -1]))
    rows = []
    for one in (one for equals in found.verdict.needed for one in equals):
        others = " / ".join(mass(at.mass) for at in one.counter_masses[: len(found.counter_masses)])
        remain = "nothing" if one.is_complete() else per_cent_text(one.remaining_percent())
        for body, at in found.further(one):
            rows.append([body, mass(at.mass), along_axes(1e3 * at.position, 9), others, remain])
            others = remain = ""
    if rows:
        note = (
            "Each with its masses by site is a design by itself, the lightest there; farther out less mass may do. "
            "Places are in the frame of the body as in its file. "
            f"They are sought up to {REACHES[-1]:g} times as far from a body's joint as its own points."
        )
        header = ["body", "mass [kg]", "in body [mm]", "by site as above [kg]", "remain"]
        emit_table("Further sites", header, rows, note)
    if (Detail.everything or not found.verdict.attainable) and (moments := found.best.first_moments()):
        note = (
            "Missing once the masses above are mounted, which count on the bodies that carry them, too; balance "
            "conditions counts none. The least, all together; other shares that meet the conditions do as well. About "
            "the body's joint, along the body's axes as in its file."
        )
        emit_table("First moments of the bodies", *table(BodyMoment, moments, "body", "given", "missing"), note)
    if found.responses:
        print_responses(found.responses)
    if len(found.sets) > 1:
        rows = []
        for k, one in enumerate(found.sets[1:], 2):
            made = [f"{mass(c.mass)} = {counted(c.plates)}" if c.plates else mass(c.mass) for c in one.counter_masses]
            rows.append([str(k), " / ".join(made), per_cent_text(one.remaining_percent())])
        emit_table("Next best sets", ["", "masses [kg] = plates, by site as above", "remain"], rows)
    if len(found.sets) < best:
        say(f"{len(found.sets)} of {best} sets: there are no others, or plates of so many kinds that one is sought.")
    for key in found.left_out:
        say(f"The vibration of the base is without {key}, which the rig has.")
    options.tell_idle(found.best.conditions.idle)
    for body, value in found.best.balanced_payloads().items():
        if value is not None:
            say(f"They balance {body} = {mass(value)} kg, its own mass included{beside}.")


def growing(pairs: options.Pairs) -> list[options.Masses]:
    """Payloads in rising order of the one body that is named more than once, each with those of all other bodies."""
    names = [name for name, _ in pairs]
    again = sorted({name for name in names if names.count(name) > 1})
    if not again:
        return [dict(pairs)]
    if len(again) > 1:
        raise click.UsageError(
            f"--payload names {' and '.join(again)} more than once: give several payloads of one body only"
        )
    rest = {name: mass for name, mass in pairs if name != again[0]}
    masses = sorted(mass for name, mass in pairs if name == again[0])
    if len(set(masses)) < len(masses):
        raise click.UsageError(f"--payload names the same mass of {again[0]!r} twice")
    return [{**rest, again[0]: mass} for mass in masses]


def _groups(equal: tuple[str, ...]) -> list[list[str]]:
    """Groups of sites of equal masses."""
    return [[name.strip() for name in group.split(",")] for group in equal]


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


def _closed_form(mechanism: str, payload: options.Pairs) -> Answer:
    """Size the manipulator by the published formula from the published inputs."""
    from ..balancing import closed_forms

    if mechanism != "parallelogram-6bar" or [name for name, _ in payload] != ["platform"]:
        raise click.UsageError("--closed-form is for parallelogram-6bar with --payload platform=M")
    published = closed_forms.published_sizing()
    m1, p1, m2, p2, r, p_cm = (published[key] for key in ("m1_kg", "p1_m", "m2_kg", "p2_m", "r_m", "p_cm_m"))
    first = closed_forms.manipulator_first_moment(m1, p1, m2, p2, r, payload[0][1])
    counter = closed_forms.manipulator_counter_mass(first, p_cm)
    sites = [
        {"site": site, "mass_kg": counter, "position_m": [p_cm, 0.0, 0.0],
         "first_moment_kgm": [counter * p_cm, 0.0, 0.0], "plates": []}
        for site in ("counter_A0A", "counter_B0B")
    ]  # fmt: skip
    document = {
        "mechanism": mechanism,
        "method": "closed form, printed",
        "counter_masses": sites,
        "residual_first_moment_kgm": None,
        "residual_percent": None,
        "balanced_payload_kg": dict(payload),
        "added_mass_kg": 2 * counter,
        "added_inertia_kgm2": None,
    }
    text = (
        f"{mass(counter)} kg on each arm at {p_cm * 1e3:.2f} mm, by the published closed form "
        "m_cm p_cm = -(m1 p1 + (m2 + m5) r + m2 p2); no model was evaluated."
    )
    return Answer(document, lambda: say(text))


def _published(nested: "NestedSizing") -> dict[str, Any]:
    """Sets that the source built, for the source's manipulator with its payloads; else empty."""
    models, payloads = [one.before for one in nested.sets], nested.payloads
    if not models[0].name.startswith("parallelogram-6bar") or any(list(one) != ["platform"] for one in payloads):
        return {}
    from ..balancing import closed_forms
    from ..balancing.conditions import balance_conditions

    sets = plain(closed_forms.built_sets(balance_conditions(models[0]), models, [one["platform"] for one in payloads]))
    increments = list(closed_forms.published_sizing()["nested_increments_kg"].values())
    return {"published": {"sets": sets, "increments_kg": increments}} if sets else {}


def _print_nested(nested: "NestedSizing", published: dict[str, Any]) -> None:
    """The verdict, the masses by payload and site, what each leaves; what the source built."""
    from ..balancing.nested_sizing import PayloadMass, PayloadRemainder

    say(str(nested))
    kind = "one set for all payloads" if nested.fixed else "sets that only grow"
    of = f" from {nested.stock}" if nested.stock else ""
    columns = ["site", "mass", "position", "plates"]
    columns = columns if nested.fixed else ["payload", "site", "mass", "added", *columns[2:]]
    rows = nested.counter_masses[: len(nested.sets[0].counter_masses) if nested.fixed else None]
    shown = table(PayloadMass, rows, *columns[: None if nested.stock else -1])
    emit_table(f"Counter-masses for {nested.sets[0].before.name}{of}, {kind}", *shown)
    unit = {"N": "N", "Nm": "N m"}.get(nested.unit, "")
    remain = table(PayloadRemainder, nested.remainders, *("payload", "before", "after", "percent")[:: 1 if unit else 3])
    emit_table(f"RMS {nested.made_small} with each payload" + (f" [{unit}]" if unit else ""), *remain)
    for line in nested.below():
        say(line)
    if source := published.get("published"):
        say("Built by the source, and its residual:")
        for found in source["sets"]:
            plates = f"{' + '.join(found['plates'])} = {mass(found['mass_kg'])} kg"
            say(f"  {mass(found['payload_kg'])} kg  {plates}  {found['residual_first_moment_kgm']:.4g} kg m")
        increments = " and ".join(f"{value:g}" for value in source["increments_kg"])
        masses = "differences of its published counter-masses, not of plates"
        say(f"Its published increments, {increments} kg, are {masses}.")
