// Controls, keys, address, light and dark: everything that ties the two views together.

const at = (id) => document.getElementById(id);
const views = { walk: walkView, robot: robotView };
const view = () => views[state.view];

function say(words) {
  at("message").textContent = words;
}

// --- Playing --------------------------------------------------------------------------------------------------------

const player = {
  mode: null, // "play", "rush" or null
  last: 0,

  toggle() {
    if (this.mode) return this.pause();
    if (state.view === "robot" && robotView.world) robotView.goOn();
    this.run("play");
  },

  // All that is left of the run, as fast as the machine can, a frame at a time.
  rush() {
    if (robotView.experiment?.done) return say("The training is over: Play goes on with what was learnt, Restart begins anew.");
    this.run("rush");
  },

  run(mode) {
    if (state.view === "robot" && !robotView.world) return;
    say("");
    this.mode = mode;
    this.last = 0;
    this.tell();
    requestAnimationFrame((time) => this.frame(time));
  },

  pause() {
    this.mode = null;
    this.tell();
  },

  tell() {
    for (const name of ["walk-play", "robot-play"]) at(name).textContent = this.mode ? "Pause" : "Play";
  },

  frame(time) {
    if (!this.mode) return;
    if (this.mode === "rush") {
      const until = performance.now() + 12;
      while (performance.now() < until && robotView.advance());
      robotView.show();
    } else if (time - this.last >= 125) {
      this.last = time;
      view().step();
    }
    const over = state.view === "robot" ? robotView.experiment.done : walkView.lost;
    if (over) return this.pause();
    requestAnimationFrame((next) => this.frame(next));
  },
};

// --- Controls -------------------------------------------------------------------------------------------------------

const SLIDERS = ["lambda", "guard", "alpha", "alpha0", "epsilon", "multiplier"];

function fillRules() {
  const groups = {
    "Fixed": ["fixed"],
    "Conjugate, eq. (7)": ["fletcher-reeves", "hestenes-stiefel", "polak-ribiere"],
    "With another sign": ["hestenes-stiefel:printed", "fletcher-reeves:negated", "polak-ribiere:negated"],
    "What form 2 is made of": ["gate", "gate:0.7", "gate:opposite", "inverse", "absolute"],
    "Yours": ["own"],
  };
  for (const [label, names] of Object.entries(groups)) {
    const group = document.createElement("optgroup");
    group.label = label;
    for (const name of names) group.append(new Option(FORMULAS[name][0], name));
    at("rule").append(group);
  }
}

// Controls, and what is said beside them, as the state is.
function showControls() {
  for (const button of document.querySelectorAll("nav button")) {
    if (button.dataset.view === state.view) button.setAttribute("aria-current", "page");
    else button.removeAttribute("aria-current");
  }
  for (const name of ["walk", "robot"]) {
    at(name).hidden = state.view !== name;
    for (const part of document.querySelectorAll(`[data-for="${name}"]`)) part.hidden = state.view !== name;
  }
  for (const name of ["rule", "update", "map", "seed"]) at(name).value = state[name];
  if (document.activeElement !== at("own")) at("own").value = state.own;
  at("own-field").hidden = state.rule !== "own";
  at("lambda-field").hidden = state.rule !== "fixed";
  at("formula").textContent = FORMULAS[state.rule][1];
  showKept();
  at("reset").checked = Boolean(state.reset);
  for (const name of SLIDERS) {
    const slider = at(name), value = state[name];
    slider.value = slider.dataset.log === undefined ? value : Math.log10(value);
    const told = name === "multiplier" ? `${stoppingThresholds(value).upper.toFixed(3)}` : short(value);
    document.querySelector(`output[for="${name}"]`).textContent = told;
    slider.setAttribute("aria-valuetext", told);
  }
  for (const radio of document.querySelectorAll("input[name=look]")) radio.checked = radio.value === state.look;
}

