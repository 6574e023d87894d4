// Two runs, or two studies, beside each other: where they part.

function showRuns(page) {
  const { a, b, parting } = page;
  const moment = new Moment(Math.max(a.end, b.end));
  const player = a.ego.t.length > 0 ? new Player(a, moment, b) : null;
  const first = parting.find((stream) => stream.at != null);
  const apart = carsPart(a, b);
  const marks = [...(first ? [{ t: first.at, text: `they part in ${first.stream}` }] : []), ...(apart == null ? [] : [{ t: apart, text: "the cars part" }])];
  document.getElementById("page").append(
    el("header", {}, el("h1", {}, "Two runs"), el("p", { class: "soft" }, `Swerve ${page.version}`)),
    el("div", { class: "two" }, ...[["first", a], ["second", b]].map(([name, run]) => el("div", {}, el("h3", {}, `${name}: ${run.title}`), run.metrics?.verdict ? badge(run.metrics.verdict) : null, ...notes(run.notes), commandLine(run.command)))),
    section("parting", "Where they part", partingText(parting, first, moment), player ? carsText(apart, moment) : "", partingTable(parting, moment)),
    a.metrics?.why || b.metrics?.why ? section("why", "Why", el("div", { class: "two" }, ...[["first", a], ["second", b]].map(([name, run]) => el("div", {}, el("h3", {}, name), ...(run.metrics?.why ? chainOf(run.metrics.why, moment) : []))))) : "",
    section("settings", "What is set differently", settings(a, b)),
    player ? section("player", "The drive", el("p", { class: "soft small" }, "The first run; of the second its car and its plan."), player.node()) : "",
    player ? section("timeline", "Time line", ...timeline([{ run: a, name: "first" }, { run: b, name: "second" }], moment, { marks })) : "",
    a.metrics && b.metrics ? section("metrics", "Metrics", sideBySide(a.metrics, b.metrics)) : "",
    section("times", "Run times", el("h3", {}, "first"), runTimes(a), el("h3", {}, "second"), runTimes(b)),
  );
  moment.set(addressed().has("t") ? Number(addressed().get("t")) * 1e6 : (apart ?? first?.at ?? 0));
}

/** Metres between two cars from which on they are said to part. */
const APART_M = 0.1;

/** The first instant at which the two cars are farther apart than that; null where there is none while both drive. */
function carsPart(a, b) {
  const last = b.ego.t.at(-1) ?? -1;
  const isApart = (t) => {
    const [one, other] = [egoAt(a.ego, t), egoAt(b.ego, t)];
    return other != null && Math.hypot(one.x - other.x, one.y - other.y) > APART_M;
  };
  return a.ego.t.find((t) => t <= last && isApart(t)) ?? null;
}

function carsText(apart, moment) {
  if (apart == null) return el("p", {}, `While both drive the cars are never more than ${APART_M} m apart.`);
  return el("p", {}, `The cars are more than ${APART_M} m apart from `, el("button", { click: () => moment.set(apart) }, seconds(apart)), " on.");
}

function partingText(parting, first, moment) {
  if (!first) return el("p", {}, parting.length > 0 ? "Nowhere: all messages are the same." : "Neither has a message.");
  const how = { content: "says something else", instant: "comes at another instant", missing: "is in one of them alone" }[first.by];
  const go = el("button", { click: () => moment.set(first.at) }, seconds(first.at));
  return el("p", {}, `The first message that differs is number ${first.counts[2] + 1} of `, el("b", {}, first.stream), `, for the stamp ${seconds(first.stamp)}, published at `, go, `: it ${how}.`);
}

function partingTable(parting, moment) {
  const row = (stream) => [stream.stream, stream.at == null ? "never" : el("button", { click: () => moment.set(stream.at) }, seconds(stream.at)), stream.stamp == null ? "–" : seconds(stream.stamp), stream.by || "–", stream.counts[2], stream.counts[0], stream.counts[1]];
  return table(["stream", "parts at", "stamp", "by", "same before", "messages, first", "second"], parting.map(row));
}

/** Keys whose values differ between two runs. */
function settings(a, b) {
  const values = (run) => new Map(run.changed.map((change) => [change.key, change]));
  const [of, other] = [values(a), values(b)];
  const keys = [...new Set([...of.keys(), ...other.keys()])];
  const value = (own, others, key) => (own.has(key) ? own.get(key).value || "not set" : others.get(key).default || "none");
  const rows = keys.map((key) => [key, value(of, other, key), value(other, of, key)]).filter(([, x, y]) => x !== y);
  return rows.length === 0 ? el("p", {}, a.scenario === b.scenario ? "Nothing." : `The scenario: ${a.scenario} and ${b.scenario}.`) : table(["key", "first", "second"], rows);
}

