"""Lucas-QMU: rolling-horizon evolution for many boats.

The paper: action sequences of macro-actions are evolved in a forward model (rolling-horizon evolution: Gaina, Devlin,
Lucas and Perez-Liebana 2020, arXiv 2003.12331), for one boat at a time, own and opposing players in alternation
(co-evolution: Liu, Perez-Liebana and Lucas 2016, arXiv 1607.01730), with a shift buffer; rules made for the score
refine the plan. Filled in: the forward model is the batched simulator itself; macro-actions are eight headings at full
speed and a stop, held for `MOVE_S`; mutation, fitness weights and the rules are ours. The fitness counts captures,
grabs, tags, progress, boats gone out of bounds, and contacts with teammates and opponents.
"""

from .team import Lucas as Lucas
