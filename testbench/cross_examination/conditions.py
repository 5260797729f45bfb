"""Payload, counter-masses, peak acceleration and motion of each run: the run table against what the run shows.

Payload and scale of the torques, from the torques of all runs of a campaign together.

Of drive j in run r:  tau = s_j (model + p_r payload + sum c_r site) + k_j base + J_j a + b_j v + f_j sign(v) + o_jr.

Scale s, share k of the base's motion, drive inertia J and friction b, f are those of the campaign, payload p and
offset o those of the run. No stated payload is used: the masses of the links and the counter-masses, which the run
table states and in which a pair of runs differs, close the scale. Without them scale and payload are nearly confounded,
and the interval is wide. Gauss-Newton on products of columns; intervals by a jackknife over blocks of time.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from balance.arrays import Floats
from balance.estimation.estimate import coverage_factor, student_quantile
from balance.units import G0

from ..recording import mounted_masses
from ..rig.sensors import Torque
from .observation import BLOCKS, DRIVE_TERMS, Observation, TorqueEquations, jackknife
from .peak_accelerations import Peak
from .repeated_sizes import FALSE_ALARMS
from .statement import Statement, misread
from .torque_comparison import Unlike, comparable_torques, compared

ROUNDS = 12
"""Of Gauss-Newton; from stated payloads five suffice."""
COMMON = ("model", "base", *DRIVE_TERMS[1:])
"""Columns whose factors are the campaign's; the factor of ``model`` is the scale."""


@dataclass(frozen=True)
class TorqueBalance:
    """What the torques of a campaign say."""

    payload: Floats
    """By run, (r,) [kg]."""
    scale: Floats
    """Readings per torque, by joint, (j,) [-]."""
    inflation: Floats
    """Variance inflation factor of each payload, (r,) [-]: over that beside known scale, friction and inertia."""
    gain: Floats
    """Of the unexplained share of all runs, what a held payload's own value would explain, by run, (r,) [-]."""
    runs: tuple[str, ...]
    joints: tuple[str, ...]
    deviation: Floats
    """Standard uncertainty of each payload, (r,) [kg]."""
    scale_deviation: Floats

    @property
    def determined(self) -> bool:
        """Whether torques tell payloads from scale, drive inertia and friction."""
        return bool((self.inflation < MOST_INFLATION).all())


def torque_balance(
    equations: Mapping[str, TorqueEquations],
    payloads: Mapping[str, float],
    masses: Mapping[str, Mapping[str, float]],
    given: Collection[str] = (),
) -> TorqueBalance:
    """Solve the runs of ``equations`` with counter-masses ``masses`` [kg] by run, starting at ``payloads`` [kg].

    Runs ``given`` carry what is stated: the payload of each is what it alone would be, beside the others.
    """
    runs = tuple(equations)
    joints = equations[runs[0]].joints
    system = _System([equations[r] for r in runs], [masses[r] for r in runs])
    start = np.array([payloads[r] for r in runs])
    kept = np.array([r in given for r in runs])
    payload, scale, inflation, gain = system.solve(np.ones(BLOCKS, dtype=bool), start, np.ones(len(joints)), kept)
    start = np.where(kept, start, payload)
    without = [system.solve(np.arange(BLOCKS) != b, start, scale, kept) for b in range(BLOCKS)]
    deviations = [jackknife(np.array([one[k] for one in without])) for k in (0, 1)]
    return TorqueBalance(payload, scale, inflation, gain, runs, joints, *deviations)


