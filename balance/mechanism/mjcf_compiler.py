"""MJCF compiled by MuJoCo, so that a file means what MuJoCo says, within bounds on what it may open and cost.

Included files are put into the text first, from the file's own folder alone. Meshes, height fields and textures on
which no moving body's mass depends are not opened: MuJoCo would only draw them or let them collide.
"""

import hashlib
import json
import re
import threading
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..datasets import text_of
from ..errors import ModelError

TEXT_LIMIT = 20_000_000
"""Longest text of a mechanism, what it includes counted [characters]."""
ELEMENT_LIMIT = 50_000
"""Most elements of a mechanism once every <replicate> is written out, most keyframes, most user numbers of one."""
BODY_LIMIT = 5_000
"""Most bodies among them: MuJoCo's time grows with their square."""
ASSET_LIMIT = 200_000_000
"""Largest sum of the mesh files that masses depend on [bytes]."""
COORDINATE_LIMIT = 600
"""Most coordinates of a mechanism, and most joints."""
MEMORY_LIMIT = 1_500_000_000
"""Memory that compiling may take beyond what is in use [bytes]."""
_LIMITING = threading.Lock()
"""The limit is of the process: a second thread would take the first one's for what stood before, and leave it."""
LOOP_END = "loop end"
"""Beginning of the names of sites that a robot's loops are tied at: nobody's but the compiler's."""
MASSLESS = 2e-15
"""What a body without mass is given for MuJoCo, which takes none below 1e-15, and rid of after [kg, kg m2]."""
_NEGLIGIBLE = 1e-9
"""Inertia, relative to the largest of the file, that may be lost."""
_ROUNDED_INERTIA = 1e-14
"""By which the largest moment of inertia, relative to itself, may exceed the sum of the others: rounding."""

_TAG = re.compile(r"<(?P<close>/?)(?P<tag>[\w:.-]+)(?P<rest>(?:[^>\"']++|\"[^\"]*+\"|'[^']*+')*+)>")
"""A tag; its parts are possessive, so that no text takes longer than its length."""
_ATTRIBUTE = re.compile(r"([\w:.-]+)\s*=\s*(?:\"([^\"]*)\"|'([^']*)')")
_ASIDE = {"<!--": "-->", "<![CDATA[": "]]>", "<?": "?>", "<!": ">"}
"""What is no element, by its start, and its end."""
_REFUSED = {
    **dict.fromkeys(("plugin", "extension"), "code of its own, which is not run here; remove it"),
    **dict.fromkeys(("flex", "flexcomp"), "a flexible body; replace it by rigid ones"),
    "attach": "another model, which is not read; write the mechanism out in one file, or use <include>",
}
_FINITE = ("body_pos", "body_mass", "body_inertia", "jnt_pos", "jnt_axis", "jnt_range", "dof_damping", "dof_armature",
           "dof_frictionloss", "site_pos", "key_qpos", "eq_data")  # fmt: skip
_EQUALITIES = {"CONNECT", "WELD", "JOINT"}
_INERTIALS = "counterpoise inertials"
"""The <text> of a stored mechanism that has, as JSON, the inertials which MuJoCo computed from its meshes."""


def read_text(path: Path) -> str:
    """The text of a mechanism's file. Raises ModelError unless it is short UTF-8 that defines no entities."""
    size = path.stat().st_size
    if size > TEXT_LIMIT:
        raise ModelError(f"{path.name}: has {size} bytes; at most {TEXT_LIMIT} are read")
    try:
        text = text_of(path, "utf-8-sig")
    except UnicodeDecodeError as error:
        raise ModelError(f"{path.name}: not in UTF-8: {error}") from error
    for found, what in (("\0", "a NUL character"), ("<!ENTITY", "entities (<!ENTITY>)")):
        if found in text:
            raise ModelError(f"{path.name}: holds {what}, which is not read; write it as plain XML")
    return text


