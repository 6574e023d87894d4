// The page of one run.

/** The comfort limits that nuPlan's metrics have, m/s² and m/s³: beyond them a ride counts as uncomfortable. */
const COMFORT = { lateral: [-4.89, 4.89], along: [-4.05, 2.4], jerk: [-4.13, 4.13] };

function showRun(page) {
  const moment = new Moment(page.end);
  const drives = page.ego.t.length > 0;
  const player = drives ? new Player(page, moment) : null;
  const gantt = page.steps.start.length > 0 ? new Gantt(page, moment) : null;
  document.getElementById("page").append(
    heading(page),
    ...notes(page.notes ?? []),
    why(page.metrics?.why, moment) ?? "",
    player ? section("player", "The drive", player.node()) : "",
    page.photos?.length ? section("cameras", "Cameras", strip(page, moment)) : "",
    drives ? section("timeline", "Time line", ...timeline([{ run: page }], moment, { marks: marksOf(page) })) : "",
    page.behaviour ? section("behaviour", "Behaviour", ...behaviour(page.behaviour, moment)) : "",
    gantt ? section("operators", "Operators", gantt.node()) : "",
    gantt ? section("times", "Run times", runTimes(page)) : "",
    page.tables?.length ? section("tables", "Counts", ...page.tables.flatMap(({ title, columns, rows }) => [el("h3", {}, title), table(columns, rows, { sort: true })])) : "",
    page.metrics ? section("metrics", "Metrics", figures(page.metrics)) : "",
    page.config ? section("configuration", "Configuration", configuration(page)) : "",
    page.no_command ? section("repeat", "Again", el("p", {}, page.no_command)) : section("repeat", "Again", el("p", {}, "The command line; in virtual time it comes to the same digest."), commandLine(page.command)),
  );
  const asked = addressed();
  if (asked.has("t")) moment.set(Number(asked.get("t")) * 1e6);
  else moment.set((page.metrics?.impact?.at_s ?? page.metrics?.min_distance_at_s ?? 0) * 1e6); // where it was decided
  addEventListener("load", () => moment.set(moment.t)); // only now pictures have their widths
  if (asked.has("play")) player?.play(true);
  if (asked.has("step") && gantt) gantt.pick(Number(asked.get("step")));
}

function heading(page) {
  const metrics = page.metrics ?? {};
  const fact = (value, name) => (value == null ? null : el("div", { class: "fact" }, el("b", {}, value), el("span", {}, name)));
  const impact = metrics.impact;
  const drive = metrics.drive ?? {};
  return el("header", {},
    el("h1", {}, page.title),
    el("p", { class: "soft" }, `Swerve ${page.version}${page.digest ? ` · digest ${page.digest}` : ""}`),
    el("div", { class: "facts" },
      metrics.verdict ? el("div", { class: "fact" }, badge(metrics.verdict), el("span", { style: "display:block" }, metrics.as_expected == null ? "verdict" : metrics.as_expected ? "as the scenario expects" : "not as the scenario expects")) : null,
      impact ? fact(`${fixed(impact.ego_speed_mps, 1)} m/s`, `at the impact${metrics.impact_name ? ` with ${metrics.impact_name}` : ""}, ${fixed(impact.at_s)} s`) : null,
      impact || metrics.min_distance_m == null ? null : fact(`${fixed(metrics.min_distance_m)} m`, `closest${metrics.min_distance_name ? `, to ${metrics.min_distance_name}` : ""}, at ${fixed(metrics.min_distance_at_s)} s`),
      metrics.scores ? fact(fixed(metrics.scores.driving_score, 1), "driving score, Leaderboard 2.1") : null,
      metrics.response ? fact(`${fixed(metrics.response.p50_ms, 0)} ms`, `response time, p99 ${fixed(metrics.response.p99_ms, 0)} ms`) : null,
      page.kind === "live" ? null : drive.duration_s == null ? fact(seconds(page.end, 2), "duration") : fact(`${fixed(drive.duration_s)} s`, "duration")));
}

const notes = (list) => list.map((note) => el("p", { class: "note" }, note));

