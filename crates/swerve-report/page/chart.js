// Curves over one time axis, and histograms.

const CHART = { width: 1100, left: 58, right: 14, top: 18, bottom: 22 };

/**
 * A panel of curves. `curves`: [{ name, t, y, dash, colour }], `limits`: numbers at which dotted lines stand, with a
 * text. The axis spans `least` at least, so that noise does not fill it. A click or a drag sets the moment; an upright
 * line shows it.
 */
function timePanel({ title, unit, curves, limits = [], limitText = "", end, moment, height = 120, marks = [], least = 0.5 }) {
  const values = curves.flatMap((curve) => curve.y);
  const near = values.reduce(([low, high], y) => [Math.min(low, y), Math.max(high, y)], [0, 0]);
  const [low, high] = padded(near, least);
  const [x, y] = scales([0, end / 1e6], [low, high], height);
  const node = svg("svg", { class: "chart", viewBox: `0 0 ${CHART.width} ${height}`, role: "img", "aria-label": `${title} over time` });
  axes(node, { x, y, range: [0, end / 1e6], low, high, height });
  for (const limit of limits.filter((limit) => limit >= low && limit <= high)) {
    node.append(svg("path", { d: `M${CHART.left} ${y(limit)}H${CHART.width - CHART.right}`, stroke: "var(--alarm)", "stroke-dasharray": "2 4", fill: "none" }));
    node.append(svg("text", { x: CHART.width - CHART.right - 3, y: y(limit) + (limit < 0 ? 11 : -3), "text-anchor": "end", class: "soft" }, limitText));
  }
  for (const mark of marks) node.append(upright(mark, x, CHART.top, height - CHART.bottom));
  for (const curve of curves) {
    node.append(svg("path", { d: line(curve, x, y), stroke: curve.colour ?? "var(--ego)", "stroke-dasharray": curve.dash, "stroke-width": 1.6, fill: "none", "stroke-linejoin": "round" }));
  }
  node.append(svg("text", { x: CHART.left, y: 13, "font-weight": "bold" }, `${title}, ${unit}`));
  const names = curves.filter((curve) => curve.name);
  names.forEach((curve, k) => {
    const at = CHART.left + 240 + 190 * k;
    node.append(svg("path", { d: `M${at} 9h24`, stroke: curve.colour ?? "var(--ego)", "stroke-dasharray": curve.dash, "stroke-width": 2 }));
    node.append(svg("text", { x: at + 30, y: 13, class: "soft" }, curve.name));
  });
  const cursor = svg("path", { stroke: "var(--ink)", "stroke-width": 1, fill: "none" });
  const reading = svg("text", { y: 13, x: CHART.width - CHART.right, "text-anchor": "end" });
  node.append(cursor, reading);
  moment.onChange((t) => {
    cursor.setAttribute("d", `M${x(t / 1e6)} ${CHART.top}V${height - CHART.bottom}`);
    reading.textContent = curves.map((curve) => fixed(valueAt(curve, t), 2)).join("   ");
  });
  const pick = (event) => {
    const box = node.getBoundingClientRect();
    const at = ((event.clientX - box.left) / box.width) * CHART.width;
    moment.set((end * (at - CHART.left)) / (CHART.width - CHART.left - CHART.right));
  };
  node.addEventListener("pointerdown", pick);
  node.addEventListener("pointermove", (event) => event.buttons === 1 && pick(event));
  return node;
}

/** The line of a mark. */
function upright(mark, x, top, bottom) {
  const look = mark.isStep ? { "stroke-width": 1, "stroke-dasharray": "2 2" } : { "stroke-width": 2, "stroke-dasharray": "6 3" };
  return svg("path", { d: `M${x(mark.t / 1e6)} ${top}V${bottom}`, stroke: "var(--sight)", ...look }, svg("title", {}, `${mark.text}, ${seconds(mark.t, 2)}`));
}

