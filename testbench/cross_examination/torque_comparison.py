"""What explains a run's torques beside those of the other runs: other counter-masses than stated, or another gain.

Of drive j in run r, with the payload and counter-masses of the run table in ``body``:

tau = s_j body_r + k_j base + J_j a + b_j v + f_j sign(v) + o_jr.

All factors but the offset o are the campaign's, by least squares in which a run weighs the less the more it leaves
unexplained, so that those that agree decide. All power is a share of what the run's motion asks for without
counter-masses: a gentle run leaves less than a fast one. With these factors each run is asked which one change leaves
least: another payload, other counter-masses, or another gain of a drive.

What the model lacks is much the same in all runs. So other counter-masses are judged by the way to them: the share of
it that a run's torques ask for beside any payload, 0 with what is stated and 1 with the others, is held against that
share in the other runs, whose scatter is its uncertainty.

Where the file's masses are wrong all runs with one set of counter-masses are unlike the model in one way. So a run is
told from its peers, those with the same set, where it has any; without them it may only have carried another whole set.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from balance.arrays import Floats
from balance.estimation.estimate import coverage_factor

from .observation import DRIVE_TERMS, Observation, TorqueEquations, jackknife
from .repeated_sizes import FALSE_ALARMS, outlying

FEWEST = 5
"""Runs with torques of which some may be told from the others."""
FEWEST_WITNESSES = 3
"""Of which the others may confirm what one carried."""
EXPLAINS = 4.0
"""Unexplained power with what is stated and any payload, over that with another gain, from which that is named; and
over that of its peers, from which a run is named that nothing explains."""
REJECTED = 5.0
"""Standard uncertainties of a run's own share of the way, by a jackknife over blocks, within which nothing is said."""
MOST_INFLATION = 100.0
"""Variance inflation factor of masses beside the payload, from which torques do not tell them from it."""
LEAST_CHANGE = 0.06
"""Of a counter-mass, as a share of the largest stated at its site, below which none that nobody stated is named: twice
what the model's errors leave in simulated campaigns."""
LEAST_GAIN = 0.05
"""Change of a torque's gain from which it is named, where friction of its own does not explain the run as well."""
MOST_GAIN = 4.0
"""Factor from which a gain, as one below zero, is left to who looks at single runs."""
MOST_SITES = 6
"""Of which any may have been left empty: of more only all."""
LEAST_POWER = 1e-4
"""Of the torques that the motion of the median run asks for, below which a run counts as one of that."""
_ROUNDS = 30
_LEAST_WEIGHT = 0.3
"""Of the median of what runs leave, below which one that leaves less weighs no more."""
COMMON = ("base", *DRIVE_TERMS[1:])
"""Columns whose factors are the campaign's, beside that of the bodies."""
Masses = Mapping[str, float]
"""Counter-masses by site [kg]."""


@dataclass(frozen=True)
class Unlike:
    """What explains the torques of a run that is unlike the others."""

    masses: Masses | None
    """Counter-masses by site [kg]; None: as stated."""
    joint: str = ""
    """Whose torque has another gain."""
    gain: float = 1.0
    """Of that torque, over that in the other runs [-]."""
    times: float = 1.0
    """Where nothing explains it: unexplained power over that of its peers [-]."""


@dataclass(frozen=True)
class Compared:
    """What the torques of a campaign's runs say of each beside the others."""

    unlike: Mapping[str, Unlike]
    """By run: torques that one change explains and what is stated does not, or that nothing explains; none where half
    of the runs are unlike."""
    confirmed: frozenset[str]
    """Runs whose torques exclude all counter-masses of the campaign but those stated."""


def compared(observations: Sequence[Observation]) -> Compared:
    """The runs of stated payloads held against each other, with FALSE_ALARMS in all of an honest campaign."""
    if len(seen := comparable_torques(observations)) < FEWEST_WITNESSES:
        return Compared({}, frozenset())
    campaign = _Campaign(seen)
    enough = range(len(seen) if len(seen) >= FEWEST else 0)
    found = {seen[i][0].name: unlike for i in enough if (unlike := campaign.unlike(i))}
    confirmed = frozenset(one.name for i, (one, _) in enumerate(seen) if campaign.is_confirmed(i))
    return Compared(found if 2 * len(found) < len(seen) else {}, confirmed - found.keys())


def comparable_torques(observations: Sequence[Observation]) -> list[tuple[Observation, TorqueEquations]]:
    """Runs of a stated payload with torques, of the drives and columns that most of them have."""
    seen = [(o, o.torque) for o in observations if o.torque is not None and "payload_kg" in o.conditions]
    alike = [(torque.joints, torque.names) for _, torque in seen]
    return [one for one, own in zip(seen, alike, strict=True) if own == max(alike, key=alike.count)]


