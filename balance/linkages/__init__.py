"""Complete balancing of planar linkages by the equivalence method, with counter-masses and gears."""