// The rules beside the chosen one, each with a button that drops it.
function showKept() {
  const told = [state.with, chosen()].join(" ");
  if (at("kept").dataset.told === told) return;
  at("kept").dataset.told = told;
  at("kept").hidden = !kept().length;
  at("kept").replaceChildren("Beside it: ", ...kept().map((text) => {
    const name = nameOf(text), button = Object.assign(document.createElement("button"), { type: "button", textContent: `${name} ×` });
    button.setAttribute("aria-label", `Drop ${name}`);
    button.addEventListener("click", () => {
      state.with = kept().filter((other) => other !== text).join(";");
      changed("with");
    });
    return button;
  }));
}

// What a change touches is made anew; a drawing alone is only painted. Some settings are one view's alone.
function changed(name) {
  showControls();
  if (name === "with") {
    walkView.compare();
    if (robotView.experiment) robotView.compare();
  }
  if (["look", "map", "with"].includes(name)) {
    refreshAll();
    return noteAddress();
  }
  const problem = state.rule === "own" ? readOwn() : "";
  at("own-error").textContent = problem && `${problem} Until then “${sound}” is at work.`;
  at("own-remark").textContent = state.rule === "own" && !problem && neverDefined(ruleOf(chosen()).rule) ? "It divides by zero, always: λ is the guard’s, below." : "";
  if (problem && name === "own") {
    refreshAll();
    return player.pause();
  }
  showKept();
  if (name !== "view") {
    const own = { alpha: "walk", alpha0: "robot", epsilon: "robot", multiplier: "robot", update: "robot" }[name];
    if (own === "robot") state.seeds = 0;
    for (const other of ["walk", "robot"]) if (!own || own === other) stale.add(other);
  }
  freshen();
}

const stale = new Set(["walk", "robot"]);
const fresh = new Set(); // views that have had a run

// A view that is not seen waits until it is.
function freshen() {
  if (stale.has(state.view) && (state.view === "walk" || robotView.world)) {
    stale.delete(state.view);
    if (state.view === "robot" && fresh.has("robot")) robotView.change();
    else view().rebuild();
    fresh.add(state.view);
  }
  refreshAll();
  noteAddress();
}

const fileName = () => `homing-${state.view}-${state.rule.replaceAll(":", "-")}-seed-${state.seed}`;

