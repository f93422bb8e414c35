// What flies: a source of inputs, the craft that follows it step by step, and a ghost beside it.

import { Instance, Refusal } from "./fmu.js";

/** @typedef {import("./fmu.js").Values} Values */

export const THRUST_RATE = 1; // N/s, while a key is held
export const SHORTEST = 0.01; // s, of a communication step
export const STATES = ["pose.x", "pose.y", "pose.heading", "velocity.x", "velocity.y", "velocity.yaw_rate"];
const SEEN = [...STATES, "speed", "substeps", "stability_number", "rotation_per_substep", "error.position"];

/**
 * Inputs over time: they hold over each communication step, whose number is counted from 0.
 * @typedef {object} Source
 * @property {() => Values} inputs of the step that begins now
 * @property {() => void} pass one step goes by
 * @property {() => Source} again the same, from the start
 * @property {boolean} ended
 */

/** The operator: held keys change the thrust and fire a bow thruster; where both turning keys are held left wins. */
export class Helm {
  /**
   * @param {Values} start all inputs
   * @param {[number, number]} limits of the thrust, N
   * @param {number} step s
   */
  constructor(start, limits, step) {
    this.start = start;
    this.limits = limits;
    this.step = step;
    this.n = 0;
    this.ended = false;
    /** @type {Set<string>} */
    this.held = new Set();
    this.values = { ...start };
    this.foot = start.thrust;
    this.direction = 0;
    this.steps = 0;
    /** @type {[number, string, number][]} step, what, value: all that was done */
    this.events = [];
    /** @type {[number, string, number][]} what is to be done again */
    this.coming = [];
  }

  /** A key goes down (1) or up (0), or an input is set, now. @param {string} what @param {number} value */
  act(what, value) {
    this.events.push([this.n, what, value]);
    this.take(what, value);
  }

  /** @param {string} what @param {number} value */
  take(what, value) {
    if (what in this.values) this.values[what] = value;
    else if (value) this.held.add(what);
    else this.held.delete(what);
  }

  inputs() {
    while (this.coming.length && this.coming[0][0] <= this.n)
      this.take(...tail(/** @type {[number, string, number]} */ (this.coming.shift())));
    const left = this.held.has("left");
    return {
      ...this.values,
      port_thruster: Number(this.held.has("right") && !left),
      starboard_thruster: Number(left),
    };
  }

  /** Steps are counted from where the direction last changed: n of them come to n*step*rate, rounded once. */
  pass() {
    const direction = Number(this.held.has("up")) - Number(this.held.has("down"));
    if (direction !== this.direction) {
      this.foot = this.values.thrust;
      this.direction = direction;
      this.steps = 0;
    }
    this.steps++;
    const thrust = this.foot + direction * (this.steps * this.step * THRUST_RATE);
    this.values.thrust = Math.min(Math.max(thrust, this.limits[0]), this.limits[1]);
    this.n++;
  }

  again() {
    const helm = new Helm(this.start, this.limits, this.step);
    helm.coming = [...this.events];
    return helm;
  }
}

/** @param {[number, string, number]} event @returns {[string, number]} */
const tail = ([, what, value]) => [what, value];

/**
 * @typedef {object} Scene
 * @property {string} name
 * @property {string} description
 * @property {string} preset
 * @property {Values} values that differ from the preset
 * @property {string[]} inputs
 * @property {number[][]} rows time [s] and inputs; linear between rows, two rows at one time are a jump
 */

/** The inputs of a scene, as they are where each communication step begins. */
export class Reel {
  /** @param {Scene} scene @param {Values} start all inputs @param {number} step s */
  constructor(scene, start, step) {
    this.scene = scene;
    this.start = start;
    this.step = step;
    this.n = 0;
    this.row = 0;
  }

  get ended() {
    return this.n * this.step >= this.scene.rows[this.scene.rows.length - 1][0];
  }

  inputs() {
    const time = this.n * this.step,
      { rows, inputs } = this.scene;
    while (this.row + 1 < rows.length && rows[this.row + 1][0] <= time) this.row++;
    const here = rows[this.row],
      next = rows[this.row + 1] ?? here;
    const share = next[0] > here[0] ? (time - here[0]) / (next[0] - here[0]) : 0;
    const values = { ...this.start };
    inputs.forEach((name, i) => (values[name] = here[i + 1] + share * (next[i + 1] - here[i + 1])));
    return values;
  }

  pass() {
    this.n++;
  }

  again() {
    return new Reel(this.scene, this.start, this.step);
  }
}

