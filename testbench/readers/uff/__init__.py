"""Universal files (UFF, ``.unv``): datasets 58 and 58b, functions at nodes, and 55, data at nodes.

``index`` finds the datasets, ``function`` and ``nodal`` read their headers, ``values`` their numbers in pieces.
"""
