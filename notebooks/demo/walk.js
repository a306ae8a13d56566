// The view of the walk: the trace over time, its errors and lambdas, and how wrong the values still are.

const FIXED = ["fixed:0", "fixed:0.4", "fixed:0.8", "fixed:0.9", "fixed:1"];
const WALKS = 30, FIRST = DATA.firstWalks, SEEDS = 20; // FIRST: as in the race of notebook 4

const walkView = {
  walk: null,
  played: "", // the key of the run
  known: new Map(), // errors of many seeds, by step size, number of walks and rule

  // Make the run anew, as far as it had come. The same seed takes the same way, whatever the rule.
  rebuild() {
    this.walk = new Walk(lambdaSpec(chosen()), state.alpha, state.seed);
    this.played = this.key();
    const made = state.at;
    state.at = 0;
    while (state.at < made && this.advance());
    this.compare();
    this.show();
  },

  advance() {
    const moved = this.walk.step();
    state.at += moved;
    return moved;
  },

  step() {
    state.pick = -1;
    this.advance();
    this.show();
  },

  // To the end of the walk under way, or of the next, and of more after it.
  finish(more = 1) {
    state.pick = -1;
    const wanted = this.walk.walks + more;
    while (this.walk.walks < wanted && this.advance());
    this.show();
  },

  restart() {
    Object.assign(state, { at: 0, pick: -1 });
    this.rebuild();
  },

  // After a change: the same steps of another run.
  change() {
    this.rebuild();
  },

  key: () => [chosen(), state.alpha, state.seed].join(" "),

  show() {
    refresh("w-");
    noteAddress();
  },

  get steps() {
    return this.walk.steps;
  },

  get over() {
    return this.walk.diverged;
  },

  // The step that is looked at, an index, or -1 where there is none.
  get chosen() {
    const last = this.steps.length - 1;
    return state.pick < 0 ? last : Math.min(state.pick, last);
  },

  pick(step, row = state.row) {
    state.row = row;
    const last = this.steps.length - 1;
    state.pick = step >= last ? -1 : Math.max(0, step);
    this.show();
  },

  // Many runs of these rules and of fixed ones: at this step size, then at those of a race.
  compare() {
    between("walk", "walk", this.comparing());
  },

  *comparing() {
    for (const [alpha, walks] of [[state.alpha, WALKS], ...DATA.stepSizes.map((size) => [size, FIRST])]) {
      for (let seed = 0; seed < SEEDS; seed++) {
        for (const text of new Set([...FIXED, ...kept(), chosen()])) {
          const runs = this.runs(text, alpha, walks);
          if (runs.length > seed) continue;
          const walk = new Walk(lambdaSpec(text), alpha, 1000 + seed);
          walk.finish(walks);
          runs.push(Array.from({ length: walks + 1 }, (_, k) => (walk.diverged ? Infinity : walk.errors[k])));
          refresh("w-error");
          refresh("w-best");
          yield;
        }
      }
    }
  },

  // The error before and after each walk, seed by seed, as far as that is worked out.
  runs(text, alpha, walks) {
    return remember(this.known, `${alpha} ${walks} ${text}`, () => []);
  },

  // Mean over the seeds after each walk; without a seed, of nothing.
  means(text) {
    const runs = this.runs(text, state.alpha, WALKS);
    return runs.length ? runs[0].map((_, k) => mean(runs.map((errors) => errors[k]))) : [];
  },

  // As a race measures it (notebook 4): at each of its step sizes the mean of the first walks' errors, and of the seeds.
  sweep(text) {
    return DATA.stepSizes.flatMap((alpha) => {
      const runs = this.runs(text, alpha, FIRST);
      return runs.length ? [{ alpha, error: mean(runs.map((errors) => mean(errors.slice(1)))) }] : [];
    });
  },

  // Of the walk that is shown, from 1.
  get number() {
    return this.walk.walks + this.walk.underWay;
  },

  table() {
    const named = ["state", "after", "reward", "delta", "lambda", "clipped", "ratio"];
    const columns = ["walk", "step", ...named, ...TRUE_VALUES.map((_, s) => `trace_${s}`)];
    return [columns, this.steps.map((step, t) => [this.number, t + 1, ...named.map((name) => step[name]), ...step.trace])];
  },
};