/** Single metrics of both, those that differ first. */
function sideBySide(a, b) {
  const flat = (metrics) => {
    const found = new Map();
    const walk = (prefix, value) => {
      for (const [name, inner] of Object.entries(value)) {
        if (name === "why" || Array.isArray(inner)) continue;
        if (inner && typeof inner === "object") walk(`${prefix}${name}.`, inner);
        else found.set(prefix + name, inner);
      }
    };
    walk("", metrics);
    return found;
  };
  const [of, other] = [flat(a), flat(b)];
  const keys = [...new Set([...of.keys(), ...other.keys()])];
  const difference = (x, y) => (typeof x === "number" && typeof y === "number" ? `${y > x ? "+" : ""}${plain(y - x)}` : x === y ? "" : "differs");
  const rows = keys.map((key) => [key, plain(of.get(key)), plain(other.get(key)), of.get(key) === other.get(key) ? "" : difference(of.get(key), other.get(key))]);
  const differs = (row) => row[3] !== "";
  return table(["metric", "first", "second", "difference"], [...rows.filter(differs), ...rows.filter((row) => !differs(row))], { rowClass: (row) => (differs(row) ? "differs" : null) });
}

/** Two studies: cells of the same labels beside each other. */
function showStudies(page) {
  const { a, b } = page;
  const order = a.axes.map((axis) => b.axes.indexOf(axis));
  const comparable = order.every((axis) => axis >= 0) && a.axes.length === b.axes.length;
  const key = (labels) => labels.join("\u0000");
  const others = new Map(comparable ? b.cells.map((cell) => [key(order.map((axis) => cell.labels[axis])), cell]) : []);
  const pairs = a.cells.map((cell) => [cell, others.get(key(cell.labels))]).filter(([x, y]) => y && isDone(x) && isDone(y));
  const differ = pairs.filter(([x, y]) => x.verdict !== y.verdict);
  const search = el("input", { type: "text", id: "filter", placeholder: "filter", value: addressed().get("filter") ?? "" });
  const place = el("div");
  const show = () => {
    const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
    const row = ([x, y]) => [...x.labels, x.verdict, y.verdict, plain(x.min_distance_m), plain(y.min_distance_m), el("button", { click: () => place.after(commandLine(x.command), commandLine(y.command)) }, "commands")];
    const rows = differ.filter(([x, y]) => words.every((word) => [...x.labels, x.verdict, y.verdict].join(" ").toLowerCase().includes(word))).map(row);
    const empty = pairs.length === 0 ? "no cell is in both: there is nothing to compare" : differ.length === 0 ? `the verdicts of all ${pairs.length} cells in both are the same` : "no cell is left by the filter";
    place.replaceChildren(table([...a.axes, "first", "second", "closest m, first", "second", ""], rows, { sort: true, empty }));
  };
  search.addEventListener("input", show);
  document.getElementById("page").append(
    el("header", {}, el("h1", {}, "Two studies"), el("p", { class: "soft" }, `Swerve ${page.version} · first: ${a.title} · second: ${b.title}`)),
    comparable ? "" : el("p", { class: "note" }, `Their axes differ (${a.axes.join(", ")}; ${b.axes.join(", ")}): no cell of the one has a fellow in the other.`),
    section("verdicts", "Verdicts", ...(pairs.length === 0 ? [el("p", {}, "No finished cell is in both.")] : [el("p", {}, `${pairs.length} cells are in both; the verdict of ${differ.length} differs. Down: the first, across: the second.`), confusion(pairs)])),
    section("cells", "Where they part", el("div", { class: "bar" }, search), place),
    section("heat", "Heat maps", el("div", { class: "two" }, ...[a, b].map((study) => {
      const view = new StudyView(study);
      view.count = el("output");
      view.show();
      return el("div", {}, el("h3", {}, study.title), view.heatBar, view.heat, view.detail);
    }))));
  show();
}

/** How often which verdict became which. */
function confusion(pairs) {
  const found = (side) => [...new Set(pairs.map((pair) => pair[side].verdict))].sort();
  const [down, across] = [found(0), found(1)];
  const count = (x, y) => pairs.filter(([p, q]) => p.verdict === x && q.verdict === y).length;
  return table(["first \\ second", ...across], down.map((x) => [x, ...across.map((y) => count(x, y))]));
}
