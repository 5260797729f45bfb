"""Speed edge by edge along a whole log, start-up included: local cubics of time over pulses."""

from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats, Indices
from balance.estimation.estimate import coverage_factor

from .edges import Edges

HALF_WIDTH = 4
"""Edges on each side of a local cubic, unless asked otherwise."""


@dataclass(frozen=True)
class Course:
    """Speed of the crank at edges; the ends of the log and the edges beside gaps are left out."""

    time: Floats
    """(n,) [s]"""
    angle: Floats
    """Angle of the crank from the first edge, (n,) [rad]."""
    speed: Floats
    """(n,) [rad/s]"""
    error: Floats
    """Half width of its 95 % interval, from what the local cubics leave over, (n,) [rad/s]."""


def course(edges: Edges, half_width: int = HALF_WIDTH) -> Course:
    """Speed wherever ``2 half_width + 1`` edges in a row have no gap; the disc is taken as even."""
    slope, rest = _cubic(half_width)
    pieces = [piece for piece in _pieces(edges) if len(piece) > 2 * half_width]
    middle = np.concatenate([piece[half_width:-half_width] for piece in pieces] or [np.empty(0, dtype=int)])
    per_pulse, left = _weighted(edges, pieces, slope), _weighted(edges, pieces, rest)
    per_edge = 2.0 * np.pi / edges.disc.per_turn
    noise = float(np.median(np.abs(left))) / 0.6745 / float(np.linalg.norm(rest)) if len(left) else 0.0
    speed = per_edge / per_pulse
    error = coverage_factor() * noise * float(np.linalg.norm(slope)) * speed**2 / per_edge
    return Course(edges.time[middle], edges.angle[middle], speed, error)


def _weighted(edges: Edges, pieces: list[Indices], weights: Floats) -> Floats:
    """Weighted sums of neighbouring instants, piece by piece."""
    sums = [np.convolve(edges.time[piece], weights[::-1], "valid") for piece in pieces]
    return np.concatenate(sums) if sums else np.empty(0)


def _pieces(edges: Edges) -> list[Indices]:
    """Indices of edges between gaps."""
    return np.split(np.arange(len(edges.time)), np.flatnonzero(np.diff(edges.pulse) > 1) + 1)


def _cubic(half_width: int) -> tuple[Floats, Floats]:
    """Weights that give the slope in the middle, and what is left over in the middle, (2 half_width + 1,)."""
    k = np.arange(-half_width, half_width + 1.0)
    inverse = np.linalg.pinv(np.vander(k, 4, increasing=True))
    rest = -inverse[0]
    rest[half_width] += 1.0
    return inverse[1], rest