class _System:
    """Normal equations of all runs, from products of columns."""

    def __init__(self, equations: Sequence[TorqueEquations], masses: Sequence[Mapping[str, float]]) -> None:
        self.names = equations[0].names
        self.products = np.stack([one.products for one in equations], axis=1)
        mean = self.products.sum(axis=0)
        torque, ones = self._at("torque"), self._at("offset")
        power = mean[:, :, torque, torque] - mean[:, :, torque, ones] ** 2 / mean[:, :, ones, ones]
        self.products = self.products / power[None, :, :, None, None]
        self.mounted = np.zeros((len(equations), len(self.names)))
        self.mounted[:, self._at("model")] = 1.0
        for row, some in zip(self.mounted, masses, strict=True):
            for site, mass in some.items():
                row[self._at(site)] = mass

    def _at(self, name: str) -> int:
        return self.names.index(name)

    def solve(
        self, used: np.ndarray, payload: Floats, scale: Floats, kept: np.ndarray
    ) -> tuple[Floats, Floats, Floats, Floats]:
        """Payloads, scales, inflation and gain by ``used`` blocks (b,), from payloads (r,) [kg] and scales (j,).

        Payloads ``kept`` (r,) stay as they are; what each alone would be is then one more step.
        """
        products = self.products[used].sum(axis=0)
        runs, joints, k = products.shape[:3]
        common = len(COMMON)
        # Unknowns: factors of COMMON by joint, payloads by run, offsets by run and joint.
        ends = np.cumsum([joints * common, runs, runs * joints])
        factors, at, offset = np.split(np.arange(ends[-1]), ends[:-1])
        values = np.zeros(ends[-1])
        values[factors[::common]], values[at] = scale, payload
        places = np.empty((runs, joints, common + 2), dtype=np.intp)
        places[:, :, :common], places[:, :, common] = factors.reshape(joints, common), at[:, None]
        places[:, :, common + 1] = offset.reshape(runs, joints)
        columns, readings = np.zeros((runs, joints, k, common + 2)), np.eye(k)[self._at("torque")]
        columns[:, :, [self._at(name) for name in COMMON[1:]], range(1, common)] = 1.0
        columns[:, :, self._at("offset"), common + 1] = 1.0
        free = np.setdiff1d(np.arange(ends[-1]), held := at[kept])
        for _ in range(ROUNDS):
            columns[:, :, :, 0] = self.mounted[:, None]
            columns[:, :, self._at("payload"), 0] = values[at, None]
            columns[:, :, self._at("payload"), common] = values[factors[::common]]
            own = values[places]
            own[:, :, common] = 0.0  # the payload's part is in the first column
            rest = readings - (columns @ own[..., None])[..., 0]
            weighted = np.swapaxes(columns, 2, 3) @ products
            normal, right = np.zeros((ends[-1], ends[-1])), np.zeros(ends[-1])
            np.add.at(normal, (places[..., :, None], places[..., None, :]), weighted @ columns)
            np.add.at(right, places, (weighted @ rest[..., None])[..., 0])
            width = np.sqrt(np.maximum(np.diag(normal), 1e-300))
            normal, right, step = normal / np.outer(width, width), right / width, np.zeros(ends[-1])
            step[free] = np.linalg.lstsq(normal[np.ix_(free, free)], right[free], rcond=1e-12)[0] / width[free]
            values += step
            if np.abs(step[at]).max() < 1e-6 * max(float(np.abs(values[at]).max()), 1.0):
                break
        inverse = np.linalg.inv(normal[np.ix_(free, free)] + 1e-12 * np.eye(len(free)))
        inflation, gain = np.zeros(ends[-1]), np.zeros(ends[-1])
        inflation[free] = np.diag(inverse)
        beside = inverse @ normal[np.ix_(free, held)]
        left = np.maximum(1.0 - np.sum(normal[np.ix_(free, held)] * beside, axis=0), 1e-12)
        rest = right[held] - beside.T @ right[free]
        values[held] += rest / left / width[held]
        inflation[held], gain[held] = 1.0 / left, rest**2 / left
        return values[at], values[factors[::common]], inflation[at], gain[at]


REJECTED = 5.0
"""Standard uncertainties at which a stated value is contradicted: with eight blocks and hundreds of statements, fewer
than one campaign in twenty."""
PAYLOAD_SHARE, PAYLOAD_KG = 0.06, 0.06
"""Error of a payload by torques that the model's errors leave: twice the largest of honest simulated campaigns."""
MOST_INFLATION = 2500.0
"""Variance inflation factor of a payload from which torques do not tell it from scale, drive inertia and friction: an
error of the model, as a share of the payload's torque, becomes one fifty times as large of the payload."""
LEAST_RUNS = 3
"""With torques, of which one may be told from the others."""
UNDETERMINED = (
    f"the torques do not tell payload from drive inertia; {LEAST_RUNS} or more runs are held against each other"
)
"""Why torques say nothing of payloads."""
CAMPAIGN_DEVIATIONS = 6.0
"""Robust standard deviations of witnessed less stated values over the campaign within which a run agrees."""
ACCELERATION_SHARE = {"command": 0.05, "encoders": 0.15}
"""Share by which a peak acceleration may differ: rounded in the run table, smoothed by the encoders' low-pass."""
NO_REPEAT = float(np.log(1.5))
"""Distance of a run from its nearest repeat from which it is none [logarithm of sizes]."""
NEAR_SHARE = 0.25
"""Most of that distance by which it differs from a run with other counter-masses, as which it counts; or NO_REPEAT."""
FOLLOWS = 0.95
"""Correlation from which torques follow the model with the masses of the run table."""
ABOVE_NOISE = 30.0
"""Span of a channel over its noise from which sizes are compared: white noise alone spans eight to ten."""
REPEATS_SCATTER, PRIOR_FREE = 0.02, 4.0
"""Of sizes in repeats of an honest bench, standard deviation [logarithm], and the degrees of freedom that it counts."""
MEDIAN_OF_PAIRS, REPEAT_SHARE = 0.954, 0.37
"""Median difference of two normal values [standard deviations], and the share of degrees of freedom that it has."""
FEWEST_DEGREES = 4
"""Of freedom of repeats, without the runs in question, below which NO_REPEAT, NEAR_SHARE and all channels decide."""
CONFIRMS = 4.0
"""Standard deviations of repeats by which two conditions differ, from which a channel tells which one a run is of."""
LEAST_APART = float(np.log(1.1))
"""Of sizes in two conditions, from which a channel tells them [logarithm]."""
NAMED_MOTIONS = frozenset({"x", "y", "z", "triangle"})
TORQUE_FACTOR = 2.0
"""Largest factor between a torque and its model without a finding, where the payload does not explain it."""


