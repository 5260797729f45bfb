"""Log files into stored runs: their sheet, their sources, what became of each; folders that are watched."""

from .ingest import Ingest, Progress
from .outcome import Outcome

__all__ = ["Ingest", "Outcome", "Progress"]
