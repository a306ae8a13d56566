// An experiment, as in homing_lib.agent: look at home, survey, then learn for some episodes. And the random walk.

class SarsaAgent {
  constructor(settings, nFeatures, rng) {
    Object.assign(this, { settings, rng });
    this.learner = new LinearSarsa(nFeatures, 3, {
      stepSize: settings.alpha0,
      discount: settings.discount,
      spec: lambdaSpec(settings.lambda_rule),
      initialWeight: settings.theta0,
      update: settings.update,
    });
  }

  beginEpisode(number) {
    const s = this.settings;
    const rate = decreaseRate(number, s.first_episode_share * s.episodes); // eq. (23)
    this.learner.stepSize = s.alpha0 * rate;
    this.epsilon = s.epsilon0 * rate;
    this.learner.beginEpisode();
  }

  choose(phi) {
    return sample(epsilonGreedy(this.learner.values(phi), this.epsilon), this.rng);
  }

  // What one step teaches, or null where the weights leave the finite numbers.
  learn(phi, action, reward, phiNext, nextAction, terminal) {
    const bootstraps = !terminal || this.settings.bootstrap_terminal;
    const delta = this.learner.learn(phi, action, reward, bootstraps ? phiNext : null, nextAction);
    const { lambda, clipped, change } = this.learner;
    return delta === null ? null : { delta, lambda, clipped, change };
  }
}

const NOTHING_LEARNT = { delta: 0, lambda: 0, clipped: false, change: 0 };

class RandomAgent {
  constructor(settings, nFeatures, rng) {
    this.rng = rng;
  }

  beginEpisode() {}

  choose() {
    return this.rng.integers(3);
  }

  learn() {
    return NOTHING_LEARNT;
  }
}

// Keep to an action while the similarity rises, else draw another.
class ClimbingAgent extends RandomAgent {
  beginEpisode() {
    this.action = 0;
    this.similarity = Infinity;
  }

  choose(phi) {
    const seen = similarity(phi);
    if (seen <= this.similarity) this.action = (this.action + 1 + this.rng.integers(2)) % 3;
    this.similarity = seen;
    return this.action;
  }
}

const CONTROLLERS = { sarsa: SarsaAgent, random: RandomAgent, climb: ClimbingAgent };

// One experiment, a step at a time. `steps` are those of the episode under way, `episodes` the finished ones.
class Experiment {
  constructor(world, settings, seed, model) {
    const [surveySeed, agentSeed, worldSeed] = new SeedSequence(seed).spawn(3);
    this.settings = settings;
    this.total = settings.episodes; // more may follow the training: exploration and step size fall on
    this.env = new HomingEnv(world, settings, surveySeed, worldSeed.generateState(1)[0], model);
    this.agent = new CONTROLLERS[settings.controller](settings, world.bins, new Generator(agentSeed));
    this.episodes = [];
    this.learnt = 0; // episodes in which it learnt; step size and exploration go by them
    this.frozen = false;
    this.diverged = 0;
    this.underWay = false;
  }

  // Frozen, it drives with the weights that it has, as FrozenAgent does; it learns again with no trace, as in a new episode.
  freeze(frozen) {
    if (this.frozen && !frozen) this.agent.learner.beginEpisode();
    this.frozen = frozen;
  }

  get done() {
    return !this.underWay && (this.diverged > 0 || this.episodes.length >= this.total);
  }

  begin(start = this.env.start) {
    this.agent.beginEpisode(this.learnt + 1);
    this.phi = this.env.reset(start);
    this.action = this.agent.choose(this.phi);
    this.steps = [];
    this.from = start;
    this.underWay = true;
  }

