// The run from above: what was there, what the stack believed, where it meant to go.

/** State of the ego at an instant, SI units; null before the first. */
function egoAt(ego, t) {
  const k = lastUpTo(ego.t, t);
  if (k < 0) return null;
  const next = Math.min(k + 1, ego.t.length - 1);
  const share = next > k ? (t - ego.t[k]) / (ego.t[next] - ego.t[k]) : 0;
  const mix = (column, scale) => scale * (column[k] + share * (column[next] - column[k]));
  const turn = Math.atan2(Math.sin((ego.h[next] - ego.h[k]) / 1e3), Math.cos((ego.h[next] - ego.h[k]) / 1e3));
  return {
    x: mix(ego.x, 0.01), y: mix(ego.y, 0.01), h: ego.h[k] / 1e3 + share * turn,
    v: mix(ego.v, 0.001), a: mix(ego.a, 0.001), lat: mix(ego.lat, 0.001), steer: mix(ego.steer, 0.001),
  };
}

/** The newest of messages at an instant. */
function newest(messages, t) {
  const k = lastUpTo(messages.map.times ?? (messages.map.times = messages.list.map((m) => m.t)), t);
  return k < 0 ? null : messages.list[k];
}

/** Messages with room for their instants. */
const timed = (list) => ({ list, map: {} });

class Player {
  /** `ghost` is a second run, of which the ego and the plan are drawn. */
  constructor(run, moment, ghost = null) {
    [this.run, this.moment, this.ghost] = [run, moment, ghost];
    this.ghostPlans = timed(ghost?.plans ?? []);
    this.messages = { tracks: timed(run.tracks), predictions: timed(run.predictions), plans: timed(run.plans) };
    this.shown = { truth: true, tracks: true, predictions: true, plan: true, names: true };
    this.follows = true;
    this.scale = null; // pixels a metre
    this.centre = [0, 0];
    this.playing = false;
    this.speed = 1;
    const { node, redraw } = canvas(340, "the drive from above", (context, width, height) => this.draw(context, width, height));
    [this.canvas, this.redraw] = [node, redraw];
    this.listen();
    moment.onChange(() => redraw());
  }

  /** The canvas with its controls. */
  node() {
    const button = el("button", { id: "play", click: () => this.play(!this.playing) }, "play");
    const scrub = el("input", { type: "range", id: "scrub", min: 0, max: this.moment.end, step: 1000, "aria-label": "instant", input: () => this.moment.set(Number(scrub.value)) });
    const time = el("output", { id: "time" });
    this.button = button;
    this.moment.onChange((t) => {
      scrub.max = this.moment.end;
      scrub.value = t;
      time.textContent = seconds(t, 2);
    });
    const step = (ms) => el("button", { click: () => this.moment.set(this.moment.t + ms * 1000) }, `${ms > 0 ? "+" : "−"}${Math.abs(ms)} ms`);
    const speed = choice("speed", ["0.1", "0.25", "0.5", "1", "2", "4"], "1", (value) => (this.speed = Number(value)));
    const box = (text, checked, set) => {
      const input = el("input", { type: "checkbox", checked, change: () => (set(input.checked), this.redraw()) });
      return el("label", {}, input, text);
    };
    const layers = Object.keys(this.shown).map((name) => box(name, true, (on) => (this.shown[name] = on)));
    const follow = box("follow the ego", true, (on) => (this.follows = on));
    this.followBox = follow.querySelector("input");
    const fit = el("button", { click: () => this.fit() }, "whole way");
    return el("div", {}, this.canvas, el("div", { class: "bar" }, button, step(-50), step(50), scrub, time, speed), el("div", { class: "bar small" }, follow, fit, layers), this.legend());
  }

  legend() {
    const item = (shape, text) => el("span", {}, svg("svg", { viewBox: "0 0 26 12" }, shape), text);
    const box = (attributes) => svg("rect", { x: 3, y: 2, width: 20, height: 8, ...attributes });
    const stroke = (name, dash) => svg("path", { d: "M1 6H25", stroke: `var(--${name})`, "stroke-width": 2.5, "stroke-dasharray": dash });
    return el("div", { class: "legend" },
      item(box({ fill: "var(--ego)" }), "ego"),
      item(box({ fill: "var(--vehicle)", opacity: 0.45 }), "actors as they are; people orange"),
      item(box({ fill: "none", stroke: "var(--ink)", "stroke-dasharray": "3 2", "stroke-width": 1.5 }), "tracks, with their speed"),
      item(stroke("sight", "1 4"), "predictions"), item(stroke("plan"), "plan"), item(stroke("fallback", "6 3"), "plan that is a fallback"),
      this.run.road?.lights?.length ? item(stroke("ink"), "stop lines of traffic lights") : null,
      this.ghost ? item(box({ fill: "none", stroke: "var(--person)", "stroke-width": 2 }), "ego of the other run") : null,
      this.ghost ? item(stroke("person", "2 3"), "plan of the other run") : null);
  }

