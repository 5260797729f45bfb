"""The simulated test bench: what loggers would write if a mechanism ran on an elastically mounted base.

Downwards: ``campaign`` makes folders of logs of a plan, ``recorded`` runs in memory, ``run`` one run. Chance:
``loggers`` and ``sampling`` of what records, ``transducers`` of the sensors, ``disturbance`` of floor and drives.
Mechanics: what each of the ``sensors`` is exposed to, how ``supports`` share the load, how the ``base`` moves
(``coupling``, ``gravity``, ``rotors``, ``planes``, ``structure``). Nothing in the analysis imports ``truth``.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .simulated_logs import SimulatedRun, record_run, simulate_logs

__all__ = ["SimulatedRun", "record_run", "simulate_logs"]


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """``simulate`` and what goes with it, imported when they are asked for."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(".simulated_logs", __name__), name)
