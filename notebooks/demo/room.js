// The room from above: its things, the robot and its way, the map of the similarity, and the hands that move the robot.

const WALL_M = 0.035, RADIUS_M = DATA.settings.body_diameter_m / 2;
const WAY = "#0072B2", FROZEN = "#B0558B"; // with its learning on, and without

// Pixels for metres, at(pose, metres ahead of it, turned by), and metres for pixels.
function roomScale(width) {
  const [across, deep] = DATA.room.size, scale = width / (across + 2 * WALL_M);
  const x = (metres) => (metres + WALL_M) * scale;
  const y = (metres) => (deep + WALL_M - metres) * scale;
  const at = (pose, metres = 0, turn = 0) => {
    const direction = pose.heading + turn;
    return [x(pose.x + metres * Math.cos(direction)), y(pose.y + metres * Math.sin(direction))];
  };
  return { scale, x, y, at, back: (px, py) => ({ x: px / scale - WALL_M, y: deep + WALL_M - py / scale }) };
}

const apart = (a, b) => Math.hypot(a.x - b.x, a.y - b.y);

function paintRoom(ctx, width) {
  const scaled = roomScale(width), { scale, at } = scaled, { experiment, hand } = robotView;
  paintFurniture(ctx, scaled);
  if (!experiment) return "The table of views is being unpacked …";
  const { home, start } = experiment.env;
  const shape = (corners) => {
    line(ctx, [...corners, corners[0]]);
    ctx.fillStyle = "#ffffff";
    ctx.fill();
    ctx.stroke();
  };
  ctx.strokeStyle = "#222222";
  ctx.lineWidth = 1.6;
  shape([1, 3, 5, 7].map((k) => at(home, RADIUS_M * Math.SQRT2, (k * Math.PI) / 4)));
  line(ctx, [at(home), at(home, RADIUS_M)]);
  shape([0, 2.4, -2.4].map((turn) => at(start, 1.3 * RADIUS_M, turn)));
  paintWays(ctx, at);
  paintSight(ctx, at, robotView.pose);
  paintRobot(ctx, scaled, robotView.pose, "#D55E00");
  ctx.lineWidth = 2;
  for (const held of hand ? [hand] : robotView.grips) disc(ctx, ...at(held, handleAt(scale)), 6, "rgb(255 255 255 / 0.7)", "#222222");
  ctx.globalAlpha = 0.75;
  if (hand) paintRobot(ctx, scaled, hand, experiment.env.fits(hand) ? "#009E73" : "#000000");
  ctx.globalAlpha = 1;
  if (state.map !== "none") paintLegend(ctx, scaled);
  return roomTitle();
}

function paintFurniture(ctx, scaled) {
  const { scale, x, y } = scaled, { room } = DATA, [across, deep] = room.size;
  const paint = (left, low, wide, tall, fill) => block(ctx, x(left), y(low + tall), wide * scale, tall * scale, fill);
  const rgb = (parts) => `rgb(${parts.map((part) => Math.round(255 * part)).join(" ")})`;
  const sides = {
    east: [across, -WALL_M, WALL_M, deep + 2 * WALL_M], west: [-WALL_M, -WALL_M, WALL_M, deep + 2 * WALL_M],
    north: [-WALL_M, deep, across + 2 * WALL_M, WALL_M], south: [-WALL_M, -WALL_M, across + 2 * WALL_M, WALL_M],
  };
  paint(0, 0, across, deep, colour("floor"));
  if (robotView.experiment && state.map !== "none") paintMap(ctx, scaled);
  for (const [name, side] of Object.entries(sides)) paint(...side, rgb(room.colours[name]));
  for (const picture of room.pictures) {
    const [left, low, wide, tall] = sides[picture.wall], [length] = picture.size, from = picture.along - length / 2;
    if (wide > tall) paint(from, low, length, tall, rgb(picture.rgb));
    else paint(left, from, wide, length, rgb(picture.rgb));
  }
  ctx.strokeStyle = colour("ink");
  ctx.lineWidth = 1;
  for (const thing of room.objects) {
    if (thing.kind === "Box") {
      const [long, wide] = thing.size, left = thing.x - long / 2, low = thing.y - wide / 2;
      paint(left, low, long, wide, colour("thing"));
      ctx.strokeRect(x(left), y(low + wide), long * scale, wide * scale);
    } else disc(ctx, x(thing.x), y(thing.y), thing.radius * scale, colour("thing"), colour("ink"));
  }
}