def with_includes(text: str, name: str, folder: Path | None) -> str:
    """The text with each <include> replaced by what it names.

    Raises ModelError for a file outside ``folder``, also by a link, for one that is missing, and for one named twice.
    """
    seen: set[Path] = set()

    def parts(text: str) -> Iterator[str]:
        done = 0
        for match in tags(text):
            if match["tag"] == "include":
                yield text[done : match.start()]
                done = match.end()
                if not match["close"]:
                    yield from included(match)
        yield text[done:]

    def included(match: re.Match[str]) -> Iterator[str]:
        file = _attributes(match).get("file", "")
        path = located_file(file, "", folder, name)
        if path in seen:
            raise ModelError(f"{name}: {element_label(match)} includes the file once more; MuJoCo takes each once")
        seen.add(path)
        inner = read_text(path)
        found = list(tags(inner))
        if len(found) > 1:
            yield from parts(inner[found[0].end() : found[-1].start()])

    whole = "".join(parts(text))
    if len(whole) > TEXT_LIMIT:
        raise ModelError(f"{name}: has {len(whole)} characters with what it includes; at most {TEXT_LIMIT} are read")
    return whole


def parse_mjcf(text: str, name: str) -> Any:  # noqa: ANN401
    """MuJoCo's MjSpec of a text without <include>.

    Raises ModelError, naming the file and what was found, for what MuJoCo cannot parse, for a flexible body or a
    plugin, and for more than ELEMENT_LIMIT elements.
    """
    refuse_tags(text, name)
    mujoco = import_mujoco()
    with _bounded(mujoco, text, name):
        return _in_own_thread(partial(mujoco.MjSpec.from_string, text))


def compile_spec(spec: Any, text: str, name: str, folder: Path | None) -> tuple[Any, dict[str, str]]:  # noqa: ANN401
    """MuJoCo's MjModel of what :func:`parse_mjcf` gave; paths in it are relative to ``folder``, None for no files.

    With it the files that it took, as a Compilation has them.

    Raises ModelError, naming the file, the element and the cure, for what would change the motion and is not understood
    here, for what MuJoCo refuses, and for what would cost more than the limits of this module.
    """
    mujoco = import_mujoco()
    _refuse_parts(mujoco, spec, name)
    spec.compiler.fusestatic = False
    bounds = {key: getattr(spec.compiler, key) for key in ("boundmass", "boundinertia")}
    for key, bound in bounds.items():
        setattr(spec.compiler, key, bound or MASSLESS)
    _take_inertials(mujoco, spec, name)
    _check_inertias(mujoco, spec, name)
    files = _take_assets(mujoco, spec, name, folder)
    with _bounded(mujoco, text, name):
        model = _in_own_thread(spec.compile)
    for values, bound in zip((model.body_mass, model.body_inertia), bounds.values(), strict=True):
        if not bound:
            values[values == MASSLESS] = 0.0
    largest = float(model.body_inertia.max())
    for body in spec.bodies:
        stated = np.concatenate([body.inertia, body.fullinertia[:3]])
        lost = stated[(stated > _NEGLIGIBLE * largest) & (stated < MASSLESS)]
        if body.explicitinertial and len(lost):
            raise ModelError(
                f"{name}: body {body.name!r} has an inertia of {lost.max():g} kg m2, which MuJoCo takes for none; "
                "scale the file, such as to mm and g"
            )
    numbers = {part: getattr(model, part) for part in _FINITE} | {"gravity": model.opt.gravity}
    for part, values in numbers.items():
        if not np.isfinite(values).all():
            raise ModelError(f"{name}: a number of {part.replace('_', ' ')} is infinite; expected finite numbers")
    return model, files


def with_inertials(text: str, spec: Any, model: Any) -> str:  # noqa: ANN401
    """The text, with the compiled inertials in it where they came from meshes: it can be read again without those."""
    if not spec.assets:
        return text
    rows = [
        [model.body_mass[k], *model.body_ipos[k], *model.body_iquat[k], *model.body_inertia[k]]
        for k in (body.id for body in spec.bodies[1:])
    ]
    *_, end = tags(text)
    stored = f'<custom><text name="{_INERTIALS}" data="{json.dumps(np.array(rows).tolist())}"/></custom>'
    return text[: end.start()] + stored + text[end.start() :]


