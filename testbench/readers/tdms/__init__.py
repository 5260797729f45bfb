"""NI TDMS: ``segments`` of the file, the ``metadata`` that they declare, and its ``reader``."""
