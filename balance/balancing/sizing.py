"""Counter-masses that leave the least shaking force: of any mass within limits, and from stock plates.

What is made small is an ``Objective``: without one, the momentum over the workspace.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from ..arrays import Floats, Indices
from ..closure import Closure
from ..errors import SizingError
from ..mechanism.mechanism import Mechanism, inertia_matrix
from ..results import IN_BODY, Key, Shown, along_axes, counted, plain
from .conditions import Conditions
from .least_masses import distribute_within
from .objective import Exact, Objective, unit_masses

if TYPE_CHECKING:
    from .stock_plates import Plate
    from .stock_search import StockOptimum

COMPLETE = 1e-6
"""Share of the root mean square without counter-masses up to which a mechanism counts as balanced completely."""
BALANCES = 0.01
"""Residual, relative to what bodies lack of the payload alone, up to which a payload counts as balanced."""


@dataclass(frozen=True)
class CounterMass:
    """A counter-mass at a site.

    >>> import balance
    >>> counter = balance.size("four-bar").counter_masses[0]
    >>> counter.site, round(counter.mass, 3)
    ('counter_A0A', 1.074)
    """

    site: Annotated[str, Key("", "site")]
    mass: Annotated[float, Key("mass_kg", "mass [kg]", ".4f")]
    """[kg]"""
    position: Annotated[Floats, IN_BODY]
    """Of the site, in the frame of its body as in the file, (3,) [m]."""
    plates: Annotated[tuple[str, ...], Key("", "plates", counted)] = ()
    """Stock plates that it is made of."""
    inertia: float | None = None
    """About the axis through its own centre, normal to its plates, from the plates as drawn [kg m2].

    None where no plate is drawn: then the site's radius of gyration holds.
    """
    from_joint: Floats | None = None
    """From the body's joint to the site, along the body's axes, (3,) [m]; None where that is ``position``."""

    @property
    def first_moment(self) -> Annotated[Floats, Key("first_moment_kgm", "moment [kg m]", along_axes)]:
        """First moment of mass about the body's joint, along the body's axes as in the file, (3,) [kg m]."""
        return self.mass * (self.position if self.from_joint is None else self.from_joint)


@dataclass(frozen=True)
class BodyMoment:
    """First moment of mass about its joint that a body has of counter-masses, and lacks with them, along its own axes.

    >>> import balance
    >>> one = balance.check("four-bar", {"counter_A0A": "1 kg"}).first_moments()[0]
    >>> one.body, one.given[0], one.missing[0].round(4)
    ('A0A', -0.05, -0.0037)
    """

    body: Annotated[str, Key("", "body")]
    given: Annotated[Floats, Key("given_kgm", "sites give [kg m]", along_axes)]
    """What the counter-masses at its sites give, (3,) [kg m]."""
    missing: Annotated[Floats, Key("missing_kgm", "missing [kg m]", along_axes)]
    """What is to be added to the mechanism with all counter-masses, whose masses count on other bodies, too, on all
    bodies together: see ``Conditions.required_first_moments``, (3,) [kg m]."""


def body_moments(
    conditions: Conditions, mechanism: Mechanism, counter_masses: Sequence[CounterMass] = ()
) -> list[BodyMoment]:
    """What each body of ``mechanism``, with its ``counter_masses``, is given and misses; none where both are zero."""
    given = np.zeros((len(mechanism.bodies), 3))
    for one in counter_masses:
        site = mechanism.site(one.site)
        given[site.body] += one.mass * site.position
    carrying = list(dict.fromkeys(mechanism.bodies[mechanism.site(one.site).body] for one in counter_masses))
    missing = conditions.required_first_moments(mechanism, carrying)
    every = zip(mechanism.bodies, given, missing, strict=True)
    return [BodyMoment(body, has, lacks) for body, has, lacks in every if has.any() or lacks.any()]


@dataclass(frozen=True)
class Sizing(Shown, rows="counter_masses", figure="balance.figures.mechanism:draw_sizing"):
    """Counter-masses for a mechanism, and their residual.

    >>> import balance
    >>> balance.check("four-bar", {"counter_A0A": "1 kg"}).is_complete()
    False
    """

    conditions: Conditions
    before: Mechanism
    """The mechanism without counter-masses."""
    counter_masses: tuple[CounterMass, ...]
    payload_bodies: tuple[str, ...] = field(default=())
    objective: Objective | None = None
    """What they make small; None for masses that were given."""
    bound: float | None = None
    """What no masses that are allowed can make the objective less than [square of its unit]."""

    def root_mean_squares(self) -> tuple[float, float]:
        """Root of the objective without and with the counter-masses [its unit]."""
        objective = self.objective or self.conditions.objective
        return objective.value(self.before) ** 0.5, objective.value(self.after) ** 0.5

    def is_complete(self) -> bool:
        """Whether nothing is left of what they make small, to rounding."""
        before, after = self.root_mean_squares()
        return after <= COMPLETE * before

    def remaining_percent(self) -> float | None:
        """Root mean square that is left, in per cent of that without counter-masses; None where that is zero."""
        before, after = self.root_mean_squares()
        return 100.0 * after / before if before > 0.0 else None

    @property
    def after(self) -> Mechanism:
        """The mechanism with the counter-masses mounted, each with its own inertia."""
        return self._as_made.with_counter_mass({c.site: c.mass for c in self.counter_masses})

    @property
    def _as_made(self) -> Mechanism:
        """Without counter-masses, its sites with the radii of gyration of the plates that go there."""
        drawn = {}
        for one in self.counter_masses:
            if one.inertia is not None and one.mass > 0.0:
                radius = (one.inertia / one.mass) ** 0.5
                drawn[one.site] = replace(self.before.site(one.site), radius_of_gyration=radius)
        return replace(self.before, sites={**self.before.sites, **drawn}) if drawn else self.before

    def residual(self) -> float:
        """First-moment residual: largest first moment that a body lacks, not what is made small [kg m]."""
        return self.conditions.first_moment_residual(self.after)

    def residual_percent(self) -> float | None:
        """Residual in per cent of that without counter-masses; None where there is nothing to balance."""
        whole = self.conditions.first_moment_residual(self.before)
        return 100.0 * self.residual() / whole if whole > 0.0 else None

    def first_moments(self) -> list[BodyMoment]:
        """Of each body, the first moment that the sites give, and what is missing with them."""
        return body_moments(self.conditions, self.after, self.counter_masses)

    def is_balanced(self, tol: float) -> bool:
        """Whether no condition is off by more than ``tol`` [kg m, kg]."""
        return self.conditions.is_balanced(tol, self.after)

    @property
    def added_mass(self) -> float:
        """Mass of all counter-masses [kg]."""
        return sum(c.mass for c in self.counter_masses)

    @property
    def added_inertia(self) -> float:
        """Inertia of all counter-masses about the axes that the bodies that carry them turn about [kg m2]."""
        made = self._as_made
        sites = [(one.mass, made.site(one.site)) for one in self.counter_masses]
        return float(sum(mass * site.axis @ inertia_matrix(site.unit_mass()) @ site.axis for mass, site in sites))

    def balanced_payloads(self) -> dict[str, float | None]:
        """For each payload body, the payload that these counter-masses balance best [kg]; None where there is none."""
        return {body: balanced_payload(self.conditions, self.after, body) for body in self.payload_bodies}

    def nearest_payload(self, body: str) -> tuple[float, float] | None:
        """Mass of ``body`` with which least of the objective is left [kg], and that as ``remaining_percent``."""
        if self.objective is None:
            return None
        factor, after = self.objective.factor, self.after
        column = factor[:, :-1] @ _per_kilogram(after, body)
        change = float(column @ factor @ np.append(after.pi, 1.0)) / (float(column @ column) or np.inf)
        if (mass := after.mass(body) - change) <= 0.0:
            return None
        left = replace(self, before=self.before.with_payload({body: mass})).remaining_percent()
        return None if left is None else (mass, left)


def balanced_payload(conditions: Conditions, mechanism: Mechanism, body: str) -> float | None:
    """Mass of ``body`` with which bodies lack least, in squares [kg]; None if none meets the conditions (BALANCES)."""
    per_kilogram = conditions.lacking @ (conditions.matrix @ _per_kilogram(mechanism, body))
    missing = conditions.lacking @ conditions.values(mechanism)
    mass = mechanism.mass(body) - float(np.sum(per_kilogram * missing) / (np.sum(per_kilogram**2) or np.inf))
    largest = BALANCES * mass * float(np.linalg.norm(per_kilogram, axis=1).max())
    if not largest > 0.0:
        return None
    loaded = mechanism.with_payload({body: mass})
    is_met = (
        conditions.first_moment_residual(loaded) <= largest and conditions.residual("kg", loaded) <= BALANCES * mass
    )
    return mass if is_met else None


def _per_kilogram(mechanism: Mechanism, body: str) -> Floats:
    """Change of the inertial parameters per kilogram of a body's own mass, (10 nb,) [-, m, m2]."""
    row = np.zeros_like(mechanism.parameters)
    row[mechanism.body_index(body)] = mechanism.own_mass[body][1] / mechanism.mass(body)
    return row.ravel()


