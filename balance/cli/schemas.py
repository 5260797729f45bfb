"""JSON schemas of the input files of ``balance``, by name: what a key means, its unit, an example, its default."""

from typing import Any


def schema(name: str) -> dict[str, Any]:
    """The schema of a kind of input file. Raises DataError, listing the kinds, for a name that is none."""
    from ..balancing.springs import SpringsTable
    from ..balancing.stock_plates import MaterialsTable
    from ..drives.drive_files import DriveTable
    from ..engines.engine_files import EngineTable
    from ..errors import DataError
    from ..input_files import Table, json_schema
    from ..linkages.linkage_files import LinkageTable
    from ..motion.motion_files import MotionTable
    from ..rotors.rotor_files import RotorTable
    from ..rotors.trial_run_files import TrialRunsTable

    models: dict[str, type[Table]] = {
        "drive": DriveTable, "engine": EngineTable, "linkage": LinkageTable, "materials": MaterialsTable,
        "motion": MotionTable, "rotor": RotorTable, "springs": SpringsTable, "trial-runs": TrialRunsTable,
    }  # fmt: skip
    if name not in models:
        raise DataError(f"{name!r} is no kind of input file: there are {', '.join(models)}")
    return json_schema(models[name])
