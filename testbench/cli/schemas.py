"""JSON schemas of the input files of ``testbench``, by name: what a key means, its unit, an example, its default."""

from typing import Any


def schema(name: str) -> dict[str, Any]:
    """The schema of a kind of input file. Raises RigError, listing the kinds, for a name that is none."""
    from balance.input_files import Table, json_schema

    from ..campaign_plan import Plan
    from ..errors import RigError
    from ..ingest.run_conditions import RunRow
    from ..rig import Rig

    models: dict[str, type[Table]] = {"plan": Plan, "rig": Rig, "run-table": RunRow}
    if name not in models:
        raise RigError(f"{name!r} is no kind of input file: there are {', '.join(models)}")
    return json_schema(models[name])
