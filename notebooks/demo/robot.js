// The view of the robot: the room from above, what is seen there, the learning curve, and each step's delta and lambda.

const TEN = 10, LATE = 5; // seeds at a press; last episodes of the training

const SEEN = DATA.settings.image_size; // pixels of a drawn picture, as many as the camera has

const robotView = {
  world: null, // the atlas, once it is unpacked
  experiment: null,
  models: new Map(), // of surveys, by seed
  references: new Map(), // steps of climb, random and shortest, by all that they depend on
  stats: new Map(), // interquartile means
  lengths: new Map(), // of the episodes of whole runs, by rule, seed and all that they depend on
  hand: null, // a pose that is being dragged
  handsStart: false, // whether that is the start's, not the robot's
  kidnaps: [],
  switched: [], // steps at which it was frozen or learnt on

  settings(changes = {}) {
    return {
      ...DATA.settings,
      alpha0: state.alpha0,
      multiplier: state.multiplier,
      epsilon0: state.epsilon,
      update: state.update,
      ...changes,
    };
  },

  begin(settings, rule, seed = state.seed) {
    const experiment = new Experiment(this.world, settings, seed, rule, this.models.get(seed));
    this.models.set(seed, experiment.env.model);
    const start = readPose(state.start);
    if (start && experiment.env.fits(start)) experiment.env.start = start;
    return experiment;
  },

  // Make the run anew, as far as it had come, with the kidnaps in their places.
  rebuild() {
    if (!this.world) return;
    this.experiment = this.begin(...this.learning(chosen()));
    this.played = this.key(chosen(), state.seed);
    this.experiment.total += state.more;
    this.kidnaps = state.kidnap.split(";").filter(Boolean).map((one) => {
      const [step, pose] = one.split(":");
      return { step: Number(step), pose: readPose(pose ?? "") };
    }).filter(({ step, pose }) => step >= 0 && pose && this.experiment.env.fits(pose));
    this.switched = state.frozen.split(";").filter(Boolean).map(Number).filter(Number.isInteger);
    const made = state.made;
    state.made = 0;
    while (state.made < made && this.advance());
    this.refer();
    this.compare();
    this.show();
  },

  // The settings of a learner by the rule of a text, and its rule where the settings cannot name it.
  learning(text) {
    const { setting, own, rule } = ruleOf(text);
    return [this.settings({ lambda_rule: setting }), own === undefined ? undefined : rule];
  },

  // After a change: from the beginning, and to the end if the run before had come to its end.
  change() {
    const whole = this.experiment?.done;
    Object.assign(state, { made: 0, more: 0, kidnap: "", frozen: "" });
    this.rebuild();
    if (whole) player.rush();
  },

  // One step; false where the run is over.
  advance() {
    const { experiment } = this;
    if (experiment.done) return false;
    experiment.freeze(this.frozen);
    for (const { step, pose } of this.kidnaps) if (step === state.made) experiment.underWay ? experiment.kidnap(pose) : experiment.begin(pose);
    if (!experiment.step()) return false;
    state.made++;
    return true;
  },

  // Where the training is over: one more episode with what was learnt.
  goOn() {
    const { experiment } = this;
    if (!experiment.done || experiment.diverged || state.more >= RANGES.more[1]) return;
    experiment.total++;
    state.more++;
  },

  step() {
    if (!this.world) return;
    this.goOn();
    this.advance();
    this.show();
  },

  finish() {
    if (!this.world) return;
    this.goOn();
    const episodes = this.experiment.episodes.length;
    while (this.advance() && this.experiment.episodes.length === episodes);
    this.show();
  },

  restart() {
    Object.assign(state, { made: 0, more: 0, kidnap: "", frozen: "" });
    this.rebuild();
  },

  // Whether it is frozen, as from here on.
  get frozen() {
    return this.switched.filter((step) => step <= state.made).length % 2 > 0;
  },

  // From here on frozen, or with its learning on; twice at the same step is not at all.
  freeze() {
    if (!this.experiment) return this.tell();
    const others = this.switched.filter((step) => step !== state.made);
    this.switched = others.length < this.switched.length ? others : [...others, state.made];
    state.frozen = this.switched.join(";");
    this.show();
  },

  // What a hand can hold: the robot, once it has driven, and the start, where no episode is under way.
  get grips() {
    const { steps, underWay, diverged, env } = this.experiment;
    return [...(steps && !diverged ? [this.pose] : []), ...(underWay ? [] : [env.start])];
  },

  hold(grip) {
    this.hand = { ...grip };
    this.handsStart = grip === this.experiment.env.start;
  },

  // Where the hand lets go of the robot it drives on, in this episode or its next; the start is that of the whole run.
  put(pose) {
    const { experiment, handsStart } = this, { done, env } = experiment;
    Object.assign(this, { hand: null, handsStart: false });
    if (!env.fits(pose)) return say("The robot does not fit there; put it where it touches nothing.");
    say("");
    const told = [pose.x, pose.y, pose.heading].map((value) => Number(value.toFixed(4)));
    if (handsStart) {
      Object.assign(state, { start: told.join(","), seeds: 0 });
      return this.change();
    }
    this.goOn();
    const kidnap = { step: state.made, pose: poseOf(told) };
    this.kidnaps = [...this.kidnaps.filter(({ step }) => step !== state.made), kidnap];
    if (experiment.underWay) experiment.kidnap(kidnap.pose);
    state.kidnap = this.kidnaps.map(({ step, pose: p }) => `${step}:${p.x},${p.y},${p.heading}`).join(";");
    this.show();
    if (done) player.run("play");
  },

  // Where it was put down after an episode, until it drives on.
  get waiting() {
    return this.experiment.underWay ? undefined : this.kidnaps.find(({ step }) => step === state.made)?.pose;
  },

  // Somewhere free, the same place for the same seed and step. A robot that waits makes a step first.
  kidnap() {
    if (!this.world) return;
    for (let tries = 0; !this.experiment.underWay && tries < 2; tries++) this.step();
    if (!this.experiment.underWay) return say("The weights have left the finite numbers: nothing to kidnap.");
    this.handsStart = false;
    const rng = new Generator(new SeedSequence(state.seed, [state.made]));
    this.put(freePose(this.world, this.world.room.size, rng));
  },

  // What climbing, chance and the shortest way need from this start.
  refer() {
    const key = [state.seed, state.start, state.multiplier].join(" ");
    this.reference = this.references.get(key) ?? { climb: NaN, random: NaN, shortest: NaN };
    if (this.references.has(key)) return;
    between("reference", "robot", this.referring(key, this.reference));
  },

  *referring(key, reference) {
    for (const controller of ["climb", "random"]) {
      const one = this.begin(this.settings({ controller }));
      while (one.step()) yield;
      reference[controller] = sum(lengthsOf(one)) / one.episodes.length;
      this.curve.refresh();
    }
    reference.shortest = yield* searching(this.begin(this.settings()).env);
    this.references.set(key, reference);
    this.curve.refresh();
  },

  // The rules beside the chosen one from the same seed; with `seeds`, these and the chosen one from that many.
  compare() {
    between("seeds", "robot", this.comparing());
  },

  *comparing() {
    for (let seed = state.seed; seed < state.seed + (state.seeds || 1); seed++) {
      for (const text of state.seeds ? [...kept(), chosen()] : kept()) {
        if (this.known(text, seed)) continue;
        const key = this.key(text, seed), one = yield* this.beginning(...this.learning(text), seed);
        while (one.step()) yield;
        this.lengths.set(key, lengthsOf(one));
        this.curve.refresh();
        this.tell();
      }
    }
    jobs.delete("seeds");
    this.tell();
  },

  // As `begin`, with the survey a little at a time.
  *beginning(settings, rule, seed) {
    if (!this.models.has(seed)) {
      const [surveySeed] = new SeedSequence(seed).spawn(1);
      this.models.set(seed, yield* surveying(this.world, settings, poseOf(this.world.room.home), new Generator(surveySeed)));
    }
    return this.begin(settings, rule, seed);
  },

  key: (text, seed) => [text, seed, state.alpha0, state.epsilon, state.multiplier, state.update, state.start].join(" "),

  known(text, seed) {
    return this.lengths.get(this.key(text, seed));
  },

  // The lengths of the runs of a rule that are compared, a row for each seed up to the first that is not worked out.
  rows(text) {
    const rows = Array.from({ length: state.seeds || 1 }, (_, k) => this.known(text, state.seed + k));
    return rows.includes(undefined) ? rows.slice(0, rows.indexOf(undefined)) : rows;
  },

  // Of an episode over these rows, or of the mean of the last ones; worked out once for as many rows.
  typical(text, rows, episode = -1) {
    const key = `${this.key(text, state.seed)} ${rows.length} ${episode}`;
    if (!this.stats.has(key)) this.stats.set(key, typical(rows.map((row) => (episode < 0 ? late(row) : row[episode]))));
    return this.stats.get(key);
  },

  // Ten seeds of all rules shown; or ten more; or, pressed while they run, no more than there are.
  seeds() {
    if (!this.world) return;
    if (this.working) {
      jobs.delete("seeds");
      state.seeds = Math.min(...compared().map(({ text }) => this.rows(text).length));
    } else {
      state.seeds = Math.min(state.seeds + TEN, RANGES.seeds[1]);
      this.compare();
    }
    this.tell();
    this.show();
  },

  get working() {
    return state.seeds > 0 && jobs.has("seeds");
  },

  tell() {
    at("frozen").checked = this.frozen;
    const done = sum(compared().map(({ text }) => this.rows(text).length)), all = state.seeds * compared().length;
    at("robot-seeds").textContent = done < all && jobs.has("seeds") ? `Stop ${done}/${all}` : state.seeds ? `${TEN} more seeds` : `${TEN} seeds`;
  },

  show() {
    const { experiment } = this;
    if (experiment?.episodes.length >= DATA.settings.episodes && !state.kidnap && !state.frozen)
      this.lengths.set(this.played, lengthsOf(experiment));
    at("robot-home").hidden = !state.start;
    this.tell();
    for (const chart of ["room", "view", "curve", "stepsChart"]) this[chart].refresh();
    noteAddress();
  },

  get steps() {
    const { experiment } = this;
    return experiment?.steps ?? [];
  },

  get pose() {
    return this.waiting ?? (this.experiment.steps ? this.experiment.env.robot.pose : this.experiment.env.start);
  },

  // The lattice's similarities: the best over all headings, or at one heading, for each position; NaN outside.
  similarities() {
    const { world, experiment: { env: { model } } } = this;
    if (this.mapped !== model) {
      this.mapped = model;
      this.all = Float64Array.from({ length: world.size }, (_, number) => similarity(features(world.view(number), model)));
    }
    const turn = ((rounded((this.pose.heading - world.heading0) * world.perRadian) % world.headings) + world.headings) % world.headings;
    return world.positions.map((first) => {
      if (first < 0) return NaN;
      return state.map === "best" ? Math.max(...this.all.subarray(first, first + world.headings)) : this.all[first + turn];
    });
  },

  table() {
    const columns = ["episode", "step", "x", "y", "heading", "action", "reward", "similarity", "delta", "lambda", "reset", "change", "at_wall"];
    const { experiment } = this;
    const episodes = experiment ? experiment.episodes.map((one) => one.steps) : [];
    if (experiment?.underWay) episodes.push(experiment.steps);
    const row = (s) => [s.x, s.y, s.heading, s.action, s.reward, s.similarity, s.delta, s.lambda, s.clipped, s.change, s.atWall];
    return [columns, episodes.flatMap((steps, e) => steps.map((s, t) => [e + 1, t + 1, ...row(s)]))];
  },
};

