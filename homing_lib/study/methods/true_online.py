"""True online Sarsa(lambda): van Seijen, Mahmood, Pilarski, Machado and Sutton, JMLR 17 (2016).

    e = gamma lambda e + (1 - alpha gamma lambda e.x) x          the dutch trace
    w += alpha delta e + alpha (w - w_before).x (e - x)          x = phi(s, a)

At every step it has the weights that the online forward view would have, which Sarsa(lambda) has only as alpha goes to
0. The equations stand in `homing_lib.sarsa.LinearSarsa`; they are exact only if all weights follow their traces, so
that `update` is "all" whatever the settings say.

Cost: the trace, the weights, and the weights once more for the correction; 1.5 times Sarsa(lambda).
"""

from typing import Any

from homing_lib.sarsa import LinearSarsa
from homing_lib.study.methods.base import register


class TrueOnlineSarsa(LinearSarsa):
    """Sarsa(lambda) with dutch traces."""

    def __init__(self, *shape: int, **settings: Any) -> None:
        super().__init__(*shape, **{**settings, "traces": "dutch", "update": "all"})


register("true-online", 1.5, TrueOnlineSarsa)