function setUpControls() {
  fillRules();
  at("controls").addEventListener("submit", (event) => event.preventDefault());
  for (const button of document.querySelectorAll("nav button")) {
    button.addEventListener("click", () => {
      player.pause();
      say("");
      state.view = button.dataset.view;
      changed("view");
    });
  }
  for (const name of ["rule", "update", "map"]) at(name).addEventListener("change", () => {
    const before = chosen();
    state[name] = at(name).value;
    keep(before);
    changed(name);
    if (name === "rule" && state.rule === "own") at("own").focus();
  });
  let typing = 0;
  at("own").addEventListener("input", () => {
    state.own = at("own").value.replace(/\s+/g, " ");
    clearTimeout(typing);
    typing = setTimeout(() => changed("own"), 350);
  });
  at("reset").addEventListener("change", () => {
    const before = chosen();
    state.reset = Number(at("reset").checked);
    keep(before);
    changed("reset");
  });
  for (const radio of document.querySelectorAll("input[name=look]")) radio.addEventListener("change", () => {
    state.look = radio.value;
    changed("look");
  });
  for (const name of SLIDERS) {
    const slider = at(name);
    let soon = 0;
    slider.addEventListener("input", () => {
      const value = Number(slider.value);
      state[name] = Number((slider.dataset.log === undefined ? value : 10 ** value).toPrecision(3));
      showControls();
      clearTimeout(soon);
      soon = setTimeout(() => changed(name), 120);
    });
  }
  at("seed").addEventListener("change", () => {
    const seed = Number(at("seed").value), [low, high] = RANGES.seed;
    if (at("seed").value === "" || !Number.isInteger(seed) || seed < low || seed > high) return say(`A seed is a whole number from ${low} to ${high}.`);
    say("");
    state.seed = seed;
    changed("seed");
  });
  const press = (id, act) => at(id).addEventListener("click", () => {
    say("");
    act();
  });
  press("walk-play", () => player.toggle());
  press("robot-play", () => player.toggle());
  const paused = (act) => () => {
    player.pause();
    act();
  };
  press("walk-step", paused(() => walkView.step()));
  press("robot-step", paused(() => robotView.step()));
  press("walk-one", paused(() => walkView.finish()));
  press("walk-ten", paused(() => walkView.finish(10)));
  press("robot-one", paused(() => robotView.finish()));
  press("robot-all", () => player.rush());
  press("robot-seeds", paused(() => robotView.seeds()));
  press("robot-home", paused(() => {
    Object.assign(state, { start: "", seeds: 0 });
    robotView.change();
  }));
  at("frozen").addEventListener("change", () => robotView.freeze());
  press("robot-kidnap", paused(() => robotView.kidnap()));
  press("walk-again", paused(() => walkView.restart()));
  press("robot-again", paused(() => robotView.restart()));
  press("save-picture", () => savePicture(state.view, `${fileName()}.png`));
  press("save-data", () => saveTable(`${fileName()}.csv`, ...view().table()));
  press("theme", () => paintTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark"));
  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches("input:not([type=range], [type=checkbox], [type=radio]), textarea, select")) return;
    const keys = {
      " ": () => player.toggle(),
      "s": paused(() => view().step()),
      "e": paused(() => view().finish()),
      "r": paused(() => view().restart()),
    };
    if (!keys[event.key] || (event.key === " " && event.target.matches("button, input"))) return;
    event.preventDefault();
    keys[event.key]();
  });
  addEventListener("hashchange", () => location.hash !== address() && openAddress());
}

function paintTheme(name) {
  document.documentElement.dataset.theme = name;
  at("theme").textContent = name === "dark" ? "Light" : "Dark";
  refreshAll();
}

// --- Beginning ------------------------------------------------------------------------------------------------------

function showClaims() {
  for (const [name, findings] of Object.entries(DATA.claims)) {
    const list = document.createElement("dl");
    for (const { claim, verdict } of findings) {
      const item = document.createElement("div");
      const said = `${verdict[0].toUpperCase()}${verdict.slice(1)}.`;
      item.append(Object.assign(document.createElement("dt"), { textContent: claim }), Object.assign(document.createElement("dd"), { textContent: said }));
      list.append(item);
    }
    const head = Object.assign(document.createElement("h2"), { textContent: "What this view is about, and what the stored runs say" });
    at(`${name}-claims`).append(head, list);
  }
}

function openAddress() {
  player.pause();
  say(readAddress(location.hash));
  stale.add("walk").add("robot");
  fresh.clear();
  changed("view");
}

// Of an element that holds them in base 64: last in the page, so that it is painted before they are read.
function bytesOf(id) {
  const letters = atob(at(id).textContent), bytes = new Uint8Array(letters.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = letters.charCodeAt(i);
  return bytes;
}

async function unpack() {
  const stream = new Blob([bytesOf("atlas")]).stream().pipeThrough(new DecompressionStream("gzip"));
  robotView.world = new Atlas(new Uint8Array(await new Response(stream).arrayBuffer()));
  robotView.camera = new Camera(DATA.room, bytesOf("textures"), DATA.side, DATA.settings);
  freshen();
}

setUpWalk();
setUpRobot();
setUpControls();
showClaims();
paintTheme(matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
openAddress();
addEventListener("DOMContentLoaded", () => setTimeout(() => {
  unpack().catch((error) => say(`The table of views cannot be unpacked by this browser (${error.message}); a newer one can.`));
}, 50));
