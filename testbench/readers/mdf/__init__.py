"""ASAM MDF, versions 3 and 4, in bounded memory: ``v3`` and ``v4`` walk through the blocks of a file, ``records``
takes the records of each group from its data, ``numbers`` the channels from records, ``laws`` makes them physical.
"""
