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

const RULES = {}; // those that settings know by name, in the order in which the page offers them

// List a rule under its name in settings. label, formula: as the page writes them; group: of the rules that it stands with.
function register(group, name, label, formula, rule) {
  RULES[name] = Object.assign(rule, { group, label, formula });
  return rule;
}

const [EQ7, SIGNS, PARTS] = ["Conjugate, eq. (7)", "With another sign", "What form 2 is made of"];

const fletcherReeves = register(EQ7, "fletcher-reeves", "form 2",
  "λ = δ |φ|² / (γ δ₋ |φ₋|²), the paper’s choice (₋: of the step before)",
  ({ delta, phi, deltaPrev, phiPrev, discount }) => (delta * dot(phi, phi)) / (discount * deltaPrev * dot(phiPrev, phiPrev)));

const hestenesStiefel = register(EQ7, "hestenes-stiefel", "form 1", "λ = −(δφ − δ₋φ₋)·φ / (γ (δφ − δ₋φ₋)·e₋)",
  ({ delta, phi, deltaPrev, phiPrev, tracePrev, discount }) => {
    const alongPhi = delta * dot(phi, phi) - deltaPrev * dot(phiPrev, phi);
    const alongTrace = delta * dot(phi, tracePrev) - deltaPrev * dot(phiPrev, tracePrev);
    return -alongPhi / (discount * alongTrace);
  });

const polakRibiere = register(EQ7, "polak-ribiere", "form 3", "λ = (δφ − δ₋φ₋)·φ / (γ δ₋ |φ₋|²)",
  ({ delta, phi, deltaPrev, phiPrev, discount }) => {
    const alongPhi = delta * dot(phi, phi) - deltaPrev * dot(phiPrev, phi);
    return alongPhi / (discount * deltaPrev * dot(phiPrev, phiPrev));
  });

register(SIGNS, "hestenes-stiefel:printed", "form 1 as printed", "form 1 without its minus, as the paper prints it",
  (step) => -hestenesStiefel(step));
register(SIGNS, "fletcher-reeves:negated", "form 2 negated", "form 2 with the other sign", (step) => -fletcherReeves(step));
register(SIGNS, "polak-ribiere:negated", "form 3 negated", "form 3 with the other sign", (step) => -polakRibiere(step));

// An error of 0 has no sign.
const gate = register(PARTS, "gate", "gate", "λ = 1 while δ keeps its sign, else 0",
  ({ delta, deltaPrev }) => +(Math.min(delta, deltaPrev) > 0 || Math.max(delta, deltaPrev) < 0));
register(PARTS, "gate:0.7", "gate of 0.7", "λ = 0.7 while δ keeps its sign, else 0", (step) => 0.7 * gate(step));
register(PARTS, "gate:opposite", "opposite gate", "λ = 1 where δ changes its sign, else 0",
  ({ delta, deltaPrev }) => gate({ delta: -delta, deltaPrev }));
register(PARTS, "inverse", "inverse", "λ = γ δ₋ |φ₋|² / (δ |φ|²): form 2 upside down",
  ({ delta, phi, deltaPrev, phiPrev, discount }) => (discount * deltaPrev * dot(phiPrev, phiPrev)) / (delta * dot(phi, phi)));
register(PARTS, "absolute", "absolute", "λ = |form 2|: its size, whatever the sign", (step) => Math.abs(fletcherReeves(step)));

// A rule and its options by a text of the settings, such as "fixed:0.9" or "polak-ribiere:on_zero=1:unclipped"; one's own
// is written out after its options, "own:unclipped:0.5 * delta". Throws an Error for the reader.
function lambdaSpec(text) {
  const options = "((?::on_zero=[^:]*|:unclipped)*)";
  const [, ownOptions, own] = text.match(`^own${options}:([^]*)$`) ?? [];
  const [, name, chosen] = own === undefined ? text.match(`^([^]*?)${options}$`) : [null, "own", ownOptions];
  const onZero = Number(/on_zero=([^:]*)/.exec(chosen)?.[1] ?? 0);
  if (!(onZero >= 0 && onZero <= 1)) throw new Error(`on_zero must lie in [0, 1], in “${text}”`);
  return { text, name, own, rule: ruleNamed(name, own), onZero, clip: !chosen.includes(":unclipped") };
}