class _Campaign:
    """Products of the columns of all runs, offsets eliminated, and the factors on which most runs agree."""

    def __init__(self, seen: Sequence[tuple[Observation, TorqueEquations]]) -> None:
        self.seen = [o for o, _ in seen]
        self.names, self.joints = seen[0][1].names, seen[0][1].joints
        blocks = np.stack([torque.products for _, torque in seen], axis=1)
        whole = blocks.sum(axis=0)[None]
        products = np.concatenate([whole, whole - blocks] if len(blocks) > 1 else [whole])  # less each block
        at = self.names.index("offset")
        products = products - products[..., :, [at]] * products[..., [at], :] / products[..., [at], [at], None]
        self.products = products[0]
        scale = np.median(self.products[:, :, 0, 0], axis=0)  # of the torques, so that each drive counts alike
        self.products = self.products / np.maximum(scale, 1e-300)[None, :, None, None]
        self.torque, self.common = np.eye(len(self.names))[0], [self.names.index(name) for name in COMMON]
        self.stated = np.array([self._body(o, o.counter_masses) for o in self.seen])
        bare = np.array([self._body(o, {}) for o in self.seen])
        power = np.einsum("rk,rjkl,rl->r", bare, self.products, bare)  # so that a gentle run counts as a fast one does
        self.products /= np.maximum(power, LEAST_POWER * np.median(power) + 1e-300)[:, None, None, None]
        self.parts = products / np.maximum(scale, 1e-300)[None, None, :, None, None]
        self.factors = self._agreed()
        self._known: dict[tuple[float, ...], tuple[Floats, Floats] | None] = {}
        self.sets = sorted({tuple(sorted(o.counter_masses.items())) for o in self.seen} | {()})

    def _body(self, seen: Observation, masses: Mapping[str, float]) -> Floats:
        """Amounts of the columns (k,) of what a run carried, with its stated payload."""
        amounts = {"model": 1.0, "payload": seen.conditions["payload_kg"], **masses}
        return np.array([amounts.get(name, 0.0) for name in self.names])

    def _agreed(self) -> Floats:
        """Factors of body and common columns by joint, (j, 1 + c), by runs weighted by what they leave."""
        columns = np.zeros((len(self.seen), len(self.names), 1 + len(self.common)))
        columns[:, :, 0] = self.stated
        columns[:, self.common, range(1, 1 + len(self.common))] = 1.0
        normal = np.swapaxes(columns, 1, 2)[:, None] @ self.products @ columns[:, None]
        right = (np.swapaxes(columns, 1, 2)[:, None] @ self.products[..., :1])[..., 0]
        weights = np.ones(len(self.seen))
        for _ in range(_ROUNDS):
            whole, vector = np.einsum("r,rjab->jab", weights, normal), np.einsum("r,rja->ja", weights, right)
            width = np.sqrt(np.maximum(np.einsum("jaa->ja", whole), 1e-300))
            scaled = whole / width[:, :, None] / width[:, None, :]
            inverse = np.linalg.pinv(scaled, rcond=1e-10, hermitian=True)
            self.factors = np.einsum("jab,jb->ja", inverse, vector / width) / width
            left = self._left(self.stated).sum(axis=1)
            weights = 1.0 / np.maximum(left, _LEAST_WEIGHT * np.median(left) + 1e-300)
        return self.factors

    def _made(self, body: Floats) -> Floats:
        """Amounts of the columns (r, j, k) that make the torques of runs that carry ``body`` (r, k)."""
        made = self.factors[None, :, :1] * body[:, None, :]
        made[:, :, self.common] += self.factors[None, :, 1:]
        return made

    def _left(self, body: Floats) -> Floats:
        """Unexplained power by run and joint (r, j)."""
        rest = self.torque - self._made(body)
        return np.einsum("rjk,rjkl,rjl->rj", rest, self.products, rest)

    def _with_any_payload(self, run: int, body: Floats) -> tuple[float, float]:
        """Least unexplained power of a run over its payload, and that payload [kg]."""
        at, products = self.names.index("payload"), self.products[run]
        rest = self.torque - self._made(body[None])[0]
        power, along = (
            self.factors[:, 0] ** 2 @ products[:, at, at],
            self.factors[:, 0] @ (products[:, at] * rest).sum(1),
        )
        change = along / max(power, 1e-300)
        left = np.einsum("jk,jkl,jl->", rest, products, rest) - change * along
        return float(left), float(body[at] + change)

    @cached_property
    def _sums(self) -> tuple[Floats, Floats]:
        """Products of the bodies' columns, and with what is left, over all drives: (v, r, k, k) and (v, r, k).

        Of whole runs first, then less each block.
        """
        weights, rest = self.factors[:, 0], self.torque - self._made(self.stated)
        return (
            np.einsum("j,vrjkl->vrkl", weights**2, self.parts),
            np.einsum("j,vrjkl,rjl->vrk", weights, self.parts, rest, optimize=True),
        )

    def _asked(self, changes: Floats) -> tuple[Floats, Floats] | None:
        """How much of each of ``changes`` (c, k) to what a run carried its torques ask for, beside any payload.

        By run, and its standard uncertainty, (r, c) [-]; None where they do not tell it from another payload.
        """
        columns = np.vstack([changes, self._unit("payload")]).T
        normal, right = columns.T @ self._sums[0] @ columns, self._sums[1] @ columns
        width = np.sqrt(np.maximum(np.einsum("vrcc->vrc", normal), 1e-300))
        inverse = np.linalg.pinv(normal / width[..., :, None] / width[..., None, :], rcond=1e-10, hermitian=True)
        if not (np.einsum("rcc->rc", inverse[0]) < MOST_INFLATION).all():
            return None
        amounts = (np.einsum("vrcd,vrd->vrc", inverse, right / width) / width)[..., :-1]
        return amounts[0], jackknife(amounts[1:]) if len(amounts) > 1 else np.zeros(amounts.shape[1:])

    def _way(self, stated: Masses, other: Masses) -> tuple[Floats, Floats] | None:
        """Share of the way from stated to other counter-masses that each run's torques ask for, and its standard
        uncertainty, (r,) [-]; None where they do not tell it from another payload.
        """
        change = tuple(other.get(name, 0.0) - stated.get(name, 0.0) for name in self.names)
        if change not in self._known:
            asked = self._asked(np.array([change]))
            self._known[change] = None if asked is None else (asked[0][:, 0], asked[1][:, 0])
        return self._known[change]

    def unlike(self, run: int) -> Unlike | None:
        """What one change explains a run, or that nothing does; None where it is like the others."""
        seen, stated = self.seen[run], self._with_any_payload(run, self.stated[run])[0]
        peers = [i for i, o in enumerate(self.seen) if i != run and o.counter_masses == seen.counter_masses]
        found = self._masses(run, peers)
        found += [one for one in self._gains(run) if EXPLAINS * one[0] < stated] if peers else []
        left, best = min(found, key=lambda one: one[0], default=(np.inf, Unlike(None)))
        if left < stated:
            return best if 1.0 / MOST_GAIN < best.gain < MOST_GAIN else None
        return self._unexplained(run, peers)

    def is_confirmed(self, run: int) -> bool:
        """Whether a run's torques exclude all other counter-masses of the campaign, by the other runs' scatter."""
        stated = self.seen[run].counter_masses
        for other in self._alternatives(run, False):
            if (way := self._way(stated, other)) is None:
                return False
            shares, error = way
            kept = ~outlying(shares, FALSE_ALARMS) & (np.arange(len(shares)) != run)
            if (count := int(kept.sum())) < 2:
                return False
            apart = abs(float(shares[run] - shares[kept].mean()))
            scatter = coverage_factor(count - 1.0, 1.0 - FALSE_ALARMS) * shares[kept].std(ddof=1)
            doubt = max(float(scatter) * (1.0 + 1.0 / count) ** 0.5, REJECTED * float(error[run]))
            if max(abs(float(shares[run])), apart) + doubt > 1.0:
                return False
        return True

    def _masses(self, run: int, peers: Sequence[int]) -> list[tuple[float, Unlike]]:
        """Unexplained power with other counter-masses and any payload above zero, of those that the torques ask for."""
        seen, found = self.seen[run], []
        alternatives = self._alternatives(run, bool(peers))
        for masses in alternatives:
            way = self._way(seen.counter_masses, masses)
            if way is None or way[0][run] < 0.5 or not self._is_unlike(run, peers, *way, 0.5, len(alternatives)):
                continue
            left, payload = self._with_any_payload(run, self._body(seen, masses))
            found += [(left, Unlike(masses))] if payload > 0.0 else []
        return found or self._unstated(run, peers)

    def _is_unlike(
        self, run: int, peers: Sequence[int], amount: Floats, error: Floats, least: float, hypotheses: int
    ) -> bool:
        """Whether a run asks for more than ``least`` of a change, and than its peers and the other runs scatter."""
        beside = float(np.median(amount[list(peers)])) if peers else 0.0
        if not min(abs(amount[run]), abs(amount[run] - beside)) > max(least, REJECTED * float(error[run])):
            return False
        return bool(outlying(amount, FALSE_ALARMS / hypotheses)[run])

    def _unstated(self, run: int, peers: Sequence[int]) -> list[tuple[float, Unlike]]:
        """The same with counter-masses that no run states, where neither friction of its own nor a gain leaves less."""
        seen, sites = self.seen[run], sorted({site for one in self.sets for site, _ in one})
        asked = self._asked(np.array([self._unit(site) for site in sites])) if peers and sites else None
        alike = [i for i, o in enumerate(self.seen) if o.commanded == seen.commanded]
        if asked is None or len(alike) < FEWEST:
            return []
        at, beside, masses = alike.index(run), [alike.index(i) for i in peers if i in alike], dict(seen.counter_masses)
        for site, amount, error in zip(sites, asked[0][alike].T, asked[1][alike].T, strict=True):
            least = LEAST_CHANGE * max(o.counter_masses.get(site, 0.0) for o in self.seen)
            if beside and self._is_unlike(at, beside, amount, error, least, len(sites)):
                changed = masses.get(site, 0.0) + float(amount[at] - np.median(amount[beside]))
                masses[site] = float(f"{changed:.3g}")
        if masses == seen.counter_masses or min(masses.values()) < 0.0:
            return []
        left, payload = self._with_any_payload(run, self._body(seen, masses))
        others = [float(self._with_own_friction(run).sum()), *(rest for rest, _, _ in self._with_gains(run))]
        return [(left, Unlike(masses))] if payload > 0.0 and left < min(others) else []

    def _unexplained(self, run: int, peers: Sequence[int]) -> Unlike | None:
        """A run that leaves far more than its peers of one motion do, whatever the payload, friction or a gain."""
        alike = [i for i in peers if self.seen[i].commanded == self.seen[run].commanded]
        if len(alike) + 1 < FEWEST - 1:
            return None
        left = np.log(np.maximum([self._least(i) for i in (run, *alike)], 1e-300))
        times = float(np.exp(left[0] - np.median(left[1:])))
        odd = times > EXPLAINS and bool(outlying(left, FALSE_ALARMS / len(self.sets))[0])
        return Unlike(None, times=times) if odd else None

    def _least(self, run: int) -> float:
        """Unexplained power with what is stated and one change: of payload, friction, or a gain."""
        payload, friction = self._with_any_payload(run, self.stated[run])[0], self._with_own_friction(run).sum()
        return min(payload, float(friction), *(left for left, _, _ in self._with_gains(run)))

    def _unit(self, name: str) -> Floats:
        return np.eye(len(self.names))[self.names.index(name)]

    def _alternatives(self, run: int, has_peers: bool) -> list[Mapping[str, float]]:
        """Other counter-masses of the campaign, and none; with peers those of some of the sites too."""
        stated, whole = tuple(sorted(self.seen[run].counter_masses.items())), set(self.sets)
        part = {
            some for one in whole if len(one) <= MOST_SITES for n in range(len(one)) for some in combinations(one, n)
        }
        return [dict(one) for one in sorted(whole | (part if has_peers else set())) if one != stated]

    def _gains(self, run: int) -> list[tuple[float, Unlike]]:
        """Unexplained power with another gain of one drive's torque, where friction does not explain that as well."""
        friction = self._with_own_friction(run)
        return [
            (left, Unlike(None, joint, gain))
            for (left, own, gain), joint, dry in zip(self._with_gains(run), self.joints, friction, strict=True)
            if abs(gain - 1.0) > LEAST_GAIN and EXPLAINS * own < dry
        ]

    def _with_gains(self, run: int) -> list[tuple[float, float, float]]:
        """By drive: unexplained power of all, and of that drive, with another gain of its torque, and that gain [-]."""
        products, made = self.products[run], self._made(self.stated[run][None])[0]
        along = np.einsum("jk,jk->j", products[:, 0], made)
        power = np.maximum(np.einsum("jk,jkl,jl->j", made, products, made), 1e-300)
        left, own = self._left(self.stated)[run], products[:, 0, 0] - along**2 / power
        return [
            (float(left.sum() - left[j] + own[j]), float(own[j]), float(along[j] / power[j])) for j in range(len(own))
        ]

    def _with_own_friction(self, run: int) -> Floats:
        """Unexplained power of each drive (j,) where this run has friction of its own."""
        products, rest = self.products[run], self.torque - self._made(self.stated[run][None])[0]
        at = [self.names.index(name) for name in ("viscous", "coulomb")]
        found = np.einsum("jk,jkl,jl->j", rest, products, rest)
        for j, one in enumerate(products):
            along = one[at] @ rest[j]
            found[j] -= along @ np.linalg.pinv(one[np.ix_(at, at)], rcond=1e-10, hermitian=True) @ along
        return found
