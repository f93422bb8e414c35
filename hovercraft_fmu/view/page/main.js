// The page: it unpacks the FMU, and goes from frame to frame.

import { Chart } from "./chart.js";
import { Controls } from "./controls.js";
import { Course } from "./course.js";
import { Picture } from "./drawing.js";
import { element, field, write } from "./elements.js";
import { Flight, Helm, Pace, Reel, SHORTEST, STATES } from "./flight.js";
import { Description, Instance, Library, Refusal } from "./fmu.js";
import { measurePrices } from "./prices.js";
import { HELM, command, fragment, parsed, sceneOf, startValues } from "./settings.js";

/** @typedef {import("./fmu.js").Values} Values */

const LONGEST_LAG = 0.25; // s: what one frame catches up at most
const LONGEST_WORK = 0.012; // s: what one frame computes at most; the rest is dropped, and time goes slower
const ADAPTIVE_STEP = 0.1; // s, of communication: the adaptive method goes no further at once
const CHART_EVERY = 0.1; // s, of a person's time
const COST_EVERY = 0.5; // s
const SPEAK_EVERY = 6; // s
const MOST_NOTICES = 3;

class Page {
  /** @param {Library} library @param {Description} description @param {import("./settings.js").Data} data */
  constructor(library, description, data) {
    this.library = library;
    this.description = description;
    this.data = data;
    this.notices = /** @type {string[]} */ ([]);
    this.settings = parsed(location.hash.slice(1), data, description, (text) => this.say("Error", text));
    this.paused = false;
    this.late = false;
    this.stale = true; // whether there is something new to be seen
    this.failed = "";
    this.course = /** @type {Course | null} */ (null);
    this.pace = new Pace();
    this.frames = /** @type {number[]} */ ([]); // ms, that the scripts of the last frames took
    this.last = { chart: 0, cost: 0, spoken: 0, time: 0, wall: 0, substeps: 0 };
    this.still = matchMedia("(prefers-reduced-motion: reduce)");
    this.picture = new Picture(
      /** @type {HTMLCanvasElement} */ (element("view")),
      /** @type {HTMLCanvasElement} */ (element("map")),
      /** @type {HTMLCanvasElement} */ (element("compass")),
    );
    this.chart = new Chart(/** @type {HTMLCanvasElement} */ (element("chart")));
    const actions = {
      act: this.act.bind(this),
      pause: this.pause.bind(this),
      stepOnce: this.stepOnce.bind(this),
      reset: this.reset.bind(this),
      gates: this.toggleGates.bind(this),
      save: this.save.bind(this),
      change: this.change.bind(this),
    };
    this.controls = new Controls(actions, data, description, () => this.settings);
    this.flight = this.begun({}, 0);
    this.fromStart = true;
    const touch = matchMedia("(any-pointer: coarse)").matches || navigator.maxTouchPoints > 0;
    element("pads").hidden = !touch;
    element("sea").classList.toggle("touch", touch);
    const measure = () => {
      this.picture.measure();
      this.stale = true;
    };
    new ResizeObserver(measure).observe(element("view"));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", measure);
    this.controls.show();
    this.showCommand();
  }

  // ---- flights

  /** s, of a communication step. */
  get step() {
    return this.settings.integrator === "adaptive" ? ADAPTIVE_STEP : Math.max(SHORTEST, this.settings.step_size);
  }

  /**
   * A flight with the settings, from a state, with a thrust [N] at the helm.
   * @param {Values} state
   * @param {number} thrust
   */
  begun(state, thrust) {
    const { data, description, settings } = this;
    const moved = Object.entries(state).filter(([, value]) => value !== 0);
    const values = { ...startValues(settings, data, description), ...Object.fromEntries(moved) };
    this.thrust = thrust;
    return new Flight(this.library, description, values, this.newSource(values), this.step, (status, text) =>
      this.say(status, text),
    );
  }

