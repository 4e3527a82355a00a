"""What an attacker on the feed's own network sends, and what a true sender with a key does."""

import itertools

from steerclear.shield.bridge.feed import FlagStatus, GameState, Packet
from steerclear.shield.bridge.feed_packets import Fix, Seal
from steerclear.shield.bridge.mavlink.signing import SigningClock

GAME = GameState(1.0, {}, (FlagStatus(10.0, 20.0, False), FlagStatus(70.0, 20.0, False)))
OVER = GameState(1.0, {}, (FlagStatus(10.0, 20.0, False), FlagStatus(70.0, 20.0, False)), over=True)
CLOCK = SigningClock()


def sealed(key, seq, run=1, sender="hub", fixes=(), game=None):
    """A true packet."""
    return Seal(key).close(Packet(sender, run, seq, fixes=fixes, game=game, stamp=CLOCK.take()).encode())


def forged(*boats, latitude_deg=42.0004, longitude_deg=-71.0, keys=(bytes(32),), senders=("gps_hub", "evil")):
    """Packets without end, under the true name, a made-up one and the referee's, bare and wrongly sealed.

    They say that boats lie still at one place, fresh and exact, and that the game is over.
    """
    fixes = tuple(Fix(boat, latitude_deg, longitude_deg, 0.0, 0.0, 0.0, 0.0) for boat in boats)
    for k in itertools.count(1):
        sender, stamp = senders[k % len(senders)], CLOCK.now() + 1000 * k
        position = Packet(sender, 4711, k, fixes=fixes, stamp=stamp).encode()
        game = Packet("referee", 4711, k, game=OVER, stamp=stamp).encode()
        yield position
        yield game
        for key in keys:
            yield Seal(key).close(position)
            yield Seal(key).close(game)
