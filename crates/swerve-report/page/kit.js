// Small things that all parts of the page are made of: elements, numbers, colours, tables, one shared instant.

/** An element with attributes (functions are listeners) and children; texts stay texts. */
function el(tag, attributes = {}, ...children) {
  return fill(document.createElement(tag), attributes, children);
}

/** The same for SVG. */
function svg(tag, attributes = {}, ...children) {
  return fill(document.createElementNS("http://www.w3.org/2000/svg", tag), attributes, children);
}

function fill(node, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") node.addEventListener(name, value);
    else if (value === true) node.setAttribute(name, "");
    else if (value !== false && value != null) node.setAttribute(name, value);
  }
  node.append(...children.flat().filter((child) => child != null));
  return node;
}

/** A part of the page under a heading. */
function section(id, title, ...children) {
  return el("section", { id }, el("h2", {}, title), ...children);
}

/** The present colour of a name in style.css: light and dark differ. */
function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

/** Calls `draw` now, whenever the window changes its size, and whenever light turns to dark. */
function redrawn(draw) {
  addEventListener("resize", draw);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
}

/** A number with so many decimals, a dash where there is none. */
function fixed(value, decimals = 2) {
  if (value == null || !Number.isFinite(value)) return "–";
  const text = value.toFixed(decimals);
  return Number(text) === 0 ? (0).toFixed(decimals) : text;
}

/** Microseconds as seconds or milliseconds. */
const seconds = (us, decimals = 3) => `${fixed(us / 1e6, decimals)} s`;
const milliseconds = (us) => `${fixed(us / 1e3, us % 1000 === 0 ? 0 : 2)} ms`;

/** The text of any value of a JSON file. */
function plain(value) {
  if (value == null) return "–";
  if (typeof value === "number") return Number.isInteger(value) ? String(value) : fixed(value, 3);
  if (typeof value === "boolean") return value ? "yes" : "no";
  return typeof value === "string" ? value : JSON.stringify(value);
}

/** Where in an ascending list the last value stands that is not above `value`; -1 before the first. */
function lastUpTo(list, value) {
  let low = 0;
  let high = list.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (list[middle] <= value) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

/** Round places on an axis: multiples of 1, 2 or 5 times a power of ten. */
function ticks(low, high, about) {
  const raw = Math.max((high - low) / about, 1e-9);
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw * 0.999);
  const places = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k += 1) places.push(k * step);
  return { places, decimals: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
}

/** A table; columns whose cells are all numbers stand to the right. Given `sort`, headings sort it. */
function table(head, rows, { sort = false, rowClass = null, empty = "nothing to show" } = {}) {
  const isNumber = (cell) => typeof cell === "number" || /^[–-]?[\d.,]*( ?(%|s|ms|m|m\/s))?$/.test(cell);
  const numeric = head.map((_, c) => rows.length > 0 && rows.every((row) => !(row[c] instanceof Node) && isNumber(String(row[c] ?? ""))));
  const body = el("tbody");
  const show = (shown) => {
    const cell = (value, c) => el("td", { class: numeric[c] ? "number" : null }, value instanceof Node ? value : String(value ?? ""));
    const line = (row) => el("tr", { class: rowClass ? rowClass(row) : null }, row.map(cell));
    body.replaceChildren(...shown.map(line));
    if (shown.length === 0) body.append(el("tr", {}, el("td", { colspan: head.length, class: "soft" }, empty)));
  };
  let [by, down] = [-1, false];
  const order = (c) => {
    [by, down] = [c, by === c ? !down : false];
    const key = (row) => (row[c] instanceof Node ? row[c].textContent : String(row[c] ?? ""));
    const compare = (a, b) => (numeric[c] ? parseFloat(key(a)) - parseFloat(key(b)) : key(a).localeCompare(key(b)));
    show([...rows].sort((a, b) => (down ? -1 : 1) * compare(a, b)));
  };
  const title = (text, c) => (sort ? el("button", { click: () => order(c) }, text) : text);
  show(rows);
  const top = el("thead", {}, el("tr", {}, head.map((text, c) => el("th", { class: numeric[c] ? "number" : null }, title(text, c)))));
  return el("div", { class: "scroll" }, el("table", {}, top, body));
}

/** A choice among texts; `chosen` is told the new one. */
function choice(label, options, value, chosen) {
  const option = (text) => el("option", { value: text, selected: text === value }, text);
  const select = el("select", { change: () => chosen(select.value) }, options.map(option));
  return el("label", {}, label, select);
}

/** A line for a terminal, with a button that copies it. */
function commandLine(text) {
  const button = el("button", { click: () => copy(text, button) }, "copy");
  return el("div", { class: "command" }, el("pre", {}, text), button);
}

async function copy(text, button) {
  try {
    await navigator.clipboard.writeText(text);
    button.textContent = "copied";
  } catch {
    button.textContent = "select and copy";
  }
}

/** Has the browser save a text. */
function save(name, type, text) {
  const address = URL.createObjectURL(new Blob([text], { type }));
  el("a", { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 1000);
}

/** A cell of a CSV file. */
const csvField = (value) => (/[",\n]/.test(value) ? `"${value.replaceAll('"', '""')}"` : value);
const csv = (rows) => rows.map((row) => row.map((cell) => csvField(String(cell ?? ""))).join(",") + "\n").join("");

/** How a verdict is set off: by colour, as in the picture of the drive, and by the shape of its frame. */
function badge(verdict) {
  return el("span", { class: `badge ${verdict}` }, verdict.replaceAll("_", " "));
}

/** What stands behind the `#` of the address, as `name=value` joined by `&`. */
function addressed() {
  return new URLSearchParams(location.hash.slice(1));
}

/** The instant that all views of a run show, microseconds. */
class Moment {
  constructor(end) {
    this.end = end;
    this.t = 0;
    this.listeners = [];
  }
  onChange(listener) {
    this.listeners.push(listener);
    listener(this.t);
  }
  set(t) {
    this.t = Math.min(Math.max(Math.round(t), 0), this.end);
    for (const listener of this.listeners) listener(this.t);
  }
}

/** A canvas as wide as its place, sharp on any screen; `draw(context, width, height)` whenever it has to be drawn. */
function canvas(height, label, draw) {
  const node = el("canvas", { style: `height:${height}px`, role: "img", "aria-label": label, tabindex: 0 });
  let due = false;
  const paint = () => {
    due = false;
    const [width, scale] = [node.clientWidth, window.devicePixelRatio || 1];
    if (width === 0) return;
    const [columns, rows] = [Math.round(width * scale), Math.round(height * scale)];
    if (node.width !== columns || node.height !== rows) [node.width, node.height] = [columns, rows];
    const context = node.getContext("2d");
    context.setTransform(scale, 0, 0, scale, 0, 0);
    context.clearRect(0, 0, width, height);
    draw(context, width, height);
  };
  const redraw = () => {
    if (!due) requestAnimationFrame(paint);
    due = true;
  };
  redrawn(redraw);
  new ResizeObserver(redraw).observe(node);
  return { node, redraw };
}
