// The run of the robot and those beside it: playing, kidnaps and freezing, references and many seeds.

const TEN = 10, LATE = 5; // seeds at a press; last episodes of the training

const robotView = {
  world: null, // the atlas, once it is unpacked
  experiment: null,
  played: "", // the key of its run
  models: new Map(), // what a survey found, by seed
  references: new Map(), // steps of climb, random and the shortest way, by all that they depend on
  lengths: new Map(), // of the episodes of whole runs, by rule, seed and all that they depend on
  intervals: new Map(), // interquartile means of these
  hand: null, // a pose that is being dragged
  handsStart: false, // whether that is the start's, not the robot's

  begin(changes, seed = state.seed) {
    const { alpha0, multiplier, epsilon: epsilon0, update } = state;
    const settings = { ...DATA.settings, alpha0, multiplier, epsilon0, update, ...changes };
    const experiment = new Experiment(this.world, settings, seed, this.models.get(seed)), { env } = experiment;
    this.models.set(seed, env.model);
    const start = readPose(state.start);
    if (start && env.fits(start)) env.start = start;
    return experiment;
  },

  // Make the run anew, as far as it had come, with the kidnaps in their places.
  rebuild() {
    if (!this.world) return;
    this.experiment = this.begin({ lambda_rule: chosen() });
    this.played = this.key();
    this.experiment.total += state.more;
    const made = state.made;
    state.made = 0;
    while (state.made < made && this.advance());
    this.refer();
    this.compare();
    this.show();
  },

  restart() {
    Object.assign(state, { made: 0, more: 0, kidnap: "", frozen: "" });
    this.rebuild();
  },

  // After a change: from the beginning, and to the end if the run before had come to its end.
  change() {
    const whole = this.experiment?.done;
    this.restart();
    if (whole) player.rush();
  },

  // One step; false where the run is over.
  advance() {
    const { experiment } = this;
    if (experiment.done) return false;
    experiment.freeze(this.frozen);
    const kidnap = this.kidnapAt(state.made);
    if (kidnap) experiment.underWay ? experiment.kidnap(kidnap) : experiment.begin(kidnap);
    if (!experiment.step()) return false;
    state.made++;
    return true;
  },

  // Where the training is over: one more episode with what was learnt.
  goOn() {
    const { experiment } = this;
    if (!experiment?.done || experiment.diverged || !inRange("more", state.more + 1)) return;
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

  get over() {
    return this.experiment.done;
  },

  get steps() {
    return this.experiment?.steps ?? [];
  },

  // Where the robot is, or where it was put down after an episode until it drives on.
  get pose() {
    const { steps, env } = this.experiment;
    return this.waiting ?? (steps ? env.robot.pose : env.start);
  },

  get waiting() {
    return this.experiment.underWay ? undefined : this.kidnapAt(state.made);
  },

  // Where it is put down after so many steps, if it is and if it fits there.
  kidnapAt(made) {
    const found = state.kidnap.split(";").map((text) => text.split(":")).findLast(([step]) => step !== "" && Number(step) === made);
    const pose = readPose(found?.[1]);
    return pose && this.experiment.env.fits(pose) ? pose : undefined;
  },

  // Whether it is frozen, as from here on.
  get frozen() {
    return state.frozen.split(";").filter((step) => step !== "" && Number(step) <= state.made).length % 2 > 0;
  },

  // From here on frozen, or with its learning on; twice at the same step is not at all.
  freeze() {
    if (!this.experiment) return this.tell();
    const here = String(state.made), switches = state.frozen.split(";").filter(Boolean);
    const others = switches.filter((step) => step !== here);
    state.frozen = (others.length < switches.length ? others : [...others, here]).join(";");
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
    const { experiment, handsStart } = this, { done, env, underWay } = experiment;
    Object.assign(this, { hand: null, handsStart: false });
    if (!env.fits(pose)) return say("The robot does not fit there; put it where it touches nothing.");
    say("");
    const place = [pose.x, pose.y, pose.heading].map((value) => Number(value.toFixed(4))).join(",");
    if (handsStart) {
      state.start = place;
      return changed();
    }
    this.goOn();
    const others = state.kidnap.split(";").filter((kidnap) => kidnap && !kidnap.startsWith(`${state.made}:`));
    state.kidnap = [...others, `${state.made}:${place}`].join(";");
    if (underWay) experiment.kidnap(readPose(place));
    this.show();
    if (done) player.run("play");
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

  // What climbing, chance and the shortest way take from this start.
  refer() {
    const key = [state.seed, state.start, state.multiplier].join(" ");
    this.reference = this.references.get(key) ?? { climb: NaN, random: NaN, "shortest way": NaN };
    if (!this.references.has(key)) between("reference", "robot", this.referring(key, this.reference));
  },

  *referring(key, reference) {
    for (const controller of ["climb", "random"]) {
      const experiment = this.begin({ controller });
      while (experiment.step()) yield;
      reference[controller] = mean(lengthsOf(experiment));
      refresh("r-curve");
    }
    reference["shortest way"] = yield* searching(this.begin().env);
    this.references.set(key, reference);
    refresh("r-curve");
  },

  // The rules beside the chosen one from the same seed; with `seeds`, these and the chosen one from that many.
  compare() {
    between("seeds", "robot", this.comparing());
  },

  *comparing() {
    for (let seed = state.seed; seed < state.seed + (state.seeds || 1); seed++) {
      for (const text of state.seeds ? [...kept(), chosen()] : kept()) {
        const key = this.key(text, seed);
        if (this.lengths.has(key)) continue;
        const experiment = this.begin({ lambda_rule: text }, seed);
        while (experiment.step()) yield;
        this.lengths.set(key, lengthsOf(experiment));
        refresh("r-curve");
        this.tell();
      }
    }
    jobs.delete("seeds");
    this.tell();
  },

  // All that a run depends on.
  key(text = chosen(), seed = state.seed) {
    const { alpha0, epsilon, multiplier, update, start } = state;
    return [text, seed, alpha0, epsilon, multiplier, update, start].join(" ");
  },

  // The lengths of the runs of a rule that are compared, a row for each seed up to the first that is not worked out.
  rows(text) {
    const rows = Array.from({ length: state.seeds || 1 }, (_, k) => this.lengths.get(this.key(text, state.seed + k)));
    return rows.includes(undefined) ? rows.slice(0, rows.indexOf(undefined)) : rows;
  },

  // Over these rows, of what `of` takes from each; name: what that is, by which it is worked out once.
  interval(text, rows, name, of) {
    return remember(this.intervals, [this.key(text, state.seed), rows.length, name].join(" "), () => iqmInterval(rows.map(of)));
  },

  // The compared rules, the chosen one first, with the rows of each.
  get rules() {
    return compared().reverse().map((rule) => ({ ...rule, rows: this.rows(rule.text) }));
  },

  // Ten seeds of all rules shown; or ten more; or, pressed while they run, no more than there are.
  seeds() {
    if (!this.world) return;
    if (this.working) {
      jobs.delete("seeds");
      state.seeds = Math.min(...this.rules.map(({ rows }) => rows.length));
    } else {
      state.seeds = Math.min(state.seeds + TEN, OPTIONS.seeds.range[1]);
      this.compare();
    }
    this.show();
  },

  get working() {
    return state.seeds > 0 && jobs.has("seeds");
  },

  tell() {
    at("frozen").checked = this.frozen;
    at("after-freezing").hidden = !state.frozen; // whoever is to guess first does not read it before
    const done = sum(this.rules.map(({ rows }) => rows.length)), all = state.seeds * compared().length;
    at("robot-seeds").textContent = done < all && this.working ? `Stop ${done}/${all}` : state.seeds ? `${TEN} more seeds` : `${TEN} seeds`;
  },

  show() {
    const { experiment } = this;
    if (experiment?.episodes.length >= DATA.settings.episodes && !state.kidnap && !state.frozen)
      this.lengths.set(this.played, lengthsOf(experiment));
    at("robot-home").hidden = !state.start;
    this.tell();
    refresh("r-");
    noteAddress();
  },

  table() {
    const names = ["x", "y", "heading", "action", "reward", "similarity", "delta", "lambda", "clipped", "change", "atWall"];
    const episodes = this.experiment?.episodes.map(({ steps }) => steps) ?? [];
    if (this.experiment?.underWay) episodes.push(this.steps);
    const row = (step) => names.map((name) => step[name]);
    return [["episode", "step", ...names.slice(0, -1), "at_wall"], episodes.flatMap((steps, e) => steps.map((step, t) => [e + 1, t + 1, ...row(step)]))];
  },
};

// Steps of the episodes of the training; where the weights ran away, as many as an episode can have.
function lengthsOf({ episodes, settings }) {
  return Array.from({ length: settings.episodes }, (_, k) => episodes[k]?.steps.length ?? settings.max_steps);
}

// From "x,y,heading", or null.
function readPose(text = "") {
  const [x, y, heading, ...more] = text.split(",").map(Number);
  return [x, y, heading].every(Number.isFinite) && !more.length ? { x, y, heading: wrapped(heading) } : null;
}
