"""What counter-masses leave of the shaking force: along which directions, and which bodies would need a site."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ..arrays import Floats, root_mean_square
from ..mechanism.mechanism import PARAMETERS, Mechanism
from .least_masses import bounded_least_squares
from .sizing import COMPLETE, Sizing, upper_limits

STEPS = 0.05
"""Share of the shaking force that steps of stock plates may leave where other masses would balance completely."""

_LESS = 1e-3
"""Part of what is left by which another site must lessen it to be worth naming."""
_SMALL = 1e-6
"""Weight that holds unknowns small where nothing else does, columns of length one."""


@dataclass(frozen=True)
class RemainingDirection:
    """A principal direction of what is left; what is along different ones is uncorrelated."""

    direction: Floats
    """Unit vector in the base frame, (3,) [-]."""
    before: float
    """Root mean square along it without counter-masses [unit of the objective]."""
    after: float
    """With them."""


def remaining_directions(before: Floats, after: Floats) -> tuple[RemainingDirection, ...]:
    """Principal directions of what is left, most first, from samples (n, 3) without and with counter-masses [N].

    Along several in which as much is left, to rounding, those of what there was: samples alone do not tell them apart.
    """
    sizes, axes = np.linalg.eigh(after.T @ after / len(after))
    whole = before.T @ before / len(before)
    rounding = COMPLETE**2 * np.trace(whole)
    steps = np.flatnonzero(np.diff(sizes) > rounding) + 1
    axes = np.hstack([alike @ np.linalg.eigh(alike.T @ whole @ alike)[1] for alike in np.split(axes, steps, axis=1)])
    sizes = np.where(sizes > rounding, sizes, 0.0)
    found = []
    for size, axis in zip(sizes[::-1], axes.T[::-1], strict=True):
        axis = np.where(np.abs(axis) > 1e-6, axis, 0.0) * np.sign(axis[np.argmax(np.abs(axis))]) + 0.0
        found.append(RemainingDirection(axis, root_mean_square(before @ axis), float(size**0.5)))
    return tuple(found)


@dataclass(frozen=True)
class NeededSite:
    """A body that lacks a site at the right place."""

    body: str
    after: float
    """Root of the objective that the best masses leave with it, and with those named before it [its unit]."""
    first_moment: Floats
    """Which the counter-mass has there, about the origin of the body's frame and along its axes, (3,) [kg m], once
    those on all bodies named are mounted; of several as good that of least squares."""
    alternatives: tuple[str, ...] = ()
    """Other bodies that would do as well in its place."""
    masses: Mapping[str, float] = field(default_factory=dict)
    """Counter-masses at the sizing's sites then [kg]."""


def needed_sites(sizing: Sizing, limits: Mapping[str, float] | None = None) -> tuple[NeededSite, ...]:
    """Bodies where a counter-mass of any mass at any place would lessen what is left, the most helpful first.

    Each with those before it, besides those at the sizing's sites of any mass within ``limits`` [kg], until nothing is
    left or nothing helps. Of bodies that would do as well the first by name, so that the order of the file does not
    matter.
    """
    mechanism, objective = sizing.before, sizing.objective
    assert objective is not None
    names = [c.site for c in sizing.counter_masses]
    columns, target = objective.system(mechanism, names)
    most = upper_limits(names, limits)
    before, left = sizing.root_mean_squares()
    found: list[NeededSite] = []
    chosen, bounds = columns, np.zeros(columns.shape[1])
    while left > COMPLETE * before and len(found) < len(mechanism.bodies):
        trials = []
        for body in sorted(set(mechanism.bodies) - {one.body for one in found}):
            first = len(PARAMETERS) * mechanism.body_index(body)
            added = np.hstack([chosen, objective.factor[:, first : first + 4]])
            least = np.concatenate([bounds, [0.0], np.full(3, -np.inf)])
            trials.append((_least_squares(added, target, least, most)[0], body, added, least))
        smallest = min(size for size, *_ in trials)
        if not smallest < (1.0 - _LESS) * left:
            break
        (left, body, chosen, bounds), *others = (one for one in trials if one[0] <= smallest + COMPLETE * before)
        alternatives = tuple(name for _, name, *_ in others)
        found.append(NeededSite(body, left if left > COMPLETE * before else 0.0, np.zeros(3), alternatives))
    _, unknown = _least_squares(chosen, target, bounds, most, _SMALL)
    masses = dict(zip(names, unknown[: len(names)].tolist(), strict=True))
    moments = unknown[len(names) :].reshape(-1, 4)[:, 1:]
    return tuple(replace(one, first_moment=moment, masses=masses) for one, moment in zip(found, moments, strict=True))


def _least_squares(
    columns: Floats, target: Floats, least: Floats, most: Floats, small: float = 0.0
) -> tuple[float, Floats]:
    """Root of the least square error with unknowns of at least ``least``, the first of at most ``most``, and the
    unknowns; ``small`` holds those that change nothing small.
    """
    size, upper = np.linalg.norm(columns, axis=0), np.full(columns.shape[1], np.inf)
    upper[: len(most)] = most
    used = (size > 1e-12 * size.max(initial=0.0)) & (upper > least)
    unknown = np.zeros(len(size))
    if used.any():
        unit = columns[:, used] / size[used]
        count = unit.shape[1]
        augmented, wanted = np.vstack([unit, small * np.eye(count)]), np.pad(target, (0, count))
        unknown[used] = bounded_least_squares(augmented, wanted, least[used], upper[used] * size[used]) / size[used]
    return float(np.linalg.norm(columns @ unknown - target)), unknown


@dataclass(frozen=True)
class Verdict:
    """Whether counter-masses balance a mechanism completely, and what they leave."""

    balanced: bool
    attainable: bool
    """Whether masses of any size at these sites, within their limits, would."""
    before: float
    """Root of the objective without counter-masses [its unit]."""
    after: float
    """With them."""
    least: float | None
    """What no masses that are allowed are below; None where that is not known."""
    directions: tuple[RemainingDirection, ...]
    """Empty where it is balanced, or where not the force alone is made small."""
    needed: tuple[NeededSite, ...]
    """Empty where masses of any size at these sites would do, or where not the force alone is made small: inertia of
    what is mounted adds to moment and torque by the place, which is open here."""

    @property
    def has_finding(self) -> bool:
        """Whether it is not balanced, steps of stock plates aside."""
        return not self.balanced and not (self.attainable and self.after <= STEPS * self.before)


def verdict_of(
    found: Sizing,
    any_mass: Sizing,
    samples: Callable[[Mechanism], Floats] | None,
    limits: Mapping[str, float] | None = None,
) -> Verdict:
    """The verdict on counter-masses, ``any_mass`` the best ones of any mass at the same sites and within their limits.

    ``samples`` gives the force, or the momentum over the workspace, of a mechanism, (n, 3) [unit of the objective].
    """
    before, after = found.root_mean_squares()
    balanced, attainable = found.is_complete(), any_mass.is_complete()
    directions = (
        () if balanced or samples is None else remaining_directions(samples(found.before), samples(found.after))
    )
    needed = () if attainable or samples is None else needed_sites(any_mass, limits)
    least = None if found.bound is None else min(found.bound**0.5, after)
    return Verdict(balanced, attainable, before, after, least, directions, needed)
