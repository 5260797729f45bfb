"""A stored run as analyses take it: with its rig in SI (``SIRun``), on one clock with its motion (``AlignedRun``)."""
