"""How a group of commands lists them in its help: each with its first sentence, and nothing cut."""

from __future__ import annotations

import click

__all__ = ["Listing", "first_sentence"]


def first_sentence(command: click.Command) -> str:
    """What *command* does, in one sentence."""
    return (command.help or "").split("\n\n")[0].replace("\n", " ").split(". ")[0].rstrip(".")


class Listing(click.Group):
    """A group whose help has whole sentences, where click cuts them to fit a line."""

    def format_commands(self, context: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        """Shows the commands."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, first_sentence(command)) for name, command in sorted(self.commands.items())])
