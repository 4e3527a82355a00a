"""The person in charge: STOP ALL, and overrides that are logged, end by themselves and say what they disable."""

from __future__ import annotations

import logging
import threading
from dataclasses import dataclass

from ..exceptions import ConfigError
from .failsafe_table import DISABLES
from .messages import Action

LOG = logging.getLogger(__name__)
LONGEST_OVERRIDE_S = 600.0  # no override lasts longer; it can be given again


@dataclass(frozen=True)
class Override:
    """A declared response switched off for a while."""

    condition: str  # one of `DISABLES`
    subject: str  # boat or contact it is about; empty: all
    until_s: float  # time it ends, s on the loop's clock
    by: str  # who asked for it

    @property
    def name(self) -> str:
        """What it is of."""
        return f"{self.condition} {self.subject}".strip()

    @property
    def disables(self) -> str:
        """What it switches off, in words."""
        return DISABLES[self.condition]

    def covers(self, condition: str, subject: str) -> bool:
        """Whether it switches this response off."""
        return self.condition == condition and self.subject in ("", subject)


class Operator:
    """What the operator asked for; safe to call from any thread.

    Attributes:
        stopped: why all boats are told to stop; empty: they are not.
        hard: whether they are stopped by their links, past the shield: STOP ALL was asked for twice.
        ended: why the run is to end; empty: it goes on.
    """

    def __init__(self) -> None:
        self.stopped, self.hard, self.ended = "", False, ""
        self._lock = threading.Lock()
        self._overrides: tuple[Override, ...] = ()
        self._taken: tuple[tuple[str, str], ...] = ()

    def stop_all(self, by: str = "operator") -> None:
        """Tell all boats to stop, at every tick, until `resume`.

        The first time they stop through the shield, which may have them get clear of each other before. The second time
        they stop by their links' surest way, whatever is near.
        """
        with self._lock:
            self.hard = bool(self.stopped)
            self.stopped = by
        LOG.warning("STOP ALL by %s%s", by, ", past the shield" if self.hard else "")

    def resume(self, by: str = "operator") -> None:
        """Take STOP ALL back."""
        with self._lock:
            self.stopped, self.hard = "", False
        LOG.warning("STOP ALL taken back by %s", by)

    def take_back(self, boat: str, by: str = "operator") -> None:
        """Ask for a boat that somebody took from us: mode and arming are asked for, once."""
        with self._lock:
            self._taken = (*self._taken, (boat, by))
        LOG.warning("%s: to be taken back, asked for by %s", boat, by)

    def take_requests(self) -> tuple[tuple[str, str], ...]:
        """Boats to be taken back and who asked, since the last call."""
        with self._lock:
            taken, self._taken = self._taken, ()
        return taken

    def end(self, by: str = "operator") -> None:
        """End the run: boats are left stopped."""
        with self._lock:
            self.ended = by
        LOG.warning("end of the run asked for by %s", by)

    def override(self, condition: str, subject: str, seconds: float, now_s: float, by: str = "operator") -> Override:
        """Switch a declared response off for a while, at most `LONGEST_OVERRIDE_S`; see `Override`.

        Raises:
            ConfigError: it cannot be overridden, or not for so long.
        """
        if condition not in DISABLES:
            raise ConfigError(f"{condition!r} cannot be overridden; choose one of {', '.join(DISABLES)}")
        if not 0.0 < seconds <= LONGEST_OVERRIDE_S:
            raise ConfigError(f"an override of {seconds} s; give more than 0 and at most {LONGEST_OVERRIDE_S:g} s")
        made = Override(condition, subject, now_s + seconds, by)
        with self._lock:
            kept = [entry for entry in self._overrides if (entry.condition, entry.subject) != (condition, subject)]
            self._overrides = (*kept, made)
        LOG.warning("override of %s for %g s by %s: disables %s", made.name, seconds, by, made.disables)
        return made

    def active(self, now_s: float) -> tuple[Override, ...]:
        """Overrides in force; those that ended are logged and dropped."""
        with self._lock:
            ended = [entry for entry in self._overrides if entry.until_s <= now_s]
            if ended:
                self._overrides = tuple(entry for entry in self._overrides if entry.until_s > now_s)
        for entry in ended:
            LOG.warning("override of %s ended", entry.name)
        return self._overrides

    def actions(self, now_s: float) -> tuple[Action, ...]:
        """What is in force, for the record and the display."""
        past = ", past the shield" if self.hard else ""
        stop = [Action("all", "stop_all", "stop", f"STOP ALL by {self.stopped}{past}")] if self.stopped else []
        overrides = []
        for entry in self.active(now_s):
            text = f"override of {entry.name} for {entry.until_s - now_s:.0f} s more: disables {entry.disables}"
            overrides.append(Action(entry.subject or "all", "override", entry.condition, text))
        return (*stop, *overrides)
