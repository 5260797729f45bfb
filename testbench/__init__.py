"""Mechanics in the lab: logs to HDF5, reductions of vibration, and what is still unbalanced."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .runs.physical_run import physical
    from .store import Campaign, Run, open_campaign, open_run

__all__ = ["Campaign", "Run", "open_campaign", "open_run", "physical"]


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """What is public here is imported when it is asked for, so that the command line starts at once."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if name == "physical":
        from .runs.physical_run import physical

        return physical
    from . import store

    return getattr(store, name)
