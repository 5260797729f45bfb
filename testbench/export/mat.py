"""MATLAB level 5: a struct a group with name, unit and data of each channel, and time."""

from pathlib import Path
from typing import Any

import numpy as np

from ..errors import StoreError
from ..store import Run
from .columns import columns, line, provenance

LARGEST = 2**31 - 1
"""Bytes that an array of level 5 may have."""


def write(run: Run, groups: list[str], target: Path) -> list[str]:
    """Write all groups; each channel is a field of its HDF5 name with ``name``, ``unit`` and ``data``."""
    from scipy.io import savemat

    content: dict[str, Any] = {"counterpoise": line(provenance(run))}
    for name in groups:
        group = run.group(name)
        if group.samples * 8 > LARGEST:
            raise StoreError(f"{run.path.name}: {group.samples} samples are more than a MAT file holds; use parquet")
        keys = ["time_s" if column.index is None else group.keys[column.index] for column in columns(run, name)]
        content["group_" + group.path.rpartition("/")[2]] = {
            "name": name,
            **{
                "channel_" + key: {
                    "name": c.channel.name,
                    "unit": c.channel.unit or "",
                    "data": c.values[:, np.newaxis],
                }
                for key, c in zip(keys, columns(run, name), strict=True)
            },
        }
    savemat(str(target), _short(content), appendmat=False, long_field_names=True)
    return []


def _short(content: dict[str, Any]) -> dict[str, Any]:
    """Names of no more than the 63 characters that MATLAB takes."""
    return {key[:63]: _short(value) if isinstance(value, dict) else value for key, value in content.items()}
