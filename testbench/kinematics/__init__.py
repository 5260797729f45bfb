"""What moved in a run: its motions and legs, positions differentiated, the joints and the base."""
