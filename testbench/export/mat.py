"""MATLAB level 5: a struct a group with name, unit and data of each channel, and time."""

from pathlib import Path
from typing import Any

import numpy as np

from ..errors import StoreError
from ..store import Run
from .columns import columns, line, provenance, unique

LARGEST = 2**31 - 1
"""Bytes that a variable of level 5 may have: here a struct with all channels of a group."""
LONGEST = 63
"""Characters that MATLAB takes in a name."""


def write(run: Run, groups: list[str], target: Path) -> list[str]:
    """Write all groups; each channel is a field of its HDF5 name with ``name``, ``unit`` and ``data``."""
    from scipy.io import savemat

    names = unique([f"group_{run.group(name).path.rpartition('/')[2]}" for name in groups], LONGEST)
    content: dict[str, Any] = {"counterpoise": line(provenance(run))}
    content |= {name: _struct(run, group) for name, group in zip(names, groups, strict=True)}
    savemat(str(target), content, appendmat=False, long_field_names=True)
    return []


def _struct(run: Run, name: str) -> dict[str, Any]:
    """A group; no two channels have one field, however long their names are."""
    group, found = run.group(name), columns(run, name)
    if (size := 8 * group.samples * len(found)) > LARGEST:
        raise StoreError(
            f"{run.path.name}: group {name!r} has {size} bytes of samples, a variable of a MAT file no more than "
            f"{LARGEST}; use parquet"
        )
    keys = ["time_s" if column.index is None else group.keys[column.index] for column in found]
    fields = {
        key: {"name": column.channel.name, "unit": column.channel.unit or "", "data": column.values[:, np.newaxis]}
        for key, column in zip(unique([f"channel_{key}" for key in keys], LONGEST), found, strict=True)
    }
    return {"name": name, **fields}
