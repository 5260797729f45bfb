"""Mechanisms by name or from a file: MJCF, compiled by MuJoCo, URDF and SDF.

What MuJoCo made of a file is kept in the user's cache: importing MuJoCo takes longer than all else of a small command.
The environment's ``COUNTERPOISE_CACHE=off`` switches that off.
"""

import hashlib
import json
import math
import os
import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from .. import datasets
from ..datasets import FileDigest, files_read, note_files
from ..errors import ModelError
from .compiled_model import Compilation, mechanism_of
from .mechanism import Mechanism
from .mjcf_compiler import ASSET_LIMIT, compile_spec, parse_mjcf, read_text, tags, with_includes, with_inertials

_LIMIT, _COUNT = 2_000_000, 100
"""Largest entry of the cache [bytes], and most entries."""


def load_mechanism(name: str | Path) -> Mechanism:
    """Load a shipped mechanism by name, or a file: MJCF (.xml, .mjcf), URDF (.urdf) or SDF (.sdf).

    Raises DataError for a name that is neither, ModelError for a file that cannot be understood. Warns of a hinge more
    than a turn from zero in its keyframe: degrees, most likely, where MuJoCo reads radians whatever the file's angles.
    """
    path = datasets.find_dataset(name, "mechanisms", ".xml")
    if path.suffix.lower() not in {".xml", ".mjcf", ".urdf", ".sdf"}:
        raise ModelError(f"{path.name}: expected a MJCF (.xml, .mjcf), URDF (.urdf) or SDF (.sdf) file")
    with files_read() as files:
        found = _mechanism(read_text(path), path.stem, path.name, path)
    joints = zip(found.coordinates, found.tree.joints, found.home, strict=True)
    if wound := {name: at for name, joint, at in joints if joint.revolute and abs(at) > 2.0 * math.pi}:
        stated = ", ".join(f"{name} = {at:.6g} rad ({math.radians(at):.4g} if degrees)" for name, at in wound.items())
        warnings.warn(
            f"{path.name}: in {found.branch!r} hinges are more than one turn (6.283 rad) from zero: {stated}; "
            'keyframes are in radians, with <compiler angle="degree"/> too: write these if degrees were meant',
            stacklevel=2,
        )
    return replace(found, files=tuple(files))


def mechanism_from_text(text: str, name: str) -> Mechanism:
    """Load a mechanism from the text of a MJCF, URDF or SDF file, such as one stored with a run."""
    return _mechanism(text, Path(name).name, f"{Path(name).name}.xml", None)


def _mechanism(text: str, name: str, file: str, path: Path | None) -> Mechanism:
    folder, loose_base = None if path is None else path.parent, ""
    if (kind := next((tag["tag"] for tag in tags(text)), "")) in ("robot", "sdf"):
        from .robot_files import read_robot  # late: most mechanisms are MJCF

        robot, text = read_robot(text, file, path)
        loose_base = "".join(robot.roots) if kind == "sdf" else ""  # of two roots the spec is refused

        def compiled() -> Compilation:
            model, files = compile_spec(robot.spec(), text, file, folder)
            robot.restore(model)
            return Compilation.of(model, text, files)

    else:
        text = with_includes(text, file, folder)

        def compiled() -> Compilation:
            spec = parse_mjcf(text, file)
            model, files = compile_spec(spec, text, file, folder)
            return Compilation.of(model, with_inertials(text, spec, model), files)

    compilation = compiled() if folder is None else _compiled_once(text, folder, compiled)
    note_files(FileDigest(Path(mesh).name, digest) for mesh, digest in compilation.files.items() if digest)
    return replace(mechanism_of(compilation, file, name), loose_base=loose_base)


def _compiled_once(text: str, folder: Path, compiled: Callable[[], Compilation]) -> Compilation:
    """What ``compiled`` gives for a text whose files are in ``folder``; by the cache where that has it.

    An entry holds for the very text, this installation of MuJoCo, these sources, and other files as they were. One that
    is damaged is made anew; where nothing can be kept nothing is.
    """
    from ..user_cache import cache_folder, forget_oldest, read_cached, write_cached

    package = find_spec("mujoco")
    if package is None or os.environ.get("COUNTERPOISE_CACHE") == "off":
        return compiled()
    key = _key(text, [*(package.submodule_search_locations or ()), str(Path(__file__).parent)])
    try:
        path = cache_folder() / f"mechanism-{key}.json"
    except OSError:
        return compiled()
    found = _decoded(read_cached(path, _LIMIT), key)
    if found is None or not all(_is_as_it_was(folder, *file) for file in found.files.items()):
        found = compiled()
        content = _encoded(found, key)
        if len(content) <= _LIMIT:
            with suppress(OSError):
                write_cached(path, content)
                forget_oldest("mechanism-*", _COUNT)
    return found


def _key(text: str, folders: list[str]) -> str:
    """What an entry holds for: the text, and names, sizes and times of what MuJoCo and this package consist of."""
    installed = [
        (entry.name, entry.stat().st_size, entry.stat().st_mtime_ns)
        for folder in folders
        for entry in os.scandir(folder)
        if entry.is_file()
    ]
    return hashlib.sha256(f"{sorted(installed)}\n{text}".encode()).hexdigest()


def _is_as_it_was(folder: Path, file: str, digest: str) -> bool:
    path = folder / file
    if not digest:
        return path.is_file()
    inside = path.resolve().is_relative_to(folder.resolve())
    short = inside and path.is_file() and path.stat().st_size <= ASSET_LIMIT
    return short and hashlib.sha256(path.read_bytes()).hexdigest() == digest


def _encoded(found: Compilation, key: str) -> bytes:
    """As JSON: each array by type, shape and values."""
    parts = {part: [a.dtype.str, a.shape, a.ravel().tolist()] for part, a in vars(found.model).items()}
    whole = {"key": key, "parts": parts, "names": found.names, "text": found.text, "files": dict(found.files)}
    return json.dumps(whole).encode()


def _decoded(content: bytes | None, key: str) -> Compilation | None:
    """Of a cache's entry; None where it is not the key's."""
    whole = json.loads(content) if content is not None else {}
    if whole.get("key") != key:
        return None
    parts = {part: np.array(values, kind).reshape(shape) for part, (kind, shape, values) in whole["parts"].items()}
    return Compilation(SimpleNamespace(**parts), whole["names"], whole["text"], whole["files"])