HEAVIER, PLAUSIBLE = 100.0, (0.01, 10.0)
"""Times the mechanism's own mass from which a stated mass may be in grams, and what it is then in kg."""
LEAST_GRAMS = 10.0
"""Stated mass below which it is not taken for grams: few bodies are so light."""
ROUNDED = 0.01
"""Share by which a mass in another unit may be beyond those of the other runs: it was rounded."""


def in_grams(observations: Sequence[Observation]) -> list[Statement]:
    """Payloads and counter-masses of the run table that a thousandth, or a thousandfold, would make like those of most
    other runs; and those too heavy for the mechanism, if a thousandth is not.
    """
    stated: dict[tuple[str, str], dict[str, float]] = {}
    for seen in observations:
        loads = {"": seen.conditions.get("payload_kg", 0.0)} | mounted_masses(seen.conditions, "payloads")
        for about, masses in ("payload", loads), ("counter-masses", seen.counter_masses):
            for name, mass in masses.items():
                stated.setdefault((about, name), {}).update({seen.name: mass} if mass > 0.0 else {})
    mechanism, found = {seen.name: seen.mechanism_kg for seen in observations}, list[Statement]()
    for (about, name), by_run in stated.items():
        for run, mass in by_run.items():
            others = [other for key, other in by_run.items() if key != run]
            if (why := _another_unit(mass, others, mechanism[run])) is not None:
                said = f"{mass:g} kg{f' at {name}' if name else ''} by the run table"
                witnessed = f"{why[1]}: may be grams for kilograms, or another slip of a thousand"
                code = "payload_contradiction" if about == "payload" else "counter_mass_contradiction"
                found.append(Statement(run, about, None, said, witnessed, why[0], code))
    return found


def _another_unit(mass: float, others: Sequence[float], mechanism: float) -> tuple[str, str] | None:
    """The witness by which a mass may be in another unit, and what it says; None where it is as the others."""
    thousandth = mass / 1000.0 if mass >= LEAST_GRAMS else 0.0
    least, most = (share * mechanism for share in PLAUSIBLE)
    if max(mass, *others, 0.0) > HEAVIER * mechanism > 0.0:
        if mass > most >= thousandth >= least:
            return "the mechanism", f"all that moves has {mechanism:g} kg"
        others = [other for other in others if other <= most]
    # Most others may be the ones in grams: where a thousandth is nearer to the mechanism's mass they are taken as such.
    read = [kg / 1000.0 if kg >= LEAST_GRAMS and kg * kg / 1000.0 > mechanism**2 > 0.0 else kg for kg in others]
    for meant in (1000.0 * mass, thousandth):
        stated, alike = ([kg for kg in some if 1.0 / 30.0 < meant / kg < 30.0] for some in (others, read))
        # Of as many in either unit those are meant that are nearer to it.
        nearer = (meant < mass) == (meant * mass > (mechanism or 1.0) ** 2)
        if not stated or 2 * len(alike) <= len(others) + (not nearer):
            continue
        if (1.0 - ROUNDED) * min(alike) <= meant <= (1.0 + ROUNDED) * max(alike):
            return "the run table of the other runs", f"{min(stated):g} to {max(stated):g} kg"
    return None


def accelerations(seen: Observation) -> list[Statement]:
    """The peak acceleration by the command and by the encoders, of a point or of joints.

    Of joints the run table may state the largest of one joint or, as motion files do, that along the leg.
    """
    turning, stated = seen.conditions.get("peak_acceleration_rad_s2"), seen.conditions.get("peak_acceleration_g")
    shown: list[tuple[str, float, Peak, str]] = []
    if turning and seen.peak_joint_acceleration:
        nearest = min(seen.peak_joint_acceleration, key=lambda peak: abs(peak.value - turning))
        shown.append(("encoders", turning, nearest, "rad/s2"))
    for witness, value in seen.peak_acceleration.items():
        if stated and value.value > 0.0 and (witness == "command" or seen.conditions.get("motion") in NAMED_MOTIONS):
            shown.append((witness, stated * G0, value, "m/s2"))

    found = _by_stored_motion(seen) if not turning else []
    for witness, wanted, peak, unit in shown:
        code = "acceleration_contradiction" if peak.contradicts(wanted, ACCELERATION_SHARE[witness]) else None
        column = "peak_acceleration_g" if unit == "m/s2" else "peak_acceleration_rad_s2"
        found.append(_peak_statement(seen, wanted, peak, unit, "run table", witness, code, column))
    return found


