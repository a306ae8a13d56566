// The robot and its world, as in homing_lib: robot.py, features.py, environment.py, and atlas.py over compact.atlas.

const FRONT_SENSORS = [1, 2, 3, 4]; // 45, 10, -10 and -45 degrees from the heading
const [LEFT, RIGHT] = [0, 1];

const radians = (degrees) => (degrees * Math.PI) / 180;

const wrapped = (angle) => (Math.abs(angle) > Math.PI ? Math.atan2(Math.sin(angle), Math.cos(angle)) : angle);

// Python's round(): halves to the even neighbour.
function rounded(value) {
  const below = Math.floor(value);
  const part = value - below;
  return part < 0.5 || (part === 0.5 && below % 2 === 0) ? below : below + 1;
}

// numpy's sum of a contiguous array of 8 or more, in its order.
function pairwiseSum(values, from = 0, count = values.length) {
  if (count <= 128) {
    const r = Array.from({ length: 8 }, (_, k) => values[from + k]);
    let i = 8;
    for (; i < count - (count % 8); i += 8) for (let k = 0; k < 8; k++) r[k] += values[from + i + k];
    let total = r[0] + r[1] + (r[2] + r[3]) + (r[4] + r[5] + (r[6] + r[7]));
    for (; i < count; i++) total += values[from + i];
    return total;
  }
  let half = Math.floor(count / 2);
  half -= half % 8;
  return pairwiseSum(values, from, half) + pairwiseSum(values, from + half, count - half);
}

// The table of views that comes with the library; homing_lib/publish/compact.py describes the file. bytes: unpacked.
class Atlas {
  constructor(bytes) {
    const end = bytes.indexOf(10);
    const { arrays, settings, room, x0, y0, margin_m: margin } = JSON.parse(String.fromCharCode(...bytes.subarray(0, end)));
    const shapes = {}, content = {};
    let start = end + 1;
    for (const [name, kind, shape] of arrays) {
      const size = shape.reduce((a, b) => a * b) * (kind === "u1" ? 1 : 8);
      const part = bytes.slice(start, start + size);
      shapes[name] = shape;
      content[name] = kind === "u1" ? part : new Float64Array(part.buffer);
      start += size;
    }
    Object.assign(this, { room, x0, y0, spacing: settings.atlas_spacing_m, heading0: room.home[2] });
    [this.nx, this.ny] = shapes.clearance_m;
    [, this.headings, this.bins] = shapes.counts_low;
    this.perMetre = 1 / this.spacing;
    this.perRadian = this.headings / (2 * Math.PI);
    this.pixels = settings.image_size ** 2;
    this.clearances = content.clearance_m;
    this.readings = content.infrared_m;
    this.counts = new Uint16Array(content.counts_low); // by loops here and below, which are ten times as fast as maps
    for (let i = 0; i < this.counts.length; i++) this.counts[i] |= content.counts_high[i] << 8;
    let next = 0;
    this.positions = Array.from(this.clearances, (clearance) => {
      if (clearance < -margin) return -1;
      next += this.headings;
      return next - this.headings;
    });
    this.size = next;
  }

  // Shares of the pixels in each bin, red, green and blue in turn, from the lattice pose with this number.
  view(number) {
    const view = new Float64Array(this.bins), first = number * this.bins;
    for (let i = 0; i < view.length; i++) view[i] = this.counts[first + i] / this.pixels;
    return view;
  }

  histogram(pose) {
    return this.view(this.nearest(pose));
  }

  infrared(pose) {
    const number = this.nearest(pose);
    return this.readings.subarray(number * 8, number * 8 + 8);
  }

  clearance(x, y) {
    let u = (x - this.x0) * this.perMetre;
    let v = (y - this.y0) * this.perMetre;
    if (!(u >= 0 && u < this.nx - 1 && v >= 0 && v < this.ny - 1)) return -0.1;
    const i = Math.floor(u), j = Math.floor(v);
    u -= i;
    v -= j;
    const low = i * this.ny + j, high = low + this.ny, c = this.clearances;
    return (1 - u) * ((1 - v) * c[low] + v * c[low + 1]) + u * ((1 - v) * c[high] + v * c[high + 1]);
  }

  // Where the lattice has its n-th position.
  positionAt(n) {
    return { x: this.x0 + Math.floor(n / this.ny) * this.spacing, y: this.y0 + (n % this.ny) * this.spacing };
  }

  nearest({ x, y, heading }) {
    const i = rounded((x - this.x0) * this.perMetre), j = rounded((y - this.y0) * this.perMetre);
    const turn = rounded((heading - this.heading0) * this.perRadian) % this.headings;
    return this.positions[i * this.ny + j] + (turn < 0 ? turn + this.headings : turn);
  }
}

// --- Drive and reflex -----------------------------------------------------------------------------------------------

function arc({ x, y, heading }, left, right, wheelBase) {
  const turn = (right - left) / wheelBase;
  const half = turn / 2;
  const chord = ((left + right) / 2) * (half ? Math.sin(half) / half : 1);
  const direction = heading + half;
  return {
    x: x + chord * Math.cos(direction),
    y: y + chord * Math.sin(direction),
    heading: wrapped(heading + turn),
  };
}

// Follow the arc to its end or until the body touches something: [pose, whether it was stopped].
function drive(pose, left, right, wheelBase, world) {
  const end = arc(pose, left, right, wheelBase);
  const advance = Math.abs(left + right) / 2;
  if (!advance || world.clearance(pose.x, pose.y) > advance) return [end, false];
  const touches = (share) => {
    const { x, y } = arc(pose, share * left, share * right, wheelBase);
    return world.clearance(x, y) < 0;
  };
  let blocked = [0.25, 0.5, 0.75, 1].find(touches);
  if (!blocked) return [end, false];
  let free = blocked - 0.25;
  for (let i = 0; i < 10; i++) {
    const middle = (free + blocked) / 2;
    if (touches(middle)) blocked = middle;
    else free = middle;
  }
  return [arc(pose, free * left, free * right, wheelBase), true];
}

