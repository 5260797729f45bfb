"""Text with delimiters, as loggers write it. ``reader`` is the way in: ``dialect`` and ``header`` read the first
lines, ``rewritten_columns`` finds times and numbers in other notations, ``table`` reads the rows in blocks, and
``irregular_rows`` sees that nothing odd is taken for a number.
"""