def _by_stored_motion(seen: Observation) -> list[Statement]:
    """The peak acceleration of joints by the encoders, against the stored motion's where the run table states none."""
    pairs = list(zip(seen.wanted_peaks, seen.peak_joint_acceleration, strict=False))
    if not pairs or min(min(wanted, peak.value) for wanted, peak in pairs) <= 0.0:
        return []
    wanted, peak = min(pairs, key=lambda pair: abs(np.log(pair[1].value / pair[0])))
    code = "motion_contradiction" if peak.contradicts(wanted, ACCELERATION_SHARE["encoders"]) else None
    return [_peak_statement(seen, wanted, peak, "rad/s2", "stored motion", "encoders", code, "")]


def _peak_statement(
    seen: Observation, wanted: float, peak: Peak, unit: str, source: str, witness: str, code: str | None, column: str
) -> Statement:
    table, text = (f"{v:.4g} {unit}" + (f" = {v / G0:.3g} g0" if unit == "m/s2" else "") for v in (wanted, peak.value))
    if np.isinf(peak.more):
        text = f"at least {peak.least:.4g} {unit} in a record that begins or ends in motion"
    elif peak.less < peak.more:
        text += f" [{peak.least:.4g}, {peak.most:.4g}]"
    return Statement(seen.name, "acceleration", None, f"peak {table} by the {source}", text, f"the {witness}", code,
                     column=column)  # fmt: skip


def motions(seen: Observation) -> list[Statement]:
    """By the command and the encoders; by an accelerometer, whose path drifts, unless one of them says as stated. One
    statement of all that say the same.
    """
    stated = seen.conditions.get("motion")
    if stated not in NAMED_MOTIONS:
        return []
    named = {source: [one.name for one in found] for source, found in seen.motions.items()}
    witnesses = {source: some for source, some in named.items() if some and "unknown" not in some}
    if any(set(some) == {stated} for some in witnesses.values()):
        witnesses.pop("acceleration", None)
    agreeing: dict[tuple[str, ...], list[str]] = {}
    for name, some in witnesses.items():
        agreeing.setdefault(tuple(dict.fromkeys(some)), []).append(f"the {name}")
    return [
        Statement(
            seen.name, "motion", None, f"motion {stated} by the run table", f"motion {', '.join(some)}",
            " and ".join(filter(None, (", ".join(names[:-1]), names[-1]))),
            None if some == (stated,) else "motion_contradiction",
        )
        for some, names in agreeing.items()
    ]  # fmt: skip


WITNESS = "its sensors beside those of its repeats"
Apart = Mapping[tuple[str, str], float]
"""By logger and channel, the logarithm of the ratio of sizes in two runs [-]."""


def unlike_repeats(observations: Sequence[Observation]) -> list[Statement]:
    """Runs whose forces, torques and base accelerations are unlike all their repeats, and like runs with other masses.

    Sizes of channels are compared, which needs no model. Where both of two repeats are unlike, torques that follow the
    model with the masses of the run table tell which of them carries these. Where the logs of one logger alone are
    those of another run (:func:`exchanged_logs`), that is stated instead.
    """
    found = list[Statement]()
    for seen in observations:
        same = [o for o in observations if o.unmounted_condition == seen.unmounted_condition]
        apart = {o.name: _apart(seen, o, same) for o in same if o is not seen}
        repeats = [o for o in same if o is not seen and o.counter_masses == seen.counter_masses]
        others = [o for o in same if o.counter_masses != seen.counter_masses]
        if (nearest := _like_others(apart, repeats, others)) is None:
            continue
        factor, other, wrong = nearest
        wrong = wrong and not (_follows(seen, same) and not any(_follows(o, same) for o in repeats))
        right = [one for one in seen.rig.loggers if _tells_repeat(apart, repeats, others, one)]
        if wrong or right:
            witnessed = f"channels of {' and '.join(right)} are as large as in {repeats[0].name}, a repeat"
            if wrong:
                witnessed = (
                    f"its channels differ from those of {repeats[0].name}, a repeat, by a factor of {factor:.2g}, "
                )
                witnessed += f"the median, and agree with those of {other.name}, with {_masses(other.counter_masses)}"
            stated = f"{_masses(seen.counter_masses)} by the run table"
            code = "counter_mass_contradiction" if wrong else None
            found.append(Statement(seen.name, "counter-masses", None, stated, witnessed, WITNESS, code))
    mixed = exchanged_logs(observations)
    return [s for s in found if s.run not in {one.run for one in mixed}] + mixed


