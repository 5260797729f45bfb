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
from collections.abc import Callable, Collection, Mapping
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

# Each name is an alias of itself, by which type checkers know it as public.
# isort: off
if TYPE_CHECKING:
    from .balancing.conditions import Conditions as Conditions
    from .balancing.methods import Methods as Methods
    from .balancing.nested_sizing import NestedSizing as NestedSizing
    from .balancing.sizing import CounterMass as CounterMass, Sizing as Sizing
    from .balancing.sizing_study import SizingStudy as SizingStudy
    from .balancing.sweep import Designs as Designs
    from .balancing.tradeoff import Front as Front
    from .closure import Trajectory as Trajectory
    from .drives.harmonic_balance import SteadyRotation as SteadyRotation
    from .dynamics.inverse_dynamics import Response as Response
    from .errors import CounterpoiseError as CounterpoiseError
    from .front_door import (
        animate as animate,
        assemble as assemble,
        check as check,
        conditions as conditions,
        drive as drive,
        engine as engine,
        follow as follow,
        influence as influence,
        linkage as linkage,
        load as load,
        load_motion as load_motion,
        methods as methods,
        rotor as rotor,
        shipped as shipped,
        simulate as simulate,
        size as size,
        size_nested as size_nested,
        sweep as sweep,
        tolerance as tolerance,
        tradeoff as tradeoff,
        write_report as write_report,
    )
    from .mechanism.mechanism import Mechanism as Mechanism
    from .units import si as si

    __version__: str


def lazy_names(
    package: str, homes: Mapping[str, str], modules: Collection[str] = ()
) -> tuple[list[str], Callable[[str], Any], Callable[[], list[str]]]:
    """``__all__``, ``__getattr__`` and ``__dir__`` of a package whose names are imported when they are asked for.

    ``homes``: by module of the package the names that it gives; ``modules``: those that go by their own names, not in
    ``__all__``. So the command line starts at once.
    """
    home_of = {name: home for home, names in homes.items() for name in names.split()}

    def find(name: str) -> Any:  # noqa: ANN401
        from importlib import import_module

        if name == "__version__":
            from importlib.metadata import version

            return version(DISTRIBUTION)
        if name in modules:
            return import_module(f"{package}.{name}")
        if name not in home_of:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(f"{package}.{home_of[name]}"), name)

    return sorted(home_of), find, lambda: [*sorted(home_of), *modules, "__version__"]


__all__, __getattr__, __dir__ = lazy_names(__name__, {
    "balancing.conditions": "Conditions",
    "balancing.nested_sizing": "NestedSizing",
    "balancing.sizing": "CounterMass Sizing",
    "errors": "CounterpoiseError",
    "balancing.sweep": "Designs",
    "balancing.tradeoff": "Front",
    "mechanism.mechanism": "Mechanism",
    "balancing.methods": "Methods",
    "dynamics.inverse_dynamics": "Response",
    "balancing.sizing_study": "SizingStudy",
    "drives.harmonic_balance": "SteadyRotation",
    "closure": "Trajectory",
    "front_door": "animate assemble check conditions drive engine follow influence linkage load load_motion methods "
    "rotor shipped simulate size size_nested sweep tolerance tradeoff write_report",
    "units": "si",
})  # fmt: skip
