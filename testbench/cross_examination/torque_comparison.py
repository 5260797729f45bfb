"""What explains a run's torques beside those of the other runs: other counter-masses than stated, or another gain.

Of drive j in run r, with the payload and counter-masses of the run table in ``body``:

tau = s_j body_r + k_j base + J_j a + b_j v + f_j sign(v) + o_jr.

All factors but the offset o are the campaign's, by least squares in which a run weighs the less the more it leaves
unexplained, so that those that agree decide. All power is a share of what the run's motion asks for without
counter-masses: a gentle run leaves less than a fast one. With these factors each run is asked which one change leaves
least: another payload, other counter-masses, or another gain of a drive.

Where the file's masses are wrong all runs with one set of counter-masses are unlike the model in one way. So a run is
told from its peers, those with the same set, where it has any; without them it may only have carried another whole set.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from balance.arrays import Floats

from .observation import DRIVE_TERMS, Observation, TorqueEquations

FEWEST = 5
"""Runs with torques of which some may be told from the others."""
EXPLAINS = 4.0
"""Unexplained power with what is stated and any payload, over that with another cause, from which that is named; and
over that of the best of its peers."""
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


@dataclass(frozen=True)
class Unlike:
    """What explains the torques of a run that is unlike the others."""

    masses: Mapping[str, float] | None
    """Counter-masses by site [kg]; None: as stated."""
    joint: str = ""
    """Whose torque has another gain."""
    gain: float = 1.0
    """Of that torque, over that in the other runs [-]."""


def unlike_others(observations: Sequence[Observation]) -> dict[str, Unlike]:
    """Runs whose torques one change explains, and what was stated does not; none where half of them are unlike."""
    if len(seen := comparable_torques(observations)) < FEWEST:
        return {}
    campaign = _Campaign(seen)
    found = {one.name: unlike for i, (one, _) in enumerate(seen) if (unlike := campaign.unlike(i))}
    return found if 2 * len(found) < len(seen) else {}


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
        products = np.stack([torque.products.sum(axis=0) for _, torque in seen])
        at = self.names.index("offset")
        self.products = products - products[..., :, [at]] * products[..., [at], :] / products[..., [at], [at], None]
        scale = np.median(self.products[:, :, 0, 0], axis=0)  # of the torques, so that each drive counts alike
        self.products = self.products / np.maximum(scale, 1e-300)[None, :, None, None]
        self.torque, self.common = np.eye(len(self.names))[0], [self.names.index(name) for name in COMMON]
        self.stated = np.array([self._body(o, o.counter_masses) for o in self.seen])
        bare = np.array([self._body(o, {}) for o in self.seen])
        power = np.einsum("rk,rjkl,rl->r", bare, self.products, bare)  # so that a gentle run counts as a fast one does
        self.products /= np.maximum(power, LEAST_POWER * np.median(power) + 1e-300)[:, None, None, None]
        self.factors = self._agreed()
        self.left = self._left(self.stated).sum(axis=1)

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

    def unlike(self, run: int) -> Unlike | None:
        """What one change explains a run; None where it is like the others, or nothing explains it."""
        seen, stated = self.seen[run], self._with_any_payload(run, self.stated[run])[0]
        peers = [self.left[i] for i, o in enumerate(self.seen) if i != run and o.counter_masses == seen.counter_masses]
        least = min(peers) if peers else float(np.median(self.left))
        if stated < EXPLAINS * least:
            return None
        found = self._masses(run, bool(peers))
        found += self._gains(run) if peers else []
        left, best = min(found, key=lambda one: one[0], default=(np.inf, Unlike(None)))
        if EXPLAINS * left > stated or not 1.0 / MOST_GAIN < best.gain < MOST_GAIN:
            return None
        return best

    def _masses(self, run: int, has_peers: bool) -> list[tuple[float, Unlike]]:
        """Unexplained power with other counter-masses and any payload above zero."""
        each = self._alternatives(run, has_peers)
        left = [self._with_any_payload(run, self._body(self.seen[run], masses)) for masses in each]
        return [(rest, Unlike(masses)) for (rest, payload), masses in zip(left, each, strict=True) if payload > 0.0]

    def _alternatives(self, run: int, has_peers: bool) -> list[Mapping[str, float]]:
        """Other counter-masses of the campaign, and none; with peers those of some of the sites too."""
        stated = tuple(sorted(self.seen[run].counter_masses.items()))
        whole = {tuple(sorted(o.counter_masses.items())) for o in self.seen} | {()}
        part = {
            some for one in whole if len(one) <= MOST_SITES for n in range(len(one)) for some in combinations(one, n)
        }
        return [dict(one) for one in sorted(whole | (part if has_peers else set())) if one != stated]

    def _gains(self, run: int) -> list[tuple[float, Unlike]]:
        """Unexplained power with another gain of each drive's torque."""
        products, made = self.products[run], self._made(self.stated[run][None])[0]
        along = np.einsum("jk,jk->j", products[:, 0], made)
        power = np.maximum(np.einsum("jk,jkl,jl->j", made, products, made), 1e-300)
        left, own = self._left(self.stated)[run], products[:, 0, 0] - along**2 / power
        gains, by_friction = along / power, self._with_own_friction(run)
        return [
            (float(left.sum() - left[j] + own[j]), Unlike(None, joint, float(gains[j])))
            for j, joint in enumerate(self.joints)
            if abs(gains[j] - 1.0) > LEAST_GAIN and EXPLAINS * own[j] < by_friction[j]
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