def sizing_of_given(
    conditions: Conditions,
    mechanism: Mechanism,
    masses: Mapping[str, float],
    plates: "Mapping[str, Sequence[Plate]] | None" = None,
    objective: Objective | None = None,
    bound: float | None = None,
) -> Sizing:
    """Given counter-masses [kg] by site, with the plates of each, on ``mechanism``, which is without them."""
    found = []
    for name, mass in masses.items():
        site, stack = mechanism.site(name), (plates or {}).get(name, ())
        # plates on one axis, their centres at the site; one that is not drawn has the site's radius of gyration
        square, own = site.radius_of_gyration**2, [(plate.mass, plate.inertia) for plate in stack]
        inertia = sum(m * square if i is None else i for m, i in own) if any(i is not None for _, i in own) else None
        names = tuple(plate.name for plate in stack)
        place, from_joint = mechanism.place(name), mechanism.from_joint(name)
        found.append(CounterMass(name, float(mass), place, names, inertia, from_joint))
    return Sizing(conditions, mechanism, tuple(found), mechanism.payload_bodies, objective, bound)


def sizing_document(result: Sizing) -> dict[str, Any]:
    """Counter-masses and their residual, for JSON: units in the keys."""
    return {
        "mechanism": result.before.name,
        "counter_masses": plain(result.counter_masses),
        "residual_first_moment_kgm": result.residual(),
        "residual_percent": result.residual_percent(),
        "first_moments": plain(result.first_moments()),
        "balanced_payload_kg": result.balanced_payloads(),
        "added_mass_kg": result.added_mass,
        "added_inertia_kgm2": result.added_inertia,
    }


