"""Error types. Every message states what was found and where, what was expected, and what to do."""

from collections.abc import Iterable


class CounterpoiseError(Exception):
    """An error in what the user supplied, not a defect of the program: shown without a traceback.

    >>> import balance
    >>> try:
    ...     balance.load("for-bar")
    ... except balance.CounterpoiseError as error:
    ...     print(str(error).split(" (")[0])
    for-bar: no such file, and no shipped one of that name in mechanisms; did you mean 'four-bar'?
    """


class UnitError(CounterpoiseError):
    """A text that is not a quantity of the expected dimension."""


class ModelError(CounterpoiseError):
    """A mechanism file, body, joint or site that cannot be used as asked."""


class ClosureError(CounterpoiseError):
    """A mechanism that cannot be closed at the asked state, or that is singular there."""


class SizingError(CounterpoiseError):
    """Counter-masses that cannot be found for the asked mechanism and stock."""


class DataError(CounterpoiseError):
    """A file of a motion, stock or results with content other than expected."""


class CoarseSamples(UserWarning):
    """Samples of a motion whose rounding, noise, gaps or clock make much of the acceleration that follows."""


def suggestion(word: str, known: Iterable[str]) -> str:
    """``; did you mean 'rate'?`` if a known word is near; to a single letter only the same one is."""
    from difflib import get_close_matches  # late: every command imports this file

    by_lower = {name.lower(): name for name in known}
    near = get_close_matches(word.lower(), list(by_lower), n=1, cutoff=0.6 if len(word) > 1 else 1.0)
    return f"; did you mean {by_lower[near[0]]!r}?" if near else ""
