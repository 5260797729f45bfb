"""Sign, gain and axis of each sensor, channels that are dead or drift: against the model and the other runs."""

from collections import defaultdict
from collections.abc import Collection, Sequence
from itertools import combinations, permutations

import numpy as np

from balance.units import G0

from ..rig import Column
from ..rig.sensors import Torque
from .mounting import Signs, exchanged_axes, exchanges, signs_of
from .observation import ABOVE_NOISE, Observation, Response
from .statement import Statement, misread

FOLLOWS = 0.95
"""Correlation with the expected reading from which a channel's gain is known: what counter-masses leave is as small as
what the model lacks, and correlates less."""
PROVEN = 0.9
"""Correlation from which the model of the base, which a rig may assume, proves right enough to contradict an axis or a
sign: of other channels, or of the same with the axes exchanged."""
ABOVE_LACKS = 2.0
"""Expected reading of an accelerometer over what the model lacks in a run that proves it, from which noise alone is a
dead channel [-]."""
WHOLE = 0.95
"""Opposition, of all axes of a sensor on the base together, from which the model of the base proves right in all but
the sign: of 300 honest pairs whose rigs state 0.01 to 100 times the stiffness none exceeds 0.92. So does one axis that
is as large as what another should show, and its opposite, where the other shakes too little to follow it."""
REVERSED = -0.8
"""Correlation with its load below which a force channel is reversed."""
LARGE = 0.1
"""Least expected load of a force channel over the largest of its kind."""
SIMILAR_SIZE = 2.0
"""Largest factor, either way, between readings and load of a force channel that is checked."""
LEAST_EXPLAINED = 0.8
"""Mean square of the correlations from which the model explains the forces."""
GAIN_FACTOR = 1.6
"""Least factor between gains of two runs that is a contradiction: on the deep simulated bench the model of the base is
right to a factor of 1.5 across the motion."""
GAIN_DEVIATIONS = 6.0
"""Robust standard deviations of the logarithm of a channel's gains over the campaign within which a run agrees."""
NOISE_FACTOR = 1.5
"""Least factor between noises of a channel in two runs that is a contradiction."""
FLAT = 0.1
"""Share of the expected reading below which a channel is flat."""
OTHER_RUN = 3.0
"""Factor of reading over model, inverse in the other run of a pair, from which runs or counter-masses are exchanged."""
EXCHANGED = 0.35
"""Remainder with axes exchanged over that without from which they are exchanged; those that are also reversed over that
with any axes reversed, and of three over that with two exchanged."""
DOUBTFUL, AS_STATED = 0.5, 1.0 / 3.0
"""Remainder of axes as they are above which they may be exchanged, and below which they follow the model: correlations
of 0.58 and 0.71, in between nothing is known."""
SIGN_SHOWN = 0.7
"""Correlation from which a channel's sign is witnessed."""
ACCELERATION: tuple[str, ...] = ("acceleration",)
UNITS: dict[tuple[str, ...], str] = {ACCELERATION: "m/s2", ("force",): "N", ("moment",): "N m"}
MANY_STEPS = 8
"""Values from which a channel vibrates by more than its step."""
DRIFT_SHARE = 0.25
"""Least drift over the vibration's span that is a contradiction."""
LEAST_DRIFT = 0.25 * G0
"""Least drift that is a contradiction [m/s2]: what is slower than the band of an analysis is not in it."""


def levels(observations: Sequence[Observation]) -> list[Statement]:
    """Channels that show one value only while something moves, or keep one, and accelerometers whose levels drift.

    A single axis may rest within the sensor's step: it is dead where it vibrates in another run of that kind.
    """
    kinds = {o.name: (o.conditions.get("motion"), bool(o.counter_masses)) for o in observations}
    each = [(seen, channel, record) for seen in observations for channel, record in seen.records.items()]
    silent = {(channel, kinds[seen.name]) for seen, channel, record in each if record.dead}
    alive = {
        kind
        for seen, channel, record in each
        if (kind := (channel, kinds[seen.name])) in silent and len(np.unique(record.start)) > MANY_STEPS
    }
    found = []
    for seen, channel, record in each:
        if record.stuck is not None:
            stated = "it should change as in the rest of the record"
            found.append(Statement(seen.name, "dead", channel, stated, record.stuck, "its readings", "flat_channel"))
        elif record.dead:
            siblings = [seen.records[c.channel] for c in record.column.siblings if c.channel in seen.records]
            dead = seen.moves and (all(s.dead for s in siblings) or (channel, kinds[seen.name]) in alive)
            stated, witnessed = "it should vibrate, for encoders or command move", "one value all the time"
            code = "flat_channel" if dead else None
            found.append(Statement(seen.name, "dead", channel, stated, witnessed, "its readings", code))
        if not record.dead and record.column.dimensions == ACCELERATION:
            drifts = abs(record.drift) > max(DRIFT_SHARE * record.span, LEAST_DRIFT)
            moves = "drifts by" if drifts else "stays within"
            witnessed = f"it {moves} {abs(record.drift):.3g} m/s2, beneath a vibration of {record.span:.3g} m/s2"
            code = "level_drift" if drifts else None
            found.append(Statement(seen.name, "rest", channel, "its level is at rest", witnessed, "its readings", code))
    return found


