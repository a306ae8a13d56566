// The model's mathematics, as in homing_lib: lambdas.py, sarsa.py, policy.py and thresholds.py, under the same names.

// In eight sums, as numpy and BLAS do: what is lost to rounding is then next to nothing.
function dot(x, y) {
  let a = 0, b = 0, c = 0, d = 0, e = 0, f = 0, g = 0, h = 0, i = 0;
  for (const n = x.length - 7; i < n; i += 8) {
    a += x[i] * y[i];
    b += x[i + 1] * y[i + 1];
    c += x[i + 2] * y[i + 2];
    d += x[i + 3] * y[i + 3];
    e += x[i + 4] * y[i + 4];
    f += x[i + 5] * y[i + 5];
    g += x[i + 6] * y[i + 6];
    h += x[i + 7] * y[i + 7];
  }
  for (; i < x.length; i++) a += x[i] * y[i];
  return a + b + (c + d) + (e + f + (g + h));
}

// --- Lambda rules ---------------------------------------------------------------------------------------------------

// A rule is asked with {delta, phi, deltaPrev, phiPrev, tracePrev, discount}. What is not finite has no meaning (0/0,
// x/0), and the learner's onZero stands in.

function hestenesStiefel({ delta, phi, deltaPrev, phiPrev, tracePrev, discount }) {
  const alongPhi = delta * dot(phi, phi) - deltaPrev * dot(phiPrev, phi);
  const alongTrace = delta * dot(phi, tracePrev) - deltaPrev * dot(phiPrev, tracePrev);
  return -alongPhi / (discount * alongTrace);
}

function fletcherReeves({ delta, phi, deltaPrev, phiPrev, discount }) {
  return (delta * dot(phi, phi)) / (discount * deltaPrev * dot(phiPrev, phiPrev));
}

function polakRibiere({ delta, phi, deltaPrev, phiPrev, discount }) {
  const alongPhi = delta * dot(phi, phi) - deltaPrev * dot(phiPrev, phi);
  return alongPhi / (discount * deltaPrev * dot(phiPrev, phiPrev));
}

function inverse({ delta, phi, deltaPrev, phiPrev, discount }) {
  return (discount * deltaPrev * dot(phiPrev, phiPrev)) / (delta * dot(phi, phi));
}

// 1 where the TD error keeps its sign, else 0. An error of 0 has none.
const gate = ({ delta, deltaPrev }) => +(Math.min(delta, deltaPrev) > 0 || Math.max(delta, deltaPrev) < 0);

const RULES = {
  "hestenes-stiefel": hestenesStiefel,
  "hestenes-stiefel:printed": (step) => -hestenesStiefel(step),
  "fletcher-reeves": fletcherReeves,
  "fletcher-reeves:negated": (step) => -fletcherReeves(step),
  "polak-ribiere": polakRibiere,
  "polak-ribiere:negated": (step) => -polakRibiere(step),
  "gate": gate,
  "gate:0.7": (step) => 0.7 * gate(step),
  "gate:opposite": ({ delta, deltaPrev }) => gate({ delta: -delta, deltaPrev }),
  "inverse": inverse,
  "absolute": (step) => Math.abs(fletcherReeves(step)),
};

// The rule of a name such as "fixed:0.9" or "polak-ribiere:on_zero=1:unclipped", with onZero and clip. Throws Error.
function parseRule(text) {
  const [first, ...options] = text.split(":");
  let name = first;
  while (options.length && (name === "fixed" || RULES[`${name}:${options[0]}`])) name += `:${options.shift()}`;
  let rule = RULES[name];
  if (name.startsWith("fixed:")) {
    const value = Number(name.slice(6));
    if (!(value >= 0 && value <= 1)) throw new Error(`lambda must lie in [0, 1], not be ${name.slice(6)}`);
    rule = () => value;
  }
  if (!rule) throw new Error(`there is no lambda rule “${text}”`);
  let onZero = 0;
  for (const option of options) {
    if (option.startsWith("on_zero=")) onZero = Number(option.slice(8));
    else if (option !== "unclipped") throw new Error(`there is no option “${option}”`);
  }
  return { name, rule, onZero, clip: !options.includes("unclipped") };
}

// --- The learner ----------------------------------------------------------------------------------------------------

class Diverged extends Error {}

// Sarsa(lambda_t) of Fig. 2; TD prediction is the same with one action. Settings as in homing_lib.sarsa.LinearSarsa.
class LinearSarsa {
  constructor(nFeatures, nActions, settings) {
    const usual = { initialWeight: 0, clip: true, onZero: 0, traces: "accumulating", bootstrapTerminal: false };
    Object.assign(this, usual, settings);
    this.update ??= this.traces === "dutch" ? "all" : "taken";
    this.n = nFeatures;
    this.weights = new Float64Array(nFeatures * nActions).fill(this.initialWeight);
    this.rows = Array.from({ length: nActions }, (_, a) => this.weights.subarray(a * nFeatures, (a + 1) * nFeatures));
    this.change = 0;
    this.beginEpisode();
  }

