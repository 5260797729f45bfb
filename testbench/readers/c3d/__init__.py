"""C3D: markers and analog channels of movement laboratories, force plates among them.

``parameters`` reads the parameter section, ``header`` what it and the header say of the data, ``frames`` the data.
"""