def _take_inertials(mujoco: Any, spec: Any, name: str) -> None:  # noqa: ANN401
    """Inertials that :func:`with_inertials` stored, in the place of those of geometry."""
    stored, bodies = spec.text(_INERTIALS), spec.bodies[1:]
    if stored is None:
        return
    try:
        rows = np.array(json.loads(stored.data), dtype=float).reshape(len(bodies), 11)
    except (ValueError, TypeError) as error:
        raise ModelError(f"{name}: <text name={_INERTIALS!r}>: expected 11 numbers for each body") from error
    spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
    spec.compiler.settotalmass, spec.compiler.balanceinertia = -1.0, False
    for body, row in zip(bodies, rows, strict=True):
        body.mass, body.ipos, body.iquat, body.inertia = row[0], row[1:4], row[4:8], row[8:]
        body.fullinertia, body.explicitinertial = np.full(6, np.nan), True


def _check_inertias(mujoco: Any, spec: Any, name: str) -> None:  # noqa: ANN401
    """Refuse masses and principal moments of inertia that no body has, which MuJoCo would put others in the place of.

    Those of a lamina in a drawing's digits, beyond the sum by rounding alone, are lifted by as much.
    """
    if spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE:
        return
    for body in spec.bodies:
        if body.explicitinertial and body.mass < 0.0:
            raise ModelError(f"{name}: body {body.name!r}: mass is {body.mass:g} kg: expected zero or a positive mass")
        full = np.array(body.fullinertia)
        stated = not np.isnan(full[0])
        xx, yy, zz, xy, xz, yz = full if stated else (*body.inertia, 0.0, 0.0, 0.0)
        values = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        if not body.explicitinertial or not np.isfinite(values).all():
            continue
        a, b, c = np.linalg.eigvalsh(values)
        if min(a, a + b - c) < -_ROUNDED_INERTIA * abs(c) or c < 0.0:
            raise ModelError(
                f"{name}: body {body.name!r}: the principal moments of inertia {a:.6g}, {b:.6g} and {c:.6g} kg m2 are "
                "of no body: none is below zero, and the largest is at most the sum of the others; correct them "
                "(balanceinertia would put their mean in the place of each)"
            )
        if a > 0.0 and a + b - c < _ROUNDED_INERTIA * c:
            lifted = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]) * 4.0 * _ROUNDED_INERTIA * c
            body.fullinertia = full + lifted if stated else full
            body.inertia = body.inertia if stated else body.inertia + lifted[:3]


def tags(text: str) -> Iterator[re.Match[str]]:
    """The tags of an XML text up to where it is malformed; comments and what else is no element passed over."""
    at = text.find("<")
    while at >= 0:
        aside = next((start for start in _ASIDE if text.startswith(start, at)), None)
        match = None if aside else _TAG.match(text, at)
        if match:
            yield match
            end = match.end()
        else:
            end = text.find(_ASIDE[aside], at) + 1 if aside else 0
        if not end:
            return
        at = text.find("<", end)


def element_label(match: re.Match[str]) -> str:
    """An element as written in the file, cut at 120 characters."""
    return f"<{' '.join([match['tag'], *(f'{k}={v!r}' for k, v in _attributes(match).items())])[:120]}>"


def _attributes(match: re.Match[str]) -> dict[str, str]:
    return {key: double or single for key, double, single in _ATTRIBUTE.findall(match["rest"])}


def import_mujoco() -> Any:  # noqa: ANN401
    """The module. Raises ModelError, saying how to get it, where it is not installed."""
    try:
        import mujoco
    except ImportError as error:
        raise ModelError(
            "reading a mechanism needs MuJoCo: install 'mujoco-core' with pip; without it, "
            "balance size parallelogram-6bar --closed-form works"
        ) from error
    return mujoco


@contextmanager
def _bounded(mujoco: Any, text: str, name: str) -> Iterator[None]:  # noqa: ANN401
    """Bound the memory of what MuJoCo does, take its warnings, and turn what it raises into ModelError of one line."""
    said: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(said.append)
    try:
        with _bounded_memory(), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except (MemoryError, ValueError, TypeError, RuntimeError, mujoco.FatalError, mujoco.UnexpectedError) as error:
        said_so = " ".join(str(error).split())
        if isinstance(error, MemoryError) or "unknown exception" in said_so:
            raise ModelError(f"{name}: needs more than {MEMORY_LIMIT / 1e9:g} GB of memory; make it smaller") from error
        units = "; numbers have no unit behind them: m, kg, kg m2" if "bad format in attribute" in said_so else ""
        raise ModelError(f"{name}: MuJoCo refuses it: {said_so}{units}") from error
    finally:
        mujoco.set_mju_user_warning(before)
    if any("NaN" in warning for warning in said):
        where = next((element_label(m) for m in tags(text) if re.search(r"\bnan\b", m[0], re.I)), "an element")
        raise ModelError(f"{name}: {where} holds 'nan'; expected finite numbers")


