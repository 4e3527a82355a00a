"""A reader of your own: what the wrappers read a game by, here one whose positions err, checked by the suite."""

import numpy as np
from steerclear.env.mctf import MctfEnv
from steerclear.experiments.conformance import check_reader
from steerclear.shield import Shield
from steerclear.shield.wrappers import ShieldedParallelEnv, game_reader
from steerclear.shield.wrappers.mctf import MctfReader


class FoggyEnv(MctfEnv):
    """The game, seen through instruments."""


@game_reader(fits=lambda env: isinstance(env, FoggyEnv))
class FoggyReader(MctfReader):
    """Rounds positions to 1 cm."""

    def fleet(self, team, shield_autopilot):
        """All boats now, as the instruments tell."""
        fleet = super().fleet(team, shield_autopilot)
        fleet.state[:, :2] = np.round(fleet.state[:, :2], 2)
        return fleet


check_reader(lambda: FoggyEnv("aamas2024"))
env = ShieldedParallelEnv(FoggyEnv("aamas2024"), Shield(position_error_m=0.01))
env.reset(seed=1)
env.step({agent: 4 for agent in env.agents})
print("read by", type(env.reader).__name__)
