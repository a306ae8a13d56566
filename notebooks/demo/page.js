// Controls, keys, address, light and dark: everything that ties the two views together.

const at = (id) => document.getElementById(id);
const view = () => ({ walk: walkView, robot: robotView })[state.view];

function say(words) {
  at("message").textContent = words;
}

// --- Controls -------------------------------------------------------------------------------------------------------

const SLIDERS = ["lambda", "guard", "alpha", "alpha0", "epsilon", "multiplier"];

// Controls, and what is said beside them, as the state is.
function showControls() {
  for (const button of document.querySelectorAll("nav button")) {
    button.setAttribute("aria-current", button.dataset.view === state.view ? "page" : "false");
  }
  for (const part of document.querySelectorAll("[data-for]")) part.hidden = part.dataset.for !== state.view;
  for (const name of ["rule", "update", "map", "seed"]) at(name).value = state[name];
  if (document.activeElement !== at("own")) at("own").value = state.own;
  at("own-field").hidden = state.rule !== "own";
  at("lambda-field").hidden = state.rule !== "fixed";
  at("formula").textContent = OFFERED[state.rule].formula;
  showKept();
  at("reset").checked = Boolean(state.reset);
  for (const name of SLIDERS) {
    const slider = at(name), value = state[name];
    slider.value = "log" in slider.dataset ? Math.log10(value) : value;
    const shown = name === "multiplier" ? stoppingThresholds(value).upper.toFixed(3) : short(value);
    document.querySelector(`output[for="${name}"]`).textContent = shown;
    slider.setAttribute("aria-valuetext", shown);
  }
  for (const radio of document.querySelectorAll("input[name=look]")) radio.checked = radio.value === state.look;
}

// The rules beside the chosen one, each with a button that drops it.
function showKept() {
  const rules = [state.with, chosen()].join(" ");
  if (at("kept").dataset.rules === rules) return; // a button that is about to be pressed stays
  at("kept").dataset.rules = rules;
  at("kept").hidden = !kept().length;
  at("kept").replaceChildren("Beside it: ", ...kept().map((text) => {
    const name = nameOf(text), button = Object.assign(element("button", `${name} ×`), { type: "button" });
    button.setAttribute("aria-label", `Drop ${name}`);
    button.addEventListener("click", () => {
      state.with = kept().filter((other) => other !== text).join(";");
      changed();
    });
    return button;
  }));
}

// After any change: what is said beside the controls, and the run that is seen, anew if it is no longer the one chosen.
function changed() {
  const own = state.rule === "own", problem = own ? readOwn() : "";
  at("own-error").textContent = problem && `${problem} Until then “${sound}” is at work.`;
  at("own-remark").textContent = own && !problem && neverDefined(ownRule(sound)) ? "It divides by zero, always: λ is the guard’s, below." : "";
  showControls();
  const shown = view();
  if (!shown.played) shown.rebuild();
  else if (shown.played !== shown.key()) shown.change();
  else shown.compare();
  refresh();
  noteAddress();
}

const paused = (act) => () => {
  player.pause();
  act();
};

// What the buttons and the keys do.
const ACTS = {
  play: () => player.toggle(),
  rush: () => player.rush(),
  step: paused(() => view().step()),
  finish: paused(() => view().finish()),
  ten: paused(() => walkView.finish(10)),
  seeds: paused(() => robotView.seeds()),
  kidnap: () => robotView.kidnap(),
  restart: paused(() => view().restart()),
  home: paused(() => {
    state.start = "";
    changed();
  }),
  data: () => saveTable(`homing-${state.view}-${state.rule.replaceAll(":", "-")}-seed-${state.seed}.csv`, ...view().table()),
  theme: () => paintTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark"),
};
const KEYS = { " ": "play", "s": "step", "e": "finish", "r": "restart" };