function ruleNamed(name, own) {
  if (name === "own") return ownRule(own ?? "");
  if (Object.hasOwn(RULES, name)) return RULES[name];
  if (!name.startsWith("fixed:")) throw new Error(`there is no lambda rule “${name}”`);
  const value = Number(name.slice(6));
  if (!(value >= 0 && value <= 1)) throw new Error(`lambda must lie in [0, 1], not be ${name.slice(6)}`);
  return () => value;
}

// --- The learner ----------------------------------------------------------------------------------------------------

// Sarsa(lambda_t) of Fig. 2; TD prediction is the same with one action. Settings as in homing_lib.sarsa.LinearSarsa,
// with accumulating traces.
class LinearSarsa {
  constructor(nFeatures, nActions, { stepSize, discount, spec, initialWeight = 0, update = "taken" }) {
    Object.assign(this, { stepSize, discount, spec, update });
    this.weights = new Float64Array(nFeatures * nActions).fill(initialWeight);
    this.rows = Array.from({ length: nActions }, (_, a) => this.weights.subarray(a * nFeatures, (a + 1) * nFeatures));
    this.beginEpisode();
  }

  beginEpisode() {
    this.trace = new Float64Array(this.weights.length);
    this.before = null; // delta_{t-1}, phi_{t-1}
  }

  values(phi) {
    return this.rows.map((row) => dot(row, phi));
  }

  // From s_t, a_t, r_{t+1}, s_{t+1}, a_{t+1}: returns the TD error, or null where the weights leave the finite numbers.
  // phiNext: null where nothing follows.
  learn(phi, action, reward, phiNext, nextAction) {
    const { weights, trace } = this, first = action * phi.length;
    const qNext = phiNext ? dot(this.rows[nextAction], phiNext) : 0;
    const delta = reward + this.discount * qNext - dot(this.rows[action], phi); // eq. (1)

    const phiTaken = new Float64Array(weights.length);
    phiTaken.set(phi, first);
    const decay = this.discount * this.chooseLambda(delta, phiTaken); // eq. (7)

    for (let i = 0; i < trace.length; i++) trace[i] = decay * trace[i] + phiTaken[i]; // eq. (17)

    const [from, to] = this.update === "taken" ? [first, first + phi.length] : [0, trace.length];
    const rate = this.stepSize * delta;
    let squares = 0, finite = true;
    for (let i = from; i < to; i++) {
      const change = rate * trace[i];
      weights[i] += change; // eq. (18)
      squares += change * change;
      finite &&= Number.isFinite(weights[i]);
    }
    this.change = Math.sqrt(squares);
    return finite ? delta : null;
  }

  // lambda_t by the rule, guarded and clipped; 0 at the first step of an episode.
  chooseLambda(delta, phi) {
    this.lambda = 0;
    this.clipped = false;
    this.ratio = null; // what the rule said, before guard and clip
    if (this.before) {
      const { spec, discount, trace: tracePrev } = this, { delta: deltaPrev, phi: phiPrev } = this.before;
      this.ratio = spec.rule({ delta, phi, deltaPrev, phiPrev, tracePrev, discount });
      this.lambda = Number.isFinite(this.ratio) ? this.ratio : spec.onZero;
      this.clipped = spec.clip && !(this.lambda >= 0 && this.lambda <= 1);
      if (this.clipped) this.lambda = Math.min(Math.max(0, this.lambda), 1);
    }
    this.before = { delta, phi };
    return this.lambda;
  }
}

// --- Exploration ------------------------------------------------------------------------------------------------------

const sum = (values) => values.reduce((total, value) => total + value, 0);
const mean = (values) => sum(values) / values.length;

// Eq. (21), which is all of the policy in the settings of this page.
function epsilonGreedy(values, epsilon) {
  const probabilities = values.map(() => epsilon / values.length);
  probabilities[values.indexOf(Math.max(...values))] += 1 - epsilon;
  return probabilities;
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
