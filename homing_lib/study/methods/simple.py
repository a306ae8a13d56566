"""A linear learner that one reads on a page: what the published one becomes if home is to be found fast, and kept.

    x(s)     = (phi(s) - m) / |phi(s) - m|, and a constant           m: mean of the views met
    Q(s, a)  = theta_0 n (NRB(s) - psi) + w(a)^T x(s)                 w = 0 at first
    delta    = r + max over b of Q(s', b) - Q(s, a)                   home is worth 0
    w(a)    += alpha delta x(s)

After an episode that came home, its steps and those of the episodes before are learnt from once more, from home
backwards. A step costs some 6 n multiplications, and as many for each episode that is replayed. gamma is 1.

Where it leaves the published model, and why:

- Features are centred and of length 1. They are n numbers near 1, so that views hardly differ: what is learnt of one
  changes all. A mean taken out, they differ; at length 1 alpha is the share of an error that a step takes away
  (normalised least mean squares: Nagumo and Noda, IEEE Transactions on Automatic Control 12, 1967).
- It looks ahead to the best action, lambda is 0, and alpha stays (Q-learning: Watkins 1989): in a world that draws no
  lots but at walls, nothing has to be averaged.
- Home is worth 0 and a step costs the same wherever it is, so that Q is a number of steps. An action that has not been
  tried is worth what the similarity promises, as in the published model; that is too much, and so each is tried
  (potential-based: Wiewiora, Journal of Artificial Intelligence Research 19, 2003). Epsilon adds little to that.
- The last episodes are replayed (Lin, Machine Learning 8, 1992), backwards, so that one pass carries home's worth to
  the start.
"""

from collections import deque
from functools import partial
from math import isfinite
from typing import NamedTuple

import numpy as np
from scipy.linalg.blas import ddot as dot

from homing_lib.agent import Learnt, register
from homing_lib.features import Array
from homing_lib.policy import decrease_rate, epsilon_greedy, sample
from homing_lib.sarsa import Diverged
from homing_lib.settings import Settings
from homing_lib.thresholds import stopping_thresholds

CONSTANT = 0.3  # the feature that is the same everywhere, beside the others, of length 1 together
REPLAYED = 5  # episodes
REPLAY_SHARE = 0.3  # of alpha: with so much they are learnt from once more


class View(NamedTuple):
    """What the learner makes of a view: its features, what any action is worth at first, and Q of every action."""

    phi: Array
    x: Array
    start: float
    values: list[float]


class SimpleAgent:
    """The learner of this file. Of the settings it takes alpha0, theta0, and epsilon0, which falls by eq. (23).

    replayed: how many episodes; centred: whether the mean is taken out of the features.
    """

    def __init__(
        self, settings: Settings, rng: np.random.Generator, *, replayed: int = REPLAYED, centred: bool = True
    ) -> None:
        self.settings, self.rng, self.centred = settings, rng, centred
        self.psi = stopping_thresholds(settings.multiplier, settings.band).upper
        self.mean, self.views = np.zeros(settings.n_features), 0
        self.weights = np.zeros((3, settings.n_features + 1))
        self.episodes: deque[list[tuple[Array, int, float]]] = deque(maxlen=replayed)
        self.here: View | None = None  # what the step under way began with
        self.last: View | None = None  # what was looked at last; none if the weights have changed since

    @property
    def learner(self) -> "SimpleAgent":
        """Itself: where whoever freezes a robot finds its action values."""
        return self

    def begin_episode(self, number: int) -> None:
        """Set the exploration of episode 1, 2, ..., and begin to write down what is seen, done and paid."""
        self.epsilon = self.settings.epsilon0 * decrease_rate(number, self.settings.first_episode)
        self.here = self.last = None
        self.steps: list[tuple[Array, int, float]] = []

    def x(self, phi: Array) -> Array:
        """The features that it learns with, shape (n + 1,), of a view; of T views, shape (T, n + 1)."""
        away = phi - self.mean
        length = np.sqrt(dot(away, away)) if away.ndim == 1 else np.sqrt([[dot(one, one)] for one in away])
        x = np.full((*phi.shape[:-1], phi.shape[-1] + 1), CONSTANT)
        x[..., :-1] = away / (length + 1e-12)  # a view may be the mean itself
        return x

    def start_value(self, phi: Array) -> Array:
        """What every action is worth at first, of a view or of T: 0 if it is just like enough to home."""
        return np.asarray(self.settings.theta0 * (phi.sum(axis=-1) - phi.shape[-1] * self.psi))

    def look(self, phi: Array) -> View:
        """A view; it is worked out once for whoever chooses, and then learns."""
        if self.last is None or self.last.phi is not phi:
            x, start = self.x(phi), float(self.start_value(phi))
            self.last = View(phi, x, start, [start + dot(weights, x) for weights in self.weights])
        return self.last

    def value_list(self, phi: Array) -> list[float]:
        """Q of every action."""
        return self.look(phi).values

    def choose(self, phi: Array) -> int:
        """The best action, but for a share epsilon of the steps."""
        self.here = self.here or self.look(phi)
        return sample(epsilon_greedy(self.value_list(phi), self.epsilon), self.rng)

    def learn(
        self, phi: Array, action: int, reward: float, phi_next: Array, next_action: int, terminal: bool, at_wall: bool
    ) -> Learnt:
        """One step of learning; at home, the replay."""
        here, there = self.here or self.look(phi), self.look(phi_next)
        ahead = 0.0 if terminal else max(there.values)
        delta = self.update(here.x, action, reward + ahead - here.start, self.settings.alpha0)
        self.here, self.last = there, None
        self.steps.append((phi, action, reward))
        if self.centred:
            self.views += 1
            self.mean += (phi_next - self.mean) / self.views
        if terminal:
            self.episodes.append(self.steps)
            self.replay()
        return Learnt(delta)

    def update(self, x: Array, action: int, target: float, alpha: float) -> float:
        """Move what was learnt of an action towards a target; return by how much it was wrong, the TD error."""
        weights = self.weights[action]
        delta = target - dot(weights, x)
        if not isfinite(delta):
            raise Diverged(self.views, "simple", alpha)
        weights += alpha * delta * x
        return float(delta)

    def replay(self) -> None:
        """Learn once more from the last episodes that came home, the oldest first, each from home backwards."""
        alpha = REPLAY_SHARE * self.settings.alpha0
        for episode in self.episodes:
            views, ahead = np.array([phi for phi, _, _ in episode]), 0.0
            seen = zip(self.x(views), self.start_value(views).tolist(), strict=True)
            for (x, start), (_, action, reward) in reversed([*zip(seen, episode, strict=True)]):
                self.update(x, action, reward + ahead - start, alpha)
                ahead = start + max([dot(weights, x) for weights in self.weights])


register("simple", SimpleAgent)
register("simple, no replay", partial(SimpleAgent, replayed=0))
register("simple, not centred", partial(SimpleAgent, centred=False))
