"""``balance engine``: shaking forces of slider-cranks and engines, and what balances them."""

from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..results import NO_VALUE
from . import options
from .framework import FILE, Answer, Quantity, argument, command, option
from .options import SPEED
from .printing import Detail, cells, emit_table, say

if TYPE_CHECKING:
    from ..engines.engine import Engine
    from ..engines.free_forces import FreeForces, ResidualOverTurn

_BUILT_ORDERS = 2
"""Highest order whose balance shafts are shown: those of higher orders are not built."""
_LEAST_SHAFT = 1e-4
"""Force of a balance shaft, in that of the greatest, from which it is shown."""
_CASES = {
    "counterweight": "name", "m_b r_b [kg mm]": "kgmm:.5g", "m_b [kg]": "counterweight_mass_kg:.5g",
    "r_b [mm]": "counterweight_radius_mm:.5g", "F max [N]": "F_max_N:.5g", "F RMS [N]": "F_rms_N:.5g",
}  # fmt: skip
_ENGINES = {
    "engine": "engine", "F1": "F1_mrw2:.4g", "F1*": "F1_with_counterweights_mrw2:.4g", "M1": "M1_mrw2a:.4g",
    "M1*": "M1_with_counterweights_mrw2a:.4g", "F2": "F2_mrw2:.4g", "M2": "M2_mrw2a:.4g", "fires": "fires",
    "intervals": "intervals",
}  # fmt: skip


@click.group()
def engine() -> None:
    """Shaking forces and moments of slider-cranks and engines, and what balances them."""


@command(
    group=engine,
    short_help="One slider-crank: rod as point masses, shaking force exact and by orders, partial balance.",
    epilog="""\b
Examples:
  balance engine single single
  balance engine single single --speed 3000rpm --fraction 0.6 --radius 60mm --figure polar.png""",
    file=("engine", "in-line-4"),
)
def single(
    engine: str = argument("ENGINE"),
    speed: float | None = SPEED,
    fractions: tuple[float, ...] = option(
        "Balance this fraction of the reciprocating mass too.", click.FloatRange(-1e3, 1e3), "--fraction"
    ),
    radius: float | None = option("Choose r_b: the mass follows.", options.LENGTH, metavar="R"),
    mass: float | None = option("Choose m_b: the radius follows.", options.MASS, metavar="M"),
    figure: str | None = options.FIGURE,
) -> Answer:
    """The slider-crank of ENGINE, a file (TOML) or a shipped one: rod, shaking force, partial balance.

    x is along the cylinder's axis away from the crank, y a quarter turn on, where the crank pin goes from top dead
    centre and where a positive offset of the cylinder's axis is; the force is what the machine exerts on its
    base, weight excluded. Fraction: of the reciprocating mass, balanced on the crank together with all that rotates.
    """
    from ..engines import slider_crank
    from ..engines.engine_files import load_engine
    from ..engines.results import cylinder_document

    if radius is not None and mass is not None:
        raise click.UsageError("give either --radius or --mass: m_b r_b is fixed")
    model = load_engine(engine)
    if model.normalised:
        raise click.UsageError(f"{model.name} is a layout without sizes: its file needs [slider_crank]")
    if any(isnan(fraction) for fraction in fractions):
        raise click.UsageError("--fraction: expected a number")
    omega = speed if speed is not None else model.speed
    if omega is None:
        raise click.UsageError("the forces need --speed (or speed in the file)")
    crank = model.cylinders[0].crank
    best = slider_crank.best_fraction(crank)
    cases: dict[str, float] = {"unbalanced": 0.0, "rotating only": crank.rotating_unbalance}
    named = {"1/2": 0.5, "2/3": 2 / 3, "best": best.fraction} | {f"{f:g}": f for f in fractions}
    cases |= {name: slider_crank.counterweight(crank, fraction) for name, fraction in named.items()}
    options.draw(figure, "balance.figures.rotating:draw_polar", crank, cases, omega)
    document = cylinder_document(model, cases, omega, radius, mass)
    one = f", one of its {document['cylinders']} cylinders" if document["cylinders"] > 1 else ""
    largest, least = (document["cases"][name]["exact"] for name in ("unbalanced", "best"))

    def show() -> None:
        say(
            f"{model.name}{one}: largest shaking force {largest['F_max_N']:.5g} N unbalanced, {least['F_max_N']:.5g} N "
            f"at least, with fraction {best.fraction:.6f} of the reciprocating mass balanced on the crank."
        )
        rows = [
            {"name": name, "kgmm": 1e3 * case["counterweight_kgm"], **case, **case["exact"]}
            for name, case in document["cases"].items()
        ]
        emit_table(f"Shaking force of {model.name}{one}", *cells(rows, _CASES))
        if own := ", ".join(weight.name for weight in model.counterweights):
            say(f"The file's own counterweights ({own}) are not included here: see balance engine free.")

    further = ("", "cases", "rod", "best_fraction")
    return Answer(document, show, findings=document["findings"], further=further)


