// What is saved: the figures of a view as one picture, its run as a table.

function save(name, blob) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

// A text in lines that fit.
function lines(ctx, words, width) {
  return words.split(" ").reduce((fitting, word) => {
    const longer = `${fitting.at(-1)} ${word}`.trim();
    if (fitting.at(-1) && ctx.measureText(longer).width > width) return [...fitting, word];
    return [...fitting.slice(0, -1), longer];
  }, [""]);
}

// All figures of a view under their titles in two columns, painted anew and sharp, and the address that leads back.
function savePicture(view, name) {
  const u = unit(), column = 620 * u, gap = 24 * u, whole = 2 * column + gap, row = 20 * u;
  const sheet = document.createElement("canvas"), ctx = sheet.getContext("2d");
  ctx.font = font(15, "bold");
  const strips = []; // of figures beside each other
  for (const chart of CHARTS.filter(({ canvas }) => canvas.closest(`#${view}`))) {
    const width = chart.canvas.closest(".wide") ? whole : column;
    const title = lines(ctx, chart.caption.textContent, width), height = title.length * row + chart.heightAt(width) + gap;
    const [first, second] = strips.at(-1) ?? [];
    if (first?.width === column && width === column && !second) strips.at(-1).push({ chart, title, width, height });
    else strips.push([{ chart, title, width, height }]);
  }
  const back = address().match(/.{1,150}/g), heights = strips.map((strip) => Math.max(...strip.map(({ height }) => height)));
  const size = [whole + 2 * gap, gap + sum(heights) + back.length * row + gap];
  [sheet.width, sheet.height] = size.map((pixels) => 2 * Math.ceil(pixels));
  ctx.scale(2, 2);
  block(ctx, 0, 0, ...size, colour("paper"));
  let top = gap;
  const write = (words, x, k, look) => text(ctx, words, x, top + (k + 0.5) * row, look);
  strips.forEach((strip, s) => {
    strip.forEach(({ chart, title, width }, k) => {
      const left = gap + k * (column + gap);
      title.forEach((words, k) => write(words, left, k, { size: 15, weight: "bold" }));
      ctx.save();
      ctx.translate(left, top + title.length * row);
      chart.paintOn(ctx, width, chart.heightAt(width));
      ctx.restore();
    });
    top += heights[s];
  });
  back.forEach((words, k) => write(words, gap, k, { size: 11, fill: colour("soft") }));
  sheet.toBlob((blob) => save(name, blob));
}

function saveTable(name, columns, rows) {
  const cell = (value) => (typeof value === "boolean" ? +value : value ?? "");
  const table = [columns, ...rows].map((row) => row.map(cell).join(","));
  save(name, new Blob([`# ${address()}\n`, table.join("\n"), "\n"], { type: "text/csv" }));
}
