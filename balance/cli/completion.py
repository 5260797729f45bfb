"""What the shell completes: names of what is shipped, files, sites and bodies of the mechanism that is named."""

from copy import copy
from pathlib import Path

import click
from click.shell_completion import CompletionItem

from ..datasets import KINDS, dataset_names
from ..errors import CounterpoiseError

SHIPPED = {**KINDS, "words": KINDS["mechanism"], "tests": KINDS["plan"]}
"""Folder and ending of the data sets that a parameter of this name takes, besides files."""
OF_A_MECHANISM = {"site": "", "without": "", "counter": "=", "limit": "=", "payload": "="}
"""What follows the name of a site, or with ``payload`` of a body, in parameters of these names."""


class Completed(click.types.StringParamType):
    """A text that is converted as any, and completed by what a parameter of this name takes."""

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Names that begin with what is typed; where none does, files."""
        parameter = str(param.name)
        if parameter in OF_A_MECHANISM:
            words = [ctx.params.get("mechanism"), *(ctx.params.get("words") or ()), *ctx.args]  # behind an option: args
            names = _parts(next(filter(None, words), ""), parameter)
        else:  # what is shipped, and files and folders of this one
            folder, ending = SHIPPED[parameter]
            here = sorted(path.name for path in Path().glob("[!.]*") if path.suffix == ending)
            names = [*dataset_names(folder, ending), *here]
        found = [CompletionItem(name) for name in names if name.startswith(incomplete)]
        return found or [CompletionItem(incomplete, type="file")]


def _parts(mechanism: str, parameter: str) -> list[str]:
    """Sites or bodies of a mechanism; none where it cannot be read: the command says why."""
    from ..mechanism.mjcf_parser import load_mechanism

    try:
        model = load_mechanism(mechanism)
    except CounterpoiseError:
        return []
    names = model.own_mass if parameter == "payload" else model.sites
    return [f"{name}{OF_A_MECHANISM[parameter]}" for name in names]


def completing(command: click.Command) -> click.Command:
    """A copy of a command, or of a group with each one in it, whose parameters complete names."""
    found = copy(command)
    if isinstance(found, click.Group):
        found.commands = {name: completing(one) for name, one in found.commands.items()}
    found.params = [copy(parameter) for parameter in command.params]
    for parameter in found.params:
        if parameter.name in SHIPPED.keys() | OF_A_MECHANISM.keys():
            parameter.type = Completed()
    return found
