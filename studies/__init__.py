"""Statistical and fault studies, run from a checkout by ``python -m studies``; no part of the installed packages."""