def mechanisms(observations: Sequence[Observation]) -> list[Statement]:
    """Runs whose mechanism cannot be read, or whose loops do not follow the encoders, and follow those of another."""
    stated, code = "the mechanism of the rig", "unread_mechanism"
    unread = [
        Statement(seen.name, "mechanism", None, stated, f"it cannot be read: {seen.unread}", "its stored text", code)
        for seen in observations
        if seen.unread is not None
    ]
    if not any(seen.peak_joint_acceleration or "encoders" in seen.peak_acceleration for seen in observations):
        return unread
    stated = "the mechanism's loops follow the encoders, as in other runs"
    return unread + [
        Statement(seen.name, "encoder", None, stated, seen.unclosed, "the encoders", "encoder_contradiction")
        for seen in observations
        if seen.unclosed is not None
    ]


Heard = Sequence[tuple[Observation, Response]]
Gained = dict[str, dict[str, tuple[float, float]]]
"""Gain and its standard uncertainty by channel and run."""


def examined_sensors(observations: Sequence[Observation], unsure: frozenset[str]) -> list[Statement]:
    """Axis, sign and gain of every sensor of every run; the model of runs of ``unsure`` masses is no witness.

    But of what shows the motion alone, whatever is mounted: a command, or an accelerometer on what moves.
    """
    heard = [
        (seen, one)
        for seen in observations
        for one in seen.responses
        if seen.name not in unsure
        or (one.columns[0].dimensions == ACCELERATION and one.columns[0].sensor not in seen.rig.base_accelerometers)
    ]
    statements: list[Statement] = []
    gains: Gained = defaultdict(dict)
    others = _Others(heard)
    for seen, one in heard:
        wrong = _exchanged(seen, one, others)
        statements += wrong
        if any(s.code for s in wrong):
            continue
        statements += _signs(seen, one, others)
        least = FOLLOWS if one.columns[0].dimensions == ACCELERATION else PROVEN
        for i in map(int, np.flatnonzero(one.witnessed & (one.correlation > least))):
            record = seen.records.get(one.columns[i].channel)
            if not one.columns[0].commanded and not (record and record.clipped):
                gains[one.columns[i].channel][seen.name] = (float(one.gain[i]), float(one.gain_deviation[i]))
    for seen in observations:
        known = {s.channel for s in statements if s.run == seen.name and s.code == "force_sign"}
        statements += [s for s in ([] if seen.name in unsure else _forces(seen)) if s.channel not in known]
    statements += _exchanged_runs([(seen, one) for seen, one in heard if _is_accelerometer(one.columns[0])])
    columns = {column.channel: column for _, one in heard for column in one.columns}
    for channel, by_run in gains.items():
        statements += _gain_statements(columns[channel], by_run)
    found = {(s.run, s.channel) for s in statements if s.code in {"gain_contradiction", "flat_channel"}}
    return statements + [s for s in _noises(observations, gains, found) if (s.run, s.channel) not in found]


def _is_accelerometer(column: Column) -> bool:
    return column.dimensions == ACCELERATION and not column.commanded


def _whole(one: Response) -> tuple[float, float]:
    """Correlation with the model, and gain, of all witnessed channels together [-]; zeros where none reads."""
    yy, yp, pp = (np.diag(m)[one.witnessed].sum() for m in (one.yy, one.yp, one.pp))
    return (float(yp / np.sqrt(yy * pp)), float(yp / pp)) if yy * pp > 0.0 else (0.0, 0.0)


