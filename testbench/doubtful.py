"""What the reductions of a condition cannot say, a finding each."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from .amplitudes.condition import Condition, Scatter
from .findings import Finding

if TYPE_CHECKING:
    from .reductions import Reduction


def limits(condition: Condition, found: Sequence["Reduction"]) -> list[Finding]:
    """What the reductions of a pair cannot say, a finding each."""
    pair, dead = condition.pair, {place for place, runs in condition.dead.items() if runs}
    where = " ".join(run.name for run in pair.runs)
    alive = [r for r in found if (r.sensor, r.axis) not in dead]
    kinds = {
        "dead_channel": (
            [r for r in found if (r.sensor, r.axis) in dead],
            "the channel shows one value only in a run: there is no reduction",
        ),
        "vibrates_more": (
            [r for r in alive if r.interval and r.interval[1] < 0.0],
            "it vibrates more with counter-masses than without: if that is not so, runs or sheet are mixed up",
        ),
        "below_noise": (
            [r for r in found if r.below_noise],
            "what is left with counter-masses is not above the noise: the reductions are lower bounds",
        ),
        "no_reduction": (
            [r for r in alive if r.percent is None],
            "nothing vibrates above the noise without counter-masses: there is no reduction",
        ),
        "noise_stated": (
            [r for r in found if r.noise_stated],
            "no stretch at rest before the motion shows the noise: that which the rig states is taken off",
        ),
        "no_noise_floor": (
            [r for r in alive if None in r.noise_floor],
            "no stretch at rest before the motion is long enough to show the noise, and the rig states none: it is in "
            "the amplitudes, so that what falls may be noise",
        ),
    }
    return [
        Finding(code, None, where, f"{pair.key}, {sensor} along {', '.join(axes)}: {says} ({where})")
        for code, (some, says) in kinds.items()
        for sensor in dict.fromkeys(r.sensor for r in some)
        if (axes := [r.axis for r in some if r.sensor == sensor])
    ]


def unlike(condition: Condition, scatter: Scatter) -> list[Finding]:
    """Repeats of a condition that scatter more than those of the others let expect."""
    odd = [
        (place, group)
        for place, groups in condition.groups.items()
        for group in groups
        if (repeats := scatter[place]) and repeats.leaves_out(group)
    ]
    return [
        Finding(
            "repeats_differ",
            None,
            where := " ".join(group.names),
            f"{condition.pair.key}, {sensor} along {axis}: repeats differ more than those of other conditions let "
            f"expect: the interval comes from them alone ({where})",
        )
        for (sensor, axis), group in odd
    ]
