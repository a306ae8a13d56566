// An experiment, as in homing_lib.agent: look at home, survey, then learn for some episodes. And the random walk.

class SarsaAgent {
  constructor(settings, nFeatures, rng, ownRule) {
    const chosen = parseRule(settings.lambda_rule);
    const rule = ownRule ?? chosen.rule;
    this.settings = settings;
    this.rng = rng;
    this.learner = new LinearSarsa(nFeatures, 3, {
      stepSize: settings.alpha0,
      discount: settings.discount,
      rule: settings.overwrite_features ? (step) => rule({ ...step, phiPrev: step.phi }) : rule,
      initialWeight: settings.theta0,
      clip: chosen.clip,
      onZero: chosen.onZero,
      traces: settings.traces,
      update: settings.update,
      bootstrapTerminal: settings.bootstrap_terminal,
    });
  }

  beginEpisode(number) {
    const s = this.settings;
    const rate = decreaseRate(number, s.first_episode_share * s.episodes); // eq. (23)
    this.learner.stepSize = s.alpha0 * rate;
    this.policy = { epsilon: s.epsilon0 * rate, temperature: s.tau0 * rate, mixture: s.mixture };
    this.learner.beginEpisode();
  }

  choose(phi) {
    return sample(actionProbabilities(this.learner.values(phi), this.policy), this.rng);
  }

  learn(phi, action, reward, phiNext, nextAction, terminal, atWall) {
    if (atWall && !this.settings.learn_at_walls) return NOTHING_LEARNT;
    const delta = this.learner.learn(phi, action, reward, phiNext, nextAction, terminal);
    const { lambda, clipped, change } = this.learner;
    return { delta, lambda, clipped, change };
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
  constructor(world, settings, seed, ownRule, model) {
    const [surveySeed, agentSeed, worldSeed] = new SeedSequence(seed).spawn(3);
    this.settings = settings;
    this.total = settings.episodes; // more may follow the training: exploration and step size fall on
    this.env = new HomingEnv(world, settings, surveySeed, worldSeed.generateState(1)[0], model);
    this.agent = new CONTROLLERS[settings.controller](settings, world.bins, new Generator(agentSeed), ownRule);
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
    const { robot } = this.env;
    const nextAction = robot.reflex ?? this.agent.choose(seen.phi);
    let learnt;
    try {
      learnt = this.frozen ? NOTHING_LEARNT : this.agent.learn(
        this.phi, seen.action, seen.reward, seen.phi, nextAction, seen.terminated, seen.atWall,
      );
    } catch (error) {
      if (!(error instanceof Diverged)) throw error;
      this.diverged = this.episodes.length + 1;
      this.underWay = false;
      return null;
    }
    const { action, reward, similarity, atWall } = seen;
    const happened = { ...robot.pose, action, reward, similarity, ...learnt, atWall, frozen: this.frozen };
    this.steps.push(happened);
    if (seen.terminated || seen.truncated) {
      const frozen = sum(this.steps.map((step) => +step.frozen)) / this.steps.length; // share of its steps
      this.episodes.push({ steps: this.steps, reached: seen.terminated, from: this.from, frozen });
      this.learnt += frozen < 1;
      this.underWay = false;
    }
    this.phi = seen.phi;
    this.action = nextAction;
    return happened;
  }

  // To the end of the episode under way, or of the next.
  episode() {
    const before = this.episodes.length;
    while (!this.done && this.episodes.length === before) this.step();
  }

  // Carry the robot elsewhere: it sees so at its next step.
  kidnap(pose) {
    this.env.robot.place(pose);
  }
}

// The whole run.
function run(world, settings, seed, ownRule) {
  const experiment = new Experiment(world, settings, seed, ownRule);
  while (!experiment.done) experiment.episode();
  return experiment;
}

// The least number of steps to a view that ends an episode, by breadth-first search as in homing_lib.study.measures.
const shortest = (env) => drained(searching(env));

function* searching(env) {
  const { world, settings, psi } = env;
  const commands = wheelCommands(settings);
  const seen = new Set();
  let frontier = [env.start];
  for (let steps = 1; steps <= settings.max_steps && frontier.length; steps++) {
    const reached = [];
    for (const pose of frontier) {
      yield;
      for (const [left, right] of commands) {
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
  constructor({ rule, onZero = 0, clip = true, stepSize, seed, discount = 1 }) {
    this.learner = new LinearSarsa(STATES, 1, { rule, onZero, clip, stepSize, discount });
    this.rng = new Generator(seed);
    this.walks = 0;
    this.steps = null;
  }

  // One step; it begins a walk where none is under way. `steps` are those of the walk.
  step() {
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
    const delta = this.learner.learn(UNIT[state], 0, reward, done ? null : UNIT[after], 0, done);
    const { lambda, clipped, ratio, trace } = this.learner;
    this.steps.push({ state, after, reward, delta, lambda, clipped, ratio, trace: trace.slice() });
    this.state = after;
    if (done) {
      this.underWay = false;
      this.walks++;
    }
  }

  // To the end of the walk under way, or of the next.
  walk() {
    do this.step();
    while (this.underWay);
  }

  // Root of the mean squared error of the values.
  get error() {
    const { weights } = this.learner;
    return Math.sqrt(sum(TRUE_VALUES.map((value, state) => (weights[state] - value) ** 2)) / STATES);
  }
}