/** The chain of why: { actor, verdict, sentence, steps: [{ what, at_s, waited: [{ for, ms }] }] }; null without. */
const why = (chain, moment) => (chain ? section("why", "Why", ...chainOf(chain, moment)) : null);

function chainOf(chain, moment) {
  const waited = (list) => (list?.length ? ` · waited ${list.map((wait) => `${fixed(wait.ms, 0)} ms for ${wait.for}`).join(", ")}` : "");
  const step = ({ what, at_s: at, waited: list }) => el("li", {}, at == null ? null : el("button", { click: () => moment.set(at * 1e6) }, `${fixed(at)} s`), ` ${what.replaceAll("_", " ")}`, el("span", { class: "soft" }, waited(list)));
  return [el("p", {}, chain.sentence ?? ""), el("ol", { class: "chain" }, (chain.steps ?? []).map(step))];
}

/** Pictures of the cameras in a row; a click goes to their instant. */
function strip(page, moment) {
  const streams = [...new Set(page.photos.map((photo) => photo.stream))];
  return el("div", {}, streams.map((stream) => {
    const photos = page.photos.filter((photo) => photo.stream === stream);
    const figure = (photo) => el("figure", { click: () => moment.set(photo.t) }, el("img", { src: photo.data, alt: `${stream} at ${seconds(photo.t, 2)}` }), el("figcaption", {}, seconds(photo.t, 2)));
    const figures = photos.map(figure);
    const row = el("div", { class: "strip" }, figures);
    moment.onChange((t) => {
      const now = Math.max(0, lastUpTo(photos.map((photo) => photo.t), t));
      figures.forEach((node, k) => node.classList.toggle("now", k === now));
      row.scrollLeft = figures[now].offsetLeft - row.offsetLeft - row.clientWidth / 2;
    });
    return el("div", {}, el("h3", {}, stream), row);
  }));
}

/** Instants that all panels of the time line mark. */
function marksOf(page) {
  const metrics = page.metrics ?? {};
  const marks = [];
  if (metrics.impact) marks.push({ t: metrics.impact.at_s * 1e6, text: "collision" });
  else if (metrics.min_distance_at_s != null) marks.push({ t: metrics.min_distance_at_s * 1e6, text: "closest" });
  const others = metrics.first_collision_of_others;
  if (others) marks.push({ t: others.at_s * 1e6, text: `${others.names.join(" and ")} collide` });
  const steps = (metrics.why?.steps ?? []).filter((step) => step.at_s != null);
  return [...marks, ...steps.map((step) => ({ t: step.at_s * 1e6, text: step.what.replaceAll("_", " "), isStep: true }))];
}

/** The curves of one run, or of two above each other. */
function timeline(of, moment, { marks = [] } = {}) {
  const end = moment.end;
  const looks = [{ colour: "var(--ego)" }, { colour: "var(--person)", dash: "7 3" }];
  const curves = (values, times = (run) => run.ego.t) => of.map(({ run, name }, k) => ({ ...looks[k], name, t: times(run), y: values(run) }));
  const scaled = (column, scale = 1e-3) => (run) => run.ego[column].map((value) => value * scale);
  const pedals = (sign) => (run) => run.commands.t.map((_, k) => (sign * (run.commands.throttle[k] - run.commands.brake[k])) / 1000);
  const panel = (title, unit, lines, rest = {}) => timePanel({ title, unit, curves: lines, end, moment, marks, ...rest });
  const located = of.filter(({ run }) => run.located?.t.length > 0);
  const errors = located.flatMap(({ run, name }, k) => {
    const sure = run.located.sigma.some((sigma) => sigma != null);
    const line = (y, colour, told) => ({ ...looks[k], colour, name: [name, told].filter(Boolean).join(", "), t: run.located.t, y });
    return [
      line(run.located.off.map((off) => off / 10), looks[k].colour, sure || name ? "off by" : ""),
      sure ? line(run.located.sigma.map((sigma) => (2 * (sigma ?? 0)) / 10), "var(--soft)", "two deviations as it gives them") : null,
    ].filter(Boolean);
  });
  const hasPedals = of.every(({ run }) => run.commands.t.length > 0);
  const told = marks.filter((mark) => !mark.isStep);
  const chain = marks.some((mark) => mark.isStep);
  return [
    chain ? markStrip({ marks, end, moment }) : null,
    panel("Speed", "m/s", curves(scaled("v"))),
    panel("Front wheels", "degrees to the left", curves(scaled("steer", 0.18 / Math.PI)), { least: 2 }),
    panel("Acceleration along", "m/s²", curves(scaled("a")), { least: 4, limits: COMFORT.along, limitText: "comfort" }),
    panel("Acceleration across", "m/s²", curves(scaled("lat")), { least: 4, limits: COMFORT.lateral, limitText: "comfort" }),
    panel("Jerk along", "m/s³", curves((run) => slopes(run.ego.t, run.ego.a)), { least: 8, limits: COMFORT.jerk, limitText: "comfort" }),
    errors.length > 0 ? panel("Error of localization", "cm on the ground", errors) : null,
    hasPedals ? panel("Pedals", "throttle above, brake below 0", curves(pedals(1), (run) => run.commands.t)) : null,
    el("p", { class: "soft small" }, `Dotted: the limits of comfort in nuPlan's metrics (Karnchanachari et al. 2024). ${told.map((mark) => `Dashed: ${mark.text} at ${seconds(mark.t, 2)}. `).join("")}${chain ? "Thin upright lines: the steps from the first sight to the effect. " : ""}Click or drag to go to an instant.`),
  ].filter(Boolean);
}

