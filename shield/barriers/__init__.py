"""Barriers h: margins, m, that are >= 0 while a boat on its backup manoeuvre stays clear.

Each is evaluated on the path of a manoeuvre. `pursuit` and `value_function` give a margin only. The others write one
row (`clearance`): the margin h, m, the sample of the path where it is least, and dh/dx, dh/dy there (`registered` only
where the QP needs them). From `boats` and `static`, `filter.qp` derives gradients by the commands of this step.

    boats             teammates on their manoeuvres, opponents that hold their course
    pursuit           the worst pursuing opponent
    value_function    the worst opponent, looked up in a value table
    static            the worst static constraint or registered barrier over a path; each has a number, and a margin
                      and gradient by place: of a circle, wall or edge
    registered        barriers written by users, see `register_barrier`
"""

from .registry import Barrier, register_barrier

__all__ = ["Barrier", "register_barrier"]
