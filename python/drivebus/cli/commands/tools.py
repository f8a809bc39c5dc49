"""Commands around the line: shell completion, the demonstration."""

from __future__ import annotations

import click
from click.shell_completion import get_completion_class

from drivebus.cli import demonstration as demonstration
from drivebus.cli.session import Session, pass_session
from drivebus.cli.wrong_use import WrongUse

__all__ = ["COMMANDS"]


@click.command()
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
@click.pass_context
def completion(context: click.Context, shell: str) -> None:
    """Print the completion script of a shell.

    \b
    bash: drivebus completion bash > ~/.local/share/bash-completion/completions/drivebus
    zsh:  drivebus completion zsh > a file _drivebus in a folder of $fpath
    fish: drivebus completion fish > ~/.config/fish/completions/drivebus.fish
    """  # noqa: D301 - click needs the control character
    kind = get_completion_class(shell)
    if kind is None:
        raise WrongUse(f"no completion for {shell}")
    click.echo(kind(context.find_root().command, {}, "drivebus", "_DRIVEBUS_COMPLETE").source())


@click.command()
@pass_session
def demo(session: Session) -> None:
    """Run a simulated GD350 through a whole job. Takes less than a minute and needs no hardware."""
    demonstration.run(session.out)


COMMANDS = [completion, demo]
