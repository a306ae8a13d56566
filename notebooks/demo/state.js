// What is chosen, all of it in the address: #rule=gate&seed=3. A name is there only where it differs from the usual.

const USUAL = {
  view: "walk",
  rule: "fletcher-reeves",
  own: "0.7 if delta * delta_prev > 0 else 0",
  lambda: 0.9,
  guard: 0, // lambda where the rule divides by zero
  reset: 1, // whether a lambda outside [0, 1] is reset to the nearer bound
  with: "", // rules beside it, as compare.js writes them; gate;fixed:0.9
  seed: 1,
  // the walk
  alpha: 0.1,
  at: 0, // steps made
  look: "backward",
  pick: -1, // the step that is looked at; -1: the last
  row: -1, // the state that is looked at; -1: none
  // the robot
  alpha0: DATA.settings.alpha0,
  multiplier: DATA.settings.multiplier,
  epsilon: DATA.settings.epsilon0,
  update: DATA.settings.update,
  map: "none",
  start: "", // x,y,heading
  kidnap: "", // step:x,y,heading;...
  frozen: "", // steps at which it was frozen, learnt on, was frozen ...; 900;1200
  made: 0, // steps made
  more: 0, // episodes after the training
  seeds: 0, // how many, from `seed` on, are compared; 0: the one that is played
};

// What only one view asks for; the other's is not in the address.
const ONLY = {
  walk: ["alpha", "at", "look", "pick", "row"],
  robot: ["alpha0", "multiplier", "epsilon", "update", "map", "start", "kidnap", "frozen", "made", "more", "seeds"],
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
  row: [-1, 18], alpha0: [1e-5, 1], multiplier: [1.5, 40], epsilon: [0, 1], made: [0, 3e5], more: [0, 100], seeds: [0, 100],
};

const WHOLE = ["reset", "seed", "at", "pick", "row", "made", "more", "seeds"];

const state = { ...USUAL };

// From an address; returns what in it could not be understood, as a sentence.
function readAddress(hash) {
  const problems = [];
  Object.assign(state, USUAL);
  readOwn();
  for (const [name, value] of new URLSearchParams(hash.replace(/^#/, ""))) {
    if (!(name in USUAL)) problems.push(`“${name}” is not known`);
    else if (ALLOWED[name] && !ALLOWED[name].includes(value)) problems.push(`${name} cannot be “${value}”`);
    else if (RANGES[name]) {
      const [low, high] = RANGES[name];
      const number = Number(value);
      const sound = value !== "" && number >= low && number <= high && (!WHOLE.includes(name) || Number.isInteger(number));
      if (sound) state[name] = number;
      else problems.push(`${name} must be ${WHOLE.includes(name) ? "a whole number " : ""}from ${low} to ${high}, not “${value}”`);
    } else if (name === "with") state.with = value.split(";").filter((text) => readable(text, problems)).slice(-KEPT).join(";");
    else state[name] = value;
  }
  return problems.length ? `Of the address: ${problems.join("; ")}. The rest is taken.` : "";
}

function readable(text, problems) {
  try {
    return ruleOf(text);
  } catch (error) {
    problems.push(`with: ${error.message}`);
  }
}

// What leads back here: of a rule of one's own the one at work, not what is being typed.
function address() {
  const told = new URLSearchParams();
  const idle = [...ONLY[state.view === "walk" ? "robot" : "walk"]];
  if (state.rule !== "own") idle.push("own");
  if (state.rule !== "fixed") idle.push("lambda");
  for (const [name, usual] of Object.entries(USUAL)) {
    const value = name === "own" ? sound : state[name];
    if (value !== usual && !idle.includes(name)) told.set(name, value);
  }
  return `#${told}`;
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
  try {
    ownRule(state.own);
    sound = state.own;
    return "";
  } catch (error) {
    if (error instanceof RuleError) return error.message;
    throw error;
  }
}

// The rule that is chosen, with its options, as ruleOf reads it.
function chosen() {
  const options = `${state.guard ? `:on_zero=${state.guard}` : ""}${state.reset ? "" : ":unclipped"}`;
  return { own: `own${options}:${sound}`, fixed: `fixed:${state.lambda}${options}` }[state.rule] ?? state.rule + options;
}

// The rules beside it, the longest kept first.
const KEPT = 3;
const kept = () => state.with.split(";").filter((text) => text && text !== chosen());

// Keep the rule that was chosen until now beside the one that is.
function keep(text) {
  state.with = [...kept().filter((other) => other !== text), ...(text === chosen() ? [] : [text])].slice(-KEPT).join(";");
}

// All of them, the chosen one last, and with it what draws each, in the order in which they came.
const PAINTS = [["blue", []], ["orange", [7, 3]], ["green", [3, 3]], ["pink", [9, 3, 2, 3]]];
const compared = () => [...kept(), chosen()].map((text, i) => ({ text, name: nameOf(text), paint: PAINTS[i][0], dash: PAINTS[i][1] }));

function nameOf(text) {
  const { name, own, onZero, clip } = ruleOf(text);
  const unread = state.own === sound ? "your rule" : "your last readable rule";
  const typed = own && (own.length > 18 ? `${own.slice(0, 17)}…` : own);
  const bare = own !== undefined ? (text === chosen() ? unread : typed) : FORMULAS[name]?.[0] ?? `fixed λ = ${short(Number(name.slice(6)))}`;
  return `${bare}${onZero ? `, guard ${short(onZero)}` : ""}${clip ? "" : ", no reset"}`;
}

const ruleName = () => nameOf(chosen());

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
  "inverse": ["inverse", "λ = γ δ₋ |φ₋|² / (δ |φ|²): form 2 upside down"],
  "absolute": ["absolute", "λ = |form 2|: its size, whatever the sign"],
  "own": ["a rule of your own", "from δ, δ₋, γ, φ, φ₋ and e₋, or delta, delta_prev, discount, phi, phi_prev and trace_prev; φ·φ or dot(phi, phi), abs, min, max, sqrt, ..."],
};
