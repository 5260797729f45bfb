"""HDF5 of other people: plain, NeXus, netCDF 4, MATLAB 7.3; read in a process of its own.

``safe_walk`` goes through the objects without following what leads elsewhere, and refuses datasets that cannot be read
safely; ``datasets`` makes series of samples of them; ``worker`` puts a recording together, and knows MATLAB's ways.
"""
