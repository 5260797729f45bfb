"""Speed from the instants of encoder edges: pulses are timed, never counted in a window.

Vibration at multiples of a shaft's speed: its turns by a tacho, vectors by least squares.
"""

from .encoder_edges import Disc, Edges, LostEdges, edges_of, origin_of, read_times
from .speed_fit import SpeedEstimate, SteadySpeedFit, periodic_turn
from .speed_results import SpeedHistory, speed_course

__all__ = [
    "Disc",
    "Edges",
    "LostEdges",
    "SpeedEstimate",
    "SpeedHistory",
    "SteadySpeedFit",
    "edges_of",
    "origin_of",
    "periodic_turn",
    "read_times",
    "speed_course",
]
