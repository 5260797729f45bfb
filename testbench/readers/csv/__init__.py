"""Text with delimiters, as loggers write it. ``reader`` is the way in: ``dialect``, ``header`` and ``preamble`` read
the first lines, ``table`` the rows in blocks; ``irregular_rows`` sees that nothing odd is taken for a number.
"""
