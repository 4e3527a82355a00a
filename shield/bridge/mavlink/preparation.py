"""Bringing a boat to where it obeys, and leaving it where it does no harm; each step checked by what the boat says."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ...exceptions import LinkError, LinkRefused
from ..preflight.parameters import ASKED
from .dialogue import Patience
from .modes import GUIDED, HOLD, arm_request, mode_request
from .routes import choose_route

if TYPE_CHECKING:
    from .autopilot import Autopilot

TOP_SPEED = "WP_SPEED"
OTHERS = ASKED
"""Parameters that preflight checks look at; some firmware lacks some of them."""

STILL_MPS = 0.3
STOP_S = 12.0
"""A boat at 3 m/s that is left alone needs 5.6 s to stop."""
HOLD_S = 4.0
_RESEND_S = 0.1
_LEARN_S = 10.0
_TRY_AGAIN_S = 2.0


def learn(boat: Autopilot, patience: Patience) -> None:
    """Ask for what is not known yet of what the autopilot can do."""
    boat.dialogue.learn(TOP_SPEED, OTHERS, patience)


def prepare(boat: Autopilot, route: str, patience: Patience) -> None:
    """Learn, choose the route, GUIDED, arm.

    Raises:
        LinkRefused: the autopilot says no until the time is up.
        LinkError: no answer in time, called off, or somebody took the boat meanwhile; it is left alone as before.
    """
    if boat.heartbeat is None:
        raise LinkError(f"boat {boat.boat}: not connected; call connect first")
    learn(boat, patience.part(_LEARN_S))
    boat.route = choose_route(boat.boat, route, boat.dialogue.abilities)
    _reach(boat, mode_request(*boat.target, GUIDED), lambda: boat.mode == GUIDED, "GUIDED", patience)
    _reach(boat, arm_request(*boat.target), lambda: boat.is_armed, "arming", patience)
    taken_by = boat.released
    _take(boat, patience)
    if not boat.dialogue.wait(lambda: not boat.why_not(boat.clock.now_s()), patience):
        with boat.dialogue.changed:
            text = boat.why_not(boat.clock.now_s())
            boat.released = boat.released or taken_by
        raise LinkError(f"boat {boat.boat}: {text}; put that right, then start again")


def _take(boat: Autopilot, patience: Patience) -> None:
    """From now on it is ours, unless a pilot took it since it was seen to be ready, or nobody wants it any more."""
    with boat.dialogue.changed:
        _check_wanted(boat, patience)
        if boat.mode != GUIDED or not boat.is_armed:
            state = "armed" if boat.is_armed else "disarmed"
            raise LinkError(f"boat {boat.boat}: {state} in {boat.mode} again; see who else commands it")
        boat.expects_guided, boat.released = True, ""


def _check_wanted(boat: Autopilot, patience: Patience) -> None:
    if patience.is_off():
        raise LinkError(f"boat {boat.boat}: taking it was called off; it is left alone")


def _reach(boat: Autopilot, request: Any, holds: Callable[[], bool], what: str, patience: Patience) -> None:
    """Ask until the heartbeat shows it: an acknowledgement alone is not believed."""
    if holds():
        return
    result: int | None = None
    while True:
        answer = boat.dialogue.command(request, patience.part(_TRY_AGAIN_S))
        result = result if answer is None else answer
        if boat.dialogue.wait(holds, patience.part(_TRY_AGAIN_S)):
            return
        if patience.is_over:
            break
    _check_wanted(boat, patience)
    if result is None:
        raise LinkError(f"boat {boat.boat}: no answer to the request for {what}; check the radio, then start again")
    if result == mavlink.MAV_RESULT_ACCEPTED:
        raise LinkError(f"boat {boat.boat}: accepted {what} and did not do it; check who else commands it")
    raise LinkRefused(
        f"boat {boat.boat} refuses {what} ({_result(result)}): {boat.dialogue.said()}; put that right, then start again"
    )


def _result(result: int) -> str:
    entry = mavlink.enums["MAV_RESULT"].get(result)
    return (
        f"result {result}" if entry is None else str(entry.name).removeprefix("MAV_RESULT_").lower().replace("_", " ")
    )


def leave(boat: Autopilot, stop: Callable[[], object]) -> str:
    """Stop the boat and put it in HOLD; what it was left doing, in words. Never raises.

    Args:
        boat: to leave.
        stop: sends a stop.
    """
    name, ours = boat.boat, boat.expects_guided and not boat.released
    boat.expects_guided = False
    if boat.heartbeat is None:
        return f"{name}: never heard; nothing was sent, see where it is"
    if not (ours and boat.mode == GUIDED and boat.is_armed):
        state = "armed" if boat.is_armed else "disarmed"
        return f"{name}: left alone, {state} in {boat.mode}: it was not under our command"
    stopped = _stop(boat, stop)
    held = _hold(boat)
    speed = _speed_text(boat)
    if held:
        return f"{name}: in HOLD, {speed}" + ("" if stopped else "; it was not seen to stop: watch it")
    if stopped:
        return f"{name}: {speed}, HOLD not confirmed; its own time-out keeps it stopped, take it over by hand"
    return f"{name}: NOT seen to stop ({speed}); its own time-out stops it 3 s after the last command: take it over"


def _stop(boat: Autopilot, stop: Callable[[], object]) -> bool:
    """Send stops until the boat is seen to be still."""
    patience = Patience(boat.clock, STOP_S)
    while not patience.is_over:
        stop()
        if boat.dialogue.wait(lambda: _is_still(boat), patience.part(_RESEND_S)):
            return True
    return False


def _hold(boat: Autopilot) -> bool:
    patience = Patience(boat.clock, HOLD_S)
    while not patience.is_over:
        boat.dialogue.command(mode_request(*boat.target, HOLD), patience.part(1.0))
        if boat.dialogue.wait(lambda: boat.mode == HOLD, patience.part(1.0)):
            return True
    return False


def _is_still(boat: Autopilot) -> bool:
    fresh = boat.clock.now_s() - boat.telemetry.velocity_s < 1.0
    return fresh and math.hypot(*boat.telemetry.velocity_mps) < STILL_MPS


def _speed_text(boat: Autopilot) -> str:
    if not boat.clock.now_s() - boat.telemetry.velocity_s < 5.0:
        return "speed unknown"
    return f"speed {math.hypot(*boat.telemetry.velocity_mps):.1f} m/s"
