"""The command ``testbench``."""

from balance.cli.framework import run

COMMANDS = {
    "new": ("project", "A folder for a test of your own machine: rig, plan, motion, run table, to be edited."),
    "check": ("project", "What is missing in such a folder, or contradicts, all at once."),
    "plan": ("project", "Which run to make next: what narrows most what is asked."),
    "simulate": ("simulate", "Make the logs that a test bench would write, marked as simulated."),
    "info": ("logs", "What a log file holds, and what is odd in it."),
    "describe": ("logs", "How a log is read, as detected: an import description to be corrected."),
    "formats": ("logs", "Which formats can be read."),
    "recordings": ("recordings", "Public recordings of other people: list them, fetch them, verify their SHA-256."),
    "ingest": ("ingest", "Read logs into HDF5, one file a run, losing nothing."),
    "watch": ("ingest", "Ingest what arrives in a folder, each log once."),
    "list": ("campaign:list_runs", "The runs of a campaign."),
    "verify": ("campaign", "Check every stored run against its digest."),
    "ledger": ("campaign", "What should be in a campaign: every run, record and removal; the digest of all of it."),
    "remove": ("campaign", "Take a run or record out of a campaign, by a person and with a reason."),
    "archive": ("campaign", "Store runs anew, small, and the same to the bit."),
    "recover": ("campaign", "Save what a stopped ingest had acknowledged, and report what is lost."),
    "align": ("align", "The clocks of several loggers: offset and drift, with intervals."),
    "calibrate": ("calibrate", "Correct the calibration of a sensor: a dated record; the runs never change."),
    "export": ("campaign", "Write stored runs as CSV, Parquet, MAT, UFF or an RO-Crate."),
    "report": ("report", "Each run: motions, command, base vibration and its modes, forces, torques; figures."),
    "view": ("view", "A campaign in the browser: any channel of any run, runs over each other, findings accepted."),
    "doctor": (
        "analyze",
        "Cross-examine a campaign: sensors against run table, rig, model, other runs; what to do.",
    ),
    "analyze": ("analyze", "By how much counter-masses reduce the vibration amplitude."),
    "compare": ("analyze", "Analysed from logs, simulated and published, side by side."),
    "predict": ("predict", "Printed reductions of heavier payloads, predicted from those of the lightest."),
    "identify": ("identify", "Inertial parameters and friction of a mechanism from the torques of runs."),
    "trim": ("trim", "The residual first moment of each arm, and the mass to add."),
    "speed": ("speed", "Speed over a turn and its fluctuation, from the instants of encoder edges."),
    "vectors": ("vectors", "Amplitude and phase of vibration sensors by a tachometer, for balance rotor influence."),
    "files": ("files", "What is shipped: mechanisms, motions, rigs, plans and others; copies of it, to be edited."),
    "schema": ("files", "The JSON schema of an input file: its keys, units, defaults."),
}


def main() -> None:
    """Run ``testbench``."""
    text = "Read test-bench logs into HDF5, find the reduction of vibration, compare it with simulation and print."
    run("testbench", __name__, COMMANDS, text)
