"""The competition's teams, rebuilt from what its paper says of them: `catalogue` enters one, `listing` lists all."""

from .catalogue import Entrant as Entrant
from .catalogue import entrant as entrant
from .listing import entrants as entrants
