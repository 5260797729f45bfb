"""The two commands as objects, for the reference that is made from the code."""

from balance.cli import COMMANDS as BALANCE
from balance.cli.framework import LazyGroup
from testbench.cli import COMMANDS as TESTBENCH

balance = LazyGroup("balance", package="balance.cli", lazy=BALANCE)
testbench = LazyGroup("testbench", package="testbench.cli", lazy=TESTBENCH)
