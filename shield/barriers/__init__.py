"""Barriers h: margins, m, that are >= 0 while a boat on its backup manoeuvre keeps clear.

Each is asked about the path of a manoeuvre. `pursuit` and `value_function` tell a margin alone, the others write one
row (`clearance`): the margin h, m, the sample of the path where it is least, and dh/dx, dh/dy there (`registered` only
where the program asks). `filter.qp` makes of `boats` and `static` the slopes by the commands of this step.

    boats             teammates on their manoeuvres, opponents that hold their course
    pursuit           the worst opponent that pursues
    value_function    the same, looked up in a value table
    static            the worst of all that stays, and of registered barriers, over a path: each is a number with a
                      margin and slope by place of its own, of a circle, wall or edge (`shapes`)
    registered        other people's, see `register_barrier`
"""

from .registry import Barrier, register_barrier

__all__ = ["Barrier", "register_barrier"]