// Steps of the episodes of the training; where the weights ran away, as many as an episode can have.
function lengthsOf({ episodes, settings }) {
  return Array.from({ length: settings.episodes }, (_, k) => episodes[k]?.steps.length ?? settings.max_steps);
}

function readPose(words) {
  const [x, y, heading] = words.split(",").map(Number);
  return words.split(",").length === 3 && [x, y, heading].every(Number.isFinite) ? { x, y, heading: wrapped(heading) } : null;
}

// --- The room -------------------------------------------------------------------------------------------------------

const WALL_M = 0.035, RADIUS_M = DATA.settings.body_diameter_m / 2;

function roomScale(width) {
  const [across, deep] = DATA.room.size;
  const scale = width / (across + 2 * WALL_M);
  return {
    scale,
    x: (metres) => (metres + WALL_M) * scale,
    y: (metres) => (deep + WALL_M - metres) * scale,
    back: (x, y) => ({ x: x / scale - WALL_M, y: deep + WALL_M - y / scale }),
  };
}

const rgb = (parts) => `rgb(${parts.map((part) => Math.round(255 * part)).join(" ")})`;

const ahead = ({ x, y, heading }, metres, turn = 0) => [x + metres * Math.cos(heading + turn), y + metres * Math.sin(heading + turn)];