  /** Who is at the helm. @param {Values} values of the start */
  newSource(values) {
    /** @type {Values} */
    const rest = {};
    for (const { name } of this.description.inputs)
      rest[name] = HELM.includes(name) ? 0 : (this.settings.inputs[name] ?? 0);
    const scene = sceneOf(this.settings, this.data);
    if (scene) return new Reel(scene, rest, this.step);
    const [low, high] = ["thrust_min", "thrust_max"].map(
      (name) => values[name] ?? this.description.variable(name).start ?? 0,
    );
    const thrust = Math.min(Math.max(this.thrust ?? 0, low), high);
    return new Helm({ ...rest, thrust }, [low, high], this.step);
  }

  /** Another flight: from where the craft is, or from the start. @param {boolean} fromStart */
  begin(fromStart) {
    const { flight } = this,
      held = this.held(),
      state = fromStart ? {} : flight.craft.get(...STATES);
    this.clearNotices();
    try {
      this.flight = this.begun(state, fromStart ? 0 : flight.inputs.thrust);
    } catch (error) {
      this.fail(error);
      return;
    }
    flight.free();
    this.fromStart = fromStart;
    this.begunAgain(held);
    this.showCommand();
  }

  /** What is seen and counted begins anew; keys that are held go on. @param {string[]} held */
  begunAgain(held) {
    held.forEach((what) => this.act(what, 1));
    if (this.fromStart) this.picture.clear();
    if (this.fromStart && this.course) this.course = new Course(pose(this.flight.see().craft));
    this.chart.clear();
    this.failed = "";
    this.stale = true;
    Object.assign(this.last, { cost: 0, time: 0, wall: 0, substeps: 0 });
    this.pace.restart(performance.now() / 1000);
  }

  held() {
    return this.flight.source instanceof Helm ? [...this.flight.source.held] : [];
  }

  // ---- what a person does

  /** @param {string} what @param {number} value */
  act(what, value) {
    if (this.flight.source instanceof Helm) this.flight.source.act(what, value);
    if (this.description.variables.has(what)) {
      this.settings.inputs = { ...this.settings.inputs, [what]: value };
      this.settled();
    }
  }

  pause() {
    this.paused = !this.paused;
    this.pace.restart(performance.now() / 1000);
    this.stale = true;
    write("pause", this.paused ? "Go on" : "Pause");
    element("paused").hidden = !this.paused;
  }

  stepOnce() {
    if (!this.paused) this.pause();
    this.advance(1);
  }

  /** Back to the start: where the flight began there, by its saved state. */
  reset() {
    const { flight } = this,
      held = this.held();
    if (!this.fromStart) {
      this.begin(true);
      return;
    }
    this.thrust = 0;
    flight.reset(this.newSource(flight.values));
    this.clearNotices();
    this.begunAgain(held);
  }

  toggleGates() {
    this.course = this.course ? null : new Course(pose(this.flight.see().craft));
    if (this.course && this.settings.view === "wrap") this.change({ view: "open" });
    this.stale = true;
    write("gates", this.course ? "No gates" : "Course of gates");
  }

  /** @param {Partial<import("./settings.js").Settings>} change */
  change(change) {
    const before = this.settings;
    this.settings = { ...before, ...change };
    this.settled();
    this.pace.restart(performance.now() / 1000);
    const differs = (/** @type {keyof typeof before} */ name) => this.settings[name] !== before[name];
    if (Object.keys(change).some((name) => name !== "scale" && name !== "view"))
      this.begin(differs("scene") || differs("preset") || this.settings.scene !== "");
    if (this.paused && this.flight.steps === 0 && this.fromStart) this.pause();
  }

  settled() {
    this.stale = true;
    this.controls.show();
    history.replaceState(null, "", `#${fragment(this.settings, this.data)}`);
  }

