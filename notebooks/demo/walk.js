// The view of the walk: the trace over time, its errors and lambdas, and how wrong the values still are.

const FIXED = ["fixed:0", "fixed:0.4", "fixed:0.8", "fixed:0.9", "fixed:1"];
const WALKS = 30, FIRST = DATA.firstWalks, SEEDS = 20; // FIRST: as in the stored study

const walkView = {
  walk: null,
  errors: [], // after each walk of this run
  known: new Map(), // errors of many seeds

  settings({ rule, onZero, clip }, seed = state.seed) {
    return { rule, onZero, clip, stepSize: state.alpha, seed };
  },

  // Make the run anew, as far as it had come. The same seed takes the same way, whatever the rule.
  rebuild() {
    this.walk = new Walk(this.settings(ruleOf(chosen())));
    this.errors = [];
    this.lost = false;
    const made = state.at;
    state.at = 0;
    while (state.at < made && !this.lost) this.advance();
    this.compare();
    this.show();
  },

  advance() {
    if (this.lost) return;
    const before = this.walk.walks;
    try {
      this.walk.step();
    } catch (error) {
      if (!(error instanceof Diverged)) throw error;
      this.lost = true;
      return;
    }
    state.at++;
    if (this.walk.walks > before) this.errors.push(this.walk.error);
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
    while (this.walk.walks < wanted && !this.lost) this.advance();
    this.show();
  },

  restart() {
    Object.assign(state, { at: 0, pick: -1 });
    this.rebuild();
  },

  show() {
    for (const chart of ["chain", "trace", "error", "best"]) this[chart].refresh();
    noteAddress();
  },

  get steps() {
    return this.walk.steps ?? [];
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

  // Many runs of these rules and of fixed ones: at this step size, then at those of the stored study.
  compare() {
    between("walk", "walk", this.comparing());
  },

  *comparing() {
    for (const [alpha, walks] of [[state.alpha, WALKS], ...DATA.stepSizes.map((size) => [size, FIRST])]) {
      for (let seed = 0; seed < SEEDS; seed++) {
        for (const text of new Set([...FIXED, ...kept(), chosen()])) {
          const runs = this.runs(text, alpha, walks);
          if (runs.length > seed) continue;
          runs.push(this.errorsOf(ruleOf(text), alpha, walks, 1000 + seed));
          this.error.refresh();
          this.best.refresh();
          yield;
        }
      }
    }
  },

  // The error before and after each walk, seed by seed, as far as that is worked out.
  runs(text, alpha, walks) {
    const key = `${alpha} ${walks} ${text}`;
    if (!this.known.has(key)) this.known.set(key, []);
    return this.known.get(key);
  },

  errorsOf(rule, alpha, walks, seed) {
    const walk = new Walk({ ...this.settings(rule, seed), stepSize: alpha }), errors = [walk.error];
    try {
      for (let k = 0; k < walks; k++) {
        walk.walk();
        errors.push(walk.error);
      }
    } catch (error) {
      if (!(error instanceof Diverged)) throw error;
      errors.fill(Infinity);
      while (errors.length <= walks) errors.push(Infinity);
    }
    return errors;
  },

  // Mean over the seeds after each walk; without a seed, of nothing.
  means(text) {
    const runs = this.runs(text, state.alpha, WALKS);
    return runs.length ? runs[0].map((_, k) => sum(runs.map((errors) => errors[k])) / runs.length) : [];
  },

  // As the stored study measures it: at each of its step sizes the mean of the first walks' errors, and of the seeds.
  sweep(text) {
    return DATA.stepSizes.flatMap((alpha) => {
      const runs = this.runs(text, alpha, FIRST);
      return runs.length ? [{ alpha, error: sum(runs.map((errors) => sum(errors.slice(1)) / FIRST)) / runs.length }] : [];
    });
  },

  table() {
    const columns = ["walk", "step", "state", "after", "reward", "delta", "lambda", "reset", "ratio", ...TRUE_VALUES.map((_, i) => `trace_${i}`)];
    const number = this.walk.walks + +this.walk.underWay;
    return [columns, this.steps.map((s, t) => [number, t + 1, s.state, s.after, s.reward, s.delta, s.lambda, s.clipped, s.ratio, ...s.trace])];
  },
};

// Columns of the figures over time: as many of the last steps as fit.
function timeAxis(width, total) {
  const u = unit(), left = 52 * u, right = width - 12 * u;
  const shown = Math.min(total, Math.floor((right - left) / (5 * u)));
  const first = total - shown;
  const cell = (right - left) / Math.max(shown, 24);
  return { left, right, first, cell, x: (t) => left + (t - first + 0.5) * cell };
}

// How much of the error of step k reaches step t: the product of the lambdas after t, up to k.
function reach(steps, t, k) {
  let weight = 1;
  for (let i = t + 1; i <= k; i++) weight *= steps[i].lambda;
  return weight;
}

function paintChain(ctx, width, height) {
  const u = unit(), { learner } = walkView.walk, steps = walkView.steps;
  const left = 52 * u, right = width - 12 * u, t = walkView.chosen;
  const values = [...learner.weights];
  const most = Math.min(1e6, Math.max(1, ...values.map(Math.abs).filter(Number.isFinite)));
  const box = panel(ctx, { left, right, top: 22 * u, bottom: height - 48 * u, x: [-1.4, STATES + 0.4], y: [-most, most], yLabel: "value of a state: learnt (dots) and true (dashed)" });
  curve(ctx, TRUE_VALUES.map((value, s) => [box.x(s), box.y(value)]), colour("soft"), 1.3, [6, 4]);
  curve(ctx, values.map((value, s) => [box.x(s), box.y(value)]), colour("blue-line"), 1.5);
  values.forEach((value, s) => disc(ctx, box.x(s), box.y(value), 3.5 * u, colour("blue-line")));
  const y = height - 24 * u, radius = Math.min(12 * u, (0.42 * (right - left)) / STATES);
  const trace = t < 0 ? null : steps[t].trace;
  ctx.lineWidth = 1.2 * u;
  for (let s = 0; s < STATES; s++) {
    disc(ctx, box.x(s), y, radius, trace && Math.abs(trace[s]) > 1e-3 ? traceColour(trace[s]) : colour("ground"), colour("edge"));
  }
  const at = t < 0 ? (STATES - 1) / 2 : steps[t].after;
  ctx.lineWidth = 2.5 * u;
  disc(ctx, box.x(at), y, radius + 3.5 * u, null, colour("orange-line"));
  const now = t < 0 ? null : steps[t];
  const where = !now ? "" : now.after < 0 ? "out at the left, reward −1" : now.after >= STATES ? "out at the right, reward 1" : `to state ${now.after}`;
  title("w-chain", walkView.lost
    ? "The weights have left the finite numbers: this rule and step size diverge"
    : now ? `Walk ${walkView.walk.walks + +walkView.walk.underWay}, step ${t + 1}: from state ${now.state} ${where}; δ = ${short(now.delta)}, λ = ${short(now.lambda)}`
      : "19 states in a row, a reward of 1 at the right end and −1 at the left: press Play, or 10 walks");
}

function paintTrace(ctx, width, height) {
  const u = unit(), steps = walkView.steps, chosen = walkView.chosen;
  const { left, right, first, cell, x } = timeAxis(width, steps.length);
  const top = 44 * u, bottom = 0.5 * height, forward = state.look === "forward";
  const rows = forward ? Math.max(24, steps.length - first) : STATES;
  const tall = (bottom - top) / rows;
  const y = (row) => (forward ? top + row * tall : bottom - (row + 1) * tall);
  ctx.fillStyle = colour("ground");
  ctx.fillRect(left, top, right - left, bottom - top);
  for (let k = first; k < steps.length; k++) {
    if (forward) {
      for (let t = k, weight = 1; t >= first && weight > 1e-3; weight *= steps[t].lambda, t--) {
        ctx.fillStyle = traceColour(weight);
        ctx.fillRect(x(k) - cell / 2, y(t - first), cell + 0.5, tall + 0.5);
      }
    } else {
      steps[k].trace.forEach((value, s) => {
        if (Math.abs(value) < 1e-3) return;
        ctx.fillStyle = traceColour(value);
        ctx.fillRect(x(k) - cell / 2, y(s), cell + 0.5, tall + 0.5);
        if (value > MOST && cell > 7) disc(ctx, x(k), y(s) + tall / 2, 1.6 * u, "#222222");
      });
    }
  }
  text(ctx, forward ? "row: a step; column: an error that changes it" : "trace of each state (row) at each step (column)", left, 14 * u, { base: "bottom" });
  paintScale(ctx, left, 22 * u, u);
  if (!forward) [0, 9, 18].forEach((s) => text(ctx, s, left - 6 * u, y(s) + tall / 2, { align: "right", fill: colour("soft") }));
  if (chosen >= first) {
    ctx.strokeStyle = colour("orange-line");
    ctx.lineWidth = 2 * u;
    if (forward) ctx.strokeRect(x(chosen) - cell / 2, y(chosen - first), right - x(chosen) + cell / 2, Math.max(tall, 3 * u));
    else ctx.strokeRect(x(chosen) - cell / 2, top, Math.max(cell, 2 * u), bottom - top);
    if (!forward && state.row >= 0) ctx.strokeRect(x(chosen) - cell / 2, y(state.row), Math.max(cell, 2 * u), tall);
  }
  const seen = steps.slice(first);
  stems(ctx, seen, (t) => x(t + first), { left, right, top: bottom + 34 * u, middle: bottom + 0.5 * (height - bottom) + 12 * u, bottom: height - 22 * u }, chosen - first);
  text(ctx, `step ${first + 1}`, left, height - 4 * u, { base: "bottom", fill: colour("soft") });
  if (steps.length > 1) text(ctx, `${steps.length}`, x(steps.length - 1), height - 4 * u, { base: "bottom", align: "center", fill: colour("soft") });
  title("w-trace", traceTitle(steps, chosen, forward));
}

// The same colour for the same trace, whatever the rule: up to 1, and one more above it, and below 0.
const MOST = 1 + 1e-9;
const traceColour = (value) => (value > MOST ? "#D55E00" : value < 0 ? "#CC79A7" : cividis(value));

function paintScale(ctx, left, top, u) {
  const wide = 90 * u, tall = 9 * u, small = { size: 11, fill: colour("soft"), base: "middle" };
  text(ctx, "0", left, top + tall / 2, small);
  for (let k = 0; k < 45; k++) {
    ctx.fillStyle = cividis(k / 44);
    ctx.fillRect(left + 11 * u + (k * wide) / 45, top, wide / 45 + 0.5, tall);
  }
  text(ctx, "1", left + wide + 15 * u, top + tall / 2, small);
  ctx.fillStyle = traceColour(2);
  ctx.fillRect(left + wide + 36 * u, top, 2 * tall, tall);
  disc(ctx, left + wide + 36 * u + tall, top + tall / 2, 1.6 * u, "#222222");
  text(ctx, "above 1", left + wide + 59 * u, top + tall / 2, small);
  if (state.reset) return;
  ctx.fillStyle = traceColour(-1);
  ctx.fillRect(left + wide + 118 * u, top, 2 * tall, tall);
  text(ctx, "below 0", left + wide + 141 * u, top + tall / 2, small);
}

function traceTitle(steps, chosen, forward) {
  if (chosen < 0) return forward ? "Forward: which later errors will change the state of a step" : "Backward: which states an error changes";
  const lambdas = steps.slice(1), reset = lambdas.filter((step) => step.clipped).length;
  const so = lambdas.length ? ` λ: ${short(sum(lambdas.map((step) => step.lambda)) / lambdas.length, 2)} on average, reset at ${reset} of ${count(lambdas.length, "step")}` : "";
  if (!forward) {
    const { trace } = steps[chosen], looked = state.row < 0 ? "" : `; the trace of state ${state.row} is ${short(trace[state.row])}`;
    return `The error of step ${chosen + 1} changes ${count(trace.filter((value) => Math.abs(value) > 0.01).length, "state")}${looked}.${so}`;
  }
  const weights = steps.map((_, k) => (k < chosen ? 0 : reach(steps, chosen, k))).filter((weight) => weight > 0.01);
  return `What is learnt of step ${chosen + 1} is made of the errors of ${count(weights.length, "step")}, their weights ${short(sum(weights), 3)} in all.${so}`;
}

// Of rules: chosen and kept ones in colours, fixed ones in grey, each named at its end. ends are filled.
function paintRules(ctx, box, high, ends, of) {
  for (const text of FIXED) {
    const points = of(text);
    if (!points.length || compared().some((one) => one.text === text)) continue;
    curve(ctx, points.map(([x, y]) => [box.x(x), box.y(Math.min(y, 2 * high))]), colour("edge"), 1.2, [3, 3]);
    ends.push([`λ = ${text.slice(6)}`, box.y(Math.min(points.at(-1)[1], high)), "soft"]);
  }
  for (const { text, name, paint, dash } of compared()) {
    const points = of(text);
    if (!points.length) continue;
    curve(ctx, points.map(([x, y]) => [box.x(x), box.y(Math.min(y, 2 * high))]), colour(`${paint}-line`), text === chosen() ? 3.2 : 2.2, dash);
    ends.push([name, box.y(Math.min(points.at(-1)[1], high)), paint]);
  }
}

const names = () => [...compared().map((one) => one.name), "λ = 0.9"];

// "0.154 with gate, 0.159 with form 2": the chosen rule first.
const listed = (of) => compared().reverse().map(({ text, name }) => `${of(text)} with ${name}`).join(", ");

function clipped(ctx, { left, right, top, bottom }, paint) {
  ctx.save();
  ctx.beginPath();
  ctx.rect(left, top - 2, right - left + 2, bottom - top + 3);
  ctx.clip();
  paint();
  ctx.restore();
}

function paintErrors(ctx, width, height) {
  const u = unit(), left = 52 * u, right = width - widest(ctx, names()), ends = [];
  const box = panel(ctx, { left, right, top: 22 * u, bottom: height - 42 * u, x: [0, WALKS], y: [0, 0.65], xTicks: [0, 10, 20, 30], xLabel: "walks", yLabel: "error of the values (root of the mean square)" });
  const { length } = walkView.runs(chosen(), state.alpha, WALKS);
  const start = Math.sqrt(sum(TRUE_VALUES.map((value) => value ** 2)) / STATES);
  clipped(ctx, box, () => {
    paintRules(ctx, box, 0.65, ends, (text) => walkView.means(text).map((error, k) => [k, error]));
    [start, ...walkView.errors].slice(0, WALKS + 1).forEach((error, k) => disc(ctx, box.x(k), box.y(error), 2.6 * u, colour("ink")));
  });
  const at = `At α = ${short(state.alpha)}`;
  if (!length) return title("w-error", `${at}, ${WALKS} walks of many seeds: being worked out …`);
  labelEnds(ctx, ends, right + 8 * u, 30 * u, height - 42 * u);
  const last = (text) => walkView.means(text)[WALKS] ?? NaN;
  const best = FIXED.reduce((a, b) => (last(b) < last(a) ? b : a));
  const told = (text) => (last(text) === Infinity ? "diverges" : Number.isNaN(last(text)) ? "…" : short(last(text)));
  title("w-error", `${at}, error after ${WALKS} walks (mean of ${count(length, "seed")}): ${listed(told)}; ${told(best)} with the best fixed λ, ${best.slice(6)}`);
}

function paintBest(ctx, width, height) {
  const u = unit(), left = 52 * u, right = width - widest(ctx, names()), ends = [], sizes = DATA.stepSizes;
  const box = panel(ctx, { left, right, top: 22 * u, bottom: height - 42 * u, x: [0, 1], y: [0.2, 0.65], yTicks: [0.2, 0.3, 0.4, 0.5, 0.6], xTicks: [0, 0.2, 0.4, 0.6, 0.8, 1], xLabel: "step size α", yLabel: `error, mean of the first ${FIRST} walks` });
  clipped(ctx, box, () => {
    if (sizes.at(-1) >= state.alpha) curve(ctx, [[box.x(state.alpha), box.top], [box.x(state.alpha), box.bottom]], colour("line"), 3);
    paintRules(ctx, box, 0.65, ends, (text) => walkView.sweep(text).map(({ alpha, error }) => [alpha, error]));
  });
  if (ends.length) labelEnds(ctx, ends, right + 8 * u, 30 * u, height - 42 * u);
  if (walkView.runs(chosen(), sizes.at(-1), FIRST).length < SEEDS) return title("w-best", "Each rule at its best step size: being worked out …");
  const least = (text) => Math.min(...walkView.sweep(text).map(({ error }) => error));
  const told = (text) => short(least(text), 2);
  const best = FIXED.reduce((a, b) => (least(b) < least(a) ? b : a));
  title("w-best", `Each at its best step size, over the first ${FIRST} walks, as in the stored runs: ${listed(told)}; ${told(best)} with the best fixed λ, ${best.slice(6)}`);
}

function setUpWalk() {
  walkView.chain = new Chart("w-chain", 230, paintChain);
  walkView.trace = new Chart("w-trace", 430, paintTrace);
  walkView.error = new Chart("w-error", 330, paintErrors);
  walkView.best = new Chart("w-best", 330, paintBest);
  const canvas = walkView.trace.canvas;
  canvas.addEventListener("click", (event) => {
    const { left, first, cell } = timeAxis(canvas.clientWidth, walkView.steps.length);
    const step = first + Math.floor((event.offsetX - left) / cell);
    const top = 44 * unit(), bottom = 0.5 * canvas.clientHeight;
    const row = Math.floor((STATES * (bottom - event.offsetY)) / (bottom - top));
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
