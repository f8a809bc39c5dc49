"""TLS of the page, with a certificate of the plant."""

from __future__ import annotations

import ssl
from pathlib import Path

from drivebus.errors import NotAllowed

__all__ = ["web_context"]


def web_context(certificate: Path, key: Path) -> ssl.SSLContext:
    """TLS with *certificate* and its *key*, both files of PEM.

    Raises:
        NotAllowed: They cannot be read, do not belong together, or the key has a password.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    try:
        # A key with a password would ask for it at the terminal.
        context.load_cert_chain(certificate, key, password="")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise NotAllowed(f"certificate {certificate} and key {key} cannot be used: {reason}") from None
    return context