def chosen_sites(mechanism: Mechanism, sites: Sequence[str]) -> list[str]:
    """The sites named, or those that the file names counter...; SizingError if there is none."""
    names = list(dict.fromkeys(sites)) or mechanism.counter_sites
    if not names:
        raise SizingError(
            f"{mechanism.name} has no site named counter...: add one to its file, in MJCF a site, in URDF or SDF a "
            "link without mass fixed where a counter-mass can be; or name sites by --site: there are "
            f"{', '.join(mechanism.sites) or 'none'}"
        )
    for name in names:
        mechanism.with_counter_mass({name: 0.0})
    return names


def refuse_swinging(conditions: Conditions, mechanism: Mechanism, sites: Sequence[str]) -> None:
    """Raise SizingError where a body that turns idly would swing with masses at ``sites``."""
    if conditions.idle and Closure(mechanism.with_counter_mass(dict.fromkeys(sites, 1.0))).idle != conditions.idle:
        raise SizingError(
            f"{mechanism.name}: with masses at {', '.join(sites)}, bodies that turn idly "
            f"({', '.join(conditions.idle)}) would swing, which no motor determines: leave those sites out, or put "
            "them on the line they turn about"
        )


def site_columns(conditions: Conditions, mechanism: Mechanism, names: Sequence[str]) -> Floats:
    """Change of each condition per kilogram at each site, (rank, sites) [m]."""
    return conditions.matrix @ unit_masses(mechanism, names).T


