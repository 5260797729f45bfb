"""The main job, end to end: counter-masses, a campaign of logs, how much the vibration fell, a real arm's logs."""
