"""A command with several options that it needs: all that are missing are named at once, with an example."""

from __future__ import annotations

import click

from drivebus.cli.wrong_use import WrongUse

__all__ = ["NamesAllMissing"]


class NamesAllMissing(click.Command):
    """Names every option that is missing, where click names the first and leaves the others for the next try."""

    def parse_args(self, context: click.Context, args: list[str]) -> list[str]:
        """Takes the words behind the command."""
        given = list(args)
        try:
            return super().parse_args(context, args)
        except click.MissingParameter:
            known, _, _ = self.make_parser(context).parse_args(given)
            missing = [each.opts[0] for each in self.params if each.required and each.name not in known]
            if len(missing) < 2:
                raise
            raise WrongUse(
                f"Missing options {', '.join(missing[:-1])} and {missing[-1]}. An example: `{self._example()}`"
            ) from None

    def _example(self) -> str:
        """What the help of the command gives as its example."""
        return " ".join((self.help or "").partition("Example: `")[2].partition("`")[0].split())