class _Others:
    """What the other runs of a campaign show of a channel, against the model."""

    def __init__(self, heard: Heard) -> None:
        self._by_channel: dict[str, dict[str, tuple[float, float, float]]] = defaultdict(dict)
        self._largest: dict[str, float] = defaultdict(float)
        self._heard = heard
        for seen, one in heard:
            for column, expected in zip(one.columns, one.expected, strict=True):
                self._largest[column.channel] = max(self._largest[column.channel], float(expected))
            for i in np.flatnonzero(one.witnessed):
                reading = float(one.readings[i])
                found = float(one.correlation[i]), reading / float(one.expected[i]), reading
                self._by_channel[one.columns[i].channel][seen.name] = found

    def _of(self, seen: Observation, one: Response, i: int) -> list[tuple[float, float, float]]:
        """Correlation with the model, share of it, and reading, of the channel in the other runs."""
        return [found for run, found in self._by_channel[one.columns[i].channel].items() if run != seen.name]

    def follow(self, seen: Observation, one: Response, i: int) -> bool:
        """Whether the channel follows the model in other runs, and opposes it in fewer."""
        correlations = np.array([correlation for correlation, *_ in self._of(seen, one, i)])
        return int((correlations > PROVEN).sum()) > int((correlations < -PROVEN).sum())

    def prove_reversed(self, seen: Observation, one: Response) -> bool:
        """Whether all axes of a sensor together oppose a model that is right in another run, or here but for the sign.

        Balanced runs show nothing of the model: the only run that shakes may have to prove it alone.
        """
        own, gain = _whole(one)
        if own > -PROVEN:
            return False
        sensor, right = one.columns[0].sensor, own < -WHOLE and 1.0 / GAIN_FACTOR < -gain < GAIN_FACTOR
        others = np.array([_whole(o)[0] for run, o in self._heard if run is not seen and o.columns[0].sensor == sensor])
        return bool(right or (others > PROVEN).sum() > (others < -PROVEN).sum())

    def is_large(self, one: Response, i: int) -> bool:
        """Whether the model expects of the channel what counts beside the largest of all runs."""
        return bool(one.expected[i] > LARGE * self._largest[one.columns[i].channel])

    def is_flat(self, seen: Observation, one: Response, i: int) -> bool:
        """Whether a channel far below the model is flat: by the sensor's noise, or as it is not in the other runs.

        Where an accelerometer shows vibration in other runs, the model of the base, which a rig may assume, is no
        witness unless it is right in one of them, and expects here well above what it lacks there: counter-masses take
        away what it knows best, and leave what it does not.
        """
        column, others = one.columns[i], self._of(seen, one, i)
        if column.commanded:
            return False
        if column.dimensions == ACCELERATION:
            noise = float(one.noise.max())
            shown = [(c, reading, reading / share) for c, share, reading in others if reading > ABOVE_NOISE * noise]
            is_noise = bool(one.readings[i] < ABOVE_NOISE * noise < one.expected[i])
            if not (is_noise and shown):
                return is_noise
            correlation, reading, expected = max(shown)
            lacks = np.sqrt(reading**2 + expected**2 - 2.0 * correlation * reading * expected)
            return bool(correlation > PROVEN and one.expected[i] > ABOVE_LACKS * lacks)
        return any(correlation > PROVEN and share > 0.5 for correlation, share, _ in others)


def _exchanged(seen: Observation, one: Response, others: _Others) -> list[Statement]:
    """Axes of a sensor of which each follows what another should show, or its opposite, and axes that follow the model.

    Axes that do not follow the model as they are, nor exchanged, are stated nothing of.
    """
    axes = range(len(one.columns))
    if len(axes) == 3 and _is_accelerometer(one.columns[0]) and one.witnessed.all() and (how := _turned_triple(one)):
        return _axes(seen, one, axes, how)
    found, wrong_axes, following = list[Statement](), set[int](), list[tuple[int, int]]()
    for pair in combinations(axes, 2):
        i, k = pair
        if not (one.witnessed[i] or one.witnessed[k]) or one.columns[i].dimensions != one.columns[k].dimensions:
            continue
        if how := _exchanged_pair(seen, one, others, pair):
            found += _axes(seen, one, pair, how)
            wrong_axes |= set(pair)
        elif _remainder(one, pair, pair, (1, 1)) < AS_STATED:
            following.append(pair)
    return found + [s for pair in following if not wrong_axes & set(pair) for s in _axes(seen, one, pair)]