/** The states of the behaviour planner: their times, and their changes. */
function behaviour({ changes, more, times }, moment) {
  const all = times.reduce((sum, [, ms]) => sum + ms, 0);
  const shares = times.map(([state, ms]) => [state, `${fixed(ms / 1e3)} s`, `${fixed((100 * ms) / all, 1)} %`]);
  const rows = changes.map(({ t, state, because }) => [el("button", { click: () => moment.set(t) }, seconds(t, 2)), state, because]);
  return [
    table(["state", "time", "share"], shares),
    el("h3", {}, "Changes"),
    table(["from", "state", "because of"], rows),
    more > 0 ? el("p", { class: "soft small" }, `The first ${changes.length} changes; ${more} later ones are in metrics.json.`) : null,
  ].filter(Boolean);
}

/** Change of a column in thousandths over a quarter of a second, per second. */
function slopes(t, values) {
  return values.map((value, k) => {
    const before = Math.max(0, lastUpTo(t, t[k] - 250_000));
    return t[k] > t[before] ? ((value - values[before]) / (t[k] - t[before])) * 1e3 : 0;
  });
}

/** All metrics of metrics.json that are single values, and its tables. */
function figures(metrics) {
  const rows = [];
  const walk = (prefix, value) => {
    for (const [name, inner] of Object.entries(value)) {
      const key = prefix ? `${prefix}.${name}` : name;
      if (inner && typeof inner === "object" && !Array.isArray(inner)) walk(key, inner);
      else if (!Array.isArray(inner) && inner != null) rows.push([key, plain(inner)]);
    }
  };
  const { why: _, ...rest } = metrics;
  walk("", rest);
  const half = Math.ceil(rows.length / 2);
  const actors = (metrics.actors ?? []).map((actor) => Object.values(actor).map((value) => plain(value)));
  return el("div", {},
    el("div", { class: "two" }, table(["metric", "value"], rows.slice(0, half)), table(["metric", "value"], rows.slice(half))),
    actors.length > 0 ? el("div", {}, el("h3", {}, "Actors"), table(Object.keys(metrics.actors[0]), actors, { sort: true })) : null);
}

/** What differs from the defaults, and all of it. */
function configuration(page) {
  const rows = page.changed.map((change) => [change.key, change.value || "not set", change.default || "none"]);
  const all = el("details", {}, el("summary", {}, "the whole configuration"), el("button", { click: () => save(`${page.scenario}.toml`, "text/plain", page.config) }, "save"), el("pre", {}, page.config));
  return el("div", {}, rows.length === 0 ? el("p", {}, "Everything is at its default.") : table(["key", "value", "default"], rows), all);
}
