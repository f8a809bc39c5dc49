"""Options of the whole program, before its command or behind it: `drivebus -u 2 status`, `drivebus status -u 2`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import click

from drivebus.cli.wrong_use import WrongUse

__all__ = ["in_front"]


def in_front(group: click.Group, context: click.Context, words: Sequence[str]) -> list[str]:
    """*words* with the options of *group* that stand behind its command put before it.

    An option that the command has itself stays where it is.

    Raises:
        click.UsageError: One that may be given once stands before the command and behind it.
    """
    ours = _own_options(group)
    place = next((place for place, word, option in _words(words, ours) if option is None), len(words))
    if place == len(words) or words[place] == "--":
        return list(words)
    command = group.get_command(context, words[place])
    if command is None:
        return list(words)
    before = {option for _, _, option in _words(words[:place], ours) if option is not None}
    theirs = _options(command)
    moved: list[str] = []
    kept: list[str] = []
    behind = words[place + 1 :]
    for _, taken, option in _words(behind, {**ours, **theirs}, over_words=True):
        if option is None or option in theirs.values():
            kept += taken
            continue
        if option in before and not option.multiple:
            raise WrongUse(f"{option.opts[0]} is given twice: before the command and behind it", context)
        moved += taken
    return [*words[:place], *moved, words[place], *kept]


def _own_options(command: click.Command) -> dict[str, click.Option]:
    """The options of *command* by each of their names."""
    return {name: option for option in command.params if isinstance(option, click.Option) for name in option.opts}


def _options(command: click.Command) -> dict[str, click.Option]:
    """The options of *command*, and of those within it, by each of their names."""
    found = _own_options(command)
    if isinstance(command, click.Group):
        for within in command.commands.values():
            found |= _options(within)
    return found


def _words(
    words: Sequence[str], known: Mapping[str, click.Option], over_words: bool = False
) -> Iterator[tuple[int, list[str], click.Option | None]]:
    """Each option with its value, and each other word; the first other word ends it, unless it goes *over_words*."""
    place = 0
    while place < len(words):
        word = words[place]
        if word == "--":
            yield place, list(words[place:]), None
            return
        name, attached, _ = word.partition("=") if word.startswith("--") else (word[:2], word[2:], "")
        option = known.get(name) if word.startswith("-") and len(word) > 1 else None
        takes = option is not None and not option.is_flag and not attached
        count = 2 if takes else 1
        yield place, list(words[place : place + count]), option
        if option is None and not over_words:
            return
        place += count
