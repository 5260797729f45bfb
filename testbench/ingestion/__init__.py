"""Log files into stored runs: their run table, their sources, the outcome of each; watched folders."""

from .ingest import Ingest, Outcome, Progress

__all__ = ["Ingest", "Outcome", "Progress"]
