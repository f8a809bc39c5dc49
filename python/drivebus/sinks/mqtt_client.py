"""A client of paho-mqtt as it is used here: it believes nobody without a certificate, and says when it has ended."""

from __future__ import annotations

import socket
import ssl
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import paho.mqtt.client as paho
from paho.mqtt.enums import CallbackAPIVersion, MQTTErrorCode
from paho.mqtt.properties import Properties
from paho.mqtt.reasoncodes import ReasonCode

from drivebus.errors import NotAllowed
from drivebus.sinks.mqtt_settings import MqttSettings
from drivebus.sinks.password_file import password_in

__all__ = ["CONNECTS", "Client", "checked", "cut", "in_words", "new_client", "properties_of", "reason_of"]

CONNECTS = 10.0
"""Seconds for a connection."""


def checked(settings: MqttSettings) -> ssl.SSLContext | None:
    """What *settings* mean for TLS; None: it is not used. Nothing is connected.

    Raises:
        NotAllowed: The password or the certificates cannot be read.
    """
    if settings.password_file is not None:
        password_in(settings.password_file)
    if not settings.tls:
        return None
    try:
        # It verifies the chain and the name of the host.
        context = ssl.create_default_context(cafile=settings.ca_file)
    except OSError as error:
        raise NotAllowed(f"the certificates in {settings.ca_file} cannot be read: {reason_of(error)}") from None
    context.sslsocket_class = _Wire
    return context


def new_client(settings: MqttSettings, ended: Callable[[str], None], name: str, protocol: int) -> Client:
    """A client called *name* for the broker of *settings*, not connected yet; *ended* as for `Client`.

    Raises:
        NotAllowed: As `checked`.
    """
    context = checked(settings)
    client = Client(ended, client_id=name, protocol=protocol, reconnect_on_failure=False)
    client.connect_timeout = CONNECTS
    if context is not None:
        client.tls_set_context(context)
    if settings.username:
        password = "" if settings.password_file is None else password_in(settings.password_file)
        client.username_pw_set(settings.username, password)
    return client


class _Wire(ssl.SSLSocket):
    """A socket that is closed when the other side is not who it should be: the client leaves it open."""

    def do_handshake(self, block: bool = False) -> None:
        """Learns who the other side is.

        Raises:
            OSError: It is not who it should be, or does not say.
        """
        try:
            super().do_handshake(block)
        except BaseException:
            self.close()
            raise


class Client(paho.Client):
    """A client that says when nobody serves it any more, whatever ended that.

    Args:
        ended: Told why, in words; empty where the client itself has said it.
    """

    def __init__(self, ended: Callable[[str], None], **settings: Any) -> None:
        super().__init__(CallbackAPIVersion.VERSION2, **settings)
        self._say_ended = ended

    def loop_forever(self, timeout: float = 1.0, retry_first_connection: bool = False) -> MQTTErrorCode:
        """Serves it; called in the thread that `loop_start` makes."""
        why = ""
        try:
            return super().loop_forever(timeout, retry_first_connection)
        except Exception as error:  # of what a broker can send, not all is foreseen
            why = f"what it sent could not be read: {error}"
            return MQTTErrorCode.MQTT_ERR_PROTOCOL
        finally:
            self._say_ended(why)


def cut(client: paho.Client) -> None:
    """Whatever the client waits for is over."""
    wire = client.socket()
    if isinstance(wire, socket.socket):
        with suppress(OSError):
            # Of the socket below: the thread that reads goes on using what encrypts.
            socket.socket.shutdown(wire, socket.SHUT_RDWR)


def properties_of(kind: int) -> Properties:
    """Those of a packet of a *kind* of `PacketTypes`, empty."""
    made: Callable[[int], Properties] = Properties  # the library has no types for it
    return made(kind)


def reason_of(error: Exception) -> str:
    """Why somebody cannot be reached, or a file cannot be read, in words."""
    if isinstance(error, ssl.SSLCertVerificationError):
        return f"its certificate is not trusted: {error.verify_message}"
    if isinstance(error, OSError):
        return error.strerror or str(error) or type(error).__name__
    return str(error)


def in_words(code: ReasonCode) -> str:
    """What the broker, or the client itself, says; in small letters, as all that is told."""
    told = str(code)
    return told[:1].lower() + told[1:]