  /** Messages were added to the run. */
  grown() {
    for (const messages of Object.values(this.messages)) messages.map = {};
    this.redraw();
  }

  play(on) {
    if (on && this.moment.t >= this.moment.end) this.moment.set(0);
    this.playing = on;
    this.button.textContent = on ? "pause" : "play";
    let last = null;
    const tick = (now) => {
      if (!this.playing) return;
      if (last != null) this.moment.set(this.moment.t + (now - last) * 1000 * this.speed);
      last = now;
      if (this.moment.t >= this.moment.end) return this.play(false);
      requestAnimationFrame(tick);
    };
    if (on) requestAnimationFrame(tick);
  }

  /** Shows all of the way that the ego takes. */
  fit() {
    this.unfollow();
    const { x, y } = this.run.ego;
    if (x.length === 0) return;
    const [low, high] = [(list) => Math.min(...list) / 100, (list) => Math.max(...list) / 100];
    const [across, up] = [high(x) - low(x) + 30, high(y) - low(y) + 20];
    this.scale = Math.min(this.canvas.clientWidth / across, 340 / up);
    this.centre = [(low(x) + high(x)) / 2, (low(y) + high(y)) / 2];
    this.redraw();
  }

  unfollow() {
    this.follows = false;
    this.followBox.checked = false;
  }

