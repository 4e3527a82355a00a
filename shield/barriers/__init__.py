"""Barriers h: margins, m, that are >= 0 while a boat on its backup manoeuvre keeps clear.

Each is asked about the path of a manoeuvre. `opponents`, `pursuit` and `value_function` tell a margin alone, the others
write one row (`clearance`): the margin h, m, the sample of the path where it is least, and dh/dx, dh/dy there
(`registered` only where the program asks). `filter.rows` makes of `boats` and `static` the slopes by the commands of
this step.

    boats             team-mates on their manoeuvres, opponents that hold their course
    pursuit           an opponent that pursues; `opponents` asks for the worst of them
    value_function    the same, looked up in a value table
    static            the worst of all that stays, and of registered barriers, over a path: each is a number
                      (`constraints`) with a margin and slope by place of its own
    circles, walls    which stop a boat; circles are also kept by rule
    edge              a side of the field
    registered        other people's, see `register_barrier`
    way_back          what paths are worth to a boat that is beyond one of these
"""

from .registry import Barrier, register_barrier

__all__ = ["Barrier", "register_barrier"]
