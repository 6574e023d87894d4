// A study over two of its axes, the rest pooled.

/** What a square can show: its number of so many cells, text below, and how good it is from 0 to 1. */
const MEASURES = {
  "ended well": rate((cell, study) => isGood(cell, study), (cell, study) => cell.verdict === "stopped" && !isGood(cell, study)),
  "nothing hit": rate((cell) => cell.no_collision),
  "on the road": rate((cell) => cell.on_road),
  "impact speed, m/s": median((cell) => cell.impact_speed_mps, true),
  "closest, m": median((cell) => cell.min_distance_m),
  "lateral jerk, m/s³": median((cell) => cell.lateral_jerk_max, true),
  "response p50, ms": median((cell) => cell.response_p50_ms, true),
  "response p99, ms": median((cell) => cell.response_p99_ms, true),
  "comfortable plans, share": median((cell) => cell.comfortable_share),
  "missed deadlines": median((cell) => cell.misses, true),
  "latency budget, ms": { ...median((cell) => cell.budget_ms), fromZero: true },
};

const isGood = (cell, study) => study.good.includes(cell.verdict);
const isDone = (cell) => cell.verdict != null && cell.verdict !== "failed";

/**
 * A measure that counts cells: its value is the share, with Wilson's 95 % interval. Cells that are `apart` are neither
 * good nor bad: a square shows their share hatched, and is coloured by the rest, as in the picture of the study.
 */
function rate(holds, apart = () => false) {
  return {
    isRate: true,
    of(cells, study) {
      const done = cells.filter(isDone);
      if (done.length === 0) return null;
      const hits = done.filter((cell) => holds(cell, study)).length;
      const [low, high] = wilson(hits, done.length);
      const aside = done.filter((cell) => apart(cell, study)).length;
      const shade = aside < done.length ? hits / (done.length - aside) : null;
      return { value: hits / done.length, low, high, text: `${hits} of ${done.length}`, small: `${fixed(low)}–${fixed(high)}`, shade, apart: aside / done.length };
    },
  };
}

/** A measure that is a number: its value is the median, with the quartiles. */
function median(read, lessIsBetter = false) {
  return {
    lessIsBetter,
    of(cells) {
      const values = cells.filter(isDone).map(read).filter((value) => value != null).sort((a, b) => a - b);
      if (values.length === 0) return null;
      const [low, value, high] = [0.25, 0.5, 0.75].map((share) => quantile(values, share));
      return { value, low, high, text: short(value), small: values.length > 1 ? `${short(low)}–${short(high)} of ${values.length}` : "", shade: value, apart: 0 };
    },
  };
}

const short = (value) => fixed(value, Math.abs(value) >= 100 || Number.isInteger(value) ? 0 : 2);

/** The 95 % interval of a rate (Wilson 1927). */
function wilson(hits, runs) {
  const z = 1.959963984540054;
  const p = hits / runs;
  const middle = (p + (z * z) / (2 * runs)) / (1 + (z * z) / runs);
  const half = (z / (1 + (z * z) / runs)) * Math.sqrt((p * (1 - p)) / runs + (z * z) / (4 * runs * runs));
  return [Math.max(0, middle - half), Math.min(1, middle + half)];
}

/** The steps of an axis in the order of the study. */
const stepsOf = (study, axis) => [...new Set(study.cells.map((cell) => cell.labels[axis]))];

/** Cells by the labels of some axes, in the order of the study. */
function grouped(cells, axes) {
  const groups = new Map();
  for (const cell of cells) {
    const key = axes.map((axis) => cell.labels[axis]).join(" · ");
    if (!groups.has(key)) groups.set(key, []);
    groups.get(key).push(cell);
  }
  return groups;
}