// How far the wheels go, [left, right], for each action and for each turn in place, metres.
function wheelCommands({ turn_deg, wheel_base_m, turn_advance_m, forward_m }) {
  const turn = (radians(turn_deg) * wheel_base_m) / 2;
  const slow = turn_advance_m - turn, fast = turn_advance_m + turn;
  return { actions: [[slow, fast], [fast, slow], [forward_m, forward_m]], turns: [[-turn, turn], [turn, -turn]] };
}

class Robot {
  constructor(world, settings, pose) {
    Object.assign(this, { world, settings }, wheelCommands(settings));
    this.place(pose);
  }

  place(pose) {
    this.pose = pose;
    this.reflex = null;
  }

  // One step: [the action driven, whether the robot was at a wall].
  act(action, rng) {
    const reflex = this.reflex;
    if (reflex !== null) action = reflex;
    const [left, right] = reflex === null ? this.actions[action] : this.turns[reflex];
    const { world, settings: { wheel_base_m: wheelBase, clear_way_m: clearWay } } = this;
    let stopped;
    [this.pose, stopped] = drive(this.pose, left, right, wheelBase, world);
    if (stopped) this.reflex = rng.random() < 0.5 ? LEFT : RIGHT;
    else if (reflex !== null) {
      const readings = world.infrared(this.pose);
      if (FRONT_SENSORS.every((k) => readings[k] >= clearWay)) this.reflex = null;
    }
    return [action, stopped || reflex !== null];
  }
}

// What a map holds under a key; made the first time.
function remember(map, key, make) {
  if (!map.has(key)) map.set(key, make());
  return map.get(key);
}

// --- What the robot knows of home -----------------------------------------------------------------------------------

// The snapshot and the pooled variance of the difference to it (eqs. 9, 10), from a random drive.
function survey(world, settings, home, rng) {
  const snapshot = world.histogram(home);
  const robot = new Robot(world, settings, home);
  const seen = [];
  for (let step = 0; step < settings.survey_steps; step++) {
    robot.act(rng.integers(3), rng);
    seen.push(world.nearest(robot.pose));
  }
  const views = new Map();
  const rows = seen.map((number) => remember(views, number, () => world.view(number)));
  const mean = snapshot.map((_, i) => sum(rows.map((row) => row[i])) / rows.length);
  const perBin = mean.map((centre, i) => sum(rows.map((row) => (row[i] - centre) * (row[i] - centre))) / (rows.length - 1));
  const floor = (settings.variance_floor_pixels / settings.image_size ** 2) ** 2;
  return { snapshot, variance: Math.max(pairwiseSum(perBin) / perBin.length, floor) };
}

// Eq. (12).
function features(histogram, { snapshot, variance }) {
  const exponent = -0.5 / variance, phi = new Float64Array(histogram.length);
  for (let i = 0; i < phi.length; i++) {
    const difference = histogram[i] - snapshot[i];
    phi[i] = Math.exp(difference * difference * exponent);
  }
  return phi;
}

// Eq. (15), NRB.
const similarity = (phi) => pairwiseSum(phi) / phi.length;

function freePose(world, [width, depth], rng) {
  for (;;) {
    const x = rng.uniform(0, width), y = rng.uniform(0, depth);
    if (world.clearance(x, y) >= 0) return { x, y, heading: rng.uniform(-Math.PI, Math.PI) };
  }
}

// --- The task -------------------------------------------------------------------------------------------------------

// Eq. (16), and the wall penalty of section V.A.
function rewardOf(step, now, before, psiLower, atWall, settings) {
  let gain = -1 / step;
  if (now >= psiLower && before >= psiLower) gain += 2 * now - before;
  return atWall ? gain - settings.wall_penalty : gain;
}

const poseOf = ([x, y, heading]) => ({ x, y, heading });

class HomingEnv {
  // model: what an earlier survey from the same seed has found, if there was one.
  constructor(world, settings, surveySeed, worldSeed, model) {
    Object.assign(this, { world, settings });
    this.home = poseOf(world.room.home);
    this.start = poseOf(world.room.start);
    this.psi = stoppingThresholds(settings.multiplier);
    this.model = model ?? survey(world, settings, this.home, new Generator(surveySeed));
    this.rng = new Generator(worldSeed);
    this.robot = new Robot(world, settings, this.home);
    this.seen = new Map(); // features and similarity, by lattice pose
  }

  look() {
    const number = this.world.nearest(this.robot.pose);
    return remember(this.seen, number, () => {
      const phi = features(this.world.view(number), this.model);
      return { phi, similarity: similarity(phi) };
    });
  }

  fits({ x, y }) {
    const [width, depth] = this.world.room.size;
    return x >= 0 && x <= width && y >= 0 && y <= depth && this.world.clearance(x, y) >= 0;
  }

  reset(start = this.start) {
    this.robot.place(start);
    this.steps = 0;
    this.view = this.look();
    return this.view.phi;
  }

  step(action) {
    this.steps++;
    const [driven, atWall] = this.robot.act(action, this.rng);
    const before = this.view.similarity;
    this.view = this.look();
    const now = this.view.similarity;
    const reward = rewardOf(this.steps, now, before, this.psi.lower, atWall, this.settings);
    const terminated = now >= this.psi.upper;
    const truncated = !terminated && this.steps >= this.settings.max_steps;
    return { phi: this.view.phi, similarity: now, reward, action: driven, atWall, terminated, truncated };
  }
}