// The ways of the last episodes, faint, and of the one under way.
function paintWays(ctx, at) {
  const { episodes, steps: now, from: start } = robotView.experiment;
  const dash = (leg) => (leg.carried ? [3, 5] : []), way = (leg) => leg.points.map((pose) => at(pose));
  ctx.globalAlpha = 0.55;
  for (const { steps, from } of episodes.slice(-5)) {
    if (steps !== now) for (const leg of legs(from, steps)) curve(ctx, way(leg), colour("edge"), 1.2, dash(leg));
  }
  ctx.globalAlpha = 1;
  for (const leg of now ? legs(start, now) : []) {
    curve(ctx, way(leg), "#ffffff", 4.5, dash(leg));
    curve(ctx, way(leg), leg.frozen ? FROZEN : WAY, 2.5, dash(leg));
  }
}

// The way of an episode, cut where the robot was carried, frozen or learnt on.
function legs(from, steps) {
  const found = [];
  let points = [from];
  steps.forEach((step, k) => {
    const { carried, frozen } = step;
    points.push(step);
    if (!carried && steps[k + 1]?.frozen === frozen) return;
    found.push({ points, frozen });
    if (carried) found.push({ points: [step, carried], frozen, carried });
    points = [carried ?? step];
  });
  return found;
}

// A ring ahead of what can be turned, far enough from its middle for a thumb.
const handleAt = (scale) => Math.max(0.075, 34 / scale);

function paintRobot(ctx, { scale, at }, pose, fill) {
  ctx.lineWidth = 1.5;
  disc(ctx, ...at(pose), RADIUS_M * scale, fill, "#ffffff");
  curve(ctx, [at(pose), at(pose, RADIUS_M)], "#ffffff", 2.5);
}

function paintSight(ctx, at, pose) {
  const half = radians(DATA.settings.field_of_view_deg) / 2;
  ctx.fillStyle = "rgb(255 255 255 / 0.28)";
  ctx.beginPath();
  ctx.moveTo(...at(pose));
  for (const turn of [half, half / 2, 0, -half / 2, -half]) ctx.lineTo(...at(pose, 0.22, turn));
  ctx.fill();
}

// --- The map of the similarity --------------------------------------------------------------------------------------

const similarities = { model: null, all: null }; // of all lattice poses, by what the robot knows of home

// One for each position of the lattice: the best over all headings, or at the robot's; NaN outside.
function similarityMap() {
  const { world, pose, experiment: { env: { model } } } = robotView;
  if (similarities.model !== model) {
    const all = Float64Array.from({ length: world.size }, (_, number) => similarity(features(world.view(number), model)));
    Object.assign(similarities, { model, all });
  }
  const { all } = similarities;
  return world.positions.map((first, position) => {
    if (first < 0) return NaN;
    if (state.map === "best") return Math.max(...all.subarray(first, first + world.headings));
    return all[world.nearest({ ...world.positionAt(position), heading: pose.heading })];
  });
}

const isMapped = (value) => !Number.isNaN(value);

function paintMap(ctx, { scale, x, y }) {
  const { world, experiment: { env: { psi } } } = robotView, values = similarityMap(), side = world.spacing * scale;
  const [across, deep] = DATA.room.size, low = Math.min(...values.filter(isMapped)), high = Math.max(...values.filter(isMapped));
  similarities.range = [low, high];
  const corner = (position) => {
    const place = world.positionAt(position);
    return [x(place.x) - side / 2, y(place.y) - side / 2];
  };
  ctx.save();
  ctx.beginPath();
  ctx.rect(x(0), y(deep), across * scale, deep * scale);
  ctx.clip();
  values.forEach((value, position) => {
    if (isMapped(value)) block(ctx, ...corner(position), side + 0.6, side + 0.6, cividis((value - low) / (high - low)));
  });
  ctx.strokeStyle = "#ffffff";
  ctx.lineWidth = 2;
  values.forEach((value, position) => {
    if (value >= psi.upper) ctx.strokeRect(...corner(position), side, side);
  });
  ctx.restore();
}

function paintLegend(ctx, { x, y }) {
  const [low, high] = similarities.range, wide = 90, left = x(0) + 8, top = y(0) - 30;
  const dark = { fill: "#222222", base: "top", size: 11 };
  block(ctx, left - 4, top - 4, wide + 128, 27, "rgb(255 255 255 / 0.85)");
  scaleBar(ctx, left, top, wide, 9);
  text(ctx, low.toFixed(2), left, top + 10, dark);
  text(ctx, high.toFixed(2), left + wide, top + 10, { ...dark, align: "right" });
  ctx.strokeStyle = "#222222";
  ctx.strokeRect(left + wide + 10, top, 9, 9);
  text(ctx, "stops there", left + wide + 25, top - 2, dark);
}

