"""What the data themselves show: numbers of each channel and clock, and findings about them, in one pass."""
