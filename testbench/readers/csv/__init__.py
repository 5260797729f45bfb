"""Text with delimiters, as loggers write it. ``reader`` is the way in; ``dialect`` and ``header`` read the first
lines, ``lines`` the rest in blocks, ``rows`` and ``cells`` see that nothing odd is taken for a number.
"""
