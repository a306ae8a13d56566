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

  draw() {
    const { canvas } = this;
    const width = canvas.parentElement.clientWidth;
    if (!width) return;
    const height = Math.round(this.height > 4 ? this.height * unit() : this.height * width);
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
  const text = Math.abs(value) >= 1e5 || (value && Math.abs(value) < 1e-3) ? value.toExponential(1) : value.toPrecision(digits);
  return (text.includes("e") ? text : String(Number(text))).replaceAll("-", "−");
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

// Names of curves right of their ends, moved apart where they would overlap. ends: [name, y, colour].
function labelEnds(ctx, ends, x, top, bottom) {
  const gap = 15 * unit();
  const sorted = ends.toSorted((a, b) => a[1] - b[1]);
  let place = -Infinity;
  const places = sorted.map(([, y]) => (place = Math.max(y, place + gap)));
  const over = Math.max(0, places.at(-1) - bottom);
  for (let i = places.length - 1, most = bottom; i >= 0; i--, most -= gap) if (over) places[i] = Math.min(places[i], most);
  sorted.forEach(([name, , paint], i) => text(ctx, name, x, places[i], { fill: paint }));
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

// --- Saving ---------------------------------------------------------------------------------------------------------

function save(name, blob) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

// All figures of a view below each other with their titles, and the address that leads back to them.
function savePicture(view, name) {
  const figures = [...document.querySelectorAll(`#${view} figure`)].map((figure) => ({
    canvas: figure.querySelector("canvas"),
    words: figure.querySelector("figcaption").textContent,
  }));
  const shown = figures.filter(({ canvas }) => canvas.width && canvas.offsetParent);
  const width = Math.max(...shown.map(({ canvas }) => canvas.width)), head = 40;
  const sheet = document.createElement("canvas");
  sheet.width = width + 40;
  sheet.height = shown.reduce((height, { canvas }) => height + canvas.height + head, 50);
  const ctx = sheet.getContext("2d");
  ctx.fillStyle = colour("paper");
  ctx.fillRect(0, 0, sheet.width, sheet.height);
  let y = 20;
  for (const { canvas, words } of shown) {
    text(ctx, words, 20, y + 12, { size: 16, weight: "bold" });
    ctx.drawImage(canvas, 20, y + 30);
    y += canvas.height + head;
  }
  text(ctx, location.hash || "#", 20, y + 10, { size: 12, fill: colour("soft") });
  sheet.toBlob((blob) => save(name, blob));
}

function saveTable(name, columns, rows) {
  const cell = (value) => (typeof value === "boolean" ? +value : value ?? "");
  const lines = [columns, ...rows].map((row) => row.map(cell).join(","));
  save(name, new Blob([`# ${location.hash || "#"}\n`, lines.join("\n"), "\n"], { type: "text/csv" }));
}
