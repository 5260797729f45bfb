"""Reports as one HTML page that can be mailed: numbers, pictures, a moving mechanism, and no request to any server."""

from .page import Page, inline_svg
from .plotted import PlottedChannel, PlottedRun, plotted

__all__ = ["Page", "PlottedChannel", "PlottedRun", "inline_svg", "plotted"]
