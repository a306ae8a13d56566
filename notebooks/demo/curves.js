// What the robot sees and how like home it is, its learning curve, and the similarity, error and lambda of each step.

// --- What it sees ---------------------------------------------------------------------------------------------------

const pictures = new Map(); // of the snapshot, which is drawn once

function pictureFrom(pose) {
  const picture = document.createElement("canvas"), side = DATA.settings.image_size;
  picture.width = picture.height = side;
  picture.getContext("2d").putImageData(new ImageData(robotView.camera.picture(pose, side), side, side), 0, 0);
  return picture;
}

function paintView(ctx, width, height) {
  if (!robotView.experiment) return;
  const { pose, experiment: { env } } = robotView, { world, home, model, psi } = env;
  const view = world.histogram(pose), { snapshot } = model;
  const gap = 14, side = Math.min(0.36 * height, (width - gap) / 2), bins = view.length / 3;
  ctx.imageSmoothingEnabled = false;
  ctx.drawImage(pictureFrom(pose), 0, 18, side, side);
  ctx.drawImage(remember(pictures, "snapshot", () => pictureFrom(home)), side + gap, 18, side, side);
  text(ctx, "the robot’s view", 0, 13, { base: "bottom" });
  text(ctx, "the snapshot of home", side + gap, 13, { base: "bottom" });

  const top = side + 52, low = top + 0.5 * (height - top - 60), small = { base: "top", size: 11, fill: colour("soft") };
  const most = Math.max(...view, ...snapshot), wide = (width - 2 * gap) / 3;
  ["red", "green", "blue"].forEach((name, channel) => {
    const left = channel * (wide + gap);
    const points = (values) => Array.from(values.subarray(channel * bins, (channel + 1) * bins), (value, i) => [
      left + (i / (bins - 1)) * wide, low - (value / most) * (low - top),
    ]);
    ctx.strokeStyle = colour("line");
    line(ctx, [[left, low], [left + wide, low]]);
    curve(ctx, points(snapshot), colour("soft"), 1.4, [3, 2]);
    curve(ctx, points(view), colour("blue-line"), 1.8);
    text(ctx, name, left, top - 4, { base: "bottom" });
  });
  text(ctx, "pixels by brightness; dashed: the snapshot", 0, low + 4, small);

  const phi = features(view, model), nrb = similarity(phi), under = low + 40, bottom = height - 22;
  phi.forEach((value, i) => block(ctx, (i / phi.length) * width, under, width / phi.length + 0.6, bottom - under, cividis(value)));
  text(ctx, `its ${phi.length} features: bright where a bin is as at home`, 0, bottom + 4, small);
  const so = nrb >= psi.upper ? "enough to stop" : nrb >= psi.lower ? "almost enough to stop" : `it stops at ${psi.upper.toFixed(3)}`;
  return `What it sees is ${nrb.toFixed(3)} similar to home, ${so}`;
}

// --- The learning curve ---------------------------------------------------------------------------------------------

const REFERENCES = { random: [2, 3], climb: [7, 3], "shortest way": [12, 4] };

const late = (lengths) => mean(lengths.slice(DATA.settings.episodes - LATE, DATA.settings.episodes));

function paintCurve(ctx, width, height) {
  const { experiment, reference, rules } = robotView;
  if (!experiment) return;
  const left = 52, alone = !state.seeds, { episodes } = experiment.settings, ends = [];
  const right = width - widest(ctx, ["shortest way 19", ...rules.map(({ name }) => name)]);
  const lengths = experiment.episodes.map(({ steps }) => steps.length);
  const shown = rules.toReversed().filter(({ text, rows }) => rows.length && !(alone && text === chosen()));
  const most = Math.max(400, ...lengths, ...shown.flatMap(({ rows }) => rows.flat()));
  const box = panel(ctx, {
    left, right, top: 22, bottom: height - 42, x: [1, Math.max(episodes, lengths.length)], y: [10, most * 1.1], log: true,
    xTicks: [1, 5, 10, 15, 20], yTicks: [10, 30, 100, 300, 1000].filter((value) => value < most),
    xLabel: "episode", yLabel: "steps (logarithmic)",
  });
  const place = (steps, k) => [box.x(k + 1), box.y(Math.max(10, steps))];
  for (const [label, dash] of Object.entries(REFERENCES)) {
    const value = reference[label];
    if (!Number.isFinite(value)) continue;
    curve(ctx, [[left, box.y(value)], [right, box.y(value)]], colour("edge"), 1.4, dash);
    ends.push([`${label} ${short(value)}`, box.y(value), "soft"]);
  }
  for (const { text, name, paint, dash, rows } of shown) {
    const intervals = Array.from({ length: episodes }, (_, k) => robotView.interval(text, rows, k, (row) => row[k]));
    const edge = (end) => intervals.map((interval, k) => place(interval[end], k));
    if (rows.length > 2) paintBand(ctx, edge("low"), edge("high"), paint);
    const points = edge("value");
    curve(ctx, points, colour(`${paint}-line`), text === chosen() ? 3 : 2, dash);
    ends.push([name, points.at(-1)[1], paint]);
  }
  const [{ name, paint }] = rules, ink = colour(alone ? `${paint}-line` : "ink");
  const points = experiment.episodes.map(({ steps }, k) => place(steps.length, k));
  const learning = points.filter((_, k) => !experiment.episodes[k].frozen);
  if (alone) curve(ctx, learning, ink, 2.6);
  if (alone && learning.length) ends.push([name, learning.at(-1)[1], paint]);
  ctx.lineWidth = 1.5;
  experiment.episodes.forEach(({ reached, frozen }, k) => {
    const edge = frozen ? colour("pink-line") : ink;
    (frozen ? square : disc)(ctx, ...points[k], (alone ? 4 : 2.6), reached ? edge : colour("paper"), edge);
  });
  if (ends.length) labelEnds(ctx, ends, right + 10, 22, height - 44);
  return curveTitle(experiment, reference, rules.filter(({ rows }) => rows.length));
}

