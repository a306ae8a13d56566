// What all drawings share: sharp canvases that are painted when something has changed, axes, colours, texts.

const CHARTS = [];
let waiting = false;

// The colours of the page, light or dark, by their names in page.css.
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

// A canvas that `paint(ctx, width, height)` fills; `id` names its <canvas> in the page. height: of the width, or pixels.
class Chart {
  constructor(id, height, paint) {
    this.canvas = document.getElementById(id);
    this.height = height;
    this.paint = paint;
    this.stale = true;
    CHARTS.push(this);
    new ResizeObserver(() => this.refresh()).observe(this.canvas.parentElement);
  }

  refresh() {
    this.stale = true;
    if (!waiting) requestAnimationFrame(paintAll);
    waiting = true;
  }

  high(width) {
    return Math.round(this.height > 4 ? this.height * unit() : this.height * width);
  }

  draw() {
    const { canvas } = this;
    const width = canvas.parentElement.clientWidth;
    if (!width) return;
    const height = this.high(width);
    const sharp = devicePixelRatio || 1;
    canvas.style.height = `${height}px`;
    canvas.width = width * sharp;
    canvas.height = height * sharp;
    const ctx = canvas.getContext("2d");
    ctx.scale(sharp, sharp);
    ctx.font = font();
    ctx.lineJoin = "round";
    this.stale = false;
    this.paint(ctx, width, height);
  }
}

function paintAll() {
  waiting = false;
  for (const chart of CHARTS) if (chart.stale) chart.draw();
}

const refreshAll = () => CHARTS.forEach((chart) => chart.refresh());

// Type on a canvas grows with the page's: 1 where that is 16 pixels.
const unit = () => parseFloat(getComputedStyle(document.documentElement).fontSize) / 16;
const font = (size = 13, weight = "") => `${weight} ${size * unit()}px "DejaVu Sans", Verdana, sans-serif`.trim();

// The title of a figure: what it shows at this moment. It is also what a screen reader says of the canvas.
function title(id, text) {
  const canvas = document.getElementById(id);
  const caption = canvas.closest("figure").querySelector("figcaption");
  if (caption.textContent === text) return;
  caption.textContent = text;
  canvas.setAttribute("aria-label", text);
}

const short = (value, digits = 3) => {
  if (!Number.isFinite(value)) return "none";
  const plain = !value || (Math.abs(value) < 1e5 && Math.abs(value) >= 1e-3);
  if (plain) return String(Number(value.toPrecision(digits))).replace("-", "−");
  const [digit, power] = value.toExponential(1).replace(".0", "").split("e");
  return `${digit}·10${[...String(Number(power))].map((sign) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(sign)]).join("")}`.replace("-", "−");
};

const count = (number, one, many = `${one}s`) => `${number} ${number === 1 ? one : many}`;

// Round numbers that divide an interval into about `parts`.
function ticks(low, high, parts = 4) {
  const rough = (high - low) / parts;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power >= rough);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
  return found;
}

// A panel with axes inside a rectangle of the canvas: x and y map data to pixels. log: the y axis.
function panel(ctx, { left, right, top, bottom, x: [x0, x1], y: [y0, y1], log = false, xTicks, yTicks, xLabel, yLabel }) {
  const scale = log ? Math.log : (value) => value;
  const x = (value) => left + ((value - x0) / (x1 - x0 || 1)) * (right - left);
  const y = (value) => bottom - ((scale(value) - scale(y0)) / (scale(y1) - scale(y0) || 1)) * (bottom - top);
  const u = unit();
  ctx.save();
  ctx.strokeStyle = colour("line");
  ctx.fillStyle = colour("soft");
  ctx.lineWidth = 1;
  ctx.font = font(12);
  ctx.textAlign = "right";
  ctx.textBaseline = "middle";
  for (const value of yTicks ?? ticks(y0, y1)) {
    line(ctx, [[left, y(value)], [right, y(value)]]);
    ctx.fillText(short(value), left - 5 * u, y(value));
  }
  ctx.textAlign = "center";
  ctx.textBaseline = "top";
  for (const value of xTicks ?? []) ctx.fillText(short(value), x(value), bottom + 5 * u);
  if (xLabel) {
    ctx.textAlign = "right";
    ctx.fillText(xLabel, right, bottom + 20 * u);
  }
  if (yLabel) {
    ctx.textAlign = "left";
    ctx.textBaseline = "bottom";
    ctx.fillStyle = colour("ink");
    ctx.fillText(yLabel, left, top - 4 * u);
  }
  ctx.restore();
  return { x, y, left, right, top, bottom };
}

