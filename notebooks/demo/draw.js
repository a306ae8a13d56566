// What all drawings share: sharp canvases that are painted when something has changed, axes, colours, texts.

const COUNTED = 0.01; // a trace, or the weight of an error, that is not above is neither painted nor counted
const CHARTS = [];
let waiting = false;

// The colours of the page, light or dark, by their names in page.css.
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

// A canvas that `paint(ctx, width, height)` fills, in units of type; it returns the title of the figure, which is also what a
// screen reader says of the canvas, or nothing. id: of the <canvas> in the page. tall: its height as a share of its width, or
// in units of type.
class Chart {
  constructor(id, tall, paint) {
    Object.assign(this, { canvas: document.getElementById(id), tall, paint, stale: true });
    this.caption = this.canvas.closest("figure").querySelector("figcaption");
    CHARTS.push(this);
    new ResizeObserver(() => this.refresh()).observe(this.canvas.parentElement);
  }

  refresh() {
    this.stale = true;
    if (!waiting) requestAnimationFrame(paintAll);
    waiting = true;
  }

  draw() {
    const { canvas } = this;
    const width = canvas.parentElement.clientWidth;
    if (!width) return;
    const u = unit(), density = devicePixelRatio || 1;
    const height = Math.round(this.tall > 4 ? this.tall * u : this.tall * width);
    canvas.style.height = `${height}px`;
    canvas.width = width * density;
    canvas.height = height * density;
    const ctx = canvas.getContext("2d");
    ctx.scale(u * density, u * density);
    this.stale = false;
    ctx.font = font();
    ctx.lineJoin = "round";
    const title = this.paint(ctx, width / u, height / u);
    if (!title || title === this.caption.textContent) return;
    this.caption.textContent = title;
    canvas.setAttribute("aria-label", title);
  }

  // Of what is painted: width, height, and the place of an event in it.
  measure({ offsetX, offsetY }) {
    return [this.canvas.clientWidth, this.canvas.clientHeight, offsetX, offsetY].map((pixels) => pixels / unit());
  }
}

function paintAll() {
  waiting = false;
  for (const chart of CHARTS) if (chart.stale) chart.draw();
}

// All charts whose id begins so.
function refresh(prefix = "") {
  for (const chart of CHARTS) if (chart.canvas.id.startsWith(prefix)) chart.refresh();
}

// The unit of type, in pixels: what is painted grows with the type of the page, whose size is 16 of them.
const unit = () => parseFloat(getComputedStyle(document.documentElement).fontSize) / 16;
const font = (size = 13) => `${size}px "DejaVu Sans", Verdana, sans-serif`;

// A number as a reader wants it: three digits, a true minus, powers of ten.
const short = (value, digits = 3) => {
  if (!Number.isFinite(value)) return "none";
  const plain = !value || (Math.abs(value) < 1e5 && Math.abs(value) >= 1e-3);
  if (plain) return String(Number(value.toPrecision(digits))).replace("-", "−");
  const [factor, exponent] = value.toExponential(1).replace(".0", "").split("e");
  const raised = String(Number(exponent)).replace(/./g, (sign) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(sign)]);
  return `${factor}·10${raised}`.replace("-", "−");
};

const count = (number, noun) => `${number} ${noun}${number === 1 ? "" : "s"}`;

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
function panel(ctx, { left, right, top, bottom, x: [x0, x1], y: [y0, y1], log = false, xTicks = [], yTicks, xLabel, yLabel }) {
  const scale = log ? Math.log : (value) => value;
  const x = (value) => left + ((value - x0) / (x1 - x0 || 1)) * (right - left);
  const y = (value) => bottom - ((scale(value) - scale(y0)) / (scale(y1) - scale(y0) || 1)) * (bottom - top);
  const grid = colour("line"), fill = colour("soft");
  for (const value of yTicks ?? ticks(y0, y1)) {
    curve(ctx, [[left, y(value)], [right, y(value)]], grid, 1);
    text(ctx, short(value), left - 5, y(value), { fill, align: "right" });
  }
  for (const value of xTicks) text(ctx, short(value), x(value), bottom + 5, { fill, align: "center", base: "top" });
  if (xLabel) text(ctx, xLabel, right, bottom + 20, { fill, align: "right", base: "top" });
  if (yLabel) text(ctx, yLabel, left, top - 4, { base: "bottom" });
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
  ctx.lineWidth = width;
  ctx.setLineDash(dash);
  line(ctx, points);
  ctx.restore();
}

function disc(ctx, x, y, radius, fill, edge) {
  ctx.beginPath();
  ctx.arc(x, y, radius, 0, 2 * Math.PI);
  if (fill) {
    ctx.fillStyle = fill;
    ctx.fill();
  }
  if (edge) {
    ctx.strokeStyle = edge;
    ctx.stroke();
  }
}

