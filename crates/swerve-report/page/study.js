// The page of a study: a filter above, and below it heat map, plot over an axis, ranking and cells of what it lets through.

function showStudy(page) {
  const view = new StudyView(page);
  const done = page.cells.filter((cell) => cell.verdict != null).length;
  document.getElementById("page").append(
    el("header", {}, el("h1", {}, page.title),
      el("p", { class: "soft" }, `Swerve ${page.version} · study ${page.name} · ${done} of ${page.cells.length} cells · ${verdicts(page.cells)}`),
      page.note ? el("p", {}, page.note) : ""),
    view.filterBar(),
    section("heat", "Heat map", view.heatBar, view.heat, view.detail),
    section("plot", "Over an axis", view.plotBar, view.plot),
    section("ranking", "Ranking", view.rankBar, view.rank),
    section("cells", "Cells", view.csvBar(), view.table),
    page.pictures?.length ? section("pictures", "Pictures", ...page.pictures.map(([title, text]) => el("img", { alt: title, src: `data:image/svg+xml;charset=utf-8,${encodeURIComponent(text)}`, style: "max-width:100%;background:#fff" }))) : "",
  );
  view.show();
}

class StudyView {
  constructor(study) {
    this.study = study;
    const axes = study.axes.map((_, k) => k);
    const shown = axes.filter((axis) => study.axes[axis] !== "seed" && stepsOf(study, axis).length > 1);
    this.across = shown.at(-1) ?? axes.at(-1);
    this.down = shown.filter((axis) => axis !== this.across);
    this.axis = this.across;
    this.split = this.down[0] ?? null;
    this.measure = study.budget_max_ms == null ? "ended well" : "latency budget, ms";
    this.settings = study.settings.length > 0 ? study.settings.map((name) => study.axes.indexOf(name)) : this.down.length > 0 ? this.down : [this.across];
    this.text = addressed().get("filter") ?? "";
    this.picks = new Map(); // axis or "verdict" to the label that is let through
    [this.heat, this.detail, this.plot, this.rank, this.table] = [0, 1, 2, 3, 4].map(() => el("div"));
    this.bars();
  }

  /** Which measures any cell has a number for. */
  get measures() {
    return Object.keys(MEASURES).filter((name) => MEASURES[name].of(this.study.cells, this.study) != null);
  }

  bars() {
    const { study } = this;
    const set = (name, axes = study.axes) => (value) => {
      this[name] = axes.indexOf(value) < 0 ? null : axes.indexOf(value);
      this.show();
    };
    const measure = () => choice("show", this.measures, this.measure, (value) => ((this.measure = value), this.show()));
    const across = choice("across", study.axes, study.axes[this.across], (value) => {
      this.across = study.axes.indexOf(value);
      this.down = this.down.filter((axis) => axis !== this.across);
      this.show();
    });
    this.heatBar = el("div", { class: "bar" }, measure(), across, this.ticked("down", () => this.down, (list) => (this.down = list)));
    this.plotBar = el("div", { class: "bar" }, choice("over", study.axes, study.axes[this.axis], set("axis")), choice("a line each", ["–", ...study.axes], study.axes[this.split] ?? "–", set("split")));
    this.rankBar = el("div", { class: "bar" }, this.ticked("settings by", () => this.settings, (list) => (this.settings = list)));
  }

  /** Boxes that choose a set of axes. */
  ticked(label, get, set) {
    const box = (name, axis) => {
      const input = el("input", { type: "checkbox", checked: get().includes(axis), change: () => {
        set(input.checked ? [...get(), axis].sort((a, b) => a - b) : get().filter((other) => other !== axis));
        this.show();
      } });
      return el("label", {}, input, name);
    };
    return el("span", { class: "bar" }, label, this.study.axes.map(box));
  }

  filterBar() {
    const { study } = this;
    const search = el("input", { type: "text", id: "filter", value: this.text, placeholder: "filter: words of labels or verdicts", size: 34, input: () => ((this.text = search.value), this.show()) });
    const pick = (name, steps, key) => choice(name, ["all", ...steps], "all", (value) => {
      if (value === "all") this.picks.delete(key);
      else this.picks.set(key, value);
      this.show();
    });
    const found = [...new Set(study.cells.map((cell) => cell.verdict).filter(Boolean))];
    this.count = el("output", { id: "count", class: "soft" });
    return el("div", { class: "bar" }, search, study.axes.map((name, axis) => pick(name, stepsOf(study, axis), axis)), pick("verdict", found, "verdict"), this.count);
  }

  /** The cells that the filter lets through: every word is in a label or the verdict. */
  get cells() {
    const words = this.text.toLowerCase().split(/\s+/).filter(Boolean);
    const lets = (cell) => {
      const text = [...cell.labels, cell.verdict ?? ""].join(" ").toLowerCase();
      const picked = [...this.picks].every(([key, value]) => (key === "verdict" ? cell.verdict : cell.labels[key]) === value);
      return picked && words.every((word) => text.includes(word));
    };
    return this.study.cells.filter(lets);
  }

