"""Two classic prediction problems. An episode is a list of (state, reward, next state, terminal)."""

from itertools import pairwise

import numpy as np

Episode = list[tuple[int, float, int, bool]]


class Walk:
    """The 19-state random walk of Sutton & Barto (2018), example 7.1: start in the centre, step left or right at
    even odds, reward -1 at the left end and +1 at the right. Tabular features; gamma = 1."""

    features = np.eye(19)
    values = np.arange(-9, 10) / 10

    @staticmethod
    def episode(rng: np.random.Generator) -> Episode:
        states = [9]
        while 0 <= states[-1] < 19:
            states.append(states[-1] + rng.choice((-1, 1)))
        return [
            (s, {-1: -1.0, 19: 1.0}.get(s_next, 0.0), s_next, not 0 <= s_next < 19) for s, s_next in pairwise(states)
        ]


class BoyanChain:
    """Boyan (2002): from state 12 one or two states down at even odds for a reward of -3, from state 1 to state 0 for
    -2; state 0 ends it. Four features interpolate between states 12, 8, 4, 0; gamma = 1."""

    features = np.maximum(0, 1 - np.abs(np.arange(13)[:, None] - [12, 8, 4, 0]) / 4)
    values = -2.0 * np.arange(13)
    fixed_point = np.array([-24.0, -16.0, -8.0, 0.0])

    @staticmethod
    def episode(rng: np.random.Generator) -> Episode:
        states = [12]
        while states[-1] > 0:
            states.append(max(0, states[-1] - rng.choice((1, 2))))
        return [(s, -3.0 if s > 1 else -2.0, s_next, s_next == 0) for s, s_next in pairwise(states)]


def learn(learner, problem, episodes):
    """Run these episodes through a prediction learner; yield after each."""
    for episode in episodes:
        learner.begin_episode()
        for s, reward, s_next, terminal in episode:
            phi_next = np.zeros(learner.weights.size) if terminal else problem.features[s_next]
            learner.update(problem.features[s], reward, phi_next, terminal=terminal)
        yield
