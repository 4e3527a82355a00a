"""A serial port, raw and non-blocking, by the system's own calls."""

from __future__ import annotations

import os

from ...exceptions import LinkError
from .addresses import Address
from .sockets import Peer, explain

try:
    import termios
    import tty
except ImportError:  # not a Unix
    termios = tty = None  # type: ignore[assignment]

_CHUNK = 8_192


class SerialWire:
    """A serial port with one autopilot or radio at its end; see `sockets.Wire`."""

    datagrams = False
    many = False

    def __init__(self, address: Address) -> None:
        self._address = address
        self._descriptor = -1
        self._pending = b""

    def open(self, timeout_s: float = 0.0) -> None:
        """Open the device, 8 bits, no parity, no flow control.

        Raises:
            LinkError: there is no such device, it is no serial port, or it cannot have that speed.
        """
        self.close()
        speed = self._speed()
        try:
            made = os.open(self._address.host, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError as error:
            raise explain(self._address, error) from None
        try:
            tty.setraw(made)
            settings = termios.tcgetattr(made)
            settings[2] = (settings[2] | termios.CLOCAL | termios.CREAD) & ~termios.CRTSCTS
            settings[4] = settings[5] = speed
            termios.tcsetattr(made, termios.TCSANOW, settings)
            termios.tcflush(made, termios.TCIOFLUSH)
        except termios.error as error:
            os.close(made)
            raise LinkError(f"link {self._address}: that is no serial port ({error.args[-1]}); name one") from None
        self._descriptor, self._pending = made, b""

    def _speed(self) -> int:
        if termios is None:
            raise LinkError(f"link {self._address}: serial ports need a Unix; use a UDP or TCP bridge here")
        speed = getattr(termios, f"B{self._address.number}", None)
        if speed is None:
            known = sorted(int(n[1:]) for n in dir(termios) if n[0] == "B" and n[1:].isdigit() and int(n[1:]) >= 9600)
            raise LinkError(f"link {self._address}: no baud rate {self._address.number}; give one of {known}")
        return int(speed)

    def fileno(self) -> int:
        """See `sockets.Wire`."""
        return self._descriptor

    def receive(self) -> tuple[bytes, Peer] | None:
        """Some bytes; see `sockets.Wire`."""
        if self._descriptor < 0:
            return None
        try:
            data = os.read(self._descriptor, _CHUNK)
        except (BlockingIOError, InterruptedError):
            return None
        except OSError:
            self.close()
            raise
        if not data:
            self.close()
            raise ConnectionResetError("the device is gone")
        return data, (self._address.host, self._address.number)

    def send(self, data: bytes, peer: Peer | None) -> bool:
        """A whole frame or none of it; see `sockets.Wire`."""
        if self._pending:
            self._pending = self._pending[self._write(self._pending) :]
        if self._pending:
            return False
        sent = self._write(data)
        self._pending = data[sent:] if sent > 0 else b""
        return sent > 0

    def _write(self, data: bytes) -> int:
        try:
            return os.write(self._descriptor, data) if self._descriptor >= 0 else 0
        except OSError:
            return 0

    def close(self) -> None:
        """See `sockets.Wire`."""
        if self._descriptor >= 0:
            descriptor, self._descriptor = self._descriptor, -1
            os.close(descriptor)
        self._pending = b""
