"""Team policies: the organisers' opponents and other scripted ones, competition submissions, and the user's own.

``make("medium")`` builds one by name, ``make("path/to/submission.zip")`` from a file. `from_agents` and `from_callable`
accept objects and functions. `make_batch` builds policies for a `BatchedMctf`.
"""

from .actions import HOLD, ActionReader, to_command
from .adapters import from_agents, from_callable
from .entrants import Entrant, entrant, entrants
from .fingerprint import fingerprint
from .foreign import Failure, GuardedTeam, PolicyReport
from .protocol import Action, BatchPolicy, TeamPolicy
from .registry import check, describe, make, make_batch, names
from .sb3 import load_sb3
from .submissions import load_submission

__all__ = [
    "HOLD",
    "Action",
    "ActionReader",
    "BatchPolicy",
    "Entrant",
    "Failure",
    "GuardedTeam",
    "PolicyReport",
    "TeamPolicy",
    "check",
    "describe",
    "entrant",
    "entrants",
    "fingerprint",
    "from_agents",
    "from_callable",
    "load_sb3",
    "load_submission",
    "make",
    "make_batch",
    "names",
    "to_command",
]
