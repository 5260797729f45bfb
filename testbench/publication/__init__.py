"""Printed tables of reductions predicted: the model, its calibration on one payload, what to hold it against."""