function setUpControls() {
  const on = (selector, type, act) => {
    for (const node of document.querySelectorAll(selector)) node.addEventListener(type, (event) => act(node, event));
  };
  // After the last of some changes in quick succession.
  let timer = 0;
  const soon = (milliseconds) => {
    clearTimeout(timer);
    timer = setTimeout(changed, milliseconds);
  };
  const choose = (name, value) => {
    const before = chosen();
    state[name] = value;
    keep(before);
    changed();
  };
  on("#controls", "submit", (_, event) => event.preventDefault());
  on("nav button", "click", (button) => {
    player.pause();
    say("");
    state.view = button.dataset.view;
    changed();
  });
  on("[data-act]", "click", (button) => {
    say("");
    ACTS[button.dataset.act]();
  });
  on("#rule, #update, #map", "change", ({ id, value }) => {
    choose(id, value);
    if (value === "own") at("own").focus();
  });
  on("#reset", "change", ({ checked }) => choose("reset", Number(checked)));
  on("#frozen", "change", () => robotView.freeze());
  on("input[name=look]", "change", ({ value }) => choose("look", value));
  on("#own", "input", ({ value }) => {
    state.own = value.replace(/\s+/g, " ");
    soon(350);
  });
  for (const name of SLIDERS) {
    on(`#${name}`, "input", ({ value, dataset }) => {
      state[name] = Number(("log" in dataset ? 10 ** value : Number(value)).toPrecision(3));
      showControls();
      soon(120);
    });
  }
  on("#seed", "change", ({ value }) => {
    if (!inRange("seed", value)) return say(`A seed is a whole number from ${OPTIONS.seed.range.join(" to ")}.`);
    say("");
    choose("seed", Number(value));
  });
  addEventListener("keydown", (event) => {
    const { key, target } = event, typing = "input:not([type=range], [type=checkbox], [type=radio]), textarea, select";
    if (event.ctrlKey || event.metaKey || event.altKey || target.matches(typing)) return;
    if (!Object.hasOwn(KEYS, key) || (key === " " && target.matches("button, input"))) return;
    event.preventDefault();
    ACTS[KEYS[key]]();
  });
  addEventListener("hashchange", () => location.hash !== address() && openAddress());
}

function saveTable(name, columns, rows) {
  const cell = (value) => (typeof value === "boolean" ? +value : value ?? "");
  const table = [columns, ...rows].map((row) => row.map(cell).join(","));
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([`# ${address()}\n`, table.join("\n"), "\n"], { type: "text/csv" }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

function paintTheme(name) {
  document.documentElement.dataset.theme = name;
  at("theme").textContent = name === "dark" ? "Light" : "Dark";
  refresh();
}

// --- Beginning ------------------------------------------------------------------------------------------------------

function element(tag, textContent) {
  return Object.assign(document.createElement(tag), { textContent });
}

// The select of rules, in their groups.
function offerRules() {
  for (const [name, { group, label }] of Object.entries(OFFERED)) {
    if (at("rule").lastElementChild?.label !== group) at("rule").append(Object.assign(element("optgroup"), { label: group }));
    at("rule").lastElementChild.append(new Option(label, name));
  }
}

function showClaims() {
  for (const [name, findings] of Object.entries(DATA.claims)) {
    const list = element("dl");
    for (const { claim, verdict, beside } of findings) {
      const item = element("div");
      item.append(element("dt", claim), element("dd", `${verdict[0].toUpperCase()}${verdict.slice(1)}${beside}.`));
      list.append(item);
    }
    at(`${name}-claims`).append(element("summary", "What this view is about, and what the stored runs say"), list);
  }
}

function openAddress() {
  player.pause();
  say(readAddress(location.hash));
  walkView.played = robotView.played = "";
  changed();
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
  changed();
}

setUpWalk();
setUpRoom();
new Chart("r-view", 430, paintView);
new Chart("r-curve", 400, paintCurve);
new Chart("r-steps", 400, paintSteps);
offerRules();
setUpControls();
at("settings").open = !matchMedia("(max-width: 60rem)").matches; // on a phone the picture comes first
showClaims();
paintTheme(matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
openAddress();
addEventListener("DOMContentLoaded", () => setTimeout(() => {
  unpack().catch((error) => say(`The table of views cannot be unpacked by this browser (${error.message}); a newer one can.`));
}, 50));
