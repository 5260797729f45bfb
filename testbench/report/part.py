"""A part of a report: what was found, or why nothing was."""

from collections.abc import Callable
from typing import Any

from balance.errors import CounterpoiseError

Part = dict[str, Any]


def attempt(work: Callable[[], Part]) -> Part:
    """The part, or ``{"reason": ...}`` where the run does not tell."""
    try:
        return work()
    except CounterpoiseError as error:
        return {"reason": str(error)}
