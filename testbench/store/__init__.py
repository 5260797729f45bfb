"""Runs in HDF5: one immutable file a run, with its digest file; a campaign is a folder of runs."""

from .campaign import Campaign, open_campaign
from .run import Run, StoredGroup, open_run

__all__ = ["Campaign", "Run", "StoredGroup", "open_campaign", "open_run"]
