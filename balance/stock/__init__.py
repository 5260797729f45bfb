"""Stock plates: weighed, or drawn with shape and material."""

from .stock import Plate, load, mass_of

__all__ = ["Plate", "load", "mass_of"]