// How much of the error of step k reaches step t: the product of the lambdas after t, up to k.
function reach(steps, t, k) {
  let weight = 1;
  for (let i = t + 1; i <= k; i++) weight *= steps[i].lambda;
  return weight;
}

function paintChain(ctx, width, height) {
  const { walk, steps, chosen } = walkView, now = steps[chosen], trace = now?.trace ?? [];
  const left = 52, right = width - 12, values = [...walk.learner.weights];
  const most = Math.min(1e6, Math.max(1, ...values.map(Math.abs).filter(Number.isFinite)));
  const box = panel(ctx, {
    left, right, top: 22, bottom: height - 48, x: [-1.4, STATES + 0.4], y: [-most, most],
    yLabel: "value of a state: learnt (dots) and true (dashed)",
  });
  const blue = colour("blue-line"), points = (list) => list.map((value, s) => [box.x(s), box.y(value)]);
  curve(ctx, points(TRUE_VALUES), colour("soft"), 1.3, [6, 4]);
  curve(ctx, points(values), blue, 1.5);
  for (const point of points(values)) disc(ctx, ...point, 3.5, blue);
  const y = height - 24, radius = Math.min(12, (0.42 * (right - left)) / STATES);
  ctx.lineWidth = 1.2;
  for (let s = 0; s < STATES; s++) {
    disc(ctx, box.x(s), y, radius, Math.abs(trace[s]) > COUNTED ? traceColour(trace[s]) : colour("ground"), colour("edge"));
  }
  ctx.lineWidth = 2.5;
  disc(ctx, box.x(now ? now.after : (STATES - 1) / 2), y, radius + 3.5, null, colour("orange-line"));
  if (walk.diverged) return "The weights have left the finite numbers: this rule and step size diverge";
  if (!now) return "19 states in a row, a reward of 1 at the right end and −1 at the left: press Play, or 10 walks";
  const out = now.after < 0 ? "out at the left, reward −1" : "out at the right, reward 1";
  const where = now.reward ? out : `to state ${now.after}`;
  const number = walkView.number, said = `δ = ${short(now.delta)}, λ = ${short(now.lambda)}`;
  return `Walk ${number}, step ${chosen + 1}: from state ${now.state} ${where}; ${said}`;
}

const TRACE_TOP = 44;

function paintTrace(ctx, width, height) {
  const { steps, chosen } = walkView, axis = timeAxis(width, steps.length), { left, right, first, cell, x } = axis;
  const top = TRACE_TOP, bottom = 0.5 * height, forward = state.look === "forward";
  const rows = forward ? Math.max(24, steps.length - first) : STATES, tall = (bottom - top) / rows;
  const y = (row) => (forward ? top + row * tall : bottom - (row + 1) * tall);
  const paintCell = (k, row, value) => block(ctx, x(k) - cell / 2, y(row), cell + 0.5, tall + 0.5, traceColour(value));
  block(ctx, left, top, right - left, bottom - top, colour("ground"));
  for (let k = first; k < steps.length; k++) {
    if (forward) {
      for (let t = k, weight = 1; t >= first && weight > COUNTED; weight *= steps[t].lambda, t--) paintCell(k, t - first, weight);
    } else {
      steps[k].trace.forEach((value, s) => {
        if (Math.abs(value) <= COUNTED) return;
        paintCell(k, s, value);
        if (value > MOST && cell > 7) disc(ctx, x(k), y(s) + tall / 2, 1.6, "#222222");
      });
    }
  }
  const what = forward ? "row: a step; column: an error that changes it" : "trace of each state (row) at each step (column)";
  text(ctx, what, left, 14, { base: "bottom" });
  paintScale(ctx, left, 22);
  if (!forward) for (const s of [0, 9, 18]) text(ctx, s, left - 6, y(s) + tall / 2, { align: "right", fill: colour("soft") });
  if (chosen >= first) {
    const from = x(chosen) - cell / 2, wide = Math.max(cell, 2);
    ctx.strokeStyle = colour("orange-line");
    ctx.lineWidth = 2;
    if (forward) ctx.strokeRect(from, y(chosen - first), right - from, Math.max(tall, 3));
    else ctx.strokeRect(from, top, wide, bottom - top);
    if (!forward && state.row >= 0) ctx.strokeRect(from, y(state.row), wide, tall);
  }
  const middle = bottom + 0.5 * (height - bottom) + 12;
  stems(ctx, steps, axis, { top: bottom + 34, middle, bottom: height - 22 }, chosen);
  return traceTitle(steps, chosen, forward);
}