@command(
    group=engine,
    short_help="Free forces and moments of an engine by orders, place of the resultant, balance shafts, firing.",
    epilog="""\b
Examples:
  balance engine free in-line-4
  balance engine free v8-90-crossplane --ratio 0.3 --figure orders.png
  balance engine free v4-72-offset --orders 6 --json""",
    file=("engine", "in-line-4"),
)
def free(
    engine: str = argument("ENGINE"),
    speed: float | None = SPEED,
    ratio: float | None = option("Crank radius over rod length, of an engine without sizes [default: 0.25]."),
    orders: int = option("Highest order of the exact motion.", click.IntRange(1, 64), default=8),
    second_order: bool = option("By the usual approximation, of first and second order alone."),
    about: float | None = option(
        "Place along the crankshaft that moments are about; without sizes 1 m is a spacing [default: the middle].",
        Quantity("length"),
        metavar="Z",
    ),
    figure: str | None = options.FIGURE,
) -> Answer:
    """Free forces and moments of ENGINE, a file (TOML) or a shipped one, by orders of its crankshaft's speed.

    Forward is the part that turns with the crankshaft: at first order its counterweights remove it, other parts are
    removed by balance shafts, which --all lists with their unbalances (angles in the crankshaft's sense). The force of
    an order swings between the half-axes of an ellipse. Moments are force times distance along the crankshaft, in the
    direction of the force.
    """
    from ..engines.engine_files import DEFAULT_RATIO, load_engine
    from ..engines.free_forces import balance_shafts, free_forces, residual_over_turn
    from ..engines.results import engine_document

    model = load_engine(engine, DEFAULT_RATIO if ratio is None else ratio)
    if model.normalised and speed is not None:
        raise click.UsageError(f"--speed: {model.name} has no sizes, so its forces are in m r omega^2 at any speed")
    if not model.normalised and ratio is not None:
        raise click.UsageError(f"--ratio: {model.name} has sizes, r / l = {model.cylinders[0].crank.ratio:.5g}")
    omega = 1.0 if model.normalised else speed if speed is not None else model.speed
    if omega is None:
        raise click.UsageError("the forces need --speed (or speed in the file)")
    by_order = free_forces(model, orders, "second-order" if second_order else "exact", about)
    places = [c.at for c in model.cylinders]
    shafts = balance_shafts(by_order, min(places), max(places))
    built = [shaft for shaft in shafts if shaft.order <= _BUILT_ORDERS]
    residual = residual_over_turn(model, built, omega, by_order[0].about)
    units = ("m r omega^2", "m r omega^2 a") if model.normalised else ("N", "N m")
    drawn = (by_order, model.name, omega**2, units, residual)
    options.draw(figure, "balance.figures.rotating:draw_orders", *drawn)
    document = engine_document(model, by_order, shafts, residual, omega)

    def show() -> None:
        _print_free(model, by_order, omega, units, residual)
        if Detail.everything:
            _print_shafts(document["balance_shafts"], model.normalised)

    return Answer(document, show, further=("", "textbook_sums", "over_a_turn_exact", "left_over_a_turn", "firing"))


def _print_free(
    engine: "Engine", free: "list[FreeForces]", omega: float, units: tuple[str, str], residual: "ResidualOverTurn"
) -> None:
    from ..engines.engine import firing
    from ..engines.free_forces import STAGES

    factor, length = (1.0, "a") if engine.normalised else (1e3, "mm")
    sizes = []
    for kind, unit in zip(("force", "moment"), units, strict=True):
        worst = max(free, key=lambda f: float(getattr(f, kind).largest))
        if largest := getattr(worst, kind).largest:
            sizes.append(f"{kind} of order {worst.force.order}, {omega**2 * largest:.5g} {unit}")
    known = f"largest free {' and free '.join(sizes)}" if sizes else "every order computed is balanced"
    say(f"{engine.name}: {known}{'' if engine.normalised else f', at {omega:.5g} rad/s'}.")
    rows = []
    for f in free:
        if f.force.largest or f.moment.largest:
            values = [v for part in (f.force, f.moment) for v in (part.largest, abs(part.forward), abs(part.backward))]

            sizes = [f"{omega**2 * v:.5g}" for v in values]
            rows.append([str(f.force.order), *sizes, NO_VALUE if f.place is None else f"{factor * f.place:.5g}"])
    parts = ("forward", "backward")
    header = ["order", f"force [{units[0]}]", *parts, f"moment [{units[1]}]", *parts, f"place [{length}]"]
    remark = f"moments about {factor * free[0].about:.5g} {length}; forward turns with the crankshaft"
    if rows:
        emit_table(f"Free forces and moments of {engine.name}", header, rows, remark)
    for kind, unit in zip(("force", "moment"), units, strict=True):
        sizes = [f"{getattr(residual.stages[stage], f'largest_{kind}'):.5g}" for stage in STAGES]
        if len(set(sizes)) > 1:
            each = ", ".join(f"{size} {words}" for size, words in zip(sizes, STAGES.values(), strict=True))
            say(f"Largest {kind} over a turn [{unit}]: {each}.")
    fired = firing(engine)
    say(
        f"Fires {'-'.join(map(str, fired.order))}, {engine.strokes}-stroke, at intervals of "
        f"{', '.join(f'{i:g}' for i in fired.intervals_deg)} deg: {'even' if fired.even else 'uneven'}."
    )


