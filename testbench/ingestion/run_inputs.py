"""The files that a run was made with, as texts that are stored with it: a campaign is analysed from its folder alone.

A mechanism that is made of several files (includes, meshes, the loops of a robot) is stored as one text that says the
same. What cannot be found or read is a finding: the logs are stored nevertheless.
"""

import re
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from balance import datasets
from balance.errors import CounterpoiseError, suggestion
from balance.input_files import read_text
from balance.units import G0

from ..recording import Conditions, Finding, payload_body
from ..rig.rig import NONE, mechanism_file

if TYPE_CHECKING:
    from ..rig import Rig

Inputs = dict[str, tuple[str, ...]]
"""Name and texts of a file by ``mechanism`` and ``motion``."""


def run_inputs(rig: "Rig | None", conditions: Conditions, folders: Iterable[Path]) -> tuple[Inputs, list[Finding]]:
    """The rig's mechanism, and the motion that the run table names, looked for in ``folders``, then among the shipped.

    A motion that is no file's name is a label, and none is stored; one near to a file's name is a finding. So is a
    peak acceleration of another kind than that of the motion, and a payload that no body is named for.
    """
    found, findings = Inputs(), list[Finding]()
    mechanism = None if rig is None or rig.mechanism == NONE else mechanism_file(rig.mechanism, rig.folder)
    folders, stated = list(folders), conditions.get("motion")
    motion = _motion(stated, folders)
    if stated and motion is None and (near := suggestion(stated, _known_motions(folders)) or _lost(stated)):
        message = f"motion {stated!r} of the run table is no file beside it or the rig, nor a shipped one{near}; "
        message += (
            "correct the run table, take the run out by testbench remove, and ingest again; if it is a label, leave it"
        )
        findings.append(Finding("unknown_motion", None, None, message))
    for kind, path in (("mechanism", mechanism), ("motion", motion)):
        if path is None:
            continue
        try:
            if kind == "motion":
                from balance.motion.motion_files import motion_texts

                found[kind] = (path.name, *motion_texts(path))
            elif path.parent == datasets.ROOT / "mechanisms":
                found[kind] = (path.name, read_text(path))
            else:
                from balance.mechanism.mjcf_parser import load_mechanism  # late: a shipped one can be read

                found[kind] = (path.name, load_mechanism(path).text)
        except CounterpoiseError as error:
            message = f"its {kind} is not stored with it: {error}; correct {path.name} and ingest into a new campaign"
            findings.append(Finding("input_not_stored", None, None, message))
    findings += _peak_findings(found["motion"], conditions) if "motion" in found else []
    return found, findings + (_payload_findings(found["mechanism"], conditions) if "mechanism" in found else [])


def motion_duration(inputs: Inputs, conditions: Conditions) -> tuple[str, float] | None:
    """The file of the motion that is stored, and its duration [s] at the peak acceleration that is stated.

    None where there is none, or it cannot be used as stated, which is told where it is used.
    """
    if "motion" not in inputs:
        return None
    from balance.motion.motion_files import motion_from_texts  # late: a log alone needs none of it

    peak = conditions.get("peak_acceleration_rad_s2") or G0 * conditions.get("peak_acceleration_g", 0.0)
    with suppress(CounterpoiseError):
        motion = motion_from_texts(*inputs["motion"])
        return inputs["motion"][0], (motion.with_peak_acceleration(peak) if peak else motion).duration
    return None


def _payload_findings(mechanism: tuple[str, ...], conditions: Conditions) -> list[Finding]:
    """A finding where a payload is stated and the mechanism does not name the one body that carries it."""
    if "payload_kg" not in conditions or payload_body({"mechanism": mechanism}):
        return []
    from balance.mechanism.mjcf_parser import mechanism_from_text  # late: most files say it in one line

    try:
        _ = mechanism_from_text(mechanism[1], mechanism[0]).payload_body
    except CounterpoiseError as error:
        return [Finding("condition_contradiction", None, None, f"payload_kg is stated, but {error}")]
    return []


def _peak_findings(motion: tuple[str, ...], conditions: Conditions) -> list[Finding]:
    """A finding where g0 are stated of joints that turn, or rad/s2 of anything else."""
    turning = False
    if "joints" in motion[1]:
        from balance.motion.motion_files import motion_from_texts  # late: most motions are of a point

        try:
            moved = motion_from_texts(*motion)
        except CounterpoiseError:
            return []  # told where the motion is used
        turning = bool(moved.joints) and not any(moved.sliding)
    wrong, right = "peak_acceleration_g", "peak_acceleration_rad_s2"
    if not turning:
        wrong, right = right, wrong
    if wrong not in conditions:
        return []
    kind = "joints that turn" if turning else "no joints that turn"
    message = f"{wrong} is stated, but {motion[0]} moves {kind}: state {right} in the run table"
    return [Finding("condition_contradiction", None, None, message)]


def _motion(name: str | None, folders: Iterable[Path]) -> Path | None:
    if not name:
        return None
    own = (path for folder in folders for path in _named(folder, name))
    return next((path for path in [*own, *_named(datasets.ROOT / "motions", name)] if path.is_file()), None)


def _known_motions(folders: Iterable[Path]) -> list[str]:
    """Names of the motions in these folders: files that say how they are driven; and of the shipped ones."""
    own = (path for folder in folders for path in folder.glob("*.toml"))
    shipped = (name for name in datasets.dataset_names("motions", ".toml") if len(name) > 2)  # x and y are near to much
    return [*(path.stem for path in own if _says_driven(path)), *shipped]


def _says_driven(path: Path) -> bool:
    with suppress(CounterpoiseError, OSError):
        return re.search(r"^\s*driven\s*=", read_text(path), re.MULTILINE) is not None
    return False


def _lost(name: str) -> str:
    return ": there is none of this name" if name.endswith(".toml") else ""


def _named(folder: Path, name: str) -> Iterator[Path]:
    """Files of a motion's name below a folder, and nowhere else."""
    for path in (folder / name, folder / f"{name}.toml"):
        if path.suffix == ".toml" and path.resolve().is_relative_to(folder.resolve()):
            yield path