function roomTitle() {
  const { experiment, hand, frozen } = robotView, { env, steps, episodes, diverged, underWay } = experiment;
  if (hand) return env.fits(hand) ? handTitle() : "The robot does not fit here";
  if (diverged) return `The weights left the finite numbers in episode ${diverged}: this rule and step size diverge`;
  const training = experiment.settings.episodes, number = episodes.length + underWay;
  const episode = `Episode ${number}${number > training ? `, with what was learnt in ${training}` : ""}`;
  const here = state.start ? "here; home is" : "with its back to home,";
  if (!steps) return `The robot starts ${here} the white square: press Play, or All ${training}`;
  if (robotView.waiting) return `Episode ${number + 1} begins where the robot was put${frozen ? ", frozen" : ""}: press Play`;
  if (!underWay) {
    const { reached } = episodes.at(-1), after = count(steps.length, "step");
    if (!reached) return `${episode}: cut after ${after}, not at home`;
    return `${episode}: it stopped after ${after}, ${short(100 * apart(steps.at(-1), env.home), 2)} cm from home`;
  }
  const carried = robotView.kidnapAt(state.made), turning = steps.at(-1)?.atWall ? ", turning away from a wall" : "";
  const how = carried ? `carried away after step ${steps.length}` : `step ${steps.length}${turning}`;
  const { similarity } = env.look();
  return `${episode}${frozen ? ", frozen" : ""}, ${how}: similarity ${similarity.toFixed(3)}, it stops at ${env.psi.upper.toFixed(3)}`;
}

// What happens when the hand lets go.
function handTitle() {
  const { experiment: { done, underWay, episodes }, handsStart, frozen } = robotView, release = "Let go, or press Enter, and";
  if (handsStart) return `${release} every episode starts here: a new run begins`;
  const knowing = frozen ? "frozen as it is" : "with all that it has learnt";
  if (underWay) return `${release} it goes on from here, ${knowing}: a kidnap`;
  return `${release} episode ${episodes.length + 1} begins here, ${knowing}${done ? "" : ": press Play"}`;
}

// --- Hands ----------------------------------------------------------------------------------------------------------

function setUpRoom() {
  const [across, deep] = DATA.room.size.map((metres) => metres + 2 * WALL_M);
  const chart = new Chart("r-room", deep / across, paintRoom), { canvas } = chart;
  let turning = false, from = null;
  const on = (type, act) => canvas.addEventListener(type, (event) => {
    if (robotView.experiment) act(event, robotView.hand);
  }, { passive: false });
  const held = (act) => (event, hand) => {
    if (!hand || !canvas.hasPointerCapture(event.pointerId)) return;
    act(event, hand);
    refresh("r-room");
  };
  const place = (event) => {
    const [width, , x, y] = chart.measure(event);
    return roomScale(width).back(x, y);
  };
  on("pointerdown", (event) => {
    const { scale, at, back } = roomScale(chart.measure(event)[0]), point = place(event);
    const handle = (pose) => back(...at(pose, handleAt(scale)));
    const reach = (pose) => Math.min(apart(point, pose), apart(point, handle(pose)));
    const [nearest] = robotView.grips.sort((a, b) => reach(a) - reach(b));
    if (reach(nearest) > Math.max(RADIUS_M, 22 / scale)) return;
    turning = apart(point, handle(nearest)) < apart(point, nearest);
    from = nearest;
    canvas.setPointerCapture(event.pointerId);
    robotView.hold(nearest);
    refresh("r-room");
  });
  // A finger that holds the robot does not scroll the page; elsewhere in the room it does.
  on("touchstart", (event, hand) => hand && event.preventDefault());
  on("pointermove", held((event, hand) => {
    const point = place(event);
    if (turning) hand.heading = Math.atan2(point.y - hand.y, point.x - hand.x);
    else Object.assign(hand, point);
  }));
  on("pointerup", held((event, hand) => {
    canvas.releasePointerCapture(event.pointerId);
    if (apart(hand, from) < 0.005 && hand.heading === from.heading) robotView.hand = null;
    else robotView.put(hand);
  }));
  on("pointercancel", held(() => (robotView.hand = null)));
  on("keydown", (event, hand) => {
    const moves = {
      ArrowLeft: [-1, 0, 0], ArrowRight: [1, 0, 0], ArrowUp: [0, 1, 0], ArrowDown: [0, -1, 0], ",": [0, 0, 1], ".": [0, 0, -1],
    };
    if (event.key === "Enter" && hand) robotView.put(hand);
    else if (event.key === "Escape" && hand) robotView.hand = null;
    else if (moves[event.key]) {
      const [right, up, left] = moves[event.key];
      if (!hand) robotView.hold(robotView.grips[0]);
      robotView.hand.x += 0.02 * right;
      robotView.hand.y += 0.02 * up;
      robotView.hand.heading = wrapped(robotView.hand.heading + radians(20) * left);
    } else return;
    event.preventDefault();
    refresh("r-room");
  });
}