def _turned_triple(one: Response) -> str | None:
    """What each axis of an accelerometer follows that was turned about their diagonal; None where it was not."""
    axes, turns = (0, 1, 2), exchanges(3)
    left = {(o, signs): _remainder(one, axes, o, signs) for o in permutations(axes) for signs in signs_of(3)}
    turned = min((how for how in left if how[0] in turns), key=left.__getitem__)
    without = min(_shifted_remainder(one, axes), *(rest for how, rest in left.items() if how[0] not in turns))
    wrong = left[axes, (1, 1, 1)] > DOUBTFUL and left[turned] < EXCHANGED * without
    wrong = wrong and min(_crossed(one, axes, *turned)) > PROVEN
    return exchanged_axes(_names(one, axes), *turned, "follows", "should show") if wrong else None


def _exchanged_pair(seen: Observation, one: Response, others: _Others, pair: tuple[int, int]) -> str | None:
    """What each of two axes follows that are exchanged; of an accelerometer also the opposite, as where it was turned.

    Of forces, torques and commands, whose sizes differ more, where both follow the model in other runs.
    """
    order, signs = pair[::-1], signs_of(2)[0]
    own = _remainder(one, pair, pair, signs)
    if own <= DOUBTFUL:
        return None
    weak = int(one.expected[pair[0]] > one.expected[pair[1]])  # the place of the axis that should shake less
    wrong = _remainder(one, pair, order, signs) < EXCHANGED * min(own, 1.0)
    wrong = wrong and _crossed(one, pair, order, signs)[weak] > PROVEN
    if not _is_accelerometer(one.columns[pair[0]]):
        wrong = wrong and others.is_large(one, pair[1 - weak]) and all(others.follow(seen, one, n) for n in pair)
    elif not wrong:
        without = min(_shifted_remainder(one, pair), *(_remainder(one, pair, pair, each) for each in signs_of(2)))
        crosswise, signs = min((_remainder(one, pair, order, each), each) for each in signs_of(2))
        crossed = _crossed(one, pair, order, signs)
        gains = np.array(crossed) * one.readings[list(pair)] / np.maximum(one.expected[list(order)], 1e-300)
        right = np.abs(np.log(np.maximum(gains, 1e-300))) < np.log(GAIN_FACTOR)
        follow = (min(crossed) > PROVEN and right.all()) or (crossed[weak] > WHOLE and right[weak])
        wrong = crosswise < EXCHANGED * without and bool(follow)
        signs = tuple(sign if share > PROVEN else 0 for sign, share in zip(signs, crossed, strict=True))
    return exchanged_axes(_names(one, pair), (1, 0), signs, "follows", "should show") if wrong else None


def _names(one: Response, axes: Sequence[int]) -> list[str]:
    return [one.columns[n].channel for n in axes]


def _remainder(one: Response, of: Sequence[int], by: Sequence[int], signs: Signs) -> float:
    """What expectations ``by``, each with its sign, leave of channels ``of``, over the power of both: 0 nothing, 1 all,
    2 opposed.
    """
    of, by = list(of), list(by)
    fitting, expected = float(one.yp[of, by] @ np.array(signs)), one.pp[by, by].sum()
    if not fitting > 0.0:
        return 2.0
    scale = fitting / max(expected, 1e-300)
    power = one.yy[of, of].sum() + scale**2 * expected
    return float((power - 2.0 * scale * fitting) / max(power, 1e-300))


def _shifted_remainder(one: Response, axes: Sequence[int]) -> float:
    """The same of channels as they are, all shifted by the phase at which they follow best.

    Under a force that turns, a base of another stiffness, or a clock that is late, shifts both axes by a quarter period
    as a turn of the sensor by 90 degrees does.
    """
    own = list(axes)
    fitting, expected = np.hypot(one.yp[own, own].sum(), one.quadrature[own].sum()), one.pp[own, own].sum()
    power = one.yy[own, own].sum() + fitting**2 / max(expected, 1e-300)
    return float(2.0 * one.yy[own, own].sum() / max(power, 1e-300) - 1.0)


def _crossed(one: Response, of: Sequence[int], by: Sequence[int], signs: Signs) -> list[float]:
    """Correlation of each of channels ``of`` with the expectation of that at its place in ``by``, with its sign [-]."""
    sizes = one.readings[list(of)] * one.expected[list(by)]
    found: list[float] = (np.array(signs) * one.yp[list(of), list(by)] / np.maximum(sizes, 1e-300)).tolist()
    return found


