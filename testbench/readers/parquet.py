"""Parquet, read with polars in a process of its own: ``columns`` makes numbers of its types, ``library`` reads it."""
