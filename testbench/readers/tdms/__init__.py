"""NI TDMS: the ``metadata`` of a file, which say where its samples lie, and its ``reader``."""