function paintRoom(ctx, width) {
  const { x, y, scale } = roomScale(width), u = unit(), { room } = DATA, [across, deep] = room.size;
  const block = (left, low, wide, tall, fill) => {
    ctx.fillStyle = fill;
    ctx.fillRect(x(left), y(low + tall), wide * scale, tall * scale);
  };
  const sides = {
    east: [across, -WALL_M, WALL_M, deep + 2 * WALL_M], west: [-WALL_M, -WALL_M, WALL_M, deep + 2 * WALL_M],
    north: [-WALL_M, deep, across + 2 * WALL_M, WALL_M], south: [-WALL_M, -WALL_M, across + 2 * WALL_M, WALL_M],
  };
  block(0, 0, across, deep, colour("floor"));
  if (robotView.experiment && state.map !== "none") paintMap(ctx, x, y, scale);
  for (const [name, side] of Object.entries(sides)) block(...side, rgb(room.colours[name]));
  for (const { wall, along, size: [wide], rgb: paint } of room.pictures) {
    const [left, low, length, tall] = sides[wall], from = along - wide / 2;
    if (wall === "north" || wall === "south") block(from, low, wide, tall, rgb(paint));
    else block(left, from, length, wide, rgb(paint));
  }
  ctx.strokeStyle = colour("ink");
  ctx.lineWidth = u;
  for (const thing of room.objects) {
    if (thing.kind === "Box") {
      const [long, wide] = thing.size;
      block(thing.x - long / 2, thing.y - wide / 2, long, wide, colour("thing"));
      ctx.strokeRect(x(thing.x - long / 2), y(thing.y + wide / 2), long * scale, wide * scale);
    } else disc(ctx, x(thing.x), y(thing.y), thing.radius * scale, colour("thing"), colour("ink"));
  }
  const at = (pose, metres, turn) => {
    const [px, py] = ahead(pose, metres, turn);
    return [x(px), y(py)];
  };
  const shape = (corners) => {
    line(ctx, [...corners, corners[0]]);
    ctx.fillStyle = "#ffffff";
    ctx.fill();
    ctx.stroke();
  };
  const home = poseOf([0.85, 0.5, 0]), { experiment } = robotView;
  if (experiment) Object.assign(home, experiment.env.home);
  ctx.strokeStyle = "#222222";
  ctx.lineWidth = 1.6 * u;
  shape([1, 3, 5, 7].map((k) => at(home, RADIUS_M * Math.SQRT2, (k * Math.PI) / 4)));
  line(ctx, [[x(home.x), y(home.y)], at(home, RADIUS_M)]);
  if (!experiment) return title("r-room", "The table of views is being unpacked …");
  const start = experiment.env.start;
  shape([0, 2.4, -2.4].map((turn) => at(start, 1.3 * RADIUS_M, turn)));

  const driven = (from, steps, first, ...strokes) => {
    for (const { points, carried, frozen } of legs(from, steps, first))
      for (const [paint, wide] of strokes) curve(ctx, points.map((pose) => [x(pose.x), y(pose.y)]), frozen && paint === WAY ? FROZEN : paint, wide, carried ? [3, 5] : []);
  };
  let first = 0;
  experiment.episodes.forEach(({ steps, from }, k) => {
    if (steps !== experiment.steps && k >= experiment.episodes.length - 5) {
      ctx.globalAlpha = 0.55;
      driven(from, steps, first, [colour("edge"), 1.2]);
      ctx.globalAlpha = 1;
    }
    if (steps !== experiment.steps) first += steps.length;
  });
  if (experiment.steps) driven(experiment.from, experiment.steps, first, ["#ffffff", 4.5], [WAY, 2.5]);
  const { pose } = robotView;
  paintSight(ctx, at, pose);
  paintRobot(ctx, at, pose, scale, "#D55E00");
  ctx.lineWidth = 2 * u;
  for (const held of robotView.hand ? [robotView.hand] : robotView.grips) ring(ctx, at(held, handleAt(scale)), u);
  if (robotView.hand) {
    ctx.globalAlpha = 0.75;
    paintRobot(ctx, at, robotView.hand, scale, experiment.env.fits(robotView.hand) ? "#009E73" : "#000000");
    ctx.globalAlpha = 1;
  }
  if (state.map !== "none") paintLegend(ctx, x, y, u);
  title("r-room", roomTitle());
}