  listen() {
    const node = this.canvas;
    node.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.scale = Math.min(80, Math.max(0.5, this.scale * Math.exp(-event.deltaY * 0.001)));
      this.redraw();
    }, { passive: false });
    node.addEventListener("pointermove", (event) => {
      if (event.buttons !== 1) return;
      this.unfollow();
      this.centre = [this.centre[0] - event.movementX / this.scale, this.centre[1] + event.movementY / this.scale];
      this.redraw();
    });
    node.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -50_000, ArrowRight: 50_000, Home: -Infinity, End: Infinity }[event.key];
      if (event.key === " ") this.play(!this.playing);
      else if (step) this.moment.set(this.moment.t + step);
      else return;
      event.preventDefault();
    });
  }

  draw(context, width, height) {
    const { run, shown } = this;
    const t = this.moment.t;
    const ego = egoAt(run.ego, t);
    this.scale ??= width / 90;
    if (this.follows && ego) this.centre = this.ahead(ego, t);
    const to = (x, y) => [width / 2 + (x - this.centre[0]) * this.scale, height / 2 - (y - this.centre[1]) * this.scale];
    const pen = new Pen(context, to, this.scale);
    context.fillStyle = colour("ground");
    context.fillRect(0, 0, width, height);
    if (run.road) this.drawRoad(pen, run.road);
    for (const light of run.road?.lights ?? []) this.drawLight(pen, light, t);
    pen.trail(run.ego, t, colour("ego"));
    this.drawClouds(pen, t);
    if (shown.truth) for (const actor of run.actors) this.drawActor(pen, actor, t);
    if (shown.predictions) this.drawPredictions(pen, t);
    if (shown.tracks) this.drawTracks(pen, t);
    if (shown.plan) this.drawPlan(pen, t);
    const drawEgo = (state, shape, style) => state && pen.box(state.x + Math.cos(state.h) * shape.ahead / 100, state.y + Math.sin(state.h) * shape.ahead / 100, state.h, shape.length / 100, shape.width / 100, style);
    drawEgo(ego, run.shape, { fill: colour("ego"), nose: colour("paper") });
    if (this.ghost) drawEgo(egoAt(this.ghost.ego, t), this.ghost.shape, { stroke: colour("person"), width: 2 });
    this.drawTexts(context, width, height, ego, t);
  }

  /** A place 20 m ahead along the way of the three seconds around an instant: a swerve does not turn the view. */
  ahead(ego, t) {
    const [from, to] = [egoAt(this.run.ego, Math.max(t - 1_500_000, this.run.ego.t[0])), egoAt(this.run.ego, t + 1_500_000)];
    const way = Math.hypot(to.x - from.x, to.y - from.y);
    const [cos, sin] = way > 1 ? [(to.x - from.x) / way, (to.y - from.y) / way] : [Math.cos(ego.h), Math.sin(ego.h)];
    return [ego.x + 20 * cos, ego.y + 20 * sin];
  }

  drawRoad(pen, road) {
    const back = (list) => Array.from({ length: list.length / 2 }, (_, k) => [list[list.length - 2 * k - 2], list[list.length - 2 * k - 1]]).flat();
    pen.line([...road.left, ...back(road.right)], { fill: colour("road") });
    for (const side of [road.left, road.right]) pen.line(side, { stroke: colour("edge"), width: 1.5 });
    if (road.lane > 0) for (const d of [-0.5, 0.5]) pen.line(beside(road.line, d * road.lane), { stroke: colour("lane"), width: 1.5, dash: [8, 8] });
  }

  /** A stop line and the three lamps of its light, the ones that burn filled and named. */
  drawLight(pen, light, t) {
    pen.line(light.stop, { stroke: colour("ink"), width: 3 });
    const signal = signalAt(light, t);
    const [x, y] = light.at.map((cm) => cm / 100);
    ["red", "yellow", "green"].forEach((name, k) => pen.lamp(x, y, 11 * (1 - k), LAMPS[name], signal.split(" and ").includes(name)));
    if (this.shown.names) pen.text(x, y, 24, `${light.name}: ${signal}`);
  }

  drawActor(pen, actor, t) {
    const k = lastUpTo(actor.t, t);
    if (k < 0) return;
    const person = ["pedestrian", "cyclist"].includes(actor.kind);
    const [x, y] = [actor.x[k] / 100, actor.y[k] / 100];
    const style = { fill: colour(person ? "person" : "vehicle"), alpha: person ? 0.75 : 0.45 };
    if (actor.kind === "pedestrian") pen.circle(x, y, actor.width / 200, style);
    else pen.box(x, y, actor.h[k] / 1e3, actor.length / 100, actor.width / 100, style);
    if (this.shown.names) pen.text(x, y, (actor.width / 200) * this.scale + 6, actor.name || `${actor.kind} ${actor.id}`);
  }

  /** What lidars saw last, where the run goes on and that is not long ago. */
  drawClouds(pen, t) {
    for (const cloud of Object.values(this.run.clouds ?? {})) {
      const ego = egoAt(this.run.ego, cloud.t);
      if (!ego || Math.abs(t - cloud.t) > 300_000) continue;
      const [cos, sin] = [Math.cos(ego.h) / 100, Math.sin(ego.h) / 100];
      for (let k = 0; k < cloud.points.length; k += 2) {
        const [x, y] = [cloud.points[k], cloud.points[k + 1]];
        pen.circle(ego.x + cos * x - sin * y, ego.y + sin * x + cos * y, 0.08, { fill: colour("ink") });
      }
    }
  }

  drawTracks(pen, t) {
    for (const [, x, y, h, length, width, vx, vy] of newest(this.messages.tracks, t)?.of ?? []) {
      const at = [x / 100, y / 100];
      pen.box(at[0], at[1], h / 1e3, length / 100, width / 100, { stroke: colour("ink"), dash: [4, 3], width: 1.5 });
      if (Math.hypot(vx, vy) > 100) pen.line([x, y, x + vx / 10, y + vy / 10], { stroke: colour("ink"), width: 1.5 });
    }
  }

  drawPredictions(pen, t) {
    for (const [share, ...path] of newest(this.messages.predictions, t)?.of ?? []) {
      if (path.length > 2) pen.line(path, { stroke: colour("sight"), width: 2.5, dash: [1, 5], alpha: 0.3 + 0.7 * share / 1000 });
    }
  }

  drawPlan(pen, t) {
    const other = newest(this.ghostPlans, t);
    if (other) pen.line(other.line, { stroke: colour("person"), width: 2.5, dash: [3, 4] });
    const plan = newest(this.messages.plans, t);
    if (!plan) return;
    const fallback = ["kept", "brake", "stop", "gave_up"].includes(plan.status);
    pen.line(plan.line, { stroke: colour(fallback ? "fallback" : "plan"), width: 2.5, dash: fallback ? [8, 4] : [] });
  }

  /** What is known of the instant, in the upper left corner, and a scale in the lower right one. */
  drawTexts(context, width, height, ego, t) {
    const age = (messages) => {
      const message = newest(messages, t);
      return message ? `, ${milliseconds(t - message.stamp)} old` : "";
    };
    const plan = newest(this.messages.plans, t);
    const lines = [`${seconds(t, 2)}   ${ego ? fixed(ego.v, 1) : "–"} m/s`];
    if (plan) lines.push(`plan: ${plan.status.replaceAll("_", " ")}${age(this.messages.plans)}`);
    if (this.run.tracks.length) lines.push(`tracks: ${newest(this.messages.tracks, t)?.of.length ?? 0}${age(this.messages.tracks)}`);
    context.fillStyle = colour("ink");
    context.textAlign = "left";
    lines.forEach((text, k) => {
      context.font = `${k === 0 ? "bold 14px" : "13px"} Helvetica, Arial, sans-serif`;
      context.fillText(text, 10, 20 + 18 * k);
    });
    const metres = [1, 2, 5, 10, 20, 50, 100].find((m) => m * this.scale > 60) ?? 100;
    context.fillRect(width - 14 - metres * this.scale, height - 14, metres * this.scale, 3);
    context.textAlign = "right";
    context.fillText(`${metres} m`, width - 14, height - 19);
  }
}