  save() {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([this.flight.log()], { type: "text/csv" }));
    link.download = "hovercraft.csv";
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  }

  // ---- what is said

  /** @param {string} status @param {string} text */
  say(status, text) {
    const notice = document.createElement("p");
    notice.textContent = text;
    notice.className = status === "Warning" ? "" : "bad";
    element("notices").append(notice);
    while (element("notices").childElementCount > MOST_NOTICES) element("notices").firstElementChild?.remove();
  }

  clearNotices() {
    element("notices").replaceChildren();
  }

  /** @param {unknown} error */
  fail(error) {
    if (!(error instanceof Refusal)) throw error;
    this.failed = error.message;
    if (!element("notices").textContent?.includes(error.message)) this.say("Error", error.message);
  }

  showCommand() {
    field("command").value = command(this.flight.values, this.settings, this.data, this.description, this.flight.step);
  }

  // ---- frames

  /** @param {number} now s */
  frame(now) {
    const began = performance.now();
    const { flight, pace, settings } = this;
    if (this.paused || this.failed || document.hidden) pace.restart(now);
    const due = pace.due(now, settings.scale, flight.step),
      most = Math.floor((LONGEST_LAG * settings.scale) / flight.step) + 1;
    this.late = due > most;
    for (let left = Math.min(due, most); left > 0 && !this.failed;) {
      const some = Math.min(left, 50);
      this.advance(some);
      pace.taken += some;
      left -= some;
      if ((performance.now() - began) / 1000 > LONGEST_WORK && left > 0) {
        this.late = true;
        break;
      }
    }
    if (this.late) pace.restart(now);
    if (this.stale) this.draw(now);
    this.stale = !this.paused && !this.failed;
    this.frames.push(performance.now() - began);
    if (this.frames.length > 300) this.frames.shift();
  }

  /** @param {number} n communication steps */
  advance(n) {
    this.stale = true;
    try {
      this.flight.advance(n);
    } catch (error) {
      this.fail(error);
    }
    if (this.course) this.course.pass(pose(this.flight.see().craft), this.flight.time);
  }

  /** @param {number} now s */
  draw(now) {
    const { flight, picture } = this,
      seen = flight.see(),
      craft = pose(seen.craft);
    const shown = {
      craft,
      ghost: pose(seen.ghost),
      inputs: flight.inputs,
      course: this.course,
      wraps: this.settings.view === "wrap",
      still: this.still.matches,
      size: this.size(),
    };
    picture.pass(shown);
    picture.draw(shown);
    this.write(seen);
    if (now - this.last.chart > CHART_EVERY && !this.paused) {
      this.last.chart = now;
      this.chart.add(seen.distance, seen.craft["error.position"]);
      this.chart.draw();
    }
    if (now - this.last.cost > COST_EVERY) this.writeCosts(now, seen.craft.substeps);
    if (now - this.last.spoken > SPEAK_EVERY && !this.paused) {
      this.last.spoken = now;
      write(
        "spoken",
        ["speed", "heading", "thrust", "clock"].map((id) => `${id} ${element(id).textContent}`).join(", "),
      );
    }
    if (flight.source.ended && !this.paused) this.pause();
  }

  size() {
    const start = (/** @type {string} */ name) =>
      this.flight.values[name] ?? this.description.variable(name).start ?? 0;
    return {
      length: start("length"),
      width: start("width"),
      thrust: Math.max(Math.abs(start("thrust_min")), Math.abs(start("thrust_max"))),
    };
  }

  /** @param {import("./flight.js").Seen} seen */
  write({ craft, distance }) {
    const { flight, settings } = this,
      thrust = flight.inputs.thrust,
      { limits } = /** @type {Helm} */ (flight.source);
    const degrees = ((((craft["pose.heading"] * 180) / Math.PI) % 360) + 360) % 360;
    write("speed", `${craft.speed < 1e4 ? craft.speed.toFixed(2) : craft.speed.toExponential(1)} m/s`);
    write("heading", `${degrees.toFixed(0)}°`);
    write("thrust", `${thrust.toFixed(1)} N`);
    const [low, high] = limits ?? [0, this.size().thrust],
      span = high - low || 1;
    element("thrust-bar").style.left = `${(100 * (Math.min(thrust, 0) - low)) / span}%`;
    element("thrust-bar").style.width = `${(100 * Math.abs(thrust)) / span}%`;
    write("time", `${flight.time.toFixed(1)} s${this.late ? ", late" : ""}`);
    write("distance", metres(distance));
    write("told", settings.estimate ? metres(craft["error.position"]) : "off");
    const { stability, rotation } = this.data.methods[settings.integrator];
    gauge("stability", craft.stability_number, stability, "");
    gauge("rotation", craft.rotation_per_substep, rotation, " rad");
    element("course").hidden = !this.course;
    if (this.course) {
      write("gate", this.course.finished ? "all gates" : `gate ${this.course.next + 1} of ${this.course.gates.length}`);
      write("clock", `${this.course.clock(flight.time).toFixed(1)} s`);
    }
  }

  /** @param {number} now s @param {number} substeps */
  writeCosts(now, substeps) {
    const { flight, last } = this,
      passed = flight.time - last.time;
    const of_each = this.data.methods[this.settings.integrator].stages * (this.settings.estimate ? 3 : 1);
    if (last.cost && passed > 0) {
      write("loads", String(Number(((of_each * (substeps - last.substeps)) / passed).toPrecision(3))));
      write("cost", `${Number(((1e6 * (flight.wall - last.wall)) / passed).toPrecision(2))} µs`);
    }
    Object.assign(last, { cost: now, time: flight.time, wall: flight.wall, substeps });
  }
}