def exchanged_logs(observations: Sequence[Observation]) -> list[Statement]:
    """Runs of which one logger's logs are those of another condition of the motion, while another's are their own.

    The channel that tells two conditions best, without the runs in question, decides. Of two runs that each fit the
    other's condition logs may be exchanged; of one alone, with two repeats, all channels that tell the two must say so.
    """
    found, groups = list[Statement](), list[list[Observation]]()
    for seen in observations:
        same = next((group for group in groups if group[0].commanded == seen.commanded), None)
        groups.append([seen]) if same is None else same.append(seen)
    for runs in groups:
        loggers = {logger: _LogSizes(runs, logger) for logger in runs[0].rig.loggers}
        labels = next((one.labels for one in loggers.values()), np.zeros(0))
        for logger, own in loggers.items():
            rest = [(name, one) for name, one in loggers.items() if name != logger]
            for a, seen in enumerate(runs):
                partners, right = dict[int, list[str]](), dict[int, list[str]]()
                for c in sorted({*labels} - {labels[a]}):
                    votes = {name: one.fits(a, c, (a,)) for name, one in rest}
                    if True in votes.values() or False not in votes.values():
                        continue  # the run itself may be another, or nothing tells that it is not
                    right[c] = [name for name, vote in votes.items() if vote is False]
                    partners[c] = [
                        runs[b].name
                        for b in np.flatnonzero(labels == c).tolist()
                        if own.fits(a, c, (a, b)) and own.fits(b, labels[a], (a, b))
                        if any(one.fits(b, labels[a], (b,)) is False for _, one in rest)
                    ]
                exchanged = [c for c in right if partners[c]]
                for c in exchanged or [c for c in right if own.fits(a, c, (a,), alone=True)]:
                    like = [one for one, label in zip(runs, labels, strict=True) if label == c]
                    found.append(_of_another(seen, logger, like, partners[c], right[c]))
    return found


class _LogSizes:
    """Logarithms of the sizes of a logger's channels in runs of one motion, by condition."""

    def __init__(self, runs: Sequence[Observation], logger: str) -> None:
        conditions = list[dict[str, object]]()
        conditions += [o.condition for i, o in enumerate(runs) if o.condition not in [p.condition for p in runs[:i]]]
        self.labels = np.array([conditions.index(o.condition) for o in runs])
        channels = dict.fromkeys(c for o in runs for c, one in o.records.items() if one.column.logger == logger)
        self.values = np.full((len(runs), len(channels)), np.nan)
        for k, channel in enumerate(channels):
            records = [o.records.get(channel) for o in runs]
            if any(one is not None and one.span > ABOVE_NOISE * one.noise for one in records):
                sizes = [0.0 if one is None or one.dead or one.clipped else one.span for one in records]
                self.values[:, k] = np.log([size if size > 0.0 else np.nan for size in sizes])
        self.rate = FALSE_ALARMS / (2.0 * len(runs) * max(len(conditions) - 1, 1))

    def fits(self, run: int, other: int, left_out: tuple[int, ...], alone: bool = False) -> bool | None:
        """Whether a run is as another condition and as none of its own repeats, False if as these; None if it is not
        told. ``alone``: of two repeats or more, by all channels that tell the two conditions, two or more.

        Conditions count by their medians without runs ``left_out``, scatter by the median of differences between
        repeats, with that of honest benches as four more degrees of freedom: Smyth, G. K., Statistical Applications in
        Genetics and Molecular Biology 3 (2004), 3.
        """
        kept = np.isin(np.arange(len(self.labels)), left_out, invert=True)
        sides = [self.values[kept & (self.labels == c)] for c in (self.labels[run], other)]
        if len(sides[0]) < 1 + alone or not len(sides[1]) or not self.values.size:
            return None
        pairs = [(i, j) for i, j in combinations(np.flatnonzero(kept).tolist(), 2) if self.labels[i] == self.labels[j]]
        degrees = int(kept.sum()) - len({*self.labels[kept]})
        free, few = REPEAT_SHARE * degrees, degrees < FEWEST_DEGREES
        apart = np.abs([self.values[i] - self.values[j] for i, j in pairs or [(run, run)]])
        scatter = np.median(apart, axis=0) / MEDIAN_OF_PAIRS
        scatter = np.sqrt((free * scatter**2 + PRIOR_FREE * REPEATS_SCATTER**2) / (free + PRIOR_FREE))
        limit = student_quantile(1.0 - self.rate, free + PRIOR_FREE) * scatter * np.sqrt(1.0 + 1.0 / len(sides[0]))
        limit = np.maximum(limit, NO_REPEAT if few else 0.0)
        own, far = (np.median(side, axis=0) for side in sides)
        surely = np.nan_to_num(np.abs(far - own) / np.maximum(CONFIRMS * scatter, LEAST_APART))
        tells, best = surely > 1.0, int(np.argmax(surely))
        if not tells[best]:
            return None
        away, near = (np.abs(side - self.values[run]).min(axis=0) for side in sides)
        if not (away[best] > limit[best] and near[best] < (NEAR_SHARE if few else 0.5) * away[best]):
            return False if away[best] < near[best] else None
        nearer = (near < away)[tells]
        return bool(
            (nearer.all() if alone or few else 2 * nearer.sum() > len(nearer)) and (len(nearer) > 1 or not alone)
        )


