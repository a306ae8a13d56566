// What is chosen, all of it in the address: #rule=gate&seed=3. A name is there only where it differs from the usual.

const USUAL = {
  view: "walk",
  rule: "fletcher-reeves",
  own: "0.7 if delta * delta_prev > 0 else 0",
  lambda: 0.9,
  guard: 0, // lambda where the rule divides by zero
  reset: 1, // whether a lambda outside [0, 1] is reset to the nearer bound
  seed: 1,
  // the walk
  alpha: 0.1,
  at: 0, // steps made
  look: "backward",
  pick: -1, // the step that is looked at; -1: the last
  // the robot
  alpha0: DATA.settings.alpha0,
  multiplier: DATA.settings.multiplier,
  epsilon: DATA.settings.epsilon0,
  update: DATA.settings.update,
  map: "none",
  start: "", // x,y,heading
  kidnap: "", // step:x,y,heading;...
  made: 0, // steps made
};

const ALLOWED = {
  view: ["walk", "robot"],
  look: ["backward", "forward"],
  update: ["taken", "all"],
  map: ["none", "best", "ahead"],
  rule: ["fixed", "own", ...Object.keys(RULES)],
};

const RANGES = {
  lambda: [0, 1], guard: [0, 1], reset: [0, 1], seed: [0, 2 ** 32 - 1], alpha: [0.001, 1], at: [0, 1e5], pick: [-1, 1e5],
  alpha0: [1e-5, 1], multiplier: [1.5, 40], epsilon: [0, 1], made: [0, 5e4],
};

const WHOLE = ["reset", "seed", "at", "pick", "made"];

const state = { ...USUAL };

// From an address; returns what in it could not be understood, as a sentence.
function readAddress(hash) {
  const problems = [];
  Object.assign(state, USUAL);
  for (const [name, value] of new URLSearchParams(hash.replace(/^#/, ""))) {
    if (!(name in USUAL)) problems.push(`“${name}” is not known`);
    else if (ALLOWED[name] && !ALLOWED[name].includes(value)) problems.push(`${name} cannot be “${value}”`);
    else if (RANGES[name]) {
      const [low, high] = RANGES[name];
      const number = Number(value);
      const sound = value !== "" && number >= low && number <= high && (!WHOLE.includes(name) || Number.isInteger(number));
      if (sound) state[name] = number;
      else problems.push(`${name} must be ${WHOLE.includes(name) ? "a whole number " : ""}from ${low} to ${high}, not “${value}”`);
    } else state[name] = value;
  }
  return problems.length ? `Of the address: ${problems.join("; ")}. The rest is taken.` : "";
}

function address() {
  const told = new URLSearchParams();
  for (const [name, value] of Object.entries(USUAL)) if (state[name] !== value) told.set(name, state[name]);
  return `#${told}`;
}

let addressTimer = 0;

// Soon, and not at every frame: browsers refuse more than a hundred changes in half a minute.
function noteAddress() {
  clearTimeout(addressTimer);
  addressTimer = setTimeout(() => history.replaceState(null, "", address()), 400);
}

let sound = ownRule(USUAL.own); // the last rule of one's own that could be read

// Reads it anew; returns what is wrong with it, or nothing.
function readOwn() {
  try {
    sound = ownRule(state.own);
    return "";
  } catch (error) {
    if (error instanceof RuleError) return error.message;
    throw error;
  }
}

// {rule, onZero, clip} for a learner, and its name in homing_lib's settings.
function chosenRule() {
  const guard = { onZero: state.guard, clip: Boolean(state.reset) };
  if (state.rule === "own") return { rule: sound, name: "fixed:0", ...guard };
  const name = state.rule === "fixed" ? `fixed:${state.lambda}` : state.rule;
  return { rule: parseRule(name).rule, name, ...guard };
}

const ruleName = () => ({ fixed: `fixed λ = ${short(state.lambda)}`, own: "your rule" })[state.rule] ?? FORMULAS[state.rule][0];

// What each rule is called, and says.
const FORMULAS = {
  "fixed": ["fixed λ", "the same λ at every step: TD(λ) as in the textbooks"],
  "fletcher-reeves": ["form 2", "λ = δ |φ|² / (γ δ₋ |φ₋|²), the paper’s choice (₋: of the step before)"],
  "hestenes-stiefel": ["form 1", "λ = −(δφ − δ₋φ₋)·φ / (γ (δφ − δ₋φ₋)·e₋)"],
  "hestenes-stiefel:printed": ["form 1 as printed", "form 1 without its minus, as the paper prints it"],
  "polak-ribiere": ["form 3", "λ = (δφ − δ₋φ₋)·φ / (γ δ₋ |φ₋|²)"],
  "fletcher-reeves:negated": ["form 2 negated", "form 2 with the other sign"],
  "polak-ribiere:negated": ["form 3 negated", "form 3 with the other sign"],
  "gate": ["gate", "λ = 1 while δ keeps its sign, else 0"],
  "gate:0.7": ["gate of 0.7", "λ = 0.7 while δ keeps its sign, else 0"],
  "gate:opposite": ["opposite gate", "λ = 1 where δ changes its sign, else 0"],
  "inverse": ["form 2 upside down", "λ = γ δ₋ |φ₋|² / (δ |φ|²)"],
  "absolute": ["size of form 2", "λ = |form 2|, whatever the sign"],
  "own": ["a rule of your own", "from delta, delta_prev, discount, phi, phi_prev and trace_prev; dot(phi, phi), abs, min, max, sqrt, ..."],
};