// Between two curves.
function paintBand(ctx, low, high, paint) {
  ctx.globalAlpha = 0.16;
  ctx.fillStyle = colour(`${paint}-line`);
  ctx.beginPath();
  for (const point of [...high, ...low.reverse()]) ctx.lineTo(...point);
  ctx.fill();
  ctx.globalAlpha = 1;
}

function square(ctx, x, y, half, fill, edge) {
  block(ctx, x - half, y - half, 2 * half, 2 * half, fill);
  ctx.strokeStyle = edge;
  ctx.strokeRect(x - half, y - half, 2 * half, 2 * half);
}

function curveTitle({ episodes, settings: { episodes: total } }, { climb, "shortest way": shortest }, rules) {
  const last = `Steps of the last ${LATE} of ${total} episodes`, only = `Seed ${state.seed} only`;
  if (state.seeds) return `${last}, ${seedsSaid(rules)}`;
  if (!episodes.length && !rules.length) return "The learning curve, beside chance, a climb up the similarity and the shortest way";
  const way = Number.isFinite(shortest) ? `, the shortest way ${short(shortest)}` : "";
  const beside = Number.isFinite(climb) ? `; a climb ${short(climb)}${way}` : "";
  const lengthsWhere = (share) => episodes.filter(({ frozen }) => frozen === share).map(({ steps }) => steps.length);
  const [frozen, on, lengths] = [lengthsWhere(1), lengthsWhere(0), episodes.map(({ steps }) => steps.length)];
  if (frozen.length) {
    const lately = on.slice(-LATE);
    const learning = `the last ${count(lately.length, "episode")} with its learning on: ${short(mean(lately))} steps on average; `;
    const before = on.length ? learning : "";
    return `${only}: ${before}frozen (${frozen.length}): ${short(mean(frozen))}${beside}`;
  }
  if (lengths.length < total)
    return `${only}: ${count(lengths.length, "episode")} so far${lengths.length ? `, ${short(mean(lengths))} steps on average` : ""}`;
  if (rules.length > 1) {
    const said = rules.map(({ name, rows }) => `${short(late(rows[0]))} with ${name}`).join(", ");
    return `${only}: ${last.toLowerCase()}: ${said}. “${TEN} seeds” tells luck from rule`;
  }
  const early = `the first ${LATE} episodes take ${short(mean(lengths.slice(0, LATE)))} steps on average`;
  return `${only}: ${early}, the last ${LATE} ${short(late(lengths))}${beside}`;
}

// "interquartile means of seeds 1 to 10 (7 of 10 so far): 28 [24, 30.2] with gate, ...". rules: those with rows.
function seedsSaid(rules) {
  const seeds = `seeds ${state.seed} to ${state.seed + state.seeds - 1}`;
  if (!rules.length) return `${seeds}: being worked out …`;
  const said = rules.map(({ text, name, rows }) => {
    const { value, low, high } = robotView.interval(text, rows, "late", late);
    return `${short(value)}${rows.length > 2 ? ` [${short(low)}, ${short(high)}]` : ""} with ${name}`;
  });
  const done = Math.min(...robotView.rules.map(({ rows }) => rows.length));
  return `interquartile means of ${seeds}${done < state.seeds ? ` (${done} of ${state.seeds} so far)` : ""}: ${said.join(", ")}`;
}

// --- The steps ------------------------------------------------------------------------------------------------------

function paintSteps(ctx, width, height) {
  const { experiment, steps } = robotView;
  if (!experiment) return;
  const { psi } = experiment.env, axis = timeAxis(width, steps.length), { left, right, first, x } = axis;
  const seen = steps.slice(first), low = Math.min(0.6, ...seen.map((step) => step.similarity)), third = (height - 20) / 3;
  const box = panel(ctx, {
    left, right, top: 20, bottom: third - 6, x: [0, 1], y: [low, 1], yTicks: ticks(low, 1, 2),
    yLabel: "similarity; dashed: where it stops",
  });
  curve(ctx, [[left, box.y(psi.upper)], [right, box.y(psi.upper)]], colour("ink"), 1, [5, 3]);
  curve(ctx, seen.map((step, t) => [x(t + first), box.y(step.similarity)]), colour("green-line"), 2);
  stems(ctx, steps, axis, { top: third + 26, middle: 2 * third + 16, bottom: height - 20 });
  return stepsTitle(steps);
}

function stepsTitle(steps) {
  if (steps.length < 2) return "Similarity, TD error and λ of each step";
  const later = steps.slice(1).filter((step) => !step.frozen), reset = later.filter((step) => step.clipped).length;
  if (!later.length) return "Frozen: nothing is learnt, so there is no TD error and no λ";
  const back = reaches(steps).filter((_, k) => !steps[k].frozen);
  const lambda = `Mean λ ${short(mean(later.map((step) => step.lambda)), 2)}, reset at ${reset} of ${count(later.length, "step")}`;
  return `${lambda}; an error reaches back ${short(mean(back), 2)} steps on average, ${Math.max(...back)} at most (traces above ${COUNTED})`;
}

// Over how many steps back each error of an episode is shared, as far as the trace is counted.
function reaches(steps) {
  return steps.map((_, k) => {
    let back = 0;
    for (let weight = 1; back < k && (weight *= steps[k - back].lambda) > COUNTED; ) back++;
    return back;
  });
}