def _of_another(
    seen: Observation, logger: str, like: Sequence[Observation], partners: Sequence[str], right: Sequence[str]
) -> Statement:
    """That a run's logs of a logger are as those of ``like``, another condition; those of ``right`` are its own."""
    masses = seen.counter_masses != like[0].counter_masses
    stated = f"{_carried(seen)} by the run table and as {' and '.join(right)} confirm" + "s" * (len(right) == 1)
    first = next((o for o in like if o.name not in partners), like[0])
    witnessed = f"channels of {logger} agree with those of {first.name}, with {_carried(like[0])}: "
    if partners:
        witnessed += f"logs of {logger} exchanged between {seen.name} and {' or '.join(partners)}?"
    else:
        witnessed += f"these logs of {logger} may belong to another run, such as {like[0].name}"
    return Statement(seen.name, "counter-masses" if masses else "copy", None, stated, witnessed, WITNESS,
                     "counter_mass_contradiction" if masses else "copied_run",
                     tuple(partners), because="copied_run")  # fmt: skip


def _carried(seen: Observation) -> str:
    payload = seen.conditions.get("payload_kg")
    return f"{f'{payload:g} kg of payload and ' * (payload is not None)}{_masses(seen.counter_masses)}"


def _follows(seen: Observation, same: Sequence[Observation]) -> bool:
    """Whether all torques follow the model with the masses of the run table, in size too unless their gain is odd."""
    found = [
        one.correlation[i] > FOLLOWS
        and (abs(np.log(max(one.gain[i], 1e-300))) < NO_REPEAT or _is_odd(seen, column.channel, same))
        for one in seen.responses
        for i, column in enumerate(one.columns)
        if isinstance(seen.rig.sensors.get(column.sensor), Torque)
    ]
    return bool(found) and all(found)


def _is_like(away: float, near: float) -> bool:
    """Whether sizes that are ``away`` from all of some runs are ``near`` those of others [logarithms]."""
    return away > NO_REPEAT and near < min(NEAR_SHARE * away, NO_REPEAT)


def _like_others(
    apart: Mapping[str, Apart], repeats: Sequence[Observation], others: Sequence[Observation]
) -> tuple[float, Observation, bool] | None:
    """Factor between sizes and those of the nearest repeat, the nearest run with other masses, and whether sizes are
    like its; medians over the channels. None where nothing is compared.
    """
    medians = {name: float(np.median([*sizes.values()])) for name, sizes in apart.items() if sizes}
    away = [medians[o.name] for o in repeats if o.name in medians]
    nearby = [(medians[o.name], o) for o in others if o.name in medians]
    if not away or not nearby:
        return None
    near, other = min(nearby, key=lambda one: one[0])
    return float(np.exp(min(away))), other, _is_like(min(away), near)


def _tells_repeat(
    apart: Mapping[str, Apart], repeats: Sequence[Observation], others: Sequence[Observation], logger: str
) -> bool:
    """Whether a channel of a logger is like a repeat and unlike all runs with other masses, and none the reverse."""
    votes = set[bool]()
    for key in set[tuple[str, str]]().union(*(apart[o.name] for o in repeats)):
        away, near = ([apart[o.name][key] for o in some if key in apart[o.name]] for some in (repeats, others))
        if near and key[0] == logger and _is_like(min(near), min(away)):
            votes.add(True)
        elif near and key[0] == logger and _is_like(min(away), min(near)):
            votes.add(False)
    return votes == {True}


def _apart(seen: Observation, other: Observation, same: Sequence[Observation]) -> Apart:
    """By logger and channel the logarithm of the sizes' ratio, of all that shakes above the noise.

    A channel that is larger or smaller in one of the two than in all other runs of the ``same`` condition, with and
    without counter-masses, is another gain and no other mass.
    """
    found = dict[tuple[str, str], float]()
    for channel, record in seen.records.items():
        beside, column = other.records.get(channel), record.column
        if beside is None or {record.dead, beside.dead, record.clipped, beside.clipped} != {False}:
            continue
        moved = column.dimensions[0] == "acceleration" and column.sensor not in seen.rig.base_accelerometers
        small, large = sorted((record.span, beside.span))
        if moved or not large > ABOVE_NOISE * max(record.noise, beside.noise) or not small > 0.0:
            continue
        if not any(_is_odd(one, channel, same) for one in (seen, other)):
            found[column.logger, channel] = float(np.log(large / small))
    return found


def _is_odd(seen: Observation, channel: str, same: Sequence[Observation]) -> bool:
    """Whether a channel's size is outside all of at least three other runs' by a factor that is no scatter."""
    if channel not in seen.records:
        return False
    own = seen.records[channel].span
    spans = [o.records[channel].span for o in same if o is not seen and channel in o.records]
    return len(spans) > 2 and not min(spans) / np.exp(NO_REPEAT) < own < max(spans) * np.exp(NO_REPEAT)


