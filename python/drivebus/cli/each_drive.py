"""Commands that can be given several drives; what does them side by side is loaded where there are several."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from drivebus.cli.session import Session, pass_session

__all__ = ["each_drive"]


def each_drive(command: Callable[..., None]) -> Callable[..., None]:
    """A command that several drives can be given, each of which it is done for by itself."""

    @pass_session
    @functools.wraps(command)
    def done(session: Session, /, *args: Any, **options: Any) -> None:
        if session.several:
            from drivebus.cli.parallel import Crew

            Crew(session.several).run(lambda one: command(one, *args, **options))
        else:
            command(session, *args, **options)

    return done
