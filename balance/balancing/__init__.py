"""Counter-masses from balance conditions: of any mass, within limits, and from stock plates."""
