"""Mechanics on paper: models, momentum conditions, counter-masses. Nothing here knows a sensor or a measured file.

>>> import balance
>>> mechanism = balance.load("parallelogram-6bar").with_payload(platform="5 kg")
>>> print(balance.conditions(mechanism).text(0))
mcx[A0A] + r m[AC] + mcx[BD] + r m[platform] = 0
>>> print(balance.size(mechanism))
Balanced completely over the workspace, 48.5522 kg added.

Names are imported when they are asked for. Their meaning is kept: a name, a key or a column that is to go is announced
in CHANGELOG.md, and warns by DeprecationWarning for two minor versions before it goes.
"""

import os
from typing import TYPE_CHECKING, Any

DISTRIBUTION = "counterpoise"
_FOLDER = os.path.dirname(os.path.dirname(__file__))
if _strangers := [
    name for name in os.listdir(_FOLDER) if name.startswith(("balance-", "testbench-")) and name.endswith(".dist-info")
]:
    raise ImportError(
        f"{_FOLDER}: {_strangers[0].removesuffix('.dist-info')} is another distribution that writes its files over "
        "those of counterpoise, or removes them: pip uninstall balance testbench, then "
        "pip install --force-reinstall --no-deps counterpoise; or give each an environment of its own"
    )

if TYPE_CHECKING:
    from .balancing.conditions import Conditions
    from .balancing.methods import Methods
    from .balancing.sizing import CounterMass, Sizing
    from .balancing.sizing_study import SizingStudy
    from .balancing.sweep import Designs
    from .balancing.tradeoff import Front
    from .closure import Trajectory
    from .dynamics.inverse_dynamics import Response
    from .errors import CounterpoiseError
    from .front_door import (
        assemble,
        check,
        conditions,
        drive,
        engine,
        follow,
        linkage,
        load,
        load_motion,
        methods,
        rotor,
        shipped,
        simulate,
        size,
        sweep,
        tolerance,
        tradeoff,
    )
    from .mechanism.mechanism import Mechanism
    from .units import si

    __version__: str

__all__ = [
    "Conditions",
    "CounterMass",
    "CounterpoiseError",
    "Designs",
    "Front",
    "Mechanism",
    "Methods",
    "Response",
    "Sizing",
    "SizingStudy",
    "Trajectory",
    "assemble",
    "check",
    "conditions",
    "drive",
    "engine",
    "follow",
    "linkage",
    "load",
    "load_motion",
    "methods",
    "rotor",
    "shipped",
    "si",
    "simulate",
    "size",
    "sweep",
    "tolerance",
    "tradeoff",
]
_HOMES = {
    "Conditions": "balancing.conditions",
    "CounterMass": "balancing.sizing",
    "CounterpoiseError": "errors",
    "Designs": "balancing.sweep",
    "Front": "balancing.tradeoff",
    "Mechanism": "mechanism.mechanism",
    "Methods": "balancing.methods",
    "Response": "dynamics.inverse_dynamics",
    "Sizing": "balancing.sizing",
    "SizingStudy": "balancing.sizing_study",
    "Trajectory": "closure",
    "si": "units",
}


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """What is public here is imported when it is asked for, so that the command line starts at once."""
    from importlib import import_module

    if name == "__version__":
        from importlib.metadata import version

        return version("counterpoise")
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_HOMES.get(name, 'front_door')}", __name__), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