function line(ctx, points) {
  ctx.beginPath();
  points.forEach(([x, y], i) => (i ? ctx.lineTo(x, y) : ctx.moveTo(x, y)));
  ctx.stroke();
}

function curve(ctx, points, paint, width = 2, dash = []) {
  ctx.save();
  ctx.strokeStyle = paint;
  ctx.lineWidth = width * unit();
  ctx.setLineDash(dash.map((part) => part * unit()));
  line(ctx, points);
  ctx.restore();
}

function disc(ctx, x, y, radius, fill, edge) {
  ctx.beginPath();
  ctx.arc(x, y, radius, 0, 2 * Math.PI);
  if (fill) (ctx.fillStyle = fill), ctx.fill();
  if (edge) (ctx.strokeStyle = edge), ctx.stroke();
}

function text(ctx, words, x, y, { align = "left", base = "middle", fill = colour("ink"), size = 12, weight = "" } = {}) {
  ctx.save();
  ctx.font = font(size, weight);
  ctx.textAlign = align;
  ctx.textBaseline = base;
  ctx.fillStyle = fill;
  ctx.fillText(words, x, y);
  ctx.restore();
}

// Names of curves right of their ends, moved apart where they would overlap. ends: [name, y, name of its colour].
function labelEnds(ctx, ends, x, top, bottom) {
  const gap = 15 * unit();
  const sorted = ends.toSorted((a, b) => a[1] - b[1]);
  let place = top - gap;
  const places = sorted.map(([, y]) => (place = Math.max(y, place + gap)));
  const over = Math.max(0, places.at(-1) - bottom);
  for (let i = places.length - 1, most = bottom; i >= 0; i--, most -= gap) if (over) places[i] = Math.min(places[i], most);
  sorted.forEach(([name, , paint], i) => text(ctx, name, x, places[i], { fill: colour(`${paint}-text`) }));
}

// Pixels that the longest of these names takes beside a panel.
const widest = (ctx, names) => Math.max(60 * unit(), ...names.map((name) => ctx.measureText(name).width)) + 14 * unit();

// Lambda and delta of steps as stems over a common x, each in a panel of its own; a cross where lambda was reset.
function stems(ctx, steps, x, { left, right, top, middle, bottom }, chosen) {
  const u = unit();
  const largest = Math.max(...steps.map((step) => (Number.isFinite(step.delta) ? Math.abs(step.delta) : 0)), 0) || 1;
  const whole = ticks(-largest, largest, 4);
  const delta = panel(ctx, { left, right, top, bottom: middle - 22 * u, x: [0, 1], y: [-largest, largest], yTicks: whole, yLabel: "TD error δ" });
  const most = Math.max(1, ...steps.map((step) => (Number.isFinite(step.lambda) ? step.lambda : 0)));
  const least = Math.min(0, ...steps.map((step) => (Number.isFinite(step.lambda) ? step.lambda : 0)));
  const lambda = panel(ctx, { left, right, top: middle + 6 * u, bottom, x: [0, 1], y: [least, most], yTicks: ticks(least, most, 2), yLabel: "λ, with × where it was reset to [0, 1]" });
  const blue = colour("blue-line"), orange = colour("orange-line");
  const thick = Math.max(1, Math.min(3 * u, (x(1) - x(0)) * 0.4));
  steps.forEach((step, t) => {
    const faint = chosen !== undefined && t !== chosen;
    ctx.globalAlpha = faint ? 0.6 : 1;
    ctx.lineWidth = t === chosen ? 1.8 * thick : thick;
    ctx.strokeStyle = blue;
    line(ctx, [[x(t), delta.y(0)], [x(t), delta.y(step.delta)]]);
    ctx.strokeStyle = orange;
    line(ctx, [[x(t), lambda.y(0)], [x(t), lambda.y(step.lambda)]]);
    if (thick > 1.5) disc(ctx, x(t), lambda.y(step.lambda), 1.6 * thick * 0.7, orange);
    if (!step.clipped) return;
    const r = Math.max(2 * u, Math.min(4 * u, 1.5 * thick));
    ctx.strokeStyle = colour("ink");
    ctx.lineWidth = 1.3 * u;
    const y = lambda.y(step.lambda);
    line(ctx, [[x(t) - r, y - r], [x(t) + r, y + r]]);
    line(ctx, [[x(t) - r, y + r], [x(t) + r, y - r]]);
  });
  ctx.globalAlpha = 1;
}