/** @param {Values} seen */
const pose = (seen) => ({ x: seen["pose.x"], y: seen["pose.y"], heading: seen["pose.heading"] });

/** A length in its best unit. @param {number} length m */
function metres(length) {
  const [factor, unit] =
    length === 0 || length >= 1 ? [1, "m"] : length >= 1e-3 ? [1e3, "mm"] : length >= 1e-6 ? [1e6, "µm"] : [1e9, "nm"];
  return length >= 1e4 ? `${length.toExponential(1)} m` : `${Number((length * factor).toPrecision(3))} ${unit}`;
}

/**
 * Two thirds of it are up to the limit.
 * @param {string} id
 * @param {number} value
 * @param {number | null} limit
 * @param {string} unit
 */
function gauge(id, value, limit, unit) {
  const bar = /** @type {HTMLElement} */ (element(id).firstElementChild),
    part = limit ? value / limit : 0;
  bar.style.width = `${Math.min(66.6 * part, 100)}%`;
  bar.classList.toggle("over", part > 1);
  write(`${id}-text`, `${Number(value.toPrecision(2))}${unit}${limit ? ` of ${limit}` : ", no limit"}`);
  element(id).setAttribute("aria-valuemax", String(limit ?? value));
  element(id).setAttribute("aria-valuenow", String(value));
}

/** What was deflated and written in base64. @param {string} text */
async function unpacked(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(stream).arrayBuffer();
}

const data = /** @type {import("./settings.js").Data} */ (JSON.parse(element("data").textContent ?? ""));
const description = new Description(new TextDecoder().decode(await unpacked(data.description)));
const library = await Library.load(await unpacked(data.module));
element("sorry").hidden = true;
element("app").hidden = false;
const page = new Page(library, description, data);
write(
  "about",
  `${description.name} ${data.version}, FMI ${library.version}, in your browser: nothing is installed or sent.`,
);
/** @param {number} now ms */
const go = (now) => {
  page.frame(now / 1000);
  requestAnimationFrame(go);
};
requestAnimationFrame(go);
addEventListener("hashchange", () => location.reload());
/** @param {string} name @param {number} ratio */
const priced = (name, ratio) => write(`price-${name}`, ratio > 0 && ratio < Infinity ? `× ${ratio.toFixed(2)}` : "…");
setTimeout(() => measurePrices(library, description, data.terms, priced), 500);
// for the console: the same calls, from there
Object.assign(globalThis, { hovercraft: { page, library, description, data, Instance, Flight, Helm, Reel } });