const WAY = "#0072B2", FROZEN = "#B0558B"; // with its learning on, and without

// The way of an episode, cut where the robot was carried, frozen or learnt on. first: steps made before it.
function legs(from, steps, first) {
  const found = [];
  let points = [from];
  for (let k = 0; k <= steps.length; k++) {
    const { pose } = robotView.kidnaps.findLast(({ step }) => k > 0 && step === first + k) ?? {};
    const frozen = steps[k - 1]?.frozen;
    if (pose && (k < steps.length || (robotView.experiment.underWay && steps === robotView.steps))) {
      found.push({ points, frozen }, { points: [points.at(-1), pose], carried: true });
      points = [pose];
    } else if (k > 0 && k < steps.length && steps[k].frozen !== frozen) {
      found.push({ points, frozen });
      points = [points.at(-1)];
    }
    if (k < steps.length) points.push(steps[k]);
  }
  return [...found, { points, frozen: steps.at(-1)?.frozen }];
}

// A ring ahead of what can be turned, far enough from its middle for a thumb.
const handleAt = (scale) => Math.max(0.075, (34 * unit()) / scale);

function ring(ctx, [x, y], u) {
  disc(ctx, x, y, 6 * u, "rgb(255 255 255 / 0.7)", "#222222");
}

function paintRobot(ctx, at, pose, scale, fill) {
  const [x, y] = at(pose, 0);
  ctx.lineWidth = 1.5 * unit();
  disc(ctx, x, y, RADIUS_M * scale, fill, "#ffffff");
  ctx.strokeStyle = "#ffffff";
  ctx.lineWidth = 2.5 * unit();
  line(ctx, [[x, y], at(pose, RADIUS_M)]);
}

