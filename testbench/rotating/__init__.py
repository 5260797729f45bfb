"""Rotating machines: the speed of a crank from encoder edges, and vibration at multiples of a rotor's speed.

Speed: ``encoder_edges`` numbers the edges of a log (pulses are timed, never counted in a window), ``speed_fit``
estimates the steady turn, ``speed_results`` the errors of the disc, the speed edge by edge and the
comparison with a drive's equation of motion. Vibration: ``tachometer`` gives the turns, ``order_fit`` the
vectors of one record, ``order_tracking`` those of a run.
"""

from .encoder_edges import Disc, Edges, LostEdges, log_origin, number_edges, read_edge_times
from .order_tracking import OrderVector, Vectors, vectors
from .speed_fit import SpeedEstimate, SteadySpeedFit, periodic_turn
from .speed_results import SpeedHistory, speed_history

__all__ = [
    "Disc",
    "Edges",
    "LostEdges",
    "OrderVector",
    "SpeedEstimate",
    "SpeedHistory",
    "SteadySpeedFit",
    "Vectors",
    "log_origin",
    "number_edges",
    "periodic_turn",
    "read_edge_times",
    "speed_history",
    "vectors",
]