/** The table of squares. A square that is clicked is `picked`: told its cells and its title. */
function heatTable(study, cells, { across, down, measure, picked }) {
  const of = MEASURES[measure];
  const rows = grouped(cells, down);
  const columns = stepsOf(study, across).filter((label) => cells.some((cell) => cell.labels[across] === label));
  const squares = [...rows].map(([row, list]) => ({ row, squares: columns.map((column) => {
    const inside = list.filter((cell) => cell.labels[across] === column);
    return { column, inside, result: of.of(inside, study) };
  }) }));
  const values = squares.flatMap((line) => line.squares.map((square) => square.result?.value).filter((value) => value != null));
  const [low, high] = of.isRate ? [0, 1] : [of.fromZero ? 0 : Math.min(...values), Math.max(...values)];
  const share = (value) => (high > low ? (value - low) / (high - low) : 0.5);
  let last = null;
  const square = (row, { column, inside, result }) => {
    const cell = el("td", {});
    if (inside.length === 0) return cell;
    const good = result?.shade == null ? null : of.lessIsBetter ? 1 - share(result.shade) : share(result.shade);
    if (result != null) paint(cell, good, result.apart);
    const pick = () => {
      last?.classList.remove("picked");
      (last = cell).classList.add("picked");
      picked(inside, [row, column].filter(Boolean).join(" · "));
    };
    cell.append(el("button", { click: pick, title: verdicts(inside) }, result?.text ?? "–", el("small", {}, result?.small ?? verdicts(inside))));
    return cell;
  };
  const head = el("tr", {}, el("th", {}, down.map((axis) => study.axes[axis]).join(" · ")), columns.map((column) => el("th", { class: "middle" }, column)));
  const name = el("tr", {}, el("th", {}), el("th", { class: "middle", colspan: columns.length }, study.axes[across]));
  const lines = squares.map((line) => el("tr", {}, el("th", {}, line.row), line.squares.map((one) => square(line.row, one))));
  const grid = el("div", { class: "scroll" }, el("table", { class: "heat" }, el("thead", {}, name, head), el("tbody", {}, lines)));
  const ends = of.isRate ? "share of runs, 0 to 1" : of.lessIsBetter ? `${measure}: ${short(high)} to ${short(low)}` : `${measure}: ${short(low)} to ${short(high)}`;
  const scale = el("span", { class: "scale", style: `background: linear-gradient(to right, ${GRADES.map(rgb).join(", ")})` });
  const hatched = squares.some((line) => line.squares.some((square) => square.result?.apart > 0));
  const stops = hatched ? el("span", {}, el("span", { class: "scale stopped", style: `background: ${HATCH}, #ffffff` }), "of the square's width: share of runs that stopped safely") : null;
  return el("div", {}, grid, el("div", { class: "legend" }, el("span", {}, scale, ends), stops));
}

/** From bad to good, as in the pictures: the lightness alone tells the order. */
const GRADES = [[251, 217, 176], [174, 184, 198], [93, 140, 184], [0, 63, 115]];
const rgb = (colour) => `rgb(${colour.map(Math.round).join(" ")})`;

/** What runs that stopped safely have, as in the pictures. */
const HATCH = "repeating-linear-gradient(-45deg, #6a4fa3 0 1px, transparent 1px 6px)";

/** The colour of a share of good runs. */
function graded(share) {
  const along = (GRADES.length - 1) * Math.min(1, Math.max(0, share));
  const below = Math.min(Math.floor(along), GRADES.length - 2);
  return GRADES[below].map((from, k) => from + (along - below) * (GRADES[below + 1][k] - from));
}

/** Colours a square by how good it is, and hatches the part of its width that is `apart`. */
function paint(cell, good, apart) {
  const colour = good == null ? [227, 230, 234] : graded(good);
  const part = `right / ${100 * apart}% 100% no-repeat`;
  cell.style.background = apart > 0 ? `${HATCH} ${part}, linear-gradient(#ffffff, #ffffff) ${part}, ${rgb(colour)}` : rgb(colour);
  const isDark = apart === 0 && 0.3 * colour[0] + 0.59 * colour[1] + 0.11 * colour[2] < 140;
  cell.style.color = isDark ? "#ffffff" : "#1f2328";
  cell.classList.toggle("stopped", apart > 0);
}

/** How often each verdict, as a text; of what was driven with Wilson's 95 % interval. */
function verdicts(cells) {
  const counts = new Map();
  for (const cell of cells) counts.set(cell.verdict ?? "not driven", (counts.get(cell.verdict ?? "not driven") ?? 0) + 1);
  const done = cells.filter(isDone).length;
  const between = (n) => ` (${wilson(n, done).map((share) => fixed(share)).join("–")})`;
  return [...counts].map(([verdict, n]) => `${n} ${verdict.replaceAll("_", " ")}${verdict === "failed" || verdict === "not driven" ? "" : between(n)}`).join(", ");
}

/** Four colours that differ in lightness, whole, dashed, dotted, and both in turn: as in the pictures. */
const LOOKS = [null, "7 3", "1.5 3", "9 3 1.5 3"].flatMap((dash) => [1, 2, 3, 4].map((k) => ({ colour: `var(--line-${k})`, dash })));

/** A mark for each of them: where the steps of an axis are no numbers, no line joins them. */
const MARKS = ["M-4 0a4 4 0 1 0 8 0a4 4 0 1 0 -8 0", "M-4 -4h8v8h-8z", "M0 -5l5 9h-10z", "M0 -5.5l5.5 5.5l-5.5 5.5l-5.5 -5.5z"];
const lookOf = (k) => LOOKS[k % LOOKS.length];
const markOf = (k) => ({ d: MARKS[(k + Math.floor(k / 8)) % MARKS.length], fill: k % 8 < MARKS.length ? lookOf(k).colour : "var(--panel)", stroke: lookOf(k).colour, "stroke-width": 1.5 });

