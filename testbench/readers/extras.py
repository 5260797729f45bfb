"""Libraries that only some formats need: extras of the distribution, and one clear message where one is missing."""

from importlib import import_module
from importlib.util import find_spec
from types import ModuleType

from ..errors import RecordingError

DISTRIBUTION = "counterpoise"
_MODULES = {
    "tdms": ("nptdms",),
    "ide": ("idelib", "ebmlite"),
    "mcap": ("mcap", "rosbags"),
    "rosbag": ("rosbags",),
}


def needs(extra: str) -> str:
    """What must be installed for the formats of ``extra``, as pip names it."""
    return f"{DISTRIBUTION}[{extra}]"


def installed(extra: str) -> bool:
    """Whether the libraries of ``extra`` are there; none is imported."""
    return all(find_spec(name) is not None for name in _MODULES[extra])


def library(name: str, extra: str, what: str) -> ModuleType:
    """The module ``name``, which reading ``what`` needs."""
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        raise RecordingError(f"reading {what} needs {error.name}: pip install '{needs(extra)}'") from error
