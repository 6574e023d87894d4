// Which operator ran when, and what a step had waited for.

/** The steps and messages of a run, ready to be asked. */
class Flow {
  constructor(run) {
    this.run = run;
    this.steps = run.operators.map(() => []);
    this.byStamp = new Map();
    for (let k = 0; k < run.steps.start.length; k += 1) {
      this.steps[run.steps.operator[k]].push(k);
      this.byStamp.set(`${run.steps.operator[k]} ${run.steps.stamp[k]}`, k);
    }
    for (const list of this.steps) list.sort((a, b) => run.steps.start[a] - run.steps.start[b]);
    this.starts = this.steps.map((list) => list.map((k) => run.steps.start[k]));
    this.messages = new Map(run.streams.map((name) => [name, []]));
    this.published = new Map();
    for (let m = 0; m < run.messages.at.length; m += 1) {
      this.messages.get(run.streams[run.messages.stream[m]]).push(m);
      const key = `${run.messages.operator[m]} ${run.messages.stamp[m]}`;
      if (!this.published.has(key)) this.published.set(key, m);
    }
  }

  /** What a step read: of each input the newest message that was there at its start and is not of its future. */
  inputs(k) {
    const { steps, messages, operators } = this.run;
    const [start, stamp] = [steps.start[k], steps.stamp[k]];
    return operators[steps.operator[k]].inputs.map(({ stream, feedback }) => {
      const list = this.messages.get(stream) ?? [];
      const there = (m) => (feedback ? messages.at[m] < start : messages.at[m] <= start) && messages.stamp[m] <= stamp;
      let at = list.length - 1;
      while (at >= 0 && !there(list[at])) at -= 1;
      return { stream, feedback, message: at < 0 ? null : list[at] };
    });
  }

  /** The message that a step came to; none where its result was of no use. */
  output(k) {
    const { steps } = this.run;
    return this.published.get(`${steps.operator[k]} ${steps.stamp[k]}`) ?? null;
  }

  /** The step that made a message; none for what came from outside. */
  maker(m) {
    const { messages } = this.run;
    return this.byStamp.get(`${messages.operator[m]} ${messages.stamp[m]}`) ?? null;
  }

  /** How long a step stood ready: from the last message of its own frame until its start. */
  waited(k) {
    const { steps, messages } = this.run;
    const own = this.inputs(k).filter(({ message, feedback }) => message != null && !feedback && messages.stamp[message] === steps.stamp[k]);
    return own.length === 0 ? Math.max(0, steps.start[k] - steps.stamp[k]) : steps.start[k] - Math.max(...own.map(({ message }) => messages.at[message]));
  }

  /** The steps behind one, oldest first: those of the sensor frame that its result derives from. */
  behind(k) {
    const { messages } = this.run;
    const chain = [k];
    const seen = new Set(chain);
    for (let at = k; at != null; ) {
      const own = this.output(at);
      const inputs = this.inputs(at).filter(({ message, feedback }) => message != null && !feedback);
      const same = inputs.filter(({ message }) => own != null && messages.origin[own] >= 0 && messages.origin[message] === messages.origin[own]);
      const next = same.map(({ message }) => ({ step: this.maker(message), at: messages.at[message] })).filter(({ step }) => step != null && !seen.has(step)).sort((a, b) => b.at - a.at)[0];
      at = next?.step ?? null;
      if (at != null) chain.unshift(at);
      seen.add(at);
    }
    return chain;
  }

  /** The first step of each operator that read what a step came to. */
  readers(k) {
    const own = this.output(k);
    if (own == null) return [];
    const { messages, operators, streams } = this.run;
    const stream = streams[messages.stream[own]];
    return operators.flatMap((operator, index) => {
      if (!operator.inputs.some((input) => input.stream === stream)) return [];
      const from = lastUpTo(this.starts[index], messages.at[own] - 1) + 1;
      const reads = (step) => this.inputs(step).some(({ message }) => message === own);
      const found = this.steps[index].slice(from, from + 40).find(reads);
      return found == null ? [] : [found];
    });
  }
}

class Gantt {
  constructor(run, moment) {
    [this.run, this.moment, this.flow] = [run, moment, new Flow(run)];
    this.rows = run.operators.map((_, k) => k).filter((k) => this.flow.steps[k].length > 0);
    this.width = Math.min(500_000, moment.end || 1);
    this.from = 0;
    this.picked = null;
    this.detail = el("div", { id: "chain" }, el("p", { class: "soft" }, "Click a step: what it read, how long it waited and ran, and who read its result."));
    const height = 30 + 24 * this.rows.length;
    const { node, redraw } = canvas(height, "operators over time", (context, width) => this.draw(context, width, height));
    [this.canvas, this.redraw] = [node, redraw];
    this.listen();
    moment.onChange((t) => {
      if (t < this.from || t > this.from + this.width) this.moveTo(t - 0.3 * this.width);
      redraw();
    });
  }

