"""Springs with play and feet on the floor, stepped from sample to sample; compiled where numba is installed.

It imports numba, and is imported only where there is something to step.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from balance.compiled_kernels import compiled_by

try:
    from numba import njit
except ImportError:  # without the extra ``compiled``: the same, twenty times slower
    njit = None


@compiled_by(njit, "void(f8[::1], f8[::1], f8[::1], i8, f8, f8[::1], b1, f8[::1])")
def released(
    seen: NDArray[Any], play: NDArray[Any], preload: NDArray[Any], upright: int, friction: float,
    relieved: NDArray[Any], keeps: bool, out: NDArray[Any],
) -> None:  # fmt: skip
    """What springs and feet carry otherwise than without play and bonded to the floor, ``out`` (2 s + 3 f,).

    ``seen`` has two deflections of each spring [rad, m]: of these it lacks what lies within a radius ``play`` (s,).
    Then the force on each bonded foot (f, 3) [N]. A foot presses with ``preload`` (f,) [N] and that force along
    ``upright`` or not at all; across, it is dragged by no more than ``friction`` times this. ``relieved`` (3 f,) [N] is
    what its sliding so far took off; ``keeps`` says whether it slides on now.
    """
    for s in range(len(play)):
        x, y = seen[2 * s], seen[2 * s + 1]
        far = (x * x + y * y) ** 0.5
        share = play[s] / far if far > play[s] else 1.0
        out[2 * s], out[2 * s + 1] = share * x, share * y
    for foot in range(len(preload)):
        at = 2 * len(play) + 3 * foot
        pressure, dragged = max(preload[foot] + seen[at + upright], 0.0), 0.0
        for k in range(3):
            if k != upright:
                dragged += (seen[at + k] + relieved[3 * foot + k]) ** 2
        dragged = dragged**0.5
        share = friction * pressure / dragged if dragged > friction * pressure else 1.0
        for k in range(3):
            if k == upright:
                out[at + k] = pressure - preload[foot] - seen[at + k]
            else:
                out[at + k] = share * (seen[at + k] + relieved[3 * foot + k]) - seen[at + k]
                if keeps:
                    relieved[3 * foot + k] = out[at + k]


@compiled_by(
    njit,
    "void(f8[:,::1], f8[:,::1], f8[:,::1], f8[:,::1], f8[:,::1], f8[:,::1], f8[:,::1], f8[:,:,::1], f8[:,:,::1],"
    "f8[:,::1], f8[::1], f8[::1], i8, f8, f8[:,::1], f8[:,::1])",
)
def step_through(
    phi: NDArray[Any], now: NDArray[Any], after: NDArray[Any], read: NDArray[Any], into: NDArray[Any],
    rates: NDArray[Any], pushes: NDArray[Any], beyond: NDArray[Any], solved: NDArray[Any], known: NDArray[Any],
    play: NDArray[Any], preload: NDArray[Any], upright: int, friction: float,
    states: NDArray[Any], added: NDArray[Any],
) -> None:  # fmt: skip
    """Fill ``states`` (n, k) from the first on: y[i+1] = phi y[i] + push[i] + now v[i] + after v[i+1], in SI.

    v, ``added`` (n, m), is into g, g = ``released`` of ``read`` y, forecast from that before. Where there is an inertia
    ``beyond`` D (n, m, m) the constant one, v[i] = solved[i] (into g + known[i] - D[i] rates y), y without v[i].
    """
    relieved, g = np.zeros(3 * len(preload)), np.zeros(len(read))
    released(np.dot(read, states[0]), play, preload, upright, friction, relieved, True, g)
    added[0] = np.dot(into, g)
    for i in range(len(pushes)):
        still = np.dot(phi, states[i]) + np.dot(now, added[i]) + pushes[i]
        lag = known[i + 1] - np.dot(beyond[i + 1], np.dot(rates, still)) if len(beyond) else added[0]
        for passes in range(3):  # from g before, from its forecast, and what is added where the state is
            v = np.dot(into, g)
            added[i + 1] = np.dot(solved[i + 1], v + lag) if len(beyond) else v
            if passes < 2:
                states[i + 1] = still + np.dot(after, added[i + 1])
                released(np.dot(read, states[i + 1]), play, preload, upright, friction, relieved, passes == 1, g)
