"""Barriers h: margins, m, that are >= 0 while a boat on its backup manoeuvre keeps clear.

Each is asked about the path of a manoeuvre. All but `value_function`, which tells a margin alone, write one row
(`clearance`): the margin h, m, the sample of the path where it is least, and dh/dx, dh/dy there (`registered` only
where the program asks). `filter.rows` makes of `boats` and of what stays the slopes by the commands of this step.

    boats             team-mates on their manoeuvres, opponents that hold their course
    pursuit           an opponent that pursues; `opponents` asks for the worst of them
    value_function    the same, looked up in a value table
    obstacles         circles and walls, which stop a boat
    rules             the field's edge, and keep-out circles
    registered        other people's, see `register_barrier`; `static` asks for the worst of these three
"""

from .registry import Barrier, register_barrier

__all__ = ["Barrier", "register_barrier"]
