"""A policy of your own by name: then every command takes it, and the tournament enters it."""

from steerclear import policies
from steerclear.experiments.conformance import check_policy
from steerclear.policies import entrant
from steerclear.policies.entrants.plane import go
from steerclear.policies.entrants.play import EntrantTeam


@entrant("rush", "every boat straight to the flag")
class Rush(EntrantTeam):
    """Sees its own flag on the left, whichever side it plays."""

    name = "rush"

    def decide(self, obs):
        """One order a boat."""
        return [go(boat, obs.goal) for boat in obs.own]


check_policy("rush")
print(policies.describe()["rush"])