def exact_sizing(
    conditions: Conditions,
    mechanism: Mechanism,
    sites: Sequence[str] = (),
    limits: Mapping[str, float] | None = None,
    objective: Objective | None = None,
    equal: Sequence[Sequence[str]] = (),
    added: float | None = None,
) -> Sizing:
    """Counter-masses of any mass at ``sites`` (default: those named counter...) of least ``objective``.

    Each between zero and its limit [kg], those of a group of ``equal`` the same, all together at most ``added`` [kg];
    of equals the lightest, then least squares of the masses. Raises SizingError if there is no site or the solver does
    not converge.
    """
    names = chosen_sites(mechanism, sites)
    objective = objective or conditions.objective
    masses, bound = of_any_mass(sizing_system([(objective, mechanism)], names, limits, equal, added))
    return sizing_of_given(conditions, mechanism, dict(zip(names, masses, strict=True)), None, objective, bound)


def upper_limits(names: Sequence[str], limits: Mapping[str, float] | None) -> Floats:
    """Largest mass at each site, infinite without a limit, (sites,) [kg]. Raises SizingError for a wrong limit."""
    if unused := [name for name in limits or {} if name not in names]:
        raise SizingError(f"the limit at {unused[0]!r} has no effect: counter-masses are sized at {', '.join(names)}")
    for name, limit in (limits or {}).items():
        if not limit >= 0.0:
            raise SizingError(f"the limit at {name!r} is {limit:g} kg: expected zero or more")
    return np.array([(limits or {}).get(name, np.inf) for name in names])


def total_limit(added: float | None) -> float:
    """What all counter-masses together may weigh, infinite for None [kg]. Raises SizingError below zero."""
    if added is not None and not added >= 0.0:
        raise SizingError(f"{added:g} kg may be added in all: expected zero or more")
    return np.inf if added is None else added


def site_groups(names: Sequence[str], equal: Sequence[Sequence[str]]) -> list[list[int]]:
    """Indices of the sites that carry equal masses, a group each; a site of none is a group by itself."""
    named = [name for group in equal for name in group]
    for name in named:
        if name not in names or named.count(name) > 1:
            why = "is named twice" if name in names else f"is not sized; there are {', '.join(names)}"
            raise SizingError(f"the site {name!r} of equal masses {why}")
    groups = [[names.index(name) for name in group] for group in equal]
    return [[i] for i, name in enumerate(names) if name not in named] + groups


def best_sets_from_stock(
    conditions: Conditions,
    mechanism: Mechanism,
    plates: "Sequence[Plate]",
    sites: Sequence[str] = (),
    limits: Mapping[str, float] | None = None,
    objective: Objective | None = None,
    equal: Sequence[Sequence[str]] = (),
    best: int = 1,
    exact: Exact | None = None,
    added: float | None = None,
) -> tuple[Sizing, ...]:
    """The ``best`` few choices of plates at the sites, best first, with a bound that no choice is below.

    A plate's quantity is for all sites together; ``limits``, ``added`` [kg] and ``equal`` as in ``exact_sizing``;
    ``exact`` as in ``best_plates``.
    """
    from .stock_search import best_plates  # late: masses of any size are found without it

    names = chosen_sites(mechanism, sites)
    objective = objective or conditions.objective
    each = [(objective, mechanism)]
    system = sizing_system(each, names, limits, equal, added) | stock_system(each, names, plates)
    found = best_plates(**system, best=best, exact=exact)
    sets = []
    for one in found.selections:
        masses, piles = dict(zip(names, one.masses, strict=True)), piles_of(names, one.counts, plates)
        sets.append(sizing_of_given(conditions, mechanism, masses, piles, objective, found.bound))
    return tuple(sets)


