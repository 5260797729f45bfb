"""Error types of the laboratory half."""

from balance.errors import CounterpoiseError


class RecordingError(CounterpoiseError):
    """A log file that cannot be told apart from a damaged one, or that no reader understands."""


class RigError(CounterpoiseError):
    """A rig, plan or run sheet with a wrong key or value; the message names the key."""


class StoreError(CounterpoiseError):
    """A stored run or campaign that is damaged, missing or in the way."""


class NotConfirmedError(StoreError):
    """A run that has its name, of which the system does not confirm that it is on the disk or in the ledger."""


class AnalysisError(CounterpoiseError):
    """A campaign that does not hold what the asked analysis needs."""