function paintSight(ctx, at, pose) {
  const half = radians(DATA.settings.field_of_view_deg) / 2;
  ctx.fillStyle = "rgb(255 255 255 / 0.28)";
  ctx.beginPath();
  ctx.moveTo(...at(pose, 0));
  for (const turn of [half, half / 2, 0, -half / 2, -half]) ctx.lineTo(...at(pose, 0.22, turn));
  ctx.fill();
}

function paintMap(ctx, x, y, scale) {
  const { world, experiment: { env: { psi } } } = robotView;
  const values = robotView.similarities(), side = world.spacing * scale, u = unit();
  const found = values.filter((value) => !Number.isNaN(value));
  const low = Math.min(...found), high = Math.max(...found);
  robotView.range = [low, high];
  ctx.save();
  ctx.beginPath();
  ctx.rect(x(0), y(DATA.room.size[1]), DATA.room.size[0] * scale, DATA.room.size[1] * scale);
  ctx.clip();
  values.forEach((value, p) => {
    if (Number.isNaN(value)) return;
    const px = x(world.x0 + Math.floor(p / world.ny) * world.spacing), py = y(world.y0 + (p % world.ny) * world.spacing);
    ctx.fillStyle = cividis((value - low) / (high - low));
    ctx.fillRect(px - side / 2, py - side / 2, side + 0.6, side + 0.6);
  });
  ctx.strokeStyle = "#ffffff";
  ctx.lineWidth = 2 * u;
  values.forEach((value, p) => {
    if (!(value >= psi.upper)) return;
    const px = x(world.x0 + Math.floor(p / world.ny) * world.spacing), py = y(world.y0 + (p % world.ny) * world.spacing);
    ctx.strokeRect(px - side / 2, py - side / 2, side, side);
  });
  ctx.restore();
}

function paintLegend(ctx, x, y, u) {
  const [low, high] = robotView.range, wide = 90 * u, left = x(0) + 8 * u, top = y(0) - 30 * u;
  ctx.fillStyle = "rgb(255 255 255 / 0.85)";
  ctx.fillRect(left - 4 * u, top - 4 * u, wide + 128 * u, 27 * u);
  for (let k = 0; k < 30; k++) {
    ctx.fillStyle = cividis(k / 29);
    ctx.fillRect(left + (k * wide) / 30, top, wide / 30 + 0.5, 9 * u);
  }
  const dark = { fill: "#222222", base: "top", size: 11 };
  text(ctx, low.toFixed(2), left, top + 10 * u, dark);
  text(ctx, high.toFixed(2), left + wide, top + 10 * u, { ...dark, align: "right" });
  ctx.strokeStyle = "#222222";
  ctx.strokeRect(left + wide + 10 * u, top, 9 * u, 9 * u);
  text(ctx, "stops there", left + wide + 25 * u, top - 2 * u, dark);
}

function roomTitle() {
  const { experiment } = robotView, finished = experiment.episodes.length;
  if (robotView.hand) return experiment.env.fits(robotView.hand) ? "Let go, or press Enter, to put the robot here" : "The robot does not fit here";
  if (experiment.diverged) return `The weights left the finite numbers in episode ${experiment.diverged}: this rule and step size diverge`;
  const after = experiment.settings.episodes, { frozen } = robotView;
  const trained = (number) => `Episode ${number}${number > after ? `, with what was learnt in ${after}` : ""}`;
  if (!experiment.steps) return `The robot starts ${state.start ? "here; home is" : "with its back to home,"} the white square: press Play, or All ${after}`;
  if (robotView.waiting) return `Episode ${finished + 1} begins where the robot was put${frozen ? ", frozen" : ""}: press Play`;
  if (!experiment.underWay) {
    const last = experiment.episodes.at(-1), steps = count(last.steps.length, "step");
    return last.reached ? `${trained(finished)}: it stopped after ${steps}, ${short(100 * apart(last.steps.at(-1), experiment.env.home), 2)} cm from home` : `${trained(finished)}: cut after ${steps}, not at home`;
  }
  const carried = robotView.kidnaps.some(({ step }) => step === state.made), made = experiment.steps.length;
  const how = carried ? `carried away after step ${made}` : experiment.steps.at(-1)?.atWall ? `step ${made}, turning away from a wall` : `step ${made}`;
  const seen = similarity(features(experiment.env.world.histogram(robotView.pose), experiment.env.model));
  return `${trained(finished + 1)}${frozen ? ", frozen" : ""}, ${how}: similarity ${seen.toFixed(3)}, it stops at ${experiment.env.psi.upper.toFixed(3)}`;
}

const apart = (a, b) => Math.hypot(a.x - b.x, a.y - b.y);

// --- What it sees ---------------------------------------------------------------------------------------------------

let snapshot = null; // drawn once

function pictureFrom(camera, pose, kept) {
  if (kept && snapshot) return snapshot;
  const picture = document.createElement("canvas");
  picture.width = picture.height = SEEN;
  picture.getContext("2d").putImageData(new ImageData(camera.picture(pose, SEEN), SEEN, SEEN), 0, 0);
  if (kept) snapshot = picture;
  return picture;
}

