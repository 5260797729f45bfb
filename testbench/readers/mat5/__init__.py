"""MATLAB files of version 5 (also 6 and 7), read without trusting what they declare.

``content`` gives the bytes of a variable, compressed or not; ``elements`` the tree of arrays in it; ``arrays`` their
numbers.
"""