function block(ctx, x, y, width, height, fill) {
  ctx.fillStyle = fill;
  ctx.fillRect(x, y, width, height);
}

// All that is painted stays inside a panel.
function inside(ctx, { left, right, top, bottom }, paint) {
  ctx.save();
  ctx.beginPath();
  ctx.rect(left, top - 2, right - left + 2, bottom - top + 3);
  ctx.clip();
  paint();
  ctx.restore();
}

function text(ctx, words, x, y, { align = "left", base = "middle", fill = colour("ink"), size = 12 } = {}) {
  ctx.save();
  ctx.font = font(size);
  ctx.textAlign = align;
  ctx.textBaseline = base;
  ctx.fillStyle = fill;
  ctx.fillText(words, x, y);
  ctx.restore();
}

// Names of curves right of their ends, moved apart where they would overlap. ends: [name, y, name of its colour].
function labelEnds(ctx, ends, x, top, bottom) {
  const gap = 15;
  const sorted = ends.toSorted((a, b) => a[1] - b[1]);
  let place = top - gap;
  const places = sorted.map(([, y]) => (place = Math.max(y, place + gap)));
  for (let i = places.length - 1, most = bottom; i >= 0; i--, most -= gap) places[i] = Math.min(places[i], most);
  sorted.forEach(([name, , paint], i) => text(ctx, name, x, places[i], { fill: colour(`${paint}-text`) }));
}

// Pixels that the longest of these names takes beside a panel.
const widest = (ctx, names) => Math.max(60, ...names.map((name) => ctx.measureText(name).width)) + 14;

// Columns of the figures over time: as many of the last steps as fit.
function timeAxis(width, total) {
  const left = 52, right = width - 12;
  const shown = Math.min(total, Math.floor((right - left) / 5));
  const first = total - shown;
  const cell = (right - left) / Math.max(shown, 24);
  return { left, right, first, cell, x: (t) => left + (t - first + 0.5) * cell };
}

// Lambda and delta of steps as stems over time, each in a panel of its own; a cross where lambda was reset.
function stems(ctx, steps, { left, right, first, cell, x }, { top, middle, bottom }, chosen) {
  const shown = steps.slice(first), finite = (name) => shown.map((step) => step[name]).filter(Number.isFinite);
  const largest = Math.max(...finite("delta").map(Math.abs), 0) || 1;
  const least = Math.min(0, ...finite("lambda")), most = Math.max(1, ...finite("lambda"));
  const delta = panel(ctx, { left, right, top, bottom: middle - 22, x: [0, 1], y: [-largest, largest], yLabel: "TD error δ" });
  const lambda = panel(ctx, {
    left, right, top: middle + 6, bottom, x: [0, 1], y: [least, most], yTicks: ticks(least, most, 2),
    yLabel: "λ, with × where it was reset to [0, 1]",
  });
  const thick = Math.max(1, Math.min(3, 0.4 * cell)), r = Math.max(2, Math.min(4, 1.5 * thick));
  const blue = colour("blue-line"), orange = colour("orange-line"), ink = colour("ink");
  shown.forEach((step, k) => {
    const t = first + k, px = x(t), py = lambda.y(step.lambda);
    ctx.globalAlpha = chosen === undefined || t === chosen ? 1 : 0.6;
    ctx.lineWidth = t === chosen ? 1.8 * thick : thick;
    ctx.strokeStyle = blue;
    line(ctx, [[px, delta.y(0)], [px, delta.y(step.delta)]]);
    ctx.strokeStyle = orange;
    line(ctx, [[px, lambda.y(0)], [px, py]]);
    if (thick > 1.5) disc(ctx, px, py, 1.12 * thick, orange);
    if (!step.clipped) return;
    ctx.strokeStyle = ink;
    ctx.lineWidth = 1.3;
    line(ctx, [[px - r, py - r], [px + r, py + r]]);
    line(ctx, [[px - r, py + r], [px + r, py - r]]);
  });
  ctx.globalAlpha = 1;
  const small = { base: "bottom", fill: colour("soft") };
  if (shown.length) text(ctx, `step ${first + 1}`, left, bottom + 18, small);
  if (steps.length > 1) text(ctx, steps.length, x(steps.length - 1), bottom + 18, { ...small, align: "center" });
}

// Cividis, as in the figures. share: 0 to 1.
function cividis(share) {
  const last = DATA.cividis.length - 1;
  return DATA.cividis[Math.round(Math.min(1, Math.max(0, share || 0)) * last)];
}

// Its colours from left to right.
function scaleBar(ctx, left, top, width, height) {
  const parts = 45;
  for (let k = 0; k < parts; k++) block(ctx, left + (k * width) / parts, top, width / parts + 0.5, height, cividis(k / (parts - 1)));
}