// The same colour for the same trace, whatever the rule: up to 1, and one more above it, and below 0.
const MOST = 1 + 1e-9;
const traceColour = (value) => (value > MOST ? "#D55E00" : value < 0 ? "#CC79A7" : cividis(value));

function paintScale(ctx, left, top) {
  const wide = 90, tall = 9, right = left + wide;
  const name = (label, x) => text(ctx, label, x, top + tall / 2, { size: 11, fill: colour("soft") });
  name("0", left);
  scaleBar(ctx, left + 11, top, wide, tall);
  name("1", right + 15);
  block(ctx, right + 36, top, 2 * tall, tall, traceColour(2));
  disc(ctx, right + 36 + tall, top + tall / 2, 1.6, "#222222");
  name("above 1", right + 59);
  if (state.reset) return;
  block(ctx, right + 118, top, 2 * tall, tall, traceColour(-1));
  name("below 0", right + 141);
}

function traceTitle(steps, chosen, forward) {
  if (chosen < 0) return forward ? "Forward: which later errors will change the state of a step" : "Backward: which states an error changes";
  const lambdas = steps.slice(1).map(({ lambda }) => lambda), step = `step ${chosen + 1}`;
  const resets = steps.slice(1).filter(({ clipped }) => clipped).length;
  const said = lambdas.length ? ` λ: ${short(mean(lambdas), 2)} on average, reset at ${resets} of ${count(lambdas.length, "step")}` : "";
  if (forward) {
    const weights = steps.slice(chosen).map((_, k) => reach(steps, chosen, chosen + k)).filter((weight) => weight > COUNTED);
    const errors = `the errors of ${count(weights.length, "step")} (weights above ${COUNTED}), ${short(sum(weights))} in all`;
    return `What is learnt of ${step} is made of ${errors}.${said}`;
  }
  const { trace } = steps[chosen], changed = trace.filter((value) => Math.abs(value) > COUNTED).length;
  const looked = state.row < 0 ? "" : `; the trace of state ${state.row} is ${short(trace[state.row])}`;
  return `The error of ${step} changes ${count(changed, "state")} (traces above ${COUNTED})${looked}.${said}`;
}

// The room that a figure of rules leaves for their names.
function ruleFrame(ctx, width, height) {
  const names = [...compared().map(({ name }) => name), "λ = 0.9"];
  return { left: 52, right: width - widest(ctx, names), top: 22, bottom: height - 42 };
}

// Curves of rules, chosen and kept ones in colours, fixed ones in grey, each named at its end. points: of a rule's text.
function paintRules(ctx, box, high, points) {
  const ends = [];
  const paint = (text, name, ink, label, ...look) => {
    const found = points(text);
    if (!found.length) return;
    curve(ctx, found.map(([x, y]) => [box.x(x), box.y(Math.min(y, 2 * high))]), ink, ...look);
    ends.push([name, box.y(Math.min(found.at(-1)[1], high)), label]);
  };
  inside(ctx, box, () => {
    for (const text of FIXED) {
      if (!compared().some((rule) => rule.text === text)) paint(text, `λ = ${text.slice(6)}`, colour("edge"), "soft", 1.2, [3, 3]);
    }
    for (const rule of compared()) {
      paint(rule.text, rule.name, colour(`${rule.paint}-line`), rule.paint, rule.text === chosen() ? 3.2 : 2.2, rule.dash);
    }
  });
  if (ends.length) labelEnds(ctx, ends, box.right + 8, 30, box.bottom);
}

