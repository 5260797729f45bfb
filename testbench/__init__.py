"""Mechanics in the lab: logs to HDF5, reductions of vibration, and what is still unbalanced."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .runs.aligned_run import AlignedRun
    from .runs.si_run import SIRun, physical
    from .store import Campaign, Run, open_campaign, open_run

__all__ = ["AlignedRun", "Campaign", "Run", "SIRun", "open_campaign", "open_run", "physical"]
_HOMES = {"AlignedRun": "runs.aligned_run", "SIRun": "runs.si_run", "physical": "runs.si_run"}


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """What is public here is imported when it is asked for, so that the command line starts at once."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f".{_HOMES.get(name, 'store')}", __name__), name)