// Cividis, as in the figures. share: 0 to 1.
function cividis(share) {
  const last = DATA.cividis.length - 1;
  return DATA.cividis[Math.round(Math.min(1, Math.max(0, share || 0)) * last)];
}

// --- Work between frames ---------------------------------------------------------------------------------------------

const jobs = new Map(); // generators by name, with the view that they are for
let atWork = false;

// Go through a generator a few milliseconds a frame, while its view is seen and nothing is played.
function between(name, view, steps) {
  jobs.set(name, { view, steps });
  if (!atWork) setTimeout(goOn, 200);
  atWork = true;
}

function goOn() {
  const until = performance.now() + 8;
  let moved = false;
  for (const [name, job] of jobs) {
    if (job.view !== state.view || player.mode || document.hidden) continue;
    moved = true;
    while (jobs.get(name) === job && performance.now() < until) if (job.steps.next().done) jobs.delete(name);
  }
  atWork = jobs.size > 0;
  if (atWork) moved ? requestAnimationFrame(goOn) : setTimeout(goOn, 200);
}

// --- Saving ---------------------------------------------------------------------------------------------------------

function save(name, blob) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

// A text in lines that fit.
function lines(ctx, words, width) {
  const found = [""];
  for (const word of words.split(" ")) {
    const longer = found.at(-1) ? `${found.at(-1)} ${word}` : word;
    if (ctx.measureText(longer).width > width && found.at(-1)) found.push(word);
    else found[found.length - 1] = longer;
  }
  return found;
}

// All figures of a view under their titles in two columns, painted anew and sharp, and the address that leads back.
function savePicture(view, name) {
  const u = unit(), column = 620 * u, gap = 24 * u, whole = 2 * column + gap, row = 20 * u;
  const sheet = document.createElement("canvas"), ctx = sheet.getContext("2d");
  ctx.font = font(15, "bold");
  let y = gap, beside = null;
  const placed = CHARTS.filter(({ canvas }) => canvas.closest(`#${view}`)).map((chart) => {
    const figure = chart.canvas.closest("figure"), wide = figure.matches(".wide");
    const told = lines(ctx, figure.querySelector("figcaption").textContent, wide ? whole : column);
    const height = chart.high(wide ? whole : column), full = told.length * row + height + gap;
    const place = { chart, told, width: wide ? whole : column, height, x: gap, y };
    if (!wide && beside) {
      Object.assign(place, { x: gap + column + gap, y: beside.y });
      y = Math.max(y, beside.y + full);
      beside = null;
    } else {
      beside = wide ? null : place;
      y += full;
    }
    return place;
  });
  const back = address().match(/.{1,150}/g);
  const size = [whole + 2 * gap, y + back.length * row + gap];
  [sheet.width, sheet.height] = size.map((pixels) => 2 * Math.ceil(pixels));
  ctx.scale(2, 2);
  ctx.fillStyle = colour("paper");
  ctx.fillRect(0, 0, ...size);
  for (const { chart, told, width, height, x, y: top } of placed) {
    told.forEach((words, k) => text(ctx, words, x, top + (k + 0.5) * row, { size: 15, weight: "bold" }));
    ctx.save();
    ctx.translate(x, top + told.length * row);
    ctx.font = font();
    ctx.lineJoin = "round";
    chart.paint(ctx, width, height);
    ctx.restore();
  }
  back.forEach((words, k) => text(ctx, words, gap, y + (k + 0.5) * row, { size: 11, fill: colour("soft") }));
  sheet.toBlob((blob) => save(name, blob));
}

function saveTable(name, columns, rows) {
  const cell = (value) => (typeof value === "boolean" ? +value : value ?? "");
  const lines = [columns, ...rows].map((row) => row.map(cell).join(","));
  save(name, new Blob([`# ${address()}\n`, lines.join("\n"), "\n"], { type: "text/csv" }));
}
