"""What first moment is missing where, from measured shaking forces: least squares on the balance conditions.

The shaking force is linear in pi and vanishes where the conditions C pi = c are zero: F = W_F pi = W_F[pivots] c. So c
is what is measured, one number a condition, and counter-masses m that would balance are those of C pi + B m = 0 with
the measured c in place of C pi. Intervals come from leaving out stretches of the record in turn (delete-block
jackknife), with offsets and the like of each record solved for anew. Repeats of one motion repeat its systematic
errors: the same stretch is left out of all of them. What errors that all stretches share do to c follows from the
gain of the least squares (``Fit.gains``).
"""

from .imbalance import Free, Imbalance, Missing
from .record import Record
from .sites import adjusted, columns_of, shares_of, site_columns
from .solution import Fit, fit, measure

__all__ = [
    "Fit",
    "Free",
    "Imbalance",
    "Missing",
    "Record",
    "adjusted",
    "columns_of",
    "fit",
    "measure",
    "shares_of",
    "site_columns",
]