def mounted(
    observations: Sequence[Observation], unlike: Collection[str], mixed: Collection[str] = ()
) -> tuple[list[Statement], dict[str, Mapping[str, float]]]:
    """Statements on counter-masses and torques, and the counter-masses that explain each run's torques.

    A run whose torques are in no relation to the model's has none, nor has one that is ``unlike`` its repeats unless
    the torques of the others tell what it carried. With the wrong counter-masses torques ask for a negative scale and a
    negative payload: a counter-mass carries weight on the other side of its arm. Of runs whose logs are ``mixed`` with
    those of another nothing is stated.
    """
    observations = [o for o in observations if o.name not in mixed]
    sets = [dict(s) for s in {tuple(sorted(o.counter_masses.items())): None for o in observations} if s]
    statements: list[Statement] = []
    found: dict[str, Mapping[str, float]] = {}
    beside = compared(observations)
    for seen in observations:
        if seen.torque is None or "payload_kg" not in seen.conditions:
            continue
        if (cause := beside.unlike.get(seen.name)) is not None:
            statements.append(_beside_others(seen, cause))
            if cause.masses is not None:
                found[seen.name] = cause.masses
            continue
        if seen.name in unlike:
            continue
        stated = _alone(seen, seen.counter_masses)
        gross = _gross_torques(seen, stated)
        statements += gross
        if gross:
            continue
        found[seen.name] = masses = _fitting_masses(seen, stated, [{}] if seen.counter_masses else sets)
        wrong = "counter_mass_contradiction" if masses != seen.counter_masses else None
        if wrong or (sets and seen.name in beside.confirmed):
            statements.append(
                Statement(seen.name, "counter-masses", None, f"{_masses(seen.counter_masses)} by the run table",
                          _masses(masses), "the drives' torques", wrong)
            )  # fmt: skip
    return statements, found


def _beside_others(seen: Observation, cause: Unlike) -> Statement:
    witness = "the drives' torques, beside those of the other runs"
    if cause.masses is not None:
        return Statement(seen.name, "counter-masses", None, f"{_masses(seen.counter_masses)} by the run table",
                         _masses(cause.masses), witness, "counter_mass_contradiction")  # fmt: skip
    if not cause.joint:
        witnessed = (
            f"{cause.times:.2g} times what the model leaves unexplained in other runs with these counter-masses; "
        )
        witnessed += "neither another payload, friction or gain nor counter-masses explain it"
        stated = f"torques as in the other runs with {_masses(seen.counter_masses)}"
        return Statement(seen.name, "torque", None, stated, witnessed, witness, "torque_contradiction")
    channel = next(c.channel for c in seen.rig.columns_of(Torque) if c.component == cause.joint)
    return Statement(seen.name, "gain", channel, f"torque of {cause.joint} as in the other runs",
                     f"{cause.gain:.3g} times that", witness, "gain_contradiction")  # fmt: skip


def _fitting_masses(
    seen: Observation, stated: TorqueBalance, alternatives: Sequence[Mapping[str, float]]
) -> Mapping[str, float]:
    """The stated counter-masses, or those alternative ones with which the torques make sense, in size too.

    Where torques hardly tell scale and payload from drive inertia a wrong sign is no proof against the stated ones.
    """
    wrong = (stated.scale < -REJECTED * stated.scale_deviation).all()
    if not (wrong and (stated.payload < -REJECTED * stated.deviation).all()):
        return seen.counter_masses
    solved = [(masses, _alone(seen, masses)) for masses in alternatives]
    sized = (1.0 / TORQUE_FACTOR, TORQUE_FACTOR)
    physical = [
        (masses, one)
        for masses, one in solved
        if ((one.scale > sized[0]) & (one.scale < sized[1])).all() and one.payload[0] > 0.0
    ]
    expected = seen.conditions["payload_kg"]
    return min(physical, key=lambda o: abs(float(o[1].payload[0]) - expected), default=(seen.counter_masses, stated))[0]


def _gross_torques(seen: Observation, alone: TorqueBalance) -> list[Statement]:
    """Torques that are more than TORQUE_FACTOR times the model's, or less, whatever the payload and as it is stated.

    In one run payload, drive inertia and the base's motion may take the place of the model: named is the factor of the
    model with the stated masses.
    """
    found = []
    for j, (joint, *alike) in enumerate(zip(alone.joints, alone.scale, alone.scale_deviation, strict=True)):
        factor, error = _factor_beside_friction(seen, j)
        apart = (
            not 1.0 / TORQUE_FACTOR <= abs(one) <= TORQUE_FACTOR and abs(abs(one) - 1.0) > REJECTED * uncertainty
            for one, uncertainty in (alike, (factor, error))
        )
        if all(apart) and alone.payload[0] > 0.0:
            witnessed = f"{factor:.2g} times the model's beside friction, standard uncertainty {error:.1g}, "
            witnessed += f"expected {1.0 / TORQUE_FACTOR:g} to {TORQUE_FACTOR:g}"
            column = next(c for c in seen.rig.columns_of(Torque) if c.component == joint)
            witnessed += misread(column, abs(factor))
            stated = f"torque of {joint} by the model"
            found.append(Statement(seen.name, "gain", None, stated, witnessed, "its readings", "torque_contradiction"))
    return found


