"""HDF5 of other people: plain, NeXus, netCDF 4, MATLAB 7.3; read in a process of its own.

``walk`` goes through the objects without following what leads elsewhere; ``judge`` says of a dataset whether it can be
read and why not; ``arrays`` makes series of it; ``matlab`` knows MATLAB's ways; ``library`` puts it together.
"""
