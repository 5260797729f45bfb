"""Mechanisms by name or from a file: MJCF, compiled by MuJoCo, URDF and SDF."""

from pathlib import Path

from .. import datasets
from ..errors import ModelError
from .compiled_model import mechanism_of
from .mechanism import Mechanism
from .mjcf_compiler import compile_spec, parse_mjcf, read_text, tags, with_includes, with_inertials


def load_mechanism(name: str | Path) -> Mechanism:
    """Load a shipped mechanism by name, or a file: MJCF (.xml, .mjcf), URDF (.urdf) or SDF (.sdf).

    Raises DataError for a name that is neither, ModelError for a file that cannot be understood.
    """
    path = datasets.find_dataset(name, "mechanisms", ".xml")
    if path.suffix.lower() not in {".xml", ".mjcf", ".urdf", ".sdf"}:
        raise ModelError(f"{path.name}: expected a MJCF (.xml, .mjcf), URDF (.urdf) or SDF (.sdf) file")
    return _mechanism(read_text(path), path.stem, path.name, path)


def mechanism_from_text(text: str, name: str) -> Mechanism:
    """Load a mechanism from the text of a MJCF, URDF or SDF file, such as one stored with a run."""
    return _mechanism(text, Path(name).name, f"{Path(name).name}.xml", None)


def _mechanism(text: str, name: str, file: str, path: Path | None) -> Mechanism:
    folder = None if path is None else path.parent
    if next((tag["tag"] for tag in tags(text)), "") in ("robot", "sdf"):
        from .robot_files import read_robot  # late: most mechanisms are MJCF

        robot, text = read_robot(text, file, path)
        model = compile_spec(robot.spec(), text, file, folder)
        robot.restore(model)
        return mechanism_of(model, file, name, text)
    text = with_includes(text, file, folder)
    spec = parse_mjcf(text, file)
    model = compile_spec(spec, text, file, folder)
    return mechanism_of(model, file, name, with_inertials(text, spec, model))