/** What the marks of all panels are, above these: each text beside its line, in the first row that is free there. */
function markStrip({ marks, end, moment }) {
  const [x] = scales([0, end / 1e6], [0, 1], 100);
  const rows = [];
  const placed = [...marks].sort((a, b) => a.t - b.t).map((mark) => {
    const text = `${mark.text} ${fixed(mark.t / 1e6)} s`;
    const width = 6.3 * text.length + 10;
    const at = x(mark.t / 1e6);
    const left = at + width > CHART.width ? at - width : at;
    const free = rows.findIndex((right) => right <= left);
    const row = free < 0 ? rows.length : free;
    rows[row] = Math.max(left + width, at + 3);
    return { mark, text, at, row, flips: left < at };
  });
  const height = 8 + 15 * rows.length;
  const node = svg("svg", { class: "chart", id: "steps", viewBox: `0 0 ${CHART.width} ${height}`, role: "img", "aria-label": "steps of the chain over time" });
  for (const { mark, text, at, row, flips } of placed) {
    const foot = 15 + 15 * row;
    node.append(upright(mark, x, foot - 9, height));
    node.append(svg("text", { x: at + (flips ? -4 : 4), y: foot, "text-anchor": flips ? "end" : "start", style: "cursor:pointer", click: () => moment.set(mark.t) }, text));
  }
  return node;
}

/** A range with room around it, and never so narrow that noise fills it. */
function padded([low, high], least = 0.5) {
  const room = Math.max(0.06 * (high - low), 0.5 * Math.max(0, least - (high - low)));
  return [low < 0 ? low - room : low, high + room];
}

function scales([from, to], [low, high], height) {
  const across = CHART.width - CHART.left - CHART.right;
  const up = height - CHART.top - CHART.bottom;
  const x = (value) => round(CHART.left + (across * (value - from)) / (to - from || 1));
  const y = (value) => round(CHART.top + (up * (high - value)) / (high - low || 1));
  return [x, y];
}

const round = (value) => Math.round(value * 100) / 100;

function axes(node, { x, y, range, low, high, height, unit = "s" }) {
  const across = ticks(range[0], range[1], 10);
  for (const at of across.places) {
    node.append(svg("path", { d: `M${x(at)} ${CHART.top}V${height - CHART.bottom}`, stroke: "var(--rule)" }));
    node.append(svg("text", { x: x(at), y: height - 7, "text-anchor": "middle", class: "soft" }, `${fixed(at, across.decimals)} ${unit}`.trim()));
  }
  const up = [3, 4, 5, 6, 8].slice(height > 150 ? 3 : 0).map((about) => ticks(low, high, about)).find(({ places }) => places.length >= 3) ?? ticks(low, high, 8);
  for (const at of up.places) {
    node.append(svg("path", { d: `M${CHART.left} ${y(at)}H${CHART.width - CHART.right}`, stroke: at === 0 ? "var(--edge)" : "var(--rule)" }));
    node.append(svg("text", { x: CHART.left - 6, y: y(at) + 4, "text-anchor": "end", class: "soft" }, fixed(at, up.decimals)));
  }
}

function line({ t, y: values }, x, y) {
  return values.map((value, k) => `${k === 0 ? "M" : "L"}${x(t[k] / 1e6)} ${y(value)}`).join("");
}

function valueAt({ t, y }, at) {
  const k = lastUpTo(t, at);
  return k < 0 ? null : y[k];
}

/** How often values fall where between the smallest and the largest. */
function histogram(values, label) {
  const [width, height, bins] = [220, 34, 40];
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const counts = new Array(bins).fill(0);
  const bin = (value) => (high > low ? Math.min(bins - 1, Math.floor((bins * (value - low)) / (high - low))) : bins >> 1);
  for (const value of values) counts[bin(value)] += 1;
  const most = Math.max(...counts);
  const bars = counts.map((count, k) => {
    const tall = count === 0 ? 0 : Math.max(1.5, (count / most) * (height - 2));
    return svg("rect", { x: (k * width) / bins, y: height - tall, width: width / bins - 0.6, height: tall, fill: "var(--ego)" });
  });
  const base = svg("path", { d: `M0 ${height - 0.5}H${width}`, stroke: "var(--edge)" });
  return svg("svg", { viewBox: `0 0 ${width} ${height}`, width, height, role: "img", "aria-label": label }, svg("title", {}, label), bars, base);
}

/** The value below which a share of the sorted values lies, by the nearest rank. */
const quantile = (sorted, share) => sorted[Math.max(1, Math.ceil(sorted.length * share)) - 1];
