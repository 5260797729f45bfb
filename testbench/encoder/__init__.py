"""Speed from the instants of encoder edges: pulses are timed, never counted in a window."""

from .course import Course, course
from .edges import Disc, Edges, LostEdges, edges_of, origin_of, read_times
from .turn import Estimate, Turn, periodic_turn

__all__ = [
    "Course",
    "Disc",
    "Edges",
    "Estimate",
    "LostEdges",
    "Turn",
    "course",
    "edges_of",
    "origin_of",
    "periodic_turn",
    "read_times",
]
