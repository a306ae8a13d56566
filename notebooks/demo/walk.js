// The view of the walk: the trace over time, its errors and lambdas, and how wrong the values still are.

const FIXED = [0, 0.4, 0.8, 0.9, 1];
const WALKS = 30, SEEDS = 20;

const walkView = {
  walk: null,
  errors: [], // after each walk of this run
  compared: null,
  comparing: 0,

  settings(chosen, seed = state.seed) {
    return { rule: chosen.rule, onZero: chosen.onZero, clip: chosen.clip, stepSize: state.alpha, seed };
  },

  // Make the run anew, as far as it had come. The same seed takes the same way, whatever the rule.
  rebuild() {
    this.walk = new Walk(this.settings(chosenRule()));
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
    for (const chart of ["chain", "trace", "error"]) this[chart].refresh();
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

  pick(step) {
    const last = this.steps.length - 1;
    state.pick = step >= last ? -1 : Math.max(0, step);
    this.show();
  },

  // Many runs of this rule beside fixed ones, a seed at a time between frames.
  compare() {
    const turn = ++this.comparing;
    const rules = FIXED.map((value) => ({ name: `λ = ${value}`, rule: () => value, onZero: 0, clip: true }));
    rules.push({ ...chosenRule(), name: ruleName() });
    this.compared = { names: rules.map((rule) => rule.name), sums: rules.map(() => new Float64Array(WALKS + 1)), seeds: 0 };
    const next = () => {
      if (turn !== this.comparing) return;
      if (state.view === "walk" && !document.hidden) {
        rules.forEach((rule, i) => this.addErrors(this.compared.sums[i], rule, 1000 + this.compared.seeds));
        this.compared.seeds++;
        this.error.refresh();
      }
      if (this.compared.seeds < SEEDS) setTimeout(next, 30);
    };
    setTimeout(next, 200);
  },

  addErrors(sums, rule, seed) {
    const walk = new Walk(this.settings(rule, seed));
    try {
      for (let k = 0; k <= WALKS; k++) {
        sums[k] += walk.error;
        if (k < WALKS) walk.walk();
      }
    } catch (error) {
      if (!(error instanceof Diverged)) throw error;
      sums.fill(Infinity);
    }
  },

  table() {
    const columns = ["step", "state", "after", "reward", "delta", "lambda", "reset", "ratio", ...TRUE_VALUES.map((_, i) => `trace_${i}`)];
    return [columns, this.steps.map((s, t) => [t, s.state, s.after, s.reward, s.delta, s.lambda, s.clipped, s.ratio, ...s.trace])];
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
  const box = panel(ctx, { left, right, top: 22 * u, bottom: height - 48 * u, x: [-0.7, STATES - 0.3], y: [-most, most], yLabel: "value of a state: learnt (dots) and true (dashed)" });
  curve(ctx, TRUE_VALUES.map((value, s) => [box.x(s), box.y(value)]), colour("soft"), 1.3, [6, 4]);
  curve(ctx, values.map((value, s) => [box.x(s), box.y(value)]), colour("blue-line"), 1.5);
  values.forEach((value, s) => disc(ctx, box.x(s), box.y(value), 3.5 * u, colour("blue-line")));
  const y = height - 24 * u, radius = Math.min(12 * u, (0.42 * (right - left)) / STATES);
  const trace = t < 0 ? null : steps[t].trace;
  const largest = trace ? Math.max(1, ...trace) : 1;
  ctx.lineWidth = 1.2 * u;
  for (let s = 0; s < STATES; s++) {
    disc(ctx, box.x(s), y, radius, trace && trace[s] > 1e-3 ? cividis(trace[s] / largest) : colour("ground"), colour("edge"));
  }
  const at = t < 0 ? (STATES - 1) / 2 : steps[t].after;
  const place = Math.min(STATES - 0.4, Math.max(-0.6, at));
  ctx.lineWidth = 2.5 * u;
  disc(ctx, box.x(place), y, radius + 3.5 * u, null, colour("orange-line"));
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
  const top = 22 * u, bottom = 0.5 * height, forward = state.look === "forward";
  const rows = forward ? Math.max(24, steps.length - first) : STATES;
  const tall = (bottom - top) / rows;
  const y = (row) => (forward ? top + row * tall : bottom - (row + 1) * tall);
  ctx.fillStyle = colour("ground");
  ctx.fillRect(left, top, right - left, bottom - top);
  const largest = Math.max(1, ...steps.slice(first).map((step) => Math.max(...step.trace)));
  for (let k = first; k < steps.length; k++) {
    if (forward) {
      for (let t = k, weight = 1; t >= first && weight > 1e-3; weight *= steps[t].lambda, t--) {
        ctx.fillStyle = cividis(weight);
        ctx.fillRect(x(k) - cell / 2, y(t - first), cell + 0.5, tall + 0.5);
      }
    } else {
      steps[k].trace.forEach((value, s) => {
        if (value < 1e-3) return;
        ctx.fillStyle = cividis(value / largest);
        ctx.fillRect(x(k) - cell / 2, y(s), cell + 0.5, tall + 0.5);
      });
    }
  }
  text(ctx, forward ? "row: a step; column: an error that changes it" : "trace of each state (row) at each step (column)", left, top - 4 * u, { base: "bottom" });
  if (!forward) [0, 9, 18].forEach((s) => text(ctx, s, left - 6 * u, y(s) + tall / 2, { align: "right", fill: colour("soft") }));
  if (chosen >= first) {
    ctx.strokeStyle = colour("orange-line");
    ctx.lineWidth = 2 * u;
    if (forward) ctx.strokeRect(x(chosen) - cell / 2, y(chosen - first), right - x(chosen) + cell / 2, Math.max(tall, 3 * u));
    else ctx.strokeRect(x(chosen) - cell / 2, top, Math.max(cell, 2 * u), bottom - top);
  }
  const seen = steps.slice(first);
  stems(ctx, seen, (t) => x(t + first), { left, right, top: bottom + 34 * u, middle: bottom + 0.5 * (height - bottom) + 12 * u, bottom: height - 22 * u }, chosen - first);
  text(ctx, `step ${first + 1}`, left, height - 4 * u, { base: "bottom", fill: colour("soft") });
  if (steps.length > 1) text(ctx, `${steps.length}`, x(steps.length - 1), height - 4 * u, { base: "bottom", align: "center", fill: colour("soft") });
  title("w-trace", traceTitle(steps, chosen, forward));
}

function traceTitle(steps, chosen, forward) {
  if (chosen < 0) return forward ? "Forward: which later errors will change the state of a step" : "Backward: which states an error changes";
  const lambdas = steps.slice(1), reset = lambdas.filter((step) => step.clipped).length;
  const so = lambdas.length ? ` λ: ${short(sum(lambdas.map((step) => step.lambda)) / lambdas.length, 2)} on average, reset at ${reset} of ${count(lambdas.length, "step")}` : "";
  if (!forward) return `The error of step ${chosen + 1} changes ${count(steps[chosen].trace.filter((value) => value > 0.01).length, "state")}.${so}`;
  const weights = steps.map((_, k) => (k < chosen ? 0 : reach(steps, chosen, k))).filter((weight) => weight > 0.01);
  return `What is learnt of step ${chosen + 1} is made of the errors of ${count(weights.length, "step")}, their weights ${short(sum(weights), 3)} in all.${so}`;
}

function paintErrors(ctx, width, height) {
  const u = unit(), { names, sums, seeds } = walkView.compared;
  const left = 52 * u, right = width - widest(ctx, names);
  const means = sums.map((values) => [...values].map((value) => value / seeds));
  const start = Math.sqrt(sum(TRUE_VALUES.map((value) => value ** 2)) / STATES);
  const box = panel(ctx, { left, right, top: 22 * u, bottom: height - 42 * u, x: [0, WALKS], y: [0, 0.65], xTicks: [0, 10, 20, 30], xLabel: "walks", yLabel: "error of the values (root of the mean square)" });
  const paints = [colour("edge"), colour("green-line"), colour("pink-line"), colour("blue-line"), colour("soft"), colour("orange-line")];
  const dashes = [[1, 3], [6, 3], [3, 2], [9, 3, 2, 3], [12, 3], []];
  ctx.save();
  ctx.beginPath();
  ctx.rect(left, 18 * u, right - left + 1, height - 60 * u);
  ctx.clip();
  const ours = means.length - 1;
  if (seeds) means.forEach((values, i) => {
    const points = values.filter(Number.isFinite).map((value, k) => [box.x(k), box.y(value)]);
    curve(ctx, points, paints[i], i === ours ? 3.2 : 1.6, dashes[i]);
  });
  const own = [start, ...walkView.errors].slice(0, WALKS + 1).map((value, k) => [box.x(k), box.y(value)]);
  own.forEach(([x, y]) => disc(ctx, x, y, 2.6 * u, colour("ink")));
  ctx.restore();
  if (!seeds) return title("w-error", `${WALKS} walks of many seeds, beside fixed λ`);
  labelEnds(ctx, names.map((name, i) => [name, box.y(Math.min(0.65, means[i][WALKS])), paints[i]]), right + 8 * u, 30 * u, height - 50 * u);
  const best = FIXED.map((_, i) => i).reduce((a, b) => (means[b][WALKS] < means[a][WALKS] ? b : a));
  const mine = means[ours][WALKS];
  title("w-error", Number.isFinite(mine)
    ? `After ${WALKS} walks ${names[ours]} errs by ${short(mine)}, the best fixed λ (${FIXED[best]}) by ${short(means[best][WALKS])}; mean of ${count(seeds, "seed")}`
    : `${names[ours]} diverges with this step size; the best fixed λ (${FIXED[best]}) errs by ${short(means[best][WALKS])}`);
}

function setUpWalk() {
  walkView.chain = new Chart("w-chain", 230, paintChain);
  walkView.trace = new Chart("w-trace", 430, paintTrace);
  walkView.error = new Chart("w-error", 330, paintErrors);
  const canvas = walkView.trace.canvas;
  canvas.addEventListener("click", (event) => {
    const { left, first, cell } = timeAxis(canvas.clientWidth, walkView.steps.length);
    const step = first + Math.floor((event.offsetX - left) / cell);
    if (step >= first && step < walkView.steps.length) walkView.pick(step);
  });
  canvas.addEventListener("keydown", (event) => {
    const move = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!move || walkView.chosen < 0) return;
    event.preventDefault();
    walkView.pick(walkView.chosen + move);
  });
}
