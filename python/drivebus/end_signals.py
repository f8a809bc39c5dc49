"""The signals that end a program at once unless somebody listens."""

from __future__ import annotations

import signal

__all__ = ["END_SIGNALS"]

END_SIGNALS = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, name)]
"""Asked to end, its terminal closed, and Ctrl-Break on Windows. Ctrl-C is none: Python raises it."""