  node() {
    const zoom = (factor) => () => this.zoom(factor, this.moment.t);
    const move = (share) => () => this.moveTo(this.from + share * this.width);
    const bar = el("div", { class: "bar small" },
      el("button", { click: move(-0.5) }, "◀"), el("button", { click: move(0.5) }, "▶"),
      el("button", { click: zoom(0.5) }, "closer"), el("button", { click: zoom(2) }, "wider"),
      el("span", { class: "soft" }, "orange, joined: the chain of the chosen step · hatched: result too late · × missed deadline · ▼ dropped · wheel zooms, drag moves"));
    return el("div", {}, this.canvas, bar, this.detail);
  }

  moveTo(from) {
    this.from = Math.min(Math.max(from, 0), Math.max(0, this.moment.end - this.width));
    this.redraw();
  }

  zoom(factor, about) {
    const width = Math.min(Math.max(this.width * factor, 2_000), this.moment.end || 1);
    const share = Math.min(1, Math.max(0, (about - this.from) / this.width));
    this.width = width;
    this.moveTo(about - share * width);
  }

  listen() {
    const node = this.canvas;
    const at = (event) => this.from + (this.width * (event.offsetX - this.left)) / (node.clientWidth - this.left - 8);
    let moved = 0;
    node.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(event.deltaY * 0.002), at(event));
    }, { passive: false });
    node.addEventListener("pointerdown", () => (moved = 0));
    node.addEventListener("pointermove", (event) => {
      if (event.buttons !== 1) return;
      moved += Math.abs(event.movementX);
      this.moveTo(this.from - (event.movementX * this.width) / (node.clientWidth - this.left - 8));
    });
    node.addEventListener("click", (event) => moved < 4 && this.pickAt(event.offsetX, event.offsetY, at(event)));
  }

  get left() {
    return 120;
  }

  /** Chooses the step nearest to a place. */
  pickAt(_, top, t) {
    const row = this.rows[Math.floor((top - 6) / 24)];
    if (row == null) return;
    const { steps } = this.run;
    const away = (k) => Math.max(steps.start[k] - t, t - steps.start[k] - steps.took[k], 0);
    const near = lastUpTo(this.flow.starts[row], t);
    const candidates = this.flow.steps[row].slice(Math.max(0, near - 3), near + 3);
    this.pick(candidates.sort((a, b) => away(a) - away(b))[0]);
  }

  pick(k) {
    if (k == null) return;
    this.picked = k;
    const { steps } = this.run;
    if (steps.start[k] < this.from || steps.start[k] > this.from + this.width) this.moveTo(steps.start[k] - 0.3 * this.width);
    this.chain = this.flow.behind(k);
    this.detail.replaceChildren(this.describe(k));
    this.redraw();
  }

  name(k) {
    return this.run.operators[this.run.steps.operator[k]].name;
  }

  link(k) {
    return el("button", { click: () => this.pick(k) }, `${this.name(k)} for ${seconds(this.run.steps.stamp[k])}`);
  }

  describe(k) {
    const { steps, messages } = this.run;
    const own = this.flow.output(k);
    const said = own == null ? "nothing was published for it" : `published at ${seconds(messages.at[own])}`;
    const origin = own != null && messages.origin[own] >= 0 ? `, ${milliseconds(messages.at[own] - messages.origin[own])} after the sensor's frame of ${seconds(messages.origin[own])}` : "";
    const line = (step) => {
      const waited = this.flow.waited(step);
      return el("li", {}, this.link(step), ` started at ${seconds(steps.start[step])}, after a wait of ${milliseconds(waited)}; ran ${milliseconds(steps.took[step])}`);
    };
    const input = ({ stream, message, feedback }) => {
      if (message == null) return [stream, "nothing yet", "–", "–", feedback ? "feedback" : ""];
      const maker = this.flow.maker(message);
      return [stream, maker == null ? seconds(messages.stamp[message]) : el("span", { class: "chain" }, this.link(maker)), seconds(messages.at[message]), milliseconds(steps.start[k] - messages.stamp[message]), feedback ? "feedback" : ""];
    };
    const inputs = this.flow.inputs(k);
    const readers = this.flow.readers(k);
    return el("div", {},
      el("h3", {}, `${this.name(k)} for the stamp ${seconds(steps.stamp[k])}: ran ${milliseconds(steps.took[k])}, ${said}${origin}`),
      el("div", { class: "two" },
        el("div", {}, el("h3", {}, "From the sensor's frame to here"), el("ol", { class: "chain" }, this.chain.map(line))),
        el("div", {}, el("h3", {}, "What it read"),
          inputs.length === 0 ? el("p", { class: "soft" }, "Nothing, or it is not known.") : table(["stream", "of the instant", "came at", "age", ""], inputs.map(input)),
          el("h3", {}, "Who read its result first"),
          readers.length === 0 ? el("p", { class: "soft" }, "Nobody.") : el("p", { class: "chain" }, readers.flatMap((step, n) => [n > 0 ? ", " : null, this.link(step)])))));
  }

  draw(context, width, height) {
    const { run, from } = this;
    const to = from + this.width;
    const x = (t) => this.left + ((width - this.left - 8) * (t - from)) / this.width;
    context.font = "12px Helvetica, Arial, sans-serif";
    const grid = ticks(from / 1e6, to / 1e6, 8);
    for (const at of grid.places) {
      context.fillStyle = colour("rule");
      context.fillRect(x(at * 1e6), 4, 1, height - 26);
      context.fillStyle = colour("soft");
      context.textAlign = "center";
      context.fillText(`${fixed(at, grid.decimals)} s`, x(at * 1e6), height - 8);
    }
    this.rows.forEach((row, n) => this.drawRow(context, row, 6 + 24 * n, { x, from, to }));
    this.drawMarks(context, run.misses, "×", x, from, to);
    this.drawMarks(context, run.drops, "▼", x, from, to);
    if (this.picked != null) this.drawChain(context, x);
    context.fillStyle = colour("ink");
    if (this.moment.t >= from && this.moment.t <= to) context.fillRect(x(this.moment.t), 0, 1.5, height - 22);
    context.fillStyle = colour("panel");
    context.fillRect(0, 0, this.left - 2, height);
    context.textAlign = "right";
    context.fillStyle = colour("ink");
    this.rows.forEach((row, n) => context.fillText(run.operators[row].name, this.left - 8, 22 + 24 * n, this.left - 12));
  }

  drawRow(context, row, top, { x, from, to }) {
    const { steps } = this.run;
    const late = (this.late ??= new Set(steps.late));
    const list = this.flow.steps[row];
    const first = Math.max(0, lastUpTo(this.flow.starts[row], from) - 8);
    context.fillStyle = colour("rule");
    context.fillRect(this.left, top + 20, context.canvas.width, 0.5);
    for (let n = first; n < list.length && steps.start[list[n]] <= to; n += 1) {
      const k = list[n];
      const [left, right] = [x(steps.start[k]), x(steps.start[k] + steps.took[k])];
      const chosen = this.picked != null && this.chain.includes(k);
      context.fillStyle = colour(chosen ? "person" : "ego");
      context.globalAlpha = steps.took[k] === 0 && !chosen ? 0.55 : 1;
      context.fillRect(left, top + 3, Math.max(right - left, chosen ? 3 : 1.2), 14);
      context.globalAlpha = 1;
      if (right - left > 4) {
        [context.strokeStyle, context.lineWidth] = [colour("paper"), 1];
        context.strokeRect(left, top + 3, right - left, 14);
      }
      if (late.has(k)) {
        context.fillStyle = colour("paper");
        for (let at = left + 2; at < right; at += 5) context.fillRect(at, top + 3, 1.5, 14);
      }
    }
  }

  drawMarks(context, marks, sign, x, from, to) {
    context.fillStyle = colour("alarm");
    context.textAlign = "center";
    for (let k = 0; k < marks.at.length; k += 1) {
      const row = this.rows.indexOf(marks.operator[k]);
      if (row >= 0 && marks.at[k] >= from && marks.at[k] <= to) context.fillText(sign, x(marks.at[k]), 20 + 24 * row);
    }
  }

  drawChain(context, x) {
    const { steps } = this.run;
    const middle = (k) => 16 + 24 * this.rows.indexOf(steps.operator[k]);
    [context.strokeStyle, context.lineWidth] = [colour("person"), 2];
    context.beginPath();
    for (let n = 1; n < this.chain.length; n += 1) {
      const [a, b] = [this.chain[n - 1], this.chain[n]];
      context.moveTo(x(steps.start[a] + steps.took[a]), middle(a));
      context.lineTo(x(steps.start[b]), middle(b));
    }
    context.stroke();
  }
}

/** Run times by operator: a line each, with its histogram. */
function runTimes(run) {
  const rows = run.operators.flatMap((operator, index) => {
    const times = run.steps.took.filter((_, k) => run.steps.operator[k] === index).sort((a, b) => a - b);
    if (times.length === 0) return [];
    const count = (marks) => marks.operator.filter((of) => of === index).length;
    const ms = (us) => fixed(us / 1e3, 2);
    const drawn = times[0] === times.at(-1) ? el("span", { class: "soft" }, "always the same") : histogram(times, `${operator.name}: ${ms(times[0])} to ${ms(times.at(-1))} ms`);
    return [[operator.name, times.length, ms(times[0]), ms(quantile(times, 0.5)), ms(quantile(times, 0.9)), ms(quantile(times, 0.99)), ms(times.at(-1)), count(run.misses), count(run.drops), drawn]];
  });
  return table(["operator", "steps", "min ms", "p50", "p90", "p99", "max", "misses", "drops", "from min to max"], rows, { sort: true });
}
