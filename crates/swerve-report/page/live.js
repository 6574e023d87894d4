// The page of a run that goes on: the report's player, fed while it drives, and what commands the run.

/** The newest instant is shown until somebody goes back. */
function showLive(page) {
  const moment = new Moment(0);
  const player = new Player(page, moment);
  const live = new Live(page, moment, player);
  document.getElementById("page").append(
    heading(page),
    section("live", "The run", live.node()),
    section("player", "The drive", player.node()),
    page.config ? section("configuration", "Configuration", configuration(page)) : "",
    section("repeat", "Again", page.no_command ? el("p", {}, page.no_command) : commandLine(page.command)),
  );
  live.listen();
}

class Live {
  constructor(page, moment, player) {
    [this.page, this.moment, this.player] = [page, moment, player];
    this.state = el("output", { id: "state" }, "connecting");
    this.problem = el("output", { id: "problem", role: "alert" });
    [this.looked, this.looks, this.strip] = [-1, {}, el("div", { class: "strip", id: "looks" })];
  }

  node() {
    // A car is driven by whoever drives it, never from here.
    if (this.page.watch_only) return el("div", {}, this.strip, el("div", { class: "bar" }, this.state, this.problem));
    const button = (id, text, command) => el("button", { id, click: () => this.command(command()) }, text);
    const seed = el("input", { id: "seed", type: "number", min: 0, value: this.page.seed, size: 6, "aria-label": "seed" });
    const set = el("input", { id: "set", type: "text", size: 40, placeholder: "KEY=VALUE", "aria-label": "a key of the configuration or the scenario" });
    const again = (byHand) => () => ({ do: "restart", seed: Number(seed.value), set: set.value.trim() ? [set.value.trim()] : [], by_hand: byHand });
    // As the run before up to the instant that is shown, then with the key.
    const here = () => ({ ...again(this.page.by_hand)(), from_s: this.moment.t / 1e6 });
    const speed = choice("speed", ["0.25", "0.5", "1", "2", "max"], String(this.page.speed ?? "max"), (value) => this.command({ do: "speed", speed: value === "max" ? null : Number(value) }));
    return el("div", {}, this.strip,
      el("div", { class: "bar" }, button("go", "start", () => ({ do: "go" })), button("pause", "pause", () => ({ do: "pause" })), button("step", "one frame", () => ({ do: "step" })), speed, this.state),
      el("div", { class: "bar" }, "seed", seed, set, button("restart", "restart", again(false)), button("here", "change from here", here), button("hand", "drive by hand", again(true)), this.problem),
      this.page.by_hand ? new Wheel((held) => this.command({ do: "hold", ...held })).node : "");
  }

  async command(what) {
    const answer = await fetch("control", { method: "POST", body: JSON.stringify(what) });
    this.problem.textContent = answer.ok ? "" : await answer.text();
  }

  /** How much of the run the page has: the server sends what is beyond. */
  have() {
    const { ego, commands, tracks, predictions, plans, photos, actors } = this.page;
    const last = Math.max(-1, ...actors.map((actor) => actor.t.at(-1) ?? -1));
    const [newest, before] = [(rows) => rows.at(-1)?.t ?? null, this.page.photos_before ?? 0];
    return { looked: this.looked, ego: ego.t.at(-1) ?? null, commands: commands.t.at(-1) ?? null, tracks: newest(tracks), predictions: newest(predictions), plans: newest(plans), photos: before + photos.length, actors: last < 0 ? null : last };
  }

  async listen() {
    for (;;) {
      try {
        const answer = await fetch(`rows?${encodeURIComponent(JSON.stringify(this.have()))}`);
        if (!answer.ok) throw new Error(await answer.text());
        const rows = await answer.json();
        if (rows.run !== this.page.run) return location.reload();
        this.take(rows);
        if (rows.state === "over") return await this.over(rows);
      } catch (error) {
        this.state.textContent = `the program has ended (${error.message})`;
        return;
      }
      await new Promise((resolve) => setTimeout(resolve, 40));
    }
  }

  take(rows) {
    const { page, moment } = this;
    const columns = (to, from) => Object.keys(from).filter((name) => Array.isArray(from[name])).forEach((name) => to[name].push(...from[name]));
    columns(page.ego, rows.ego);
    columns(page.commands, rows.commands);
    for (const name of ["tracks", "predictions", "plans", "photos"]) page[name].push(...rows[name]);
    for (const actor of rows.actors) {
      const known = page.actors.find((other) => other.id === actor.id);
      if (known) columns(known, actor);
      else page.actors.push(actor);
    }
    this.look(rows.looks);
    const atEnd = moment.t >= moment.end && !this.player.playing;
    moment.end = page.end = rows.end;
    this.player.grown();
    moment.set(atEnd ? rows.end : moment.t);
    this.state.textContent = rows.state;
  }

  /** Images as they come, in a row; points of a cloud go into the player. */
  look(looks) {
    for (const { stream, t, dropped, photo, points } of looks) {
      this.looked = Math.max(this.looked, t);
      const look = (this.looks[stream] ??= this.frame(stream));
      look.caption.textContent = `${stream} ${seconds(t, 2)}${dropped ? `, ${dropped} not shown` : ""}`;
      if (photo) look.image.src = photo;
      look.image.hidden = !photo;
      if (points) this.page.clouds = { ...this.page.clouds, [stream]: { t, points } };
    }
  }

  /** Room for what a stream shows. */
  frame(stream) {
    const [image, caption] = [el("img", { alt: stream }), el("figcaption", {})];
    this.strip.append(el("figure", {}, image, caption));
    return { image, caption };
  }

  /** Shows what the run came to, and waits for a restart. */
  async over(rows) {
    const whole = rows.digest ? [el("span", { id: "digest" }, ` digest ${rows.digest} `), el("a", { href: "report", target: "_blank" }, "the whole report")] : [];
    this.state.replaceChildren(rows.verdict ? badge(rows.verdict) : "over", ...whole);
    for (let now = rows, told = null; now.run === this.page.run; ) {
      // What the server refused stays until there is something new to tell.
      if (now.problem !== told) this.problem.textContent = (told = now.problem) ?? "";
      await new Promise((resolve) => setTimeout(resolve, 500));
      const answer = await fetch(`rows?${encodeURIComponent(JSON.stringify(this.have()))}`);
      now = await answer.json();
    }
    location.reload();
  }
}
