"""Rigid rotors: correction planes, bearing reactions, trial weights, holes and stock weights, permissible unbalance."""
