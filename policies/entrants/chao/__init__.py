"""Chao-NIWC-PAC: one boat plans on a grid, its mates sail circles.

The paper: PDDL+ planning on a grid, four moves, grabs and contacts as events, opponents static, the goal a capture
or to be back in the own zone, planned anew as the game goes on; only the middle boat plans. In the entry's public code
teammates are obstacles to it and sail constant turns. Filled in: 16 x 8 cells; a cell is watched whose middle is
near an opponent that may tag, by the widest of `CONTACT_SHARES` that leaves a way; corners of a plan are cut where all
cells on the line are open; a plan is asked for when the last one has ended, leads through what is
now watched or blocked, or is `REPLAN_S` old, and taken over `TAKEN_S` later; without the planner (extra ``[plan]``),
and where it has no plan, A* searches the same grid.
"""

from .team import Chao as Chao
