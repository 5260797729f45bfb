"""The two commands as objects, for the reference that is made from the code."""

from balance.cli import COMMANDS as BALANCE
from balance.cli.framework import LazyGroup
from testbench.cli import COMMANDS as TESTBENCH

ARGUMENTS = {
    "MECH": "A shipped mechanism (``balance files mechanism``), or a file: MJCF, URDF or SDF.",
    "CAMPAIGN": "Folder of stored runs, as ``testbench ingest -o`` writes it.",
    "RUN": "A stored run, such as campaign/r001.h5; of several also a campaign's folder.",
    "RUN|CAMPAIGN": "Stored runs, such as campaign/r001.h5, or a campaign's folder.",
    "FILE": "A log, in any of the formats that ``testbench formats`` lists.",
    "FILES": "Logs, in any of the formats that ``testbench formats`` lists.",
}
"""Meaning of an argument by its name."""

balance = LazyGroup("balance", package="balance.cli", lazy=BALANCE)
testbench = LazyGroup("testbench", package="testbench.cli", lazy=TESTBENCH)
