"""Groups of own boats that can meet: what does not pass is decided group by group.

Two boats are in one group if they could meet, or could both meet boats of that group (`barriers.neighbours`). A
group's decision does not depend on other groups: a teammate far away changes nothing, and many boats make many small
problems.
"""

from __future__ import annotations

from ..backup.score import ALL
from ..jit import lean_kernel
from ..workspace import Scene

NOT_OURS, NONE, NOT_YET = -1, -2, -3
"""Group numbers of other boats; of groups whose nominal commands satisfy everything; of boats not yet checked."""


@lean_kernel
def _gather(first: int, group: int, scene: Scene) -> bool:
    """Number boat ``first`` and its whole group; return whether any of them violates something."""
    ours, groups, queue = scene.ours, scene.group, scene.movers
    groups[first], queue[0] = group, first
    done, found, short = 0, 1, False
    while done < found:
        i = queue[done]
        done += 1
        short = short or scene.satisfied[i] < ALL
        for j in range(ours.shape[0]):
            if groups[j] == NOT_YET and scene.near[i, j]:
                groups[j], queue[found] = group, j
                found += 1
    if not short:
        for k in range(found):
            groups[queue[k]] = NONE
    return short


@lean_kernel
def make_groups(scene: Scene) -> int:
    """Number, in ``scene.group``, the groups in which a nominal command fails; return how many."""
    ours, groups = scene.ours, scene.group
    for i in range(ours.shape[0]):
        groups[i] = NOT_YET if ours[i] else NOT_OURS
    count = 0
    for i in range(ours.shape[0]):
        if groups[i] == NOT_YET and _gather(i, count, scene):
            count += 1
    return count


@lean_kernel
def open_group(group: int, scene: Scene) -> None:
    """Decide only for the boats of one group, from now on."""
    ours, groups = scene.ours, scene.group
    for i in range(ours.shape[0]):
        ours[i] = groups[i] == group
        scene.moving[i] = False


@lean_kernel
def close_groups(scene: Scene) -> None:
    """Decide for all own boats again."""
    for i in range(scene.ours.shape[0]):
        scene.ours[i] = scene.group[i] != NOT_OURS
