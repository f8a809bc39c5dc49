"""How much of a matrix is run: each seventh of its cases, or with DRIVEBUS_MATRIX=all all of them."""

from __future__ import annotations

import os

STEP = 1 if os.environ.get("DRIVEBUS_MATRIX") == "all" else 7
