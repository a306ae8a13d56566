// What is chosen, all of it in the address: #rule=gate&seed=3. A name is there only where it differs from the usual.

// The rules to choose from: those of the settings, and two that hold what the reader chooses.
const OFFERED = {
  fixed: { group: "Fixed", label: "fixed λ", formula: "the same λ at every step: TD(λ) as in the textbooks" },
  ...RULES,
  own: {
    group: "Yours", label: "a rule of your own",
    formula: "from δ, δ₋, γ, φ, φ₋ and e₋, or delta, delta_prev, discount, phi, phi_prev and trace_prev; φ·φ or dot(phi, phi), abs, min, max, sqrt, ...",
  },
};

// For each its usual value and what is allowed: some words, or a number in a range. view: the only one that asks for it.
const OPTIONS = {
  view: { usual: "walk", words: ["walk", "robot"] },
  rule: { usual: "fletcher-reeves", words: Object.keys(OFFERED) },
  own: { usual: "0.7 if delta * delta_prev > 0 else 0" },
  lambda: { usual: 0.9, range: [0, 1] },
  guard: { usual: 0, range: [0, 1] }, // lambda where the rule divides by zero
  reset: { usual: 1, range: [0, 1], whole: true }, // whether a lambda outside [0, 1] is reset to the nearer bound
  with: { usual: "" }, // rules beside it, as lambdaSpec reads them; gate;fixed:0.9
  seed: { usual: 1, range: [0, 2 ** 32 - 1], whole: true },
  alpha: { view: "walk", usual: 0.1, range: [0.001, 1] },
  at: { view: "walk", usual: 0, range: [0, 1e5], whole: true }, // steps made
  look: { view: "walk", usual: "backward", words: ["backward", "forward"] },
  pick: { view: "walk", usual: -1, range: [-1, 1e5], whole: true }, // the step that is looked at; -1: the last
  row: { view: "walk", usual: -1, range: [-1, 18], whole: true }, // the state that is looked at; -1: none
  alpha0: { view: "robot", usual: DATA.settings.alpha0, range: [1e-5, 1] },
  multiplier: { view: "robot", usual: DATA.settings.multiplier, range: [1.5, 40] },
  epsilon: { view: "robot", usual: DATA.settings.epsilon0, range: [0, 1] },
  update: { view: "robot", usual: DATA.settings.update, words: ["taken", "all"] },
  map: { view: "robot", usual: "none", words: ["none", "best", "ahead"] },
  start: { view: "robot", usual: "" }, // x,y,heading
  kidnap: { view: "robot", usual: "" }, // step:x,y,heading;...
  frozen: { view: "robot", usual: "" }, // steps at which it was frozen, learnt on, was frozen ...; 900;1200
  made: { view: "robot", usual: 0, range: [0, 3e5], whole: true }, // steps made
  more: { view: "robot", usual: 0, range: [0, 100], whole: true }, // episodes after the training
  seeds: { view: "robot", usual: 0, range: [0, 100], whole: true }, // compared, from `seed` on; 0: the one that is played
};

const USUAL = Object.fromEntries(Object.entries(OPTIONS).map(([name, { usual }]) => [name, usual]));

const state = { ...USUAL };

// From an address; returns what in it could not be understood, as a sentence.
function readAddress(hash) {
  Object.assign(state, USUAL);
  readOwn();
  const named = [...new URLSearchParams(hash.replace(/^#/, ""))];
  const problems = named.map(([name, value]) => readOption(name, value)).filter(Boolean);
  return problems.length ? `Of the address: ${problems.join("; ")}. The rest is taken.` : "";
}

// Takes over one value; returns what is wrong with it, or nothing.
function readOption(name, value) {
  if (!Object.hasOwn(OPTIONS, name)) return `“${name}” is not known`;
  const { words, range, whole } = OPTIONS[name], number = Number(value);
  if (words && !words.includes(value)) return `${name} cannot be “${value}”`;
  if (range && !inRange(name, value))
    return `${name} must be ${whole ? "a whole number " : ""}from ${range[0]} to ${range[1]}, not “${value}”`;
  if (name === "with") return readRules(value.split(";"));
  state[name] = range ? number : value;
  return "";
}

function inRange(name, value) {
  const { range: [low, high], whole } = OPTIONS[name], number = Number(value);
  return value !== "" && number >= low && number <= high && (!whole || Number.isInteger(number));
}

function readRules(texts) {
  const problems = texts.map((text) => problemOf(() => lambdaSpec(text)));
  state.with = texts.filter((_, k) => !problems[k]).slice(-KEPT).join(";");
  return problems.filter(Boolean).map((problem) => `with: ${problem}`).join("; ");
}

// What is thrown, as a sentence, or nothing.
function problemOf(act) {
  try {
    act();
    return "";
  } catch (error) {
    return error.message;
  }
}

// What leads back here: of a rule of one's own the one at work, not what is being typed.
function address() {
  const named = new URLSearchParams();
  for (const [name, { usual, view = state.view }] of Object.entries(OPTIONS)) {
    const value = name === "own" ? sound : state[name];
    const idle = (name === "own" && state.rule !== "own") || (name === "lambda" && state.rule !== "fixed");
    if (value !== usual && view === state.view && !idle) named.set(name, value);
  }
  return `#${named}`;
}

let addressTimer = 0;

// Soon, and not at every frame: browsers refuse more than a hundred changes in half a minute.
function noteAddress() {
  clearTimeout(addressTimer);
  addressTimer = setTimeout(() => history.replaceState(null, "", address()), 400);
}

let sound = USUAL.own; // the last rule of one's own that could be read

// Reads it anew; returns what is wrong with it, or nothing.
function readOwn() {
  const problem = problemOf(() => ownRule(state.own));
  if (!problem) sound = state.own;
  return problem;
}

// The rule that is chosen, with its options, as lambdaSpec reads it.
function chosen() {
  const options = `${state.guard ? `:on_zero=${state.guard}` : ""}${state.reset ? "" : ":unclipped"}`;
  return { own: `own${options}:${sound}`, fixed: `fixed:${state.lambda}${options}` }[state.rule] ?? state.rule + options;
}

// The rules beside it, the longest kept first.
const KEPT = 3;
const kept = () => state.with.split(";").filter((text) => text && text !== chosen());

// Keep the rule that was chosen until now beside the one that is.
function keep(text) {
  const rules = [...kept().filter((other) => other !== text), text].filter((other) => other !== chosen());
  state.with = rules.slice(-KEPT).join(";");
}

// All of them, the chosen one last, and with it what draws each, in the order in which they came.
const PAINTS = [["blue", []], ["orange", [7, 3]], ["green", [3, 3]], ["pink", [9, 3, 2, 3]]];
const compared = () => [...kept(), chosen()].map((text, k) => ({ text, name: nameOf(text), paint: PAINTS[k][0], dash: PAINTS[k][1] }));

function nameOf(text) {
  const { name, own, onZero, clip } = lambdaSpec(text);
  const options = `${onZero ? `, guard ${short(onZero)}` : ""}${clip ? "" : ", no reset"}`;
  if (name.startsWith("fixed:")) return `fixed λ = ${short(Number(name.slice(6)))}${options}`;
  if (name !== "own") return OFFERED[name].label + options;
  if (text === chosen()) return (state.own === sound ? "your rule" : "your last readable rule") + options;
  return (own.length > 18 ? `${own.slice(0, 17)}…` : own) + options;
}
