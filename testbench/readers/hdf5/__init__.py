"""HDF5 of other people: plain, NeXus, netCDF 4, MATLAB 7.3; read in a process of its own.

``safe_walk`` goes through the objects without following what leads elsewhere, and refuses datasets that cannot be read
safely; ``worker`` makes series of samples of them and a recording of these, and knows MATLAB's ways.
"""