/**
 * @typedef {object} Seen
 * @property {Values} craft
 * @property {Values} ghost
 * @property {number} distance m, of the craft from the ghost
 */

/** The craft with the chosen settings, and the ghost: RK4 at 1 ms under the same inputs. */
export class Flight {
  /**
   * @param {import("./fmu.js").Library} library
   * @param {import("./fmu.js").Description} description
   * @param {Values} values start values of the craft
   * @param {Source} source
   * @param {number} step s
   * @param {import("./fmu.js").Tell} tell
   */
  constructor(library, description, values, source, step, tell) {
    this.values = values;
    this.source = source;
    this.step = step;
    this.steps = 0;
    this.wall = 0; // s, that the craft took
    const exact = { ...values, integrator: description.item("integrator", "rk4"), step_size: 0.001, error_estimate: 1 };
    this.craft = new Instance(library, description, tell);
    this.ghost = new Instance(library, description, () => {});
    this.craft.initialize(values, source.inputs());
    this.ghost.initialize(exact, source.inputs());
    this.inputs = source.inputs();
    this.home = this.craft.save();
    this.ghostHome = this.ghost.save();
  }

  /** s */
  get time() {
    return this.steps * this.step;
  }

  /**
   * So many communication steps, first of the craft, then of the ghost: the clock, which is coarse, is read twice.
   * Throws Refusal; what was made before stays.
   * @param {number} n
   */
  advance(n) {
    const first = this.steps;
    /** @type {Values[]} */
    const inputs = [];
    let refusal = null;
    for (let i = 0; i < n && !this.source.ended; i++) {
      inputs.push(this.source.inputs());
      this.source.pass();
    }
    const began = performance.now();
    let made = 0;
    try {
      for (; made < inputs.length; made++) this.go(this.craft, first + made, inputs[made]);
    } catch (error) {
      if (!(error instanceof Refusal)) throw error;
      refusal = error;
    }
    this.wall += (performance.now() - began) / 1000;
    for (let i = 0; i < made; i++) this.go(this.ghost, first + i, inputs[i]);
    this.steps = first + made;
    if (made) this.inputs = inputs[made - 1];
    if (refusal) throw refusal;
  }

  /** @param {Instance} one @param {number} n @param {Values} inputs */
  go(one, n, inputs) {
    one.setInputs(inputs);
    one.doStep(n * this.step, (n + 1) * this.step - n * this.step);
  }

  /** @returns {Seen} */
  see() {
    const craft = this.craft.get(...SEEN),
      ghost = this.ghost.get(...STATES);
    const distance = Math.hypot(craft["pose.x"] - ghost["pose.x"], craft["pose.y"] - ghost["pose.y"]);
    return { craft, ghost, distance };
  }

  /** Back to the start. @param {Source} source */
  reset(source) {
    this.source = source;
    this.inputs = source.inputs();
    this.wall = 0;
    this.craft.restore(this.home);
    this.ghost.restore(this.ghostHome);
    this.steps = 0;
  }

  /** The control log: a row where inputs change, two rows at the time of a jump, and the last communication point. */
  log() {
    const source = this.source.again(),
      names = Object.keys(this.inputs);
    const line = (/** @type {number} */ n, /** @type {Values} */ row) => [
      n * this.step,
      ...names.map((name) => row[name]),
    ];
    const lines = [];
    /** @type {Values | null} */
    let held = null;
    for (let n = 0; n < this.steps; n++, source.pass()) {
      const now = source.inputs(),
        before = held;
      if (before && names.every((name) => before[name] === now[name])) continue;
      if (before) lines.push(line(n, before));
      lines.push(line(n, now));
      held = now;
    }
    lines.push(line(this.steps, held ?? this.inputs));
    return [["time", ...names], ...lines].map((each) => each.join(",")).join("\n") + "\n";
  }

  free() {
    this.craft.forget(this.home);
    this.ghost.forget(this.ghostHome);
    this.craft.free();
    this.ghost.free();
  }
}

/** How many communication steps are due: counted from one moment on, so it does not matter how often one asks. */
export class Pace {
  constructor() {
    this.moment = 0;
    this.taken = 0;
  }

  /** From now on. @param {number} now s */
  restart(now) {
    this.moment = now;
    this.taken = 0;
  }

  /** @param {number} now s @param {number} scale simulated seconds a second @param {number} step s */
  due(now, scale, step) {
    return Math.floor(((now - this.moment) * scale) / step) - this.taken;
  }
}