def _axes(seen: Observation, one: Response, axes: Sequence[int], exchanged: str | None = None) -> list[Statement]:
    """Of axes that follow the model as the rig states, or ``exchanged``: what each follows."""
    names = _names(one, axes)
    first, *rest = (f"axis {one.columns[n].component}" for n in axes)
    stated = ", ".join([f"{names[0]} is {first}", *(f"{n} {axis}" for n, axis in zip(names[1:], rest, strict=True))])
    witnessed = f"axes exchanged: {exchanged}" if exchanged else "as the rig states"
    code = "axis_contradiction" if exchanged else None
    return [
        Statement(seen.name, "axis", name, f"{stated} by the rig", witnessed, "the model of the motion", code)
        for name in (names if exchanged else names[:1])
    ]


def _exchanged_runs(heard: Heard) -> list[Statement]:
    """Runs with and without counter-masses of one condition, of which one shows too much and the other too little."""
    factors = []
    for seen, one in heard:
        read, expected = (float(np.linalg.norm(size[one.witnessed])) for size in (one.readings, one.expected))
        if read > 0.0 and expected > 0.0 and not OTHER_RUN > read / expected > 1.0 / OTHER_RUN:
            factors.append((seen, one.columns[0].sensor, read, expected))
    found, sensors = [], list(dict.fromkeys(sensor for _, sensor, *_ in factors))
    for seen, sensor, read, expected in sorted(factors, key=lambda factor: sensors.index(factor[1])):
        others = [
            other.name
            for other, its, more, less in factors
            if its == sensor
            and (more > less) != (read > expected)
            and bool(other.counter_masses) != bool(seen.counter_masses)
            and other.unmounted_condition == seen.unmounted_condition
        ]
        if others:
            witnessed = f"{read:.3g} m/s2 RMS, the inverse in {others[0]}: runs or counter-masses exchanged"
            stated = f"{expected:.3g} m/s2 RMS of {sensor} by the model with the counter-masses of the run table"
            found.append(
                Statement(seen.name, "counter-masses", None, stated, witnessed, "its readings",
                          "counter_mass_contradiction", (others[0],))
            )  # fmt: skip
    return found


def _signs(seen: Observation, one: Response, others: _Others) -> list[Statement]:
    """Sign of each channel, and those that are flat.

    The sign of one on the base where the model of it is proven, or by another channel that follows it. A torque that is
    as large as the model's, and the other way round, may be so in all runs of a campaign.
    """
    found, first = [], one.columns[0]
    of_the_base, of_a_support = first.sensor in seen.rig.base_accelerometers, first.sensor in seen.rig.supports
    sure = (
        not of_the_base or others.prove_reversed(seen, one) or bool((one.witnessed & (one.correlation > PROVEN)).any())
    )
    for i in map(int, np.flatnonzero(one.witnessed)):
        column, correlation = one.columns[i], float(one.correlation[i])
        opposes = correlation < -WHOLE and 1.0 / GAIN_FACTOR < -one.gain[i] < GAIN_FACTOR
        opposes = opposes and isinstance(seen.rig.sensors.get(column.sensor), Torque)
        follows = others.follow(seen, one, i)
        wrong = (sure or follows) and correlation < -PROVEN
        if (first.dimensions == ACCELERATION or follows or opposes) and (wrong or correlation > SIGN_SHOWN):
            witnessed = f"{'reversed: ' if wrong else ''}correlation {correlation:.2f} with the model, expected near 1"
            code = ("force_sign" if of_a_support else "sign_contradiction") if wrong else None
            stated, witness = "sign as in the rig", "the model of the motion"
            found.append(Statement(seen.name, "sign", column.channel, stated, witnessed, witness, code))
        if one.readings[i] < FLAT * one.expected[i] and others.is_flat(seen, one, i):
            unit = UNITS.get(column.dimensions, "")
            stated = f"{one.expected[i]:.3g} {unit} RMS by the model"
            witnessed = f"{one.readings[i]:.3g} {unit} RMS, flat"
            found.append(
                Statement(seen.name, "dead", column.channel, stated, witnessed, "its readings", "flat_channel")
            )
    return found