  // One step; it begins an episode where none is under way. Returns what happened, or null where the run is over.
  step() {
    if (this.done) return null;
    if (!this.underWay) this.begin();
    const seen = this.env.step(this.action);
    const { phi, action, reward, similarity, atWall, terminated, truncated } = seen, { robot } = this.env;
    const nextAction = robot.reflex ?? this.agent.choose(phi);
    const learnt = this.frozen ? NOTHING_LEARNT : this.agent.learn(this.phi, action, reward, phi, nextAction, terminated);
    if (!learnt) {
      this.diverged = this.episodes.length + 1;
      this.underWay = false;
      return null;
    }
    const happened = { ...robot.pose, action, reward, similarity, ...learnt, atWall, frozen: this.frozen };
    this.steps.push(happened);
    if (terminated || truncated) {
      const frozen = sum(this.steps.map((step) => +step.frozen)) / this.steps.length; // share of its steps
      this.episodes.push({ steps: this.steps, reached: terminated, from: this.from, frozen });
      this.learnt += frozen < 1;
      this.underWay = false;
    }
    this.phi = phi;
    this.action = nextAction;
    return happened;
  }

  // Carry the robot elsewhere after the step that it has made: it sees so at its next.
  kidnap(pose) {
    this.steps.at(-1).carried = pose;
    this.env.robot.place(pose);
  }
}

// The least number of steps to a view that ends an episode, by breadth-first search as in homing_lib.study.measures; yields
// between poses and returns it.
function* searching(env) {
  const { world, settings, psi, robot } = env;
  const seen = new Set();
  let frontier = [env.start];
  for (let steps = 1; steps <= settings.max_steps && frontier.length; steps++) {
    const reached = [];
    for (const pose of frontier) {
      yield;
      for (const [left, right] of robot.actions) {
        const [there, stopped] = drive(pose, left, right, settings.wheel_base_m, world);
        const turn = ((rounded(there.heading / (Math.PI / 18)) % 36) + 36) % 36;
        const cell = (Math.floor(there.x / 0.02) * 1000 + Math.floor(there.y / 0.02)) * 36 + turn;
        if (stopped || seen.has(cell)) continue;
        if (similarity(features(world.histogram(there), env.model)) >= psi.upper) return steps;
        seen.add(cell);
        reached.push(there);
      }
    }
    frontier = reached;
  }
  return NaN;
}

// --- The random walk of the textbooks -------------------------------------------------------------------------------

const STATES = 19;
const UNIT = Array.from({ length: STATES }, (_, state) => Float64Array.from({ length: STATES }, (_, i) => +(i === state)));
const TRUE_VALUES = Array.from({ length: STATES }, (_, state) => (state - (STATES - 1) / 2) / ((STATES + 1) / 2));

// TD(lambda) on states in a row, +1 at the right end and -1 at the left, a step at a time.
class Walk {
  constructor(spec, stepSize, seed) {
    this.learner = new LinearSarsa(STATES, 1, { spec, stepSize, discount: 1 });
    this.rng = new Generator(seed);
    this.steps = []; // of the walk under way, or of the last
    this.errors = [this.error]; // before the first walk, and after each
    this.underWay = false;
    this.diverged = false;
  }

  get walks() {
    return this.errors.length - 1;
  }

  // One step; it begins a walk where none is under way. False where the weights have left the finite numbers.
  step() {
    if (this.diverged) return false;
    if (!this.underWay) {
      this.learner.beginEpisode();
      this.state = (STATES - 1) / 2;
      this.steps = [];
      this.underWay = true;
    }
    const state = this.state;
    const after = state + (this.rng.integers(2) ? 1 : -1);
    const done = after < 0 || after >= STATES;
    const reward = !done ? 0 : after < 0 ? -1 : 1;
    const delta = this.learner.learn(UNIT[state], 0, reward, done ? null : UNIT[after], 0);
    this.diverged = delta === null;
    if (this.diverged) return false;
    const { lambda, clipped, ratio, trace } = this.learner;
    this.steps.push({ state, after, reward, delta, lambda, clipped, ratio, trace: trace.slice() });
    this.state = after;
    this.underWay = !done;
    if (done) this.errors.push(this.error);
    return true;
  }

  // To the end of this walk, counted from 1.
  finish(number) {
    while (this.walks < number && this.step());
  }

  // Root of the mean squared error of the values.
  get error() {
    const { weights } = this.learner;
    return Math.sqrt(sum(TRUE_VALUES.map((value, state) => (weights[state] - value) ** 2)) / STATES);
  }
}
