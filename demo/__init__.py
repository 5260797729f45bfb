"""The main job, end to end: counter-masses, a campaign of logs, how much the vibration fell, a real arm's logs."""

import signal

signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C reaches all steps: they end, and __main__ alone says so