/** Names below an axis and the room that they take more: where they would run into each other aslant, the longest cut short. */
function namesBelow(places, height) {
  const width = (label) => 6.5 * label.length + 8;
  const isCrowded = places.some(({ label, at }, k) => k > 0 && at - places[k - 1].at < 0.5 * (width(label) + width(places[k - 1].label)));
  if (!isCrowded) return { room: 0, texts: places.map(({ label, at }) => svg("text", { x: at, y: height - 6, "text-anchor": "middle", class: "soft" }, label)) };
  const most = 28;
  const cut = (label) => (label.length > most ? `${label.slice(0, most - 1)}…` : label);
  const text = ({ label, at }) => svg("text", { transform: `translate(${at} ${height - 8}) rotate(-55)`, "text-anchor": "end", class: "soft" }, cut(label), svg("title", {}, label));
  return { room: Math.max(...places.map(({ label }) => 0.82 * width(cut(label)))), texts: places.map(text) };
}

/** A measure over one axis, a look for each step of another, with intervals; numbers are joined by lines. */
function axisPlot(study, cells, { axis, split, measure }) {
  const of = MEASURES[measure];
  const labels = stepsOf(study, axis).filter((label) => cells.some((cell) => cell.labels[axis] === label));
  const numbers = labels.map(Number);
  const isScale = labels.length > 1 && numbers.every(Number.isFinite);
  const at = (k) => (isScale ? numbers[k] : k);
  const series = [...grouped(cells, split == null ? [] : [split])].map(([name, list]) => ({
    name: split == null ? "all" : `${study.axes[split]} ${name}`,
    points: labels.map((label, k) => ({ x: at(k), result: of.of(list.filter((cell) => cell.labels[axis] === label), study) })).filter((point) => point.result),
  }));
  const height = 260;
  const places = labels.map((_, k) => at(k));
  const span = Math.max(...places) - Math.min(...places) || 1;
  const range = [Math.min(...places) - 0.05 * span, Math.max(...places) + 0.05 * span];
  const values = series.flatMap((line) => line.points.flatMap(({ result }) => [result.low, result.high]));
  const [low, high] = of.isRate ? [0, 1] : padded([Math.min(0, ...values), Math.max(...values)]);
  const [x, y] = scales(range, [low, high], height);
  const below = namesBelow(labels.map((label, k) => ({ label, at: x(at(k)) })), height);
  const node = svg("svg", { class: "chart", viewBox: `0 0 ${CHART.width} ${height + below.room}`, role: "img", "aria-label": `${measure} over ${study.axes[axis]}` });
  const up = ticks(low, high, 6);
  for (const value of up.places) {
    node.append(svg("path", { d: `M${CHART.left} ${y(value)}H${CHART.width - CHART.right}`, stroke: "var(--rule)" }));
    node.append(svg("text", { x: CHART.left - 6, y: y(value) + 4, "text-anchor": "end", class: "soft" }, fixed(value, up.decimals)));
  }
  node.append(...below.texts);
  node.append(svg("text", { x: CHART.left, y: 13, "font-weight": "bold" }, `${measure} over ${study.axes[axis]}`));
  const apart = Math.min(7, (0.8 * (CHART.width - CHART.left - CHART.right)) / (labels.length * series.length));
  series.forEach((line, k) => {
    const look = lookOf(k);
    const shift = (k - (series.length - 1) / 2) * apart;
    const place = ({ x: value, result }) => [x(value) + shift, y(result.value)];
    for (const point of line.points) {
      const [px] = place(point);
      node.append(svg("path", { d: `M${px} ${y(point.result.low)}V${y(point.result.high)}m-4 0h8M${px - 4} ${y(point.result.low)}h8`, stroke: look.colour, "stroke-width": 1.2 }));
      node.append(svg("path", { ...markOf(k), transform: `translate(${px} ${y(point.result.value)})` }, svg("title", {}, `${line.name}, ${point.result.text} (${point.result.small})`)));
    }
    if (isScale) node.append(svg("path", { d: line.points.map((point, n) => `${n ? "L" : "M"}${place(point).join(" ")}`).join(""), stroke: look.colour, "stroke-dasharray": look.dash, "stroke-width": 2, fill: "none" }));
  });
  const legend = el("div", { class: "legend" }, series.map((line, k) => el("span", {}, svg("svg", { viewBox: "0 0 26 12" }, isScale ? svg("path", { d: "M1 6H25", stroke: lookOf(k).colour, "stroke-dasharray": lookOf(k).dash, "stroke-width": 2.5 }) : null, svg("path", { ...markOf(k), transform: "translate(13 6)" })), line.name)));
  const repeated = series.length > LOOKS.length ? ` ${series.length} lines; their looks repeat after ${LOOKS.length}, in the order of the legend.` : "";
  return el("div", {}, node, legend, el("p", { class: "soft small" }, (of.isRate ? "Share of runs with Wilson's 95 % interval." : "Median with the quartiles.") + repeated));
}