const LAMPS = { red: "#c8102e", yellow: "#f2b705", green: "#00a36c" };

/** What a traffic light shows: each phase holds its first instant and not its last. */
function signalAt({ phases, offset }, t) {
  let into = (t + offset) % Math.max(phases.reduce((sum, [, length]) => sum + length, 0), 1);
  return phases.find(([, length]) => (into -= length) < 0)?.[0] ?? "off";
}

/** A line that goes along another, `d` centimetres to its left. */
function beside(list, d) {
  const out = [];
  for (let k = 0; k < list.length; k += 2) {
    const [a, b] = [Math.max(k - 2, 0), Math.min(k + 2, list.length - 2)];
    const [dx, dy] = [list[b] - list[a], list[b + 1] - list[a + 1]];
    const length = Math.hypot(dx, dy) || 1;
    out.push(list[k] - (d * dy) / length, list[k + 1] + (d * dx) / length);
  }
  return out;
}

/** Draws in metres of the map. */
class Pen {
  constructor(context, to, scale) {
    [this.context, this.to, this.scale, this.texts] = [context, to, scale, []];
  }
  style({ fill, stroke, width = 1, dash = [], alpha = 1 }) {
    const { context } = this;
    context.globalAlpha = alpha;
    if (fill) {
      context.fillStyle = fill;
      context.fill();
    }
    if (stroke) {
      [context.strokeStyle, context.lineWidth, context.lineCap] = [stroke, width, dash[0] === 1 ? "round" : "butt"];
      context.setLineDash(dash);
      context.stroke();
      context.setLineDash([]);
    }
    context.globalAlpha = 1;
  }
  /** x and y in turn, centimetres. */
  line(list, style) {
    this.context.beginPath();
    for (let k = 0; k + 1 < list.length; k += 2) this.context.lineTo(...this.to(list[k] / 100, list[k + 1] / 100));
    this.style(style);
  }
  circle(x, y, radius, style) {
    this.context.beginPath();
    this.context.arc(...this.to(x, y), Math.max(radius * this.scale, 2), 0, 2 * Math.PI);
    this.style(style);
  }
  /** A lamp so many pixels above a place: dark where it does not burn. */
  lamp(x, y, above, burning, isOn) {
    const [left, top] = this.to(x, y);
    this.context.beginPath();
    this.context.arc(left, top - above, 5, 0, 2 * Math.PI);
    this.style({ fill: isOn ? burning : "#3a3f45", stroke: colour("paper"), width: 1 });
  }
  box(x, y, h, length, width, style) {
    const [cos, sin] = [Math.cos(h), Math.sin(h)];
    const corner = (along, across) => this.to(x + along * length * cos - across * width * sin, y + along * length * sin + across * width * cos);
    const path = (corners) => {
      this.context.beginPath();
      for (const [along, across] of corners) this.context.lineTo(...corner(along, across));
      this.context.closePath();
    };
    path([[0.5, 0.5], [0.5, -0.5], [-0.5, -0.5], [-0.5, 0.5]]);
    this.style(style);
    if (style.nose) {
      path([[0.46, 0], [0.2, 0.36], [0.2, -0.36]]);
      this.style({ fill: style.nose });
    }
  }
  trail(ego, t, stroke) {
    this.context.beginPath();
    for (let k = 0; k <= lastUpTo(ego.t, t); k += 1) this.context.lineTo(...this.to(ego.x[k] / 100, ego.y[k] / 100));
    this.style({ stroke, width: 1.5, alpha: 0.6 });
  }
  /** A text so many pixels above a place, or higher where another one stands. */
  text(x, y, above, text) {
    const [left, foot] = this.to(x, y);
    const { context, texts } = this;
    context.font = "12px Helvetica, Arial, sans-serif";
    const half = context.measureText(text).width / 2 + 2;
    let top = foot - above;
    while (texts.some((other) => Math.abs(other.left - left) < other.half + half && Math.abs(other.top - top) < 14)) top -= 3;
    texts.push({ left, top, half });
    context.textAlign = "center";
    [context.strokeStyle, context.lineWidth, context.lineJoin] = [colour("paper"), 3, "round"];
    context.strokeText(text, left, top);
    context.fillStyle = colour("ink");
    context.fillText(text, left, top);
  }
}