def _print_shafts(shafts: list[dict[str, Any]], normalised: bool) -> None:
    """An unbalance a row, of those whose force counts."""
    (at, length), (size, unit), scale = (("at_a", "a"), ("magnitude_mr", "m r"), 1.0) if normalised else (
        ("at_m", "mm"), ("magnitude_kgm", "kg mm"), 1e3
    )  # fmt: skip
    found = [(shaft, u, shaft["order"] ** 2 * u[size]) for shaft in shafts for u in shaft["unbalances"]]
    least = _LEAST_SHAFT * max((force for *_, force in found), default=0.0)
    rows = [
        [
            str(shaft["order"]),
            "on the crankshaft" if shaft["is_crankshaft"] else shaft["turns"],
            f"{scale * u[at]:.5g}",
            f"{scale * u[size]:.5g}",
            f"{round(u['angle_deg'], 2) % 360.0:g}",
        ]
        for shaft, u, force in found
        if force > least
    ]
    if rows:
        note = f"Left out: unbalances with {_LEAST_SHAFT:.2g} of the greatest force, or less; --json has all."
        header = ["order", "turns", f"at [{length}]", f"unbalance [{unit}]", "angle [deg]"]
        emit_table("Balance shafts", header, rows, note)


@command(
    group=engine,
    short_help="The common engines side by side.",
    epilog="""\b
Examples:
  balance engine table
  balance engine table --ratio 0.3 --json
  balance engine table own.toml in-line-4""",
)
def table(
    engines: tuple[str, ...] = argument("[ENGINE]..."),
    ratio: float = option("Crank radius over rod length, of all engines.", default=0.25),
) -> Answer:
    """The common engines side by side: first and second order forces and moments, and the residual with counterweights.

    Forces in m r omega^2, moments in m r omega^2 a, with m the reciprocating mass of one cylinder, a the spacing;
    rotating masses balanced, second order with its exact coefficient.
    """
    from .. import datasets
    from ..engines.engine_files import load_engine, load_layout
    from ..engines.results import comparison_row

    shipped = datasets.dataset_names("engines", ".toml")
    names = list(engines) or [name for name in shipped if load_engine(name).normalised]
    rows = [comparison_row(load_layout(name, ratio)) for name in names]
    balanced = [
        row["engine"] for row in rows if max(row["F1_mrw2"], row["M1_mrw2a"], row["F2_mrw2"], row["M2_mrw2a"]) < 1e-9
    ]

    def show() -> None:
        names = ", ".join(balanced) or "none"
        say(f"Of {len(rows)} engines without free forces and moments of orders 1 and 2: {names}.")
        shown = []
        for row in rows:
            fires = "-".join(map(str, row["firing_order"]))
            intervals = " ".join(f"{i:g}" for i in row["firing_intervals_deg"])
            shown.append({**row, "fires": fires, "intervals": "even" if row["firing_even"] else intervals})
        remark = (
            f"Forces in m r omega^2, moments about the middle in m r omega^2 a; r / l = {ratio:g}. *: with the best "
            "counterweights on the crankshaft, which remove what turns with it; the residual needs balance shafts."
        )
        emit_table("Engines", *cells(shown, _ENGINES), remark)

    return Answer({"ratio_r_over_l": ratio, "engines": rows}, show)


@command(
    group=engine,
    short_help="Write an engine as a mechanism file (MJCF).",
    epilog="""\b
Examples:
  balance engine mechanism v4-72-offset -o v4.xml
  balance conditions v4.xml""",
)
def mechanism(
    engine: str = argument("ENGINE"),
    output: str | None = option("Write here [default: stdout].", FILE, "-o", "--output", metavar="FILE"),
) -> None:
    """Write ENGINE, a file with sizes, as a mechanism file (MJCF) for the other commands, Pinocchio and MuJoCo."""
    from ..engines.engine_files import load_engine, mjcf

    text = mjcf(load_engine(engine))
    if output is None:
        click.echo(text, nl=False)
    else:
        Path(output).write_text(text, encoding="utf-8")