def _factor_beside_friction(seen: Observation, joint: int) -> tuple[float, float]:
    """Least-squares factor of the model with all that the run table states, beside friction; its uncertainty [-]."""
    assert seen.torque is not None
    names, each = seen.torque.names, seen.torque.products[:, joint]
    sums, stated = each.sum(axis=0) - [0.0 * each[0], *each], {"payload": seen.conditions["payload_kg"]}
    columns = np.zeros((len(names), 4))  # the model's, and what friction makes
    columns[:, 0] = [({"model": 1.0} | stated | seen.counter_masses).get(name, 0.0) for name in names]
    columns[[names.index(name) for name in ("offset", "viscous", "coulomb")], [1, 2, 3]] = 1.0
    columns /= (width := np.sqrt(np.maximum(np.diag(columns.T @ sums[0] @ columns), 1e-300)))
    inverse = np.linalg.pinv(columns.T @ sums @ columns, rcond=1e-10, hermitian=True)
    found = (inverse @ (columns.T @ sums)[..., [names.index("torque")]])[:, 0, 0] / width[0]
    return float(found[0]), float(jackknife(found[1:]))


def _alone(seen: Observation, masses: Mapping[str, float]) -> TorqueBalance:
    assert seen.torque is not None
    return torque_balance({seen.name: seen.torque}, {seen.name: seen.conditions["payload_kg"]}, {seen.name: masses})


def _masses(masses: Mapping[str, float]) -> str:
    return " and ".join(f"{mass:g} kg at {site}" for site, mass in masses.items()) or "no counter-masses"


def payloads(
    observations: Sequence[Observation], masses: Mapping[str, Mapping[str, float]]
) -> tuple[list[Statement], TorqueBalance | None]:
    """Payloads by the torques of the campaign, with counter-masses ``masses`` [kg] by run, and the torques' scale.

    Where they do not determine it, as with one drive whose inertia is not known, each run's payload is what its torques
    ask for beside those of the other runs, which carried what is stated; fewer than half are told from the others.
    """
    used = {o.name: (o, torque) for o, torque in comparable_torques([o for o in observations if o.name in masses])}
    if not used:
        return [], None
    stated = {name: o.conditions["payload_kg"] for name, (o, _) in used.items()}
    equations = {name: torque for name, (_, torque) in used.items()}
    carried = {name: masses[name] for name in used}
    solved = torque_balance(equations, stated, carried)
    if solved.determined:
        return _payload_statements(solved, stated, "the drives' torques"), solved
    if len(used) < LEAST_RUNS:
        return [], None
    witness = "the drives' torques, by what the run table says of the other runs"
    beside = solved = torque_balance(equations, stated, carried, list(used))
    if not solved.determined:
        return [], None
    found, wrong, apart = _payload_statements(solved, stated, witness), set[str](), list[str]()
    while 2 * len(apart) + 2 < len(used):
        # Of the others the run whose own payload explains most; each of them contradicts once none is a witness.
        apart.append(beside.runs[int(np.argmax(beside.gain))])
        beside = torque_balance(equations, stated, carried, [name for name in used if name not in apart])
        statements = _payload_statements(beside, stated, witness)
        if beside.determined and {s.run for s in statements if s.code} >= set(apart):
            found, solved, wrong = statements, beside, set(apart)
    return [replace(s, code=None) if wrong and s.run not in wrong else s for s in found], solved


def _payload_statements(solved: TorqueBalance, stated: Mapping[str, float], witness: str) -> list[Statement]:
    difference = solved.payload - np.array(list(stated.values()))
    centre = float(np.median(difference)) if len(stated) > 4 else 0.0
    scatter = 1.4826 * float(np.median(np.abs(difference - centre))) if len(stated) > 4 else 0.0
    statements = []
    for i, (name, table) in enumerate(stated.items()):
        value, error = float(solved.payload[i]), float(solved.deviation[i])
        least = max(PAYLOAD_SHARE * table + PAYLOAD_KG, REJECTED * error, CAMPAIGN_DEVIATIONS * scatter)
        wrong = abs(value - table) > least
        half = coverage_factor() * float(np.hypot(error, 0.5 * (PAYLOAD_SHARE * table + PAYLOAD_KG)))
        interval = f"{value:.2f} kg [{value - half:.2f}, {value + half:.2f}]"
        code = "payload_contradiction" if wrong else None
        statements.append(Statement(name, "payload", None, f"{table:g} kg by the run table", interval, witness, code))
    return statements