function paintView(ctx, width, height) {
  const { experiment, camera } = robotView;
  if (!experiment) return;
  const u = unit(), { env } = experiment, { pose } = robotView, gap = 14 * u;
  const side = Math.min(0.36 * height, (width - gap) / 2);
  [[pose, "the robot’s view"], [env.home, "the snapshot of home"]].forEach(([from, name], k) => {
    const left = k * (side + gap);
    ctx.imageSmoothingEnabled = false;
    ctx.drawImage(pictureFrom(camera, from, k === 1), left, 18 * u, side, side);
    text(ctx, name, left, 13 * u, { base: "bottom" });
  });
  const view = env.world.histogram(pose), { snapshot } = env.model, phi = features(view, env.model);
  const nrb = similarity(phi), bins = view.length / 3;
  const top = side + 52 * u, low = top + 0.5 * (height - top - 60 * u);
  const most = Math.max(...view, ...snapshot);
  ["red", "green", "blue"].forEach((name, channel) => {
    const wide = (width - 2 * gap) / 3, left = channel * (wide + gap);
    const px = (i) => left + (i / (bins - 1)) * wide, py = (value) => low - (value / most) * (low - top);
    const points = (values) => Array.from({ length: bins }, (_, i) => [px(i), py(values[channel * bins + i])]);
    ctx.strokeStyle = colour("line");
    line(ctx, [[left, low], [left + wide, low]]);
    curve(ctx, points(snapshot), colour("soft"), 1.4, [3, 2]);
    curve(ctx, points(view), colour("blue-line"), 1.8);
    text(ctx, name, left, top - 4 * u, { base: "bottom" });
  });
  text(ctx, "pixels by brightness; dashed: the snapshot", 0, low + 4 * u, { base: "top", size: 11, fill: colour("soft") });
  const under = low + 40 * u, bottom = height - 22 * u;
  phi.forEach((value, i) => {
    ctx.fillStyle = cividis(value);
    ctx.fillRect((i / phi.length) * width, under, width / phi.length + 0.6, bottom - under);
  });
  text(ctx, `its ${phi.length} features: bright where a bin is as at home`, 0, bottom + 4 * u, { base: "top", size: 11, fill: colour("soft") });
  const { upper, lower } = env.psi;
  const judged = nrb >= upper ? "enough to stop" : nrb >= lower ? "almost enough to stop" : `it stops at ${upper.toFixed(3)}`;
  title("r-view", `What it sees is ${nrb.toFixed(3)} similar to home, ${judged}`);
}

// --- Learning, and the steps ----------------------------------------------------------------------------------------

function paintCurve(ctx, width, height) {
  const { experiment, reference } = robotView;
  if (!experiment) return;
  const names = ["shortest way 19", ...compared().map((one) => one.name)];
  const u = unit(), left = 52 * u, right = width - widest(ctx, names);
  const lengths = experiment.episodes.map((one) => one.steps.length), { episodes } = experiment.settings;
  const shown = compared().map((one) => ({ ...one, rows: robotView.rows(one.text) })).filter(({ text, rows }) => rows.length && (state.seeds || text !== chosen()));
  const most = Math.max(400, ...lengths, ...shown.flatMap(({ rows }) => rows.flat()));
  const box = panel(ctx, { left, right, top: 22 * u, bottom: height - 42 * u, x: [1, Math.max(episodes, lengths.length)], y: [10, most * 1.1], log: true,
    xTicks: [1, 5, 10, 15, 20], yTicks: [10, 30, 100, 300, 1000].filter((value) => value < most), xLabel: "episode", yLabel: "steps of an episode (logarithmic)" });
  const ends = [];
  const levels = { random: ["random", [2, 3]], climb: ["climb", [7, 3]], shortest: ["shortest way", [12, 4]] };
  for (const [name, [label, dash]] of Object.entries(levels)) {
    const value = reference[name];
    if (!Number.isFinite(value)) continue;
    curve(ctx, [[left, box.y(value)], [right, box.y(value)]], colour("edge"), 1.4, dash);
    ends.push([`${label} ${short(value, 3)}`, box.y(value), "soft"]);
  }
  const up = (value) => box.y(Math.max(10, value));
  for (const { text, name, paint, dash, rows } of shown) {
    const stats = Array.from({ length: episodes }, (_, k) => robotView.typical(text, rows, k));
    if (rows.length > 2) {
      ctx.globalAlpha = 0.16;
      ctx.fillStyle = colour(`${paint}-line`);
      ctx.beginPath();
      stats.forEach(({ high }, k) => ctx.lineTo(box.x(k + 1), up(high)));
      stats.toReversed().forEach(({ low }, k) => ctx.lineTo(box.x(episodes - k), up(low)));
      ctx.fill();
      ctx.globalAlpha = 1;
    }
    const points = stats.map(({ value }, k) => [box.x(k + 1), up(value)]);
    curve(ctx, points, colour(`${paint}-line`), text === chosen() ? 3 : 2, dash);
    ends.push([name, points.at(-1)[1], paint]);
  }
  const { paint } = compared().at(-1), alone = !state.seeds, ink = colour(alone ? `${paint}-line` : "ink");
  const places = experiment.episodes.map((one, k) => ({ ...one, place: [box.x(k + 1), up(one.steps.length)] }));
  const points = places.filter((one) => !one.frozen).map(({ place }) => place);
  if (alone) curve(ctx, points, ink, 2.6);
  ctx.lineWidth = 1.5 * u;
  for (const { place: [px, py], reached, frozen } of places) {
    const edge = frozen ? colour("pink-line") : ink;
    (frozen ? square : disc)(ctx, px, py, (alone ? 4 : 2.6) * u, reached ? edge : colour("paper"), edge);
  }
  if (alone && points.length) ends.push([ruleName(), points.at(-1)[1], paint]);
  if (ends.length) labelEnds(ctx, ends, right + 10 * u, 22 * u, height - 44 * u);
  title("r-curve", curveTitle(lengths, episodes, reference));
}