def _in_own_thread(work: Callable[[], Any]) -> Any:  # noqa: ANN401
    """Where memory ends, MuJoCo 4.0 leaves the thread's handler of warnings as its own successor: the thread's next
    warning would never end.
    """
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(work).result()


@contextmanager
def _bounded_memory() -> Iterator[None]:
    """Let the process grow by MEMORY_LIMIT only, where the system can bound it."""
    try:
        import resource

        used = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * resource.getpagesize()
    except (ImportError, OSError):
        yield
        return
    with _LIMITING:
        soft, hard = resource.getrlimit(resource.RLIMIT_AS)
        bound = used + MEMORY_LIMIT
        if soft != resource.RLIM_INFINITY:
            bound = min(bound, soft)
        resource.setrlimit(resource.RLIMIT_AS, (bound, hard))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def refuse_tags(text: str, name: str, passed: str = "") -> None:
    """Raise ModelError for what must not reach a parser: code, flexible bodies, and elements or copies without end.

    An element ``passed`` over is no reason.
    """
    count, bodies, copies = 0, 0, [1]
    for match in tags(text):
        tag = match["tag"]
        if tag in _REFUSED and tag != passed:
            raise ModelError(f"{name}: {element_label(match)} is {_REFUSED[tag]}")
        if tag == "replicate":
            if match["close"]:
                copies = copies[:-1] or [1]
            elif not match["rest"].endswith("/"):
                number = _attributes(match).get("count", "1")
                copies.append(copies[-1] * (int(number) if number.isdigit() else 1))
        if not match["close"]:
            count += copies[-1]
            bodies += copies[-1] * (tag in ("body", "link"))
        if count > ELEMENT_LIMIT or bodies > BODY_LIMIT:
            raise ModelError(
                f"{name}: has more than {ELEMENT_LIMIT} elements or {BODY_LIMIT} bodies, <replicate> written out"
            )


def _refuse_parts(mujoco: Any, spec: Any, name: str) -> None:  # noqa: ANN401
    """What would move the mechanism, or hold it, in a way that is not understood here; sizes without bounds."""
    if len(spec.joints) > COORDINATE_LIMIT:
        raise ModelError(f"{name}: has {len(spec.joints)} joints; at most {COORDINATE_LIMIT} are read")
    for joint in spec.joints:
        if joint.type == mujoco.mjtJoint.mjJNT_FREE:
            raise ModelError(
                f"{name}: body {joint.parent.name!r} floats (<freejoint> {joint.name!r}): a balance needs a base; "
                "remove it to fix the body to the world, or give the body slides and a ball joint"
            )
    for body in spec.bodies:
        if body.mocap:
            raise ModelError(f"{name}: body {body.name!r} is moved from outside (mocap='true'); remove that")
    for loop in spec.equalities:
        kind = loop.type.name.removeprefix("mjEQ_")
        label = f"{name}: <equality> <{kind.lower()} name={loop.name!r}> of {loop.name1!r} and {loop.name2!r}"
        if kind not in _EQUALITIES:
            raise ModelError(f"{label} is not understood here; understood are <connect>, <weld> and <joint>")
        if not loop.active:
            raise ModelError(f"{label} is not active; remove it from the file, or its active='false'")
    sizes = {key: getattr(spec, key) for key in dir(spec) if key.startswith("nuser_")}
    for key, size in (sizes | {"nkey": spec.nkey}).items():
        if size > ELEMENT_LIMIT:
            raise ModelError(f"{name}: {key} is {size}; at most {ELEMENT_LIMIT} are read")


