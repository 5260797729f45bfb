"""Log files into stored runs: their sheet, their sources, what became of each; folders that are watched."""

from .ingest import Ingest, Outcome, Progress

__all__ = ["Ingest", "Outcome", "Progress"]