function square(ctx, x, y, half, fill, edge) {
  ctx.fillStyle = fill;
  ctx.strokeStyle = edge;
  ctx.fillRect(x - half, y - half, 2 * half, 2 * half);
  ctx.strokeRect(x - half, y - half, 2 * half, 2 * half);
}

const mean = (values) => sum(values) / values.length;

const late = (lengths) => mean(lengths.slice(DATA.settings.episodes - LATE, DATA.settings.episodes));

function curveTitle(lengths, episodes, { climb, shortest }) {
  const known = compared().reverse().map((one) => ({ ...one, rows: robotView.rows(one.text) })).filter(({ rows }) => rows.length);
  const beside = Number.isFinite(climb) ? `; a climb ${short(climb)}${Number.isFinite(shortest) ? `, the shortest way ${short(shortest)}` : ""}` : "";
  const last = `Steps of the last ${LATE} of ${episodes} episodes`;
  if (state.seeds) {
    const said = known.map(({ text, name, rows }) => {
      const { value, low, high } = robotView.typical(text, rows);
      return `${short(value)}${rows.length > 2 ? ` [${short(low)}, ${short(high)}]` : ""} with ${name}`;
    });
    const many = Math.min(...compared().map(({ text }) => robotView.rows(text).length)), seeds = `seeds ${state.seed} to ${state.seed + state.seeds - 1}`;
    if (!said.length) return `${last}, ${seeds}: being worked out …`;
    return `${last}, ${seeds}${many < state.seeds ? ` (${many} of ${state.seeds} so far)` : ""}: ${said.join(", ")}`;
  }
  if (!lengths.length && !known.length) return "The learning curve, beside a climb up the similarity, chance and the shortest way";
  const only = `Seed ${state.seed} only`;
  const [frozen, on] = [1, 0].map((share) => robotView.experiment.episodes.filter((one) => one.frozen === share).map((one) => one.steps.length));
  if (frozen.length) return `${only}: ${on.length ? `the last ${count(Math.min(LATE, on.length), "episode")} with its learning on: ${short(mean(on.slice(-LATE)))} steps on average; ` : ""}frozen (${frozen.length}): ${short(mean(frozen))}${beside}`;
  if (lengths.length < episodes) return `${only}: ${count(lengths.length, "episode")} so far${lengths.length ? `, ${short(mean(lengths))} steps on average` : ""}`;
  if (known.length > 1) return `${only}: ${last.toLowerCase()}: ${known.map(({ name, rows }) => `${short(late(rows[0]))} with ${name}`).join(", ")}. “${TEN} seeds” tells luck from rule`;
  return `${only}: the first ${LATE} episodes take ${short(mean(lengths.slice(0, LATE)))} steps, the last ${LATE} ${short(late(lengths))}${beside}`;
}