def _take_assets(mujoco: Any, spec: Any, name: str, folder: Path | None) -> dict[str, str]:  # noqa: ANN401
    """Hand over the meshes that masses depend on, and take out all else that is drawn or collides.

    A file that is missing is refused all the same, as MuJoCo does. Returns the files, as a Compilation has them.
    """
    needed = set()
    for geom in spec.geoms:
        geom.contype = geom.conaffinity = 0
        if geom.meshname and _weighs(mujoco, spec, geom.parent):
            needed.add(geom.meshname)
        elif geom.meshname or geom.hfieldname:
            geom.type, geom.size, geom.meshname, geom.hfieldname = mujoco.mjtGeom.mjGEOM_SPHERE, [1, 1, 1], "", ""
    mesh_folder, texture_folder = spec.compiler.meshdir, spec.compiler.texturedir
    assets: dict[str, bytes] = {}
    files: dict[str, str] = {}
    for mesh in list(spec.meshes):
        mesh.name = mesh.name or Path(mesh.file).stem
        if mesh.name not in needed:
            files |= _present(mesh.file, mesh_folder, spec, folder, name)
            spec.delete(mesh)
        elif mesh.file:
            file = _stripped(mesh.file, spec)
            path = located_file(file, mesh_folder, folder, name)
            mesh.file = f"{len(assets)}{path.suffix}"
            assets[mesh.file] = path.read_bytes() if path.stat().st_size <= ASSET_LIMIT else b""
            if not assets[mesh.file] or sum(map(len, assets.values())) > ASSET_LIMIT:
                raise ModelError(f"{name}: its meshes have more than {ASSET_LIMIT} bytes; give bodies an <inertial>")
            files[str(Path(mesh_folder, file))] = hashlib.sha256(assets[mesh.file]).hexdigest()
    for texture in spec.textures:
        for file in (texture.file, *texture.cubefiles):
            files |= _present(file, texture_folder, spec, folder, name)
        texture.file, texture.cubefiles = "", [""] * len(texture.cubefiles)
        texture.builtin, texture.width, texture.height = mujoco.mjtBuiltin.mjBUILTIN_FLAT, 2, 2
    for field in list(spec.hfields):
        files |= _present(field.file, mesh_folder, spec, folder, name)
        spec.delete(field)
    for skin in list(spec.skins):
        spec.delete(skin)
    spec.compiler.meshdir, spec.assets = "", assets
    return files


def _weighs(mujoco: Any, spec: Any, body: Any) -> bool:  # noqa: ANN401
    """Whether the mass of a moving body comes from its geometry."""
    rule, rules = spec.compiler.inertiafromgeom, mujoco.mjtInertiaFromGeom
    if rule == rules.mjINERTIAFROMGEOM_FALSE or (rule == rules.mjINERTIAFROMGEOM_AUTO and body.explicitinertial):
        return False
    while body is not None and not body.joints and spec.compiler.settotalmass <= 0.0:
        body = body.parent
    return body is not None


def _stripped(file: str, spec: Any) -> str:  # noqa: ANN401
    return re.split(r"[/\\]", file)[-1] if spec.strippath else file


def _present(file: str, subfolder: str, spec: Any, folder: Path | None, name: str) -> dict[str, str]:  # noqa: ANN401
    """A file that needs to be there only, as a Compilation has it. Raises ModelError where it is missing."""
    if not file or folder is None:
        return {}
    path = Path(subfolder, _stripped(file, spec))
    if not (folder / path).is_file():
        raise ModelError(f"{name}: names the file {file!r}, which is not there; put it there, or remove the element")
    return {str(path): ""}


def located_file(file: str, subfolder: str, folder: Path | None, name: str) -> Path:
    """The file that is meant. Raises ModelError if it is missing or lies outside ``folder``, links followed."""
    if folder is None:
        raise ModelError(f"{name}: names the file {file!r}, but is itself read from a text without a folder")
    path = (folder / subfolder / file).resolve()
    if not path.is_relative_to(folder.resolve()):
        raise ModelError(f"{name}: {file!r} lies outside the folder of {name}; copy it there")
    if not path.is_file():
        raise ModelError(f"{name}: names the file {file!r}, which is not there; put it there, or remove the element")
    return path
