"""The names in a mechanism's file, read without the library that models it: bodies, joints and sites."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from balance import datasets
from balance.input_files import suggestion

from ..errors import RigError

NONE = "none"
"""What a rig says that measures no mechanism, such as a force plate alone."""
_BODIES, _JOINTS = {"body", "link"}, {"joint", "freejoint"}
_SUFFIXES = (".xml", ".mjcf", ".urdf", ".sdf")


@dataclass(frozen=True)
class Names:
    """What a mechanism calls its parts."""

    mechanism: str
    bodies: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()
    sites: tuple[str, ...] = ()

    def unknown(self, kind: str, name: str) -> str | None:
        """What is wrong with a name that the mechanism does not have, with those that it has; None if it has it."""
        known: tuple[str, ...] = getattr(self, {"body": "bodies"}.get(kind, f"{kind}s"))
        if name in known:
            return None
        listed = ", ".join(known) or "none"
        return f"{self.mechanism} has no {kind} {name!r}: expected {listed}{suggestion(name, known)}"


def of_mechanism(name: str, folder: Path | None) -> Names | None:
    """The names in a shipped mechanism, or in a file beside the rig; None where the rig is for none.

    Raises RigError, listing what is shipped, if there is neither, and for a file that is no XML.
    """
    if name == NONE:
        return None
    path = _file(name, folder)
    if path is None:
        shipped = datasets.names("mechanisms", ".xml")
        place = "" if folder is None else f", and no file of that name lies beside the rig in {folder}"
        raise RigError(
            f"mechanism: no shipped mechanism {name!r}{suggestion(name, shipped)}{place} "
            f"(there are: {', '.join(shipped)}; '{NONE}' for a bench without one)"
        )
    try:
        # A file of the user's own, of which names alone are taken.
        root = ElementTree.parse(path).getroot()
    except (ElementTree.ParseError, OSError) as error:
        raise RigError(f"mechanism: {path.name} cannot be read: {error}") from error
    return _names(name, root)


def _file(name: str, folder: Path | None) -> Path | None:
    shipped = datasets.ROOT / "mechanisms" / f"{name}.xml"
    beside = [] if folder is None else [folder / name, *(folder / f"{name}{suffix}" for suffix in _SUFFIXES)]
    plain = Path(name).name == name and name not in {"", ".", ".."}
    return next((p for p in [*beside, *([shipped] if plain else [])] if p.is_file()), None)


def _names(mechanism: str, root: ElementTree.Element) -> Names | None:
    """None for a file whose parts lie in others: their names are not known here."""
    elements = list(root.iter())
    if any(element.tag in {"include", "attach", "replicate"} for element in elements):
        return None
    return Names(
        mechanism,
        _of(elements, _BODIES),
        _of(elements, _JOINTS),
        _of([e for part in root.iter("worldbody") for e in part.iter()], {"site"}),
    )


def _of(elements: Iterable[ElementTree.Element], tags: set[str]) -> tuple[str, ...]:
    found = (element.get("name") for element in elements if element.tag in tags)
    return tuple(dict.fromkeys(name for name in found if name))