  beginEpisode() {
    this.lambda = 0;
    this.clipped = false;
    this.qAhead = 0;
    this.trace = new Float64Array(this.weights.length);
    this.before = null; // delta_{t-1}, phi_{t-1}
  }

  values(phi) {
    return this.rows.map((row) => dot(row, phi));
  }

  // From s_t, a_t, r_{t+1}, s_{t+1}, a_{t+1}: returns the TD error.
  learn(phi, action, reward, phiNext, nextAction, terminal = false) {
    const { n, weights, trace, stepSize, discount } = this;
    const first = action * n;
    const q = dot(this.rows[action], phi);
    const qNext = terminal && !this.bootstrapTerminal ? 0 : dot(this.rows[nextAction], phiNext);
    const delta = reward + discount * qNext - q; // eq. (1)

    const phiTaken = new Float64Array(weights.length);
    phiTaken.set(phi, first);
    const lambda = this.chooseLambda(delta, phiTaken); // eq. (7)

    const decay = discount * lambda;
    for (let i = 0; i < trace.length; i++) trace[i] *= decay; // eq. (17)
    const own = trace.subarray(first, first + n);
    if (this.traces === "replacing") {
      for (let i = 0; i < n; i++) if (phi[i] !== 0) own[i] = phi[i];
    } else {
      const gain = this.traces === "dutch" ? 1 - stepSize * dot(own, phi) : 1;
      for (let i = 0; i < n; i++) own[i] += gain * phi[i];
    }

    const [from, to] = this.update === "taken" ? [first, first + n] : [0, trace.length];
    const alongTrace = stepSize * delta;
    const correction = this.traces === "dutch" ? stepSize * (q - this.qAhead) : 0;
    let squares = 0, largest = 0, finite = true;
    for (let i = from; i < to; i++) {
      let change = alongTrace * trace[i];
      if (correction) change += correction * (trace[i] - phiTaken[i]);
      weights[i] += change; // eq. (18)
      squares += change * change;
      largest = Math.max(largest, Math.abs(change));
      finite &&= Number.isFinite(weights[i]);
    }
    if (!finite) throw new Diverged("the weights left the finite numbers");
    this.qAhead = qNext;
    this.change = Number.isFinite(squares) ? Math.sqrt(squares) : largest;
    return delta;
  }

  // lambda_t by the rule, guarded and clipped; 0 at the first step of an episode.
  chooseLambda(delta, phi) {
    this.lambda = 0;
    this.clipped = false;
    this.ratio = null; // what the rule said, before guard and clip
    if (this.before) {
      const { delta: deltaPrev, phi: phiPrev } = this.before;
      this.ratio = this.rule({ delta, phi, deltaPrev, phiPrev, tracePrev: this.trace, discount: this.discount });
      this.lambda = Number.isFinite(this.ratio) ? this.ratio : this.onZero;
      if (this.clip && !(this.lambda >= 0 && this.lambda <= 1)) {
        this.lambda = Math.min(Math.max(0, this.lambda), 1);
        this.clipped = true;
      }
    }
    this.before = { delta, phi };
    return this.lambda;
  }
}

// --- Exploration, eqs. (20)-(23) ------------------------------------------------------------------------------------

const sum = (values) => values.reduce((total, value) => total + value, 0);

function shares(weights) {
  const total = sum(weights);
  return weights.map((weight) => weight / total);
}

function scaled(values, literal = false) {
  const divisor = literal ? sum(values) : sum(values.map(Math.abs));
  return values.map((value) => (divisor ? value / divisor : 0));
}

function actionProbabilities(values, { epsilon, temperature, mixture }) {
  const greedy = values.map(() => epsilon / values.length);
  greedy[values.indexOf(Math.max(...values))] += 1 - epsilon;
  if (mixture === "epsilon-greedy") return greedy;
  if (mixture === "normalised") {
    const preferences = scaled(values);
    const top = Math.max(...preferences);
    const soft = shares(preferences.map((preference) => Math.exp((preference - top) / temperature)));
    return soft.map((share, a) => (share + greedy[a]) / 2);
  }
  const largest = Number.MAX_VALUE;
  const bounded = (value) => Math.min(Math.max(value / temperature, -largest), largest);
  const preferences = scaled(values, true).map(bounded);
  const top = Math.max(0, ...preferences);
  return shares(preferences.map((preference, a) => Math.exp(preference - top) + greedy[a] * Math.exp(-top)));
}

function sample(probabilities, rng) {
  let remaining = rng.random();
  for (let a = 0; a < probabilities.length; a++) {
    remaining -= probabilities[a];
    if (remaining < 0) return a;
  }
  return probabilities.length - 1;
}

const decreaseRate = (episode, firstEpisode) => (firstEpisode + 1) / (firstEpisode + episode);

// Eq. (19).
function stoppingThresholds(multiplier) {
  const squareRoot = (m) => 1 - 1 / (Math.PI * Math.sqrt(m));
  return { upper: squareRoot(multiplier), lower: squareRoot(multiplier - 1) };
}
