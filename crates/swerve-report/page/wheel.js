// A run that is driven by hand, with arrow keys (or W, A, S, D) or a gamepad: stick and triggers.

const KEYS = {
  ArrowUp: "throttle", KeyW: "throttle", ArrowDown: "brake", KeyS: "brake",
  ArrowLeft: "left", KeyA: "left", ArrowRight: "right", KeyD: "right",
};
/** How often pedals and steering are looked at, ms, and by how much keys turn the wheel from one time to the next. */
const TICK_MS = 40;
const TURN = 0.08;

class Wheel {
  /** `send` tells the car and gives a promise: there is one at a time on its way, and the newest goes next. */
  constructor(send) {
    [this.send, this.held, this.steering, this.sent, this.waits] = [send, new Set(), 0, "", false];
    this.told = el("output", { id: "wheel" });
    this.node = el("div", { class: "bar" }, "arrow keys, or a gamepad's stick and triggers:", this.told);
    addEventListener("keydown", (event) => this.key(event, true), true);
    addEventListener("keyup", (event) => this.key(event, false), true);
    addEventListener("blur", () => this.held.clear());
    setInterval(() => this.tick(), TICK_MS);
  }

  key(event, down) {
    const what = KEYS[event.code];
    if (!what || event.target.matches?.("input[type=text], input[type=number]")) return;
    event.preventDefault();
    event.stopPropagation();
    if (down) this.held.add(what);
    else this.held.delete(what);
  }

  /** What a gamepad in its standard layout asks for, if one is used. */
  pad() {
    const pad = [...navigator.getGamepads()].find((one) => one?.mapping === "standard");
    if (!pad) return null;
    const steering = Math.abs(pad.axes[0]) < 0.08 ? 0 : -pad.axes[0];
    const held = { steering, throttle: pad.buttons[7].value, brake: pad.buttons[6].value };
    return Object.values(held).some((value) => value !== 0) ? held : null;
  }

  keys() {
    const on = (what) => Number(this.held.has(what));
    const away = on("left") - on("right") - this.steering;
    this.steering += Math.sign(away) * Math.min(Math.abs(away), TURN);
    return { steering: this.steering, throttle: on("throttle"), brake: on("brake") };
  }

  async tick() {
    const keys = this.keys();
    const exact = this.pad() ?? keys;
    const held = Object.fromEntries(Object.entries(exact).map(([name, value]) => [name, Math.round(100 * value) / 100]));
    const text = JSON.stringify(held);
    if (this.waits || text === this.sent) return;
    this.waits = true;
    this.told.textContent = `steering ${held.steering.toFixed(2)}, throttle ${held.throttle.toFixed(2)}, brake ${held.brake.toFixed(2)}`;
    try {
      await this.send(held);
      this.sent = text;
    } catch {
      // The program has ended, as the page tells.
    } finally {
      this.waits = false;
    }
  }
}