def _forces(seen: Observation) -> list[Statement]:
    """Signs of force channels with a large load, where the model explains the forces of the run."""
    forces = [(r, i) for r in seen.responses if r.columns[0].sensor in seen.rig.supports for i in range(len(r.columns))]
    largest: dict[str, float] = defaultdict(float)
    for r, i in forces:
        kind = r.columns[i].dimensions[0]
        largest[kind] = max(largest[kind], float(r.expected[i]))
    similar = [
        (r, i)
        for r, i in forces
        if r.expected[i] > LARGE * largest[r.columns[i].dimensions[0]] > 0.0
        and 1.0 / SIMILAR_SIZE < r.readings[i] / r.expected[i] < SIMILAR_SIZE
    ]
    if not similar or np.mean([r.correlation[i] ** 2 for r, i in similar]) < LEAST_EXPLAINED:
        return []
    found = []
    for r, i in similar:
        column, correlation = r.columns[i], r.correlation[i]
        wrong = bool(correlation < REVERSED)
        witnessed = (
            f"{'reversed polarity: it opposes' if wrong else 'it follows'} the load {column.component} that the "
            f"motion puts on {column.sensor}: correlation {correlation:.2f}, expected near 1"
        )
        code = "force_sign" if wrong else None
        found.append(Statement(seen.name, "sign", column.channel, "sign by the rig", witnessed, "the model", code))
    return found


def _gain_statements(column: Column, by_run: dict[str, tuple[float, float]]) -> list[Statement]:
    """Gain of a channel in each run against the median of the other runs; of a lone run against the model."""
    logs = {run: float(np.log(value)) for run, (value, _) in by_run.items()}
    found = []
    for run, own in logs.items():
        others = np.array([value for name, value in logs.items() if name != run])
        # Median of the others' logarithms of gains and of the model's, zero; of two in the middle the model's
        # nearest.
        votes = np.sort(np.append(others, 0.0))
        middle = votes[(len(votes) - 1) // 2 : len(votes) // 2 + 1]
        centre = float(middle[np.argmin(np.abs(middle))])
        scatter = 1.4826 * float(np.median(np.abs(others - centre))) if others.size > 2 else 0.0
        error = by_run[run][1] / by_run[run][0]
        wrong = abs(own - centre) > max(np.log(GAIN_FACTOR), GAIN_DEVIATIONS * max(scatter, error))
        wrong = wrong and bool((np.abs(own - others) > np.log(GAIN_FACTOR)).sum() > others.size / 2)
        stated = f"{np.exp(centre):.3g} times the model in the other runs" if others.size > 1 else "as the model"
        witnessed = f"{by_run[run][0]:.3g} times the model, standard uncertainty {by_run[run][1]:.2g}"
        witnessed += misread(column, float(np.exp(own - centre))) if wrong else ""
        code = "gain_contradiction" if wrong else None
        found.append(Statement(run, "gain", column.channel, stated, witnessed, "its readings", code))
    return found


def _noises(
    observations: Sequence[Observation], gains: Gained, wrong: Collection[tuple[str, str | None]]
) -> list[Statement]:
    """Gain by the noise of a channel in one run against that in the others, where the model does not show the gain.

    A run in which the model shows a channel of the sensor ``wrong`` is no witness against the others; of another whose
    gain the model shows to be off, the noise is divided by that.
    """
    by_channel: dict[str, dict[str, float]] = defaultdict(dict)
    columns: dict[str, Column] = {}
    unsure: dict[str, set[str]] = defaultdict(set)
    for seen in observations:
        for channel, record in seen.records.items():
            if record.column.dimensions[0] == "acceleration" and not (record.dead or record.clipped):
                by_channel[channel][seen.name], columns[channel] = record.noise, record.column
                if any((seen.name, sibling.channel) in wrong for sibling in record.column.siblings):
                    unsure[channel].add(seen.name)
    found = []
    for channel, by_run in by_channel.items():
        known = {run: gain for run, (gain, _) in gains[channel].items()}
        sure = [name for name in by_run if name not in unsure[channel]]
        noises = np.array([by_run[name] / (1.0 if _near_one(known.get(name, 1.0)) else known[name]) for name in sure])
        for run, own in by_run.items():
            others = noises[[name != run for name in sure]]
            if not others.size or not min(own, others.min()) > 0.0:
                continue
            centre = float(np.median(others))
            if np.ptp(others) > centre * (NOISE_FACTOR - 1.0):
                continue
            ratio = own / centre
            right = run in known and _near_one(known[run])
            code = None if right or 1.0 / NOISE_FACTOR < ratio < NOISE_FACTOR else "gain_contradiction"
            if code and ratio < FLAT:
                code = "flat_channel"
            subject = "dead" if code == "flat_channel" else "gain"
            stated, witnessed = f"noise of {centre:.3g} m/s2 in the other runs", f"{own:.3g} m/s2"
            witnessed += misread(columns[channel], ratio) if code else ""
            found.append(Statement(run, subject, channel, stated, witnessed, "its noise at rest", code))
    return found


def _near_one(gain: float) -> bool:
    return abs(float(np.log(gain))) < np.log(GAIN_FACTOR)
