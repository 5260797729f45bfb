"""NI TDMS. ``segments`` walks through the file, ``metadata`` reads what each segment declares, ``spans`` where the
samples of each channel lie, ``scaling`` makes physical values of raw ones.
"""