@dataclass(frozen=True)
class StockUse:
    """How many plates of a stock are used, by name, and of which more would leave less."""

    used: Mapping[str, int]
    in_stock: Mapping[str, int]
    more: int = 1
    """How many more of a kind: as many as there are sites of equal masses in the largest group."""
    with_more: Mapping[str, float] = field(default_factory=dict)
    """Part of the root of the objective without counter-masses that remains with ``more`` of a kind, the least first,
    where that is less than without them [-]."""
    unproven: tuple[str, ...] = ()
    """Kinds of which not all choices were looked at in the time: less may remain."""
    lightest: tuple[str, float] = ("", 0.0)
    """The lightest plate that there is, and its mass [kg]."""

    def document(self) -> dict[str, Any]:
        """For JSON: what would remain with more of a kind, and whether no plate is left."""
        more = [
            {"plate": name, "more": self.more, "remaining_percent": 100.0 * part, "proven": name not in self.unproven}
            for name, part in self.with_more.items()
        ]
        return {"with_more_plates": more, "not_searched": self._open, "all_plates_used": self.used == self.in_stock}

    @property
    def _open(self) -> list[str]:
        return [name for name in self.unproven if name not in self.with_more]

    def sentences(self, shown: Callable[[float], str]) -> Iterator[str]:
        """Of which plates more would leave less, parts ``shown`` as text; else whether no plate is left, or nothing."""
        number = "one" if self.more == 1 else self.more
        least = {name: "" if name not in self.unproven else " or less" for name in self.with_more}
        if kinds := ", ".join(f"{name} {shown(part)}{least[name]}" for name, part in self.with_more.items()):
            yield f"Less would remain with {number} more of a plate: {kinds}."
        elif self.used == self.in_stock:
            yield "All plates of the stock are used."
        if count := len(self._open):
            kinds = f"{count}{' other' if self.with_more else ''} kinds" if count > 1 else self._open[0]
            yield f"Whether {number} more of {kinds} would leave less was not found in the time."


def stock_use(
    sets: Sequence[Sizing],
    plates: "Sequence[Plate]",
    limits: Mapping[str, float] | None = None,
    equal: Sequence[Sequence[str]] = (),
    is_linear: bool = True,
    added: float | None = None,
    fixed: bool = False,
) -> StockUse:
    """Use of a stock by one set, or by ``sets`` that only grow, or are ``fixed``, one for each payload.

    ``limits``, ``added`` [kg] and ``equal`` as they were sized.

    Of which kinds more would help is left open where what is made small is not linear in the masses.
    """
    from .stock_search import with_more  # late: masses of any size are found without it

    names = [one.site for one in sets[0].counter_masses]
    made = sets[:1] if fixed else sets
    piles = [[[c.plates.count(plate.name) for plate in plates] for c in one.counter_masses] for one in made]
    counts = np.diff(np.array(piles), axis=0, prepend=0).reshape(-1, len(plates))
    more, whole = max(map(len, equal), default=1), 1.0
    found, unknown = dict[int, "StockOptimum"](), list[int]()
    if is_linear:
        each = [(one.objective or one.conditions.objective, one.before) for one in sets]
        system = sizing_system(each, names, limits, equal, added, fixed) | stock_system(each, names, plates, fixed)
        whole = float(np.sum(system["target"] ** 2))
        found, unknown = with_more(**system, counts=counts, more=more)
    unproven = [*unknown, *(kind for kind, one in found.items() if one.gap > 0.0)]
    return StockUse(
        dict(zip((plate.name for plate in plates), counts.sum(axis=0).tolist(), strict=True)),
        {plate.name: plate.quantity for plate in plates},
        more,
        {plates[kind].name: (one.selections[0].value / whole) ** 0.5 for kind, one in found.items()},
        tuple(plates[kind].name for kind in unproven),
        min(((p.mass, p.name) for p in plates if p.quantity), default=(0.0, ""))[::-1],
    )


