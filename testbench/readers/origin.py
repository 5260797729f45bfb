"""Whether a log says that it is simulated: in a comment, a property, or what this project's exports write beside it."""

import re
from collections.abc import Iterable
from dataclasses import replace

from ..recording import Origin, Recording

_ORIGIN = re.compile(r"\borigin\"?\s*[:=]\s*\"?(\w+)", re.IGNORECASE)
_LONGEST = 2000
"""Letters of a text that are looked at."""


def stated(texts: Iterable[str]) -> Origin:
    """``simulated`` if a text says so; that a log calls itself measured counts for nothing."""
    found = {match[1].casefold() for text in texts for match in _ORIGIN.finditer(text[:_LONGEST])}
    return "simulated" if "simulated" in found else "unstated"


def with_stated(recording: Recording) -> Recording:
    """The recording, ``simulated`` if its comments or metadata say so."""
    if recording.origin != "unstated":
        return recording
    texts = (*recording.comments, *(f"{key}: {text[:_LONGEST]}" for key, text in recording.metadata.items()))
    origin = stated(texts)
    # the data through the recording as it was opened, which may hold a process that waits
    return recording if origin == "unstated" else replace(recording, origin=origin, read=recording.blocks)
