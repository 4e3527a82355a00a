"""A raid that the shield permits: the boat that guards the other flag is first drawn to the far corner.

A shielded boat does not pass an opponent that comes towards it. No flag is therefore brought home while its guard is
between it and the dividing line. Three boats change that. The first, the bait, stands just beyond the line at one edge.
The guard comes and tags it, and cannot tag for a while. The second sails along the other edge to the far corner: as the
nearest intruder it draws the guard after it. The third then takes the flag from the bait's side, with the guard behind
it all the way home. Boats without a part in the raid tag intruders.

If no opponent stays at home, there is no guard to draw. Two boats then stand before their flag, and the third sails
alone when no opponent can cut it off. Meanwhile the two steer at intruders, since a tagged boat must go home first. An
opponent is also no guard if it is up at the line with nobody to chase, or if it repeats the same motion whoever comes.
Such circling or patrolling can be predicted, and the third boat passes while the opponent is elsewhere.
"""

from .team import Undertow as Undertow
