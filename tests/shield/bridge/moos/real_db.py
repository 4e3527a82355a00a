"""`RealDb`: a MOOSDB of MOOS itself with the face of the stand-in: boats and drills need not know which it is."""

import os
import signal
import subprocess
import time
from dataclasses import replace

from steerclear.shield.bridge.clock import MonotonicClock
from steerclear.shield.bridge.moos.client import MoosClient
from steerclear.shield.bridge.moos.drivers import VARIABLES
from steerclear.shield.bridge.moos.gates import HelmGate, PidGate
from steerclear.shield.bridge.moos.wire import notify
from waiting import until


class Frozen:
    """Stops and continues a process, as `threading.Event` of the stand-in does."""

    def __init__(self, pid):
        self._pid = pid

    def set(self):
        os.kill(self._pid, signal.SIGSTOP)

    def clear(self):
        os.kill(self._pid, signal.SIGCONT)


class RealDb:
    """See `stand_in.StandInDb`; a client of it posts for all apps aboard, each under its own name."""

    def __init__(self, community, port, warp=1.0, hear=lambda message: None):
        self.port, self.warp, self._hear, self.latest = port, warp, hear, {}
        arguments = ["MOOSDB", f"--moos_port={port}", f"--moos_community={community}", f"--moos_time_warp={warp:g}"]
        self._process = subprocess.Popen(arguments, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.frozen = Frozen(self._process.pid)
        names = (*VARIABLES, *HelmGate.outputs, *PidGate.outputs)
        self._client = MoosClient("uDrill", "127.0.0.1", port, MonotonicClock(warp), names, self._take)
        self._client.start()
        if not until(lambda: self._client.connected, 15.0):
            self.close()
            raise RuntimeError(self._client.health().fault)

    def now_s(self):
        return time.time() * self.warp

    def post(self, key, value, source, time_s=None):
        stamp = self.now_s() if time_s is None else time_s
        text = isinstance(value, str)
        message = notify(key, value if text else 0.0, source, stamp)
        self._client._send([message if text else replace(message, value=float(value))])

    def close(self):
        self._client.close()
        self._process.kill()
        self._process.wait()

    def _take(self, message, received_s):
        self.latest[message.key] = message
        self._hear(message)
