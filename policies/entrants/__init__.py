"""The competition's teams, rebuilt from its paper's descriptions; importing this module registers all of ours."""

from .catalogue import Entrant as Entrant
from .catalogue import entrant as entrant
from .catalogue import entrants as entrants

from . import chao, defenders, lucas, options, undertow, learned  # isort: skip # noqa: F401 (each enters its teams)