def sizing_system(
    each: Sequence[tuple[Objective, Mechanism]],
    names: Sequence[str],
    limits: Mapping[str, float] | None,
    equal: Sequence[Sequence[str]],
    added: float | None,
    fixed: bool = False,
) -> dict[str, Any]:
    """What ``best_plates`` is asked by name, but for the plates, for each of several payloads.

    Unknown is what each set adds to the one before it, or the one set that is ``fixed``; limited is what all of them
    add, at a site and in all.
    """
    systems, sites = [objective.system(mechanism, names) for objective, mechanism in each], len(names)
    steps, groups, upper = 1 if fixed else len(each), site_groups(names, equal), upper_limits(names, limits)
    parts, totals = np.tile(np.vstack([np.eye(sites), np.ones(sites)]), steps), np.append(upper, total_limit(added))
    used = np.isfinite(totals) & (np.append(np.full(sites, steps > 1), True))
    return {
        "columns": _arranged([own for own, _ in systems], fixed),
        "target": np.concatenate([own for _, own in systems]),
        "limits": np.tile(upper, steps),
        "equal": [[k * sites + i for i in group] for k in range(steps) for group in groups],
        "sums": (parts[used], totals[used]),
    }


def of_any_mass(system: Mapping[str, Any]) -> tuple[Floats, float]:
    """Masses, (sites * loads,) [kg], of least square error, and what no others are below [square of its unit]."""
    groups, parts = system["equal"], system["sums"]
    share = np.zeros((len(system["limits"]), len(groups)))
    for k, group in enumerate(groups):
        share[group, k] = 1.0 / len(group)
    most = np.array([len(group) * system["limits"][group].min() for group in groups])
    columns = system["columns"] @ share
    found, _, gap = distribute_within(columns, system["target"], most, parts[0] @ share, parts[1])
    return share @ found, max(float(np.sum((columns @ found - system["target"]) ** 2)) - gap, 0.0)


def stock_system(
    each: Sequence[tuple[Objective, Mechanism]], names: Sequence[str], plates: "Sequence[Plate]", fixed: bool = False
) -> dict[str, Any]:
    """What ``best_plates`` is asked of plates, for what ``sizing_system`` is of.

    Plates as drawn have an inertia beyond their mass at the sites' radii of gyration, (sites, kinds) [kg m2].
    """
    per_turning = _arranged([objective.turning(mechanism, names) for objective, mechanism in each], fixed)
    masses = np.array([plate.mass for plate in plates])
    squares = np.array([[each[0][1].site(name).radius_of_gyration ** 2] for name in names])
    drawn = np.array([np.nan if plate.inertia is None else plate.inertia for plate in plates])
    inertia = np.nan_to_num(drawn - squares * masses)
    return {
        "masses": masses,
        "quantities": np.array([plate.quantity for plate in plates], dtype=np.intp),
        "turning": (per_turning, np.tile(inertia, (per_turning.shape[1] // len(names), 1))),
    }


def _arranged(columns: Sequence[Floats], fixed: bool) -> Floats:
    """Columns of each payload (rows, sites) as those of what each set adds to the one before, or of one set for all."""
    if fixed:
        return np.vstack(columns)
    count = len(columns)
    return np.block([[one if j <= k else np.zeros_like(one) for j in range(count)] for k, one in enumerate(columns)])


def piles_of(names: Sequence[str], counts: Indices, plates: "Sequence[Plate]") -> "dict[str, list[Plate]]":
    """Plates at each site, in the order of the stock; ``counts`` (sites, kinds)."""
    return {
        name: [plate for plate, count in zip(plates, row, strict=True) for _ in range(count)]
        for name, row in zip(names, counts, strict=True)
    }
