"""Files that are given and yet no log to be stored: stored runs, channels without end, the same bytes twice."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from ..errors import RecordingError
from ..findings import Finding, Refusal
from ..recording import Group
from ..store import digest, layout
from ..store.campaign import KEPT, SUFFIX
from .source import Source

MOST_CHANNELS = 30_000
"""Channels of one log: each takes some 40 KiB of memory and half a millisecond while it is stored."""


def own_files(files: Sequence[Path], campaign: Path) -> list[Path]:
    """Those of ``files`` that the campaign put into its folder: a pattern for logs that lie there names them too.

    A run is known by the digest beside it, so that an HDF5 file of others stays a log; none are named where no file
    but these is given, for then somebody means them.
    """
    if not campaign.is_dir():
        return []
    own = [path for path in files if path.parent.resolve() == campaign.resolve() and _belongs(path)]
    return own if len(own) < len(files) else []


def _belongs(path: Path) -> bool:
    run = path.with_name(path.name.removesuffix(digest.SUFFIX))
    return path.name in KEPT or (run.suffix == SUFFIX and run.exists() and digest.beside(run).exists())


def refuse_stored_run(source: Source) -> None:
    """Raise Refusal for a stored run: stored anew it would lose its conditions, findings and sources."""
    if layout.MARK in source.recording.metadata:
        message = "is a stored run and no log: copy it with its .sha256 into a campaign, or use `testbench archive`"
        raise Refusal(source.path.name, Finding("stored_run", None, None, message))


def refuse_too_many(source: Source, groups: Iterable[Group]) -> None:
    """Raise Refusal for more channels than memory is for: small files can declare them without end."""
    if (count := sum(len(group.channels) for group in groups)) > MOST_CHANNELS:
        message = f"{count} channels; expected no more than {MOST_CHANNELS}: export fewer at a time"
        raise Refusal(source.path.name, Finding("too_large", None, None, message))


def refuse_twice(digests: Sequence[tuple[str, str]]) -> None:
    """Raise RecordingError where two files of one run, each its SHA-256 and name, hold the same bytes."""
    seen: dict[str, str] = {}
    for sha256, name in digests:
        if sha256 in seen:
            raise RecordingError(f"{name}: holds the same bytes as {seen[sha256]}: one recording twice in one run")
        seen[sha256] = name
