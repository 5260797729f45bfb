"""Second-order sections run forwards and backwards over several channels at once.

What ``scipy.signal.sosfiltfilt`` gives with even extension, to rounding. A recursion waits for its own last result at
every sample; four channels side by side wait together, and two threads take four channels each.
"""

import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from balance.arrays import Floats

from ..native import can_compile

_NOTHING = np.array([1.0, 0.0, 0.0, 1.0, 0.0, 0.0])
"""A section that passes what it is given."""
LANES = 4
"""Channels side by side."""
WORTH = 1 << 18
"""Samples from which on the compiled form pays for its import."""
_MOST_KEPT = 1 << 19
"""Samples of a channel up to which a thread keeps its room, 16 MB."""
_KEPT = threading.local()
WORTH_A_THREAD = 1 << 22
"""Samples from which on a second thread pays."""


def zero_phase(sections: Floats, channels: Floats, padding: int, out: Floats | None = None) -> Floats:
    """Filter channels (k, n) along their samples; ``sections`` (s, 6) as of ``scipy.signal.butter``, (k, n).

    Records are mirrored at both ends over ``padding`` samples, below n; the filter starts as if settled there. The
    result is written to ``out`` where that is given, which may be the channels themselves.
    """
    from scipy.signal import sosfilt_zi, sosfiltfilt

    passed = np.empty(channels.shape) if out is None else out
    if channels.size < WORTH or not can_compile():
        passed[...] = sosfiltfilt(sections, channels, padtype="even", padlen=padding)
        return passed
    if len(sections) % 2:
        sections = np.vstack([sections, _NOTHING])
    settled = np.ascontiguousarray(sosfilt_zi(sections), dtype=np.float64)
    parts = [slice(i, i + LANES) for i in range(0, len(channels), LANES)]

    def run(part: slice) -> None:
        _both_ways(np.ascontiguousarray(sections), settled, channels[part], padding, passed[part])

    if len(parts) == 1 or channels.size < WORTH_A_THREAD:
        for part in parts:
            run(part)
    else:
        with ThreadPoolExecutor(2) as pool:
            list(pool.map(run, parts))
    return passed


def _both_ways(sections: Floats, settled: Floats, channels: Floats, padding: int, out: Floats) -> None:
    from .compiled import recursion

    count, length = channels.shape
    wide = _wide(length + 2 * padding)
    wide[:, count:] = 0.0
    for lane, values in enumerate(channels):
        wide[padding : padding + length, lane] = values
    wide[:padding] = wide[padding + 1 : 2 * padding + 1][::-1]
    wide[padding + length :] = wide[length - 1 : padding + length - 1][::-1]
    for backwards in (False, True):
        recursion(sections, settled[:, :, None] * wide[-1 if backwards else 0], wide, backwards)
    out[...] = wide[padding : padding + length, :count].T


def _wide(length: int) -> Floats:
    """Room for four channels side by side: fresh pages cost as much as the filter, so a thread keeps its last one."""
    kept: Floats | None = getattr(_KEPT, "wide", None)
    if kept is None or len(kept) < length:
        kept = np.empty((length, LANES))
        _KEPT.wide = kept if length <= _MOST_KEPT else None
    return kept[:length]
