"""Files that are opened and yet no log to be stored: stored runs, channels without end, the same bytes twice."""

from collections.abc import Iterable, Sequence

from ..errors import RecordingError
from ..findings import Finding, Refusal
from ..recording import Group
from ..store import layout
from .source import Source

MOST_CHANNELS = 30_000
"""Channels of one log: each takes some 40 KiB of memory and half a millisecond while it is stored."""


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