  show() {
    const { study, cells } = this;
    this.count.textContent = `${cells.length} of ${study.cells.length} cells`;
    const { across, down, measure, axis, split } = this;
    const picked = (inside, title) => this.detail.replaceChildren(this.describe(inside, title));
    this.heat.replaceChildren(cells.length > 0 ? heatTable(study, cells, { across, down, measure, picked }) : el("p", { class: "soft" }, "No cell is left."));
    this.detail.replaceChildren(el("p", { class: "soft small" }, "Darker is better. Click a square for its runs and the commands that repeat them. Axes that are neither across nor down are pooled."));
    this.plot.replaceChildren(cells.length > 0 ? axisPlot(study, cells, { axis, split: split === axis ? null : split, measure }) : "");
    this.rank.replaceChildren(this.ranking(cells));
    this.table.replaceChildren(this.cellTable(cells));
  }

  describe(inside, title) {
    const without = inside.some((cell) => !cell.report && cell.verdict && !cell.command.startsWith("#"));
    return el("div", {}, el("h3", {}, `${title}: ${verdicts(inside)}`),
      without ? el("p", { class: "soft small" }, "Each command drives the run and writes its page, report.html, into the folder after --out; with `swerve study ... --reports` all pages lie beside this one.") : null,
      inside.map((cell) => el("div", {},
        el("span", { class: "small" }, `${cell.labels.join(" · ")}: `, cell.verdict ? badge(cell.verdict) : "not driven", cell.error ? ` ${cell.error}` : "", " ", cell.report ? el("a", { href: cell.report }, "open the run") : null),
        commandLine(this.commandOf(cell)))));
  }

  /** The command that drives a cell and keeps its page. */
  commandOf(cell) {
    if (cell.command.startsWith("#") || cell.command.includes(" --out ")) return cell.command;
    return `${cell.command} --out out/${this.study.name}_${this.study.cells.indexOf(cell)}`;
  }

  /** Settings, the best first: more that ended well, then fewer that hit, then slower ones. */
  ranking(cells) {
    const { study, settings } = this;
    const measures = ["ended well", "nothing hit", "on the road", "impact speed, m/s", "response p50, ms", "response p99, ms", "latency budget, ms"].filter((name) => this.measures.includes(name));
    const rows = [...grouped(cells, settings)].map(([, list]) => ({ list, of: measures.map((name) => MEASURES[name].of(list, study)) }));
    const value = (row, name) => row.of[measures.indexOf(name)]?.value ?? 0;
    const order = (a, b) => value(b, "latency budget, ms") - value(a, "latency budget, ms") || value(b, "ended well") - value(a, "ended well") || value(b, "nothing hit") - value(a, "nothing hit") || value(a, "impact speed, m/s") - value(b, "impact speed, m/s");
    const text = (result) => (result == null ? "–" : result.small ? `${result.text} (${result.small})` : result.text);
    const line = ({ list, of }, k) => [String(k + 1), ...settings.map((axis) => list[0].labels[axis]), ...of.map(text)];
    const node = table(["", ...settings.map((axis) => study.axes[axis]), ...measures], rows.sort(order).map(line));
    node.classList.add("tall");
    return node;
  }

  /** What the table shows; the CSV has every metric, by the names of cells.csv. */
  columns() {
    const known = ["verdict", "no_collision", "on_road", "min_distance_m", "impact_speed_mps", "lateral_jerk_max", "response_p50_ms", "response_p99_ms", "misses", "budget_ms", "digest"];
    return known.filter((name) => this.study.cells.some((cell) => cell[name] != null));
  }

  csvBar() {
    const { axes, columns, name } = this.study;
    const rows = () => this.cells.map((cell) => [...cell.labels, ...columns.map((_, k) => cell.row[k] ?? ""), cell.command]);
    const write = () => save(`${name}.csv`, "text/csv", csv([[...axes, ...columns, "command"], ...rows()]));
    return el("div", { class: "bar" }, el("button", { id: "csv", click: write }, "save as CSV"), el("span", { class: "soft small" }, "all metrics of what the filter lets through, as in cells.csv; headings sort"));
  }

  cellTable(cells) {
    const columns = this.columns();
    const most = 2000;
    const row = (cell) => [...cell.labels, ...columns.map((name) => plain(cell[name])), cell.report ? el("a", { href: cell.report }, "run") : el("button", { click: () => shown(cell), title: cell.command }, "command")];
    const shown = (cell) => this.detail.replaceChildren(this.describe([cell], cell.labels.join(" · "))) ?? this.detail.scrollIntoView({ block: "center" });
    const node = table([...this.study.axes, ...columns, ""], cells.slice(0, most).map(row), { sort: true, rowClass: null, empty: "no cell is left" });
    node.classList.add("tall");
    return cells.length > most ? el("div", {}, el("p", { class: "soft" }, `The first ${most}; the CSV has all.`), node) : node;
  }
}
