"""Slider-cranks and engines: shaking force exact and by orders, partial balance, free forces and moments, shafts."""
