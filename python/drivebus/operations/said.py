"""Commands as people say them, and what may have come of one of which nothing is known."""

from __future__ import annotations

__all__ = ["A_WORD", "MAY", "said"]

A_WORD = "a word that can move the motor"

MAY = {
    A_WORD: "the motor may turn",
    "run_forward": "the motor may turn",
    "run_reverse": "the motor may turn",
    "jog_forward": "the motor may turn",
    "jog_reverse": "the motor may turn",
    "stop": "the motor may still turn",
    "coast": "the motor may still be powered",
    "jog_stop": "the motor may still turn",
    "reset_fault": "the fault may be reset, and a drive that is still told to run may start",
}
"""What may have happened when a command was sent and nothing is known of it."""


def said(command: str) -> str:
    """*command* as people say it: `fault reset` for `reset_fault`."""
    return "fault reset" if command == "reset_fault" else command.replace("_", " ")
