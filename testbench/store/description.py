"""What is known of a run, as one JSON text in it: all that our own reader needs beside the samples.

The attributes say the same to other people's tools. They are not read here: HDF5 keeps texts of varying length in a
heap, and one flipped bit there makes it search without end.
"""

import json
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from ..errors import StoreError
from ..recording import Channel, Clock, Conditions, Origin, TimeColumn, UniformClock
from . import forms, layout, safe
from .forms import Decimals, Form

if TYPE_CHECKING:
    import h5py

    from .groups import GroupWriter

LARGEST = 64 << 20
"""Texts longer than this that their file does not hold as they are, but deflated, are none of ours [bytes]."""


def text(origin: Origin, conditions: Conditions, provenance: Mapping[str, Any], groups: Iterable["GroupWriter"]) -> str:
    """The description of a run."""
    document = {
        "layout": layout.LAYOUT,
        "origin": origin,
        "conditions": conditions,
        "provenance": provenance,
        "groups": [_group(writer) for writer in groups],
    }
    return json.dumps(document, ensure_ascii=False)


def read(file: "h5py.File") -> dict[str, Any]:
    """The description of a stored run. Raises StoreError if there is none that we know."""
    known = None
    if safe.has(file, layout.DESCRIPTION):
        known = json.loads(safe.texts(file, layout.DESCRIPTION, LARGEST)[0])
    if not isinstance(known, dict) or known.get("layout") != layout.LAYOUT:
        raise StoreError(f"{file.filename}: not a run stored by this version (layout {layout.LAYOUT})")
    return known


def _group(writer: "GroupWriter") -> dict[str, Any]:
    return {
        "key": writer.key,
        "name": writer.group.name,
        "samples": writer.samples,
        "rate_hz": writer.rate_hz,
        "rate_source": writer.rate_source,
        "clock": _clock(writer.group.clock),
        "channels": [
            {"key": key, "name": channel.name, "label": channel.label, "unit": channel.unit, **_form(form)}
            for key, channel, form in zip(writer.keys, writer.group.channels, writer.forms, strict=True)
        ],
    }


def _form(form: Form) -> dict[str, Any]:
    return {"whole": form.as_dict()} if isinstance(form, Decimals) else {}


def _clock(clock: Clock | None) -> dict[str, Any] | None:
    if isinstance(clock, UniformClock):
        return {"rate_hz": clock.rate_hz, "start_s": clock.start_s}
    if clock is None:
        return None
    return {"index": clock.index, "seconds_per_unit": clock.seconds_per_unit, "assumed": clock.assumed}


def clock(document: Mapping[str, Any] | None) -> Clock | None:
    """The clock of a group, from its part of the description."""
    if document is None:
        return None
    return UniformClock(**document) if "rate_hz" in document else TimeColumn(**document)


def channels(document: Iterable[Mapping[str, Any]]) -> tuple[Channel, ...]:
    """The channels of a group, from its part of the description."""
    return tuple(Channel(str(c["name"]), c["unit"], str(c["label"])) for c in document)


def whole_numbers(document: Iterable[Mapping[str, Any]]) -> tuple[Decimals | None, ...]:
    """How channels are kept as whole numbers; None for each that is float64."""
    return tuple(forms.from_dict(channel.get("whole")) for channel in document)
