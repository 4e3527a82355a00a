"""A raid that the shield lets through: the boat that guards the other flag is drawn to the far corner first.

A shielded boat does not sail past an opponent that comes towards it, so no flag comes home while its guard is between
it and the dividing line. Three boats change that. The first stands just beyond the line at one edge: the guard comes
and tags it, and cannot tag for a while. The second sails along the other edge to the far corner: as the nearest
intruder it draws the guard after it. The third then takes the flag from the bait's side and has the guard behind it all
the way home. Boats without a part in it tag whoever comes.

Where no opponent stays at home there is no guard to draw. Then two boats stand before their flag, and the third sails
alone when no opponent can cut it off; meanwhile the two sail at the intruders, since who is tagged must go home first.
An opponent is no guard, either, that is up at the line with nobody to chase, or that does the same over and over,
whoever comes: who circles or patrols is known ahead, and the third boat passes while it is elsewhere.
"""

from .team import Undertow as Undertow