// "0.154 with gate, 0.159 with form 2; 0.111 with the best fixed λ, 0.8": the chosen rule first.
function errorsSaid(errorOf, digits) {
  const said = (text) => (errorOf(text) === Infinity ? "diverges" : Number.isNaN(errorOf(text)) ? "…" : short(errorOf(text), digits));
  const best = FIXED.reduce((a, b) => (errorOf(b) < errorOf(a) ? b : a));
  const rules = compared().reverse().map(({ text, name }) => `${said(text)} with ${name}`);
  return `${rules.join(", ")}; ${said(best)} with the best fixed λ, ${best.slice(6)}`;
}

function paintErrors(ctx, width, height) {
  const axes = { x: [0, WALKS], y: [0, 0.65], xTicks: [0, 10, 20, 30], xLabel: "walks" };
  const box = panel(ctx, { ...ruleFrame(ctx, width, height), ...axes, yLabel: "error of the values (root of the mean square)" });
  paintRules(ctx, box, 0.65, (text) => walkView.means(text).map((error, k) => [k, error]));
  inside(ctx, box, () => walkView.walk.errors.slice(0, WALKS + 1).forEach((error, k) => {
    disc(ctx, box.x(k), box.y(error), 2.6, colour("ink"));
  }));
  const at = `At α = ${short(state.alpha)}`, { length } = walkView.runs(chosen(), state.alpha, WALKS);
  if (!length) return `${at}, ${WALKS} walks of many seeds: being worked out …`;
  const last = (text) => walkView.means(text)[WALKS] ?? NaN;
  return `${at}, error after ${WALKS} walks (mean of ${count(length, "seed")}): ${errorsSaid(last, 3)}`;
}

function paintBest(ctx, width, height) {
  const sizes = DATA.stepSizes, tenths = [0.2, 0.3, 0.4, 0.5, 0.6];
  const axes = { x: [0, 1], y: [0.2, 0.65], yTicks: tenths, xTicks: [0, 0.2, 0.4, 0.6, 0.8, 1], xLabel: "step size α" };
  const box = panel(ctx, { ...ruleFrame(ctx, width, height), ...axes, yLabel: `error, mean of the first ${FIRST} walks` });
  curve(ctx, [[box.x(state.alpha), box.top], [box.x(state.alpha), box.bottom]], colour("line"), 3);
  paintRules(ctx, box, 0.65, (text) => walkView.sweep(text).map(({ alpha, error }) => [alpha, error]));
  if (walkView.runs(chosen(), sizes.at(-1), FIRST).length < SEEDS) return "Each rule at its best step size: being worked out …";
  const least = (text) => Math.min(...walkView.sweep(text).map(({ error }) => error));
  return `Each at its best step size, over the first ${FIRST} walks, as in notebook 4: ${errorsSaid(least, 2)}`;
}

function setUpWalk() {
  new Chart("w-chain", 230, paintChain);
  const chart = new Chart("w-trace", 430, paintTrace), { canvas } = chart;
  new Chart("w-error", 330, paintErrors);
  new Chart("w-best", 330, paintBest);
  canvas.addEventListener("click", (event) => {
    const [width, height, x, y] = chart.measure(event), { left, first, cell } = timeAxis(width, walkView.steps.length);
    const step = first + Math.floor((x - left) / cell), bottom = 0.5 * height;
    const row = Math.floor((STATES * (bottom - y)) / (bottom - TRACE_TOP));
    if (step >= first && step < walkView.steps.length) walkView.pick(step, row >= 0 && row < STATES ? row : -1);
  });
  canvas.addEventListener("keydown", (event) => {
    const move = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (!move || walkView.chosen < 0) return;
    event.preventDefault();
    const row = Math.min(STATES - 1, Math.max(-1, state.row + move[1]));
    walkView.pick(walkView.chosen + move[0], row);
  });
}
