"""ASAM MDF, versions 3 and 4, in bounded memory.

``version3`` and ``version4`` walk through the blocks of a file, ``records`` takes the records of each channel
group from its data and the channels from records, ``conversions`` makes them physical, ``reader`` makes the recording.
"""
