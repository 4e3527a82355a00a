"""The competition's teams, rebuilt from what its paper says of them; see `catalogue` for entering one."""

from .catalogue import Entrant as Entrant
from .catalogue import entrant as entrant
from .catalogue import entrants as entrants