function paintSteps(ctx, width, height) {
  const { experiment, steps } = robotView;
  if (!experiment) return;
  const u = unit(), { psi } = experiment.env;
  const { left, right, first, x } = timeAxis(width, steps.length), seen = steps.slice(first);
  const low = Math.min(0.6, ...seen.map((step) => step.similarity)), third = (height - 20 * u) / 3;
  const box = panel(ctx, { left, right, top: 20 * u, bottom: third - 6 * u, x: [0, 1], y: [low, 1], yTicks: ticks(low, 1, 2), yLabel: "similarity; dashed: where it stops" });
  curve(ctx, [[left, box.y(psi.upper)], [right, box.y(psi.upper)]], colour("ink"), 1, [5, 3]);
  curve(ctx, seen.map((step, t) => [x(t + first), box.y(step.similarity)]), colour("green-line"), 2);
  stems(ctx, seen, (t) => x(t + first), { left, right, top: third + 26 * u, middle: 2 * third + 16 * u, bottom: height - 20 * u });
  text(ctx, steps.length ? `step ${first + 1}` : "", left, height - 2 * u, { base: "bottom", fill: colour("soft") });
  if (steps.length > 1) text(ctx, steps.length, x(steps.length - 1), height - 2 * u, { base: "bottom", align: "center", fill: colour("soft") });
  const later = steps.slice(1).filter((step) => !step.frozen), reset = later.filter((step) => step.clipped).length;
  const back = reaches(steps).filter((_, k) => !steps[k].frozen);
  if (steps.length > 1 && !later.length) return title("r-steps", "Frozen: nothing is learnt, so there is no TD error and no λ");
  title("r-steps", later.length
    ? `Mean λ ${short(mean(later.map((step) => step.lambda)), 2)}, reset at ${reset} of ${count(later.length, "step")}; the trace reaches back ${short(mean(back), 2)} steps on average, ${Math.max(...back)} at most`
    : "Similarity, TD error and λ of each step");
}

// Over how many steps each error of an episode is shared with at least a hundredth of its weight.
function reaches(steps) {
  return steps.map((_, k) => {
    let back = 0;
    for (let weight = 1; back < k && (weight *= steps[k - back].lambda) >= 0.01; ) back++;
    return back;
  });
}

// --- Hands ----------------------------------------------------------------------------------------------------------

function setUpRobot() {
  robotView.room = new Chart("r-room", (DATA.room.size[1] + 2 * WALL_M) / (DATA.room.size[0] + 2 * WALL_M), paintRoom);
  robotView.view = new Chart("r-view", 430, paintView);
  robotView.curve = new Chart("r-curve", 400, paintCurve);
  robotView.stepsChart = new Chart("r-steps", 400, paintSteps);
  const { canvas } = robotView.room;
  let turning = false, from = null;
  const place = (event) => roomScale(canvas.clientWidth).back(event.offsetX, event.offsetY);
  canvas.addEventListener("pointerdown", (event) => {
    if (!robotView.experiment) return;
    const { scale } = roomScale(canvas.clientWidth), point = place(event), near = Math.max(RADIUS_M, (22 * unit()) / scale);
    const handle = (held) => poseOf(ahead(held, handleAt(scale)));
    const reach = (held) => Math.min(apart(point, held), apart(point, handle(held)));
    const [held] = robotView.grips.sort((a, b) => reach(a) - reach(b));
    if (reach(held) > near) return;
    turning = apart(point, handle(held)) < apart(point, held);
    player.pause();
    canvas.setPointerCapture(event.pointerId);
    robotView.hold(held);
    from = held;
    robotView.room.refresh();
  });
  // A finger that holds the robot does not scroll the page; elsewhere in the room it does.
  canvas.addEventListener("touchstart", (event) => robotView.hand && event.preventDefault(), { passive: false });
  canvas.addEventListener("pointermove", (event) => {
    if (!robotView.hand || !canvas.hasPointerCapture(event.pointerId)) return;
    const { hand } = robotView, point = place(event);
    if (turning) hand.heading = Math.atan2(point.y - hand.y, point.x - hand.x);
    else Object.assign(hand, point);
    robotView.room.refresh();
  });
  const drop = (event) => {
    if (!robotView.hand || !canvas.hasPointerCapture(event.pointerId)) return;
    canvas.releasePointerCapture(event.pointerId);
    const { hand } = robotView;
    if (apart(hand, from) < 0.005 && hand.heading === from.heading) robotView.hand = null;
    else robotView.put(hand);
    robotView.room.refresh();
  };
  canvas.addEventListener("pointerup", drop);
  canvas.addEventListener("pointercancel", () => ((robotView.hand = null), robotView.room.refresh()));
  canvas.addEventListener("keydown", (event) => {
    const move = { ArrowLeft: [-1, 0, 0], ArrowRight: [1, 0, 0], ArrowUp: [0, 1, 0], ArrowDown: [0, -1, 0], ",": [0, 0, 1], ".": [0, 0, -1] }[event.key];
    if (!robotView.experiment) return;
    if (event.key === "Enter" && robotView.hand) robotView.put(robotView.hand);
    else if (event.key === "Escape" && robotView.hand) robotView.hand = null;
    else if (move) {
      player.pause();
      if (!robotView.hand) robotView.hold(robotView.grips[0]);
      const { hand } = robotView;
      hand.x += 0.02 * move[0];
      hand.y += 0.02 * move[1];
      hand.heading = wrapped(hand.heading + radians(20) * move[2]);
    } else return;
    event.preventDefault();
    robotView.room.refresh();
  });
}
