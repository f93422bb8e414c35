// What was recorded of one craft or more, to be played: the time on a slider, the whole path and a close-up.

import { Chart, SAMPLES } from "./chart.js";
import { Camera, Canvas, dot, drawCraft, drawOutline, drawSea, line, turned } from "./drawing.js";
import { element, field, write } from "./elements.js";

/** @typedef {[number, number]} Point */
/**
 * One craft; lists over time.
 * @typedef {object} Moving
 * @property {string} name
 * @property {boolean} ghost whether it is what the first is compared with: an outline
 * @property {{ length: number, width: number, thrust: number }} size m, m; full thrust, N
 * @property {number[]} x m
 * @property {number[]} y m
 * @property {number[]} heading rad
 * @property {number[]} speed m/s
 * @property {number[]} [thrust] N
 * @property {number[]} [port_thruster]
 * @property {number[]} [starboard_thruster]
 * @property {number[]} [doubt] m, how far off it says that it may be
 */
/**
 * @typedef {object} Data
 * @property {string} title
 * @property {number[]} time s
 * @property {Moving[]} crafts
 * @property {Point[]} marks m
 * @property {number[]} [apart] m, the first two craft
 * @property {{ ends: [Point, Point], tension: number[] }} [line] between them: m, body frames; N
 */

const PLAYED_IN = 30; // s, at the first speed, at most
const LONGEST_LAG = 0.25; // s: what one frame goes on at most
const SLIDER_STEPS = 300; // at most
const LABEL_ROOM = 90; // pixels
const SQUARE = 60; // pixels, at least
const SMALLEST = 14; // pixels: a shorter craft is a dot
const COLORS = ["wake", "ghost"];

export class Player {
  /** @param {Data} data */
  constructor(data) {
    this.data = data;
    this.first = data.time[0];
    this.last = data.time[data.time.length - 1];
    this.step = roundUp((this.last - this.first) / SLIDER_STEPS);
    this.time = this.first;
    this.speed = roundUp((this.last - this.first) / PLAYED_IN);
    this.zoom = 1;
    this.playing = false;
    this.moment = 0;
    this.stale = true;
    const canvas = (/** @type {string} */ id) => /** @type {HTMLCanvasElement} */ (element(id));
    this.view = new Canvas(canvas("view"));
    this.inset = new Canvas(canvas("inset"));
    this.chart = new Chart(canvas("chart"));
    this.fill();
    this.listen();
  }

  fill() {
    const { data, first, last, step } = this,
      slider = field("slider");
    document.title = data.title;
    write("title", data.title);
    slider.step = String(step);
    slider.min = String(tidy(Math.floor(first / step + 1e-6) * step));
    slider.max = String(tidy(Math.ceil(last / step - 1e-6) * step));
    for (let i = -5; i <= 5; i++) field("speed").append(new Option("", String(i)));
    this.changeSpeed(0);
    data.crafts.forEach((craft, i) => {
      const term = document.createElement("dt"),
        now = document.createElement("dd");
      term.textContent = craft.name;
      term.className = `${COLORS[i % 2]} ${craft.ghost ? "dashed" : ""}`;
      now.id = `now-${i}`;
      element("crafts").append(term, now);
    });
    const { apart } = data;
    element("apart").hidden = !apart;
    for (let i = 0; apart && i < SAMPLES; i++)
      this.chart.add(apart[Math.round((i * (apart.length - 1)) / (SAMPLES - 1))], NaN);
  }

  listen() {
    const again = () => {
      for (const each of [this.view, this.inset]) each.measure();
      this.label();
      this.stale = true;
    };
    new ResizeObserver(again).observe(element("view"));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", again);
    element("play").addEventListener("click", () => this.play());
    field("slider").addEventListener("input", () => this.go(Number(field("slider").value)));
    field("speed").addEventListener("change", () => this.changeSpeed(Number(field("speed").value)));
    field("follow").addEventListener("change", () => (this.stale = true));
    element("view").addEventListener("wheel", (event) => {
      event.preventDefault();
      this.magnify(0.998 ** event.deltaY);
    });
    addEventListener("keydown", (event) => {
      const at = /** @type {HTMLElement} */ (event.target),
        todo = this.keys()[event.key.toLowerCase()];
      if (!todo || event.ctrlKey || event.metaKey || event.altKey || at.matches("select")) return;
      if (event.key === " " && at.matches("button, summary, input[type=checkbox]")) return;
      event.preventDefault();
      todo();
    });
  }

  /** @returns {Record<string, () => void>} */
  keys() {
    const along = (/** @type {number} */ by) => () =>
      this.go(tidy((Math.round(this.time / this.step) + by) * this.step));
    const faster = (/** @type {number} */ by) => () => this.changeSpeed(Number(field("speed").value) + by);
    return {
      " ": () => this.play(),
      arrowright: along(1),
      arrowleft: along(-1),
      pageup: along(10),
      pagedown: along(-10),
      home: () => this.go(this.first),
      end: () => this.go(this.last),
      f: () => field("follow").click(),
      "+": faster(1),
      "-": faster(-1),
      "]": () => this.magnify(1.25),
      "[": () => this.magnify(0.8),
    };
  }

  play() {
    this.playing = !this.playing;
    if (this.playing && this.time >= this.last) this.time = this.first;
    this.moment = performance.now() / 1000;
    this.stale = true;
  }

  /** @param {number} time s */
  go(time) {
    this.time = Math.min(Math.max(time, this.first), this.last);
    this.stale = true;
  }

  /** By so many of the round numbers from that of the start. @param {number} by */
  changeSpeed(by) {
    if (Math.abs(by) > 5) return;
    const start = roundUp((this.last - this.first) / PLAYED_IN);
    [...element("speed").children].forEach((option, i) => (option.textContent = `× ${further(start, i - 5)}`));
    this.speed = further(start, by);
    field("speed").value = String(by);
  }

  /** @param {number} factor */
  magnify(factor) {
    this.zoom = Math.min(Math.max(this.zoom * factor, 0.1), 10);
    this.stale = true;
  }

  /** Round times under the slider, as many as there is room for. */
  label() {
    const slider = field("slider"),
      [low, high] = [Number(slider.min), Number(slider.max)];
    const every = Math.max(roundUp(((high - low) * LABEL_ROOM) / slider.clientWidth), this.step);
    const labels = [];
    for (let n = Math.ceil(low / every - 1e-6); n * every <= high * (1 + 1e-12); n++) {
      const each = document.createElement("span"),
        share = (n * every - low) / (high - low);
      each.textContent = String(tidy(n * every));
      each.style.left = `calc(${100 * share}% + ${8 - 16 * share}px)`; // the thumb is 16 pixels wide
      labels.push(each);
    }
    element("labels").replaceChildren(...labels);
  }

  /** @param {number} now s */
  frame(now) {
    if (this.playing) {
      this.go(this.time + Math.min(now - this.moment, LONGEST_LAG) * this.speed);
      this.playing = this.time < this.last;
    }
    this.moment = now;
    if (this.stale) this.draw();
    this.stale = this.playing;
  }

  draw() {
    const follows = field("follow").checked,
      { data } = this,
      states = data.crafts.map((craft) => this.state(craft));
    const camera = follows ? this.near(this.view, states, this.zoom) : this.far(this.view, this.zoom);
    const square = this.drawView(camera, states);
    this.drawView(follows ? this.far(this.inset) : this.near(this.inset, states), states);
    this.chart.draw((this.time - this.first) / (this.last - this.first));
    write("square", `a square is ${square} m`);
    write("other", follows ? "The whole path" : "Around the craft");
    write("play", this.playing ? "Pause" : "Play");
    write("time", `${this.time.toFixed(Math.max(0, -Math.floor(Math.log10(this.step) + 1e-6)))} s`);
    field("slider").value = String(this.time);
    field("slider").setAttribute("aria-valuetext", `${element("time").textContent}`);
    states.forEach((state, i) => {
      const degrees = ((((state.heading * 180) / Math.PI) % 360) + 360) % 360;
      const thrust = data.crafts[i].thrust ? `, ${state.inputs.thrust.toFixed(1)} N` : "";
      write(`now-${i}`, `${state.speed.toFixed(2)} m/s, heading ${degrees.toFixed(0)}°${thrust}`);
    });
    const apart = data.apart && `${Number(this.between(data.apart).toPrecision(3))} m apart`;
    write("between", data.line ? `the line pulls at ${this.between(data.line.tension).toFixed(1)} N` : apart || "");
  }

  /** The last recorded point that is not after now, and the way from there to the next one. */
  place() {
    const { time } = this.data;
    let [low, high] = [0, time.length - 1];
    while (low < high) {
      const middle = Math.ceil((low + high) / 2);
      if (time[middle] <= this.time) low = middle;
      else high = middle - 1;
    }
    const next = Math.min(low + 1, time.length - 1);
    return { i: low, next, share: next > low ? (this.time - time[low]) / (time[next] - time[low]) : 0 };
  }

  /** On the straight line between two points. @param {number[]} column */
  between(column) {
    const { i, next, share } = this.place();
    return column[i] + share * (column[next] - column[i]);
  }

  /** A craft as it is now; what it blows is as it was set last. @param {Moving} craft */
  state(craft) {
    const { i } = this.place();
    return {
      x: this.between(craft.x),
      y: this.between(craft.y),
      heading: this.between(craft.heading),
      speed: this.between(craft.speed),
      doubt: craft.doubt ? this.between(craft.doubt) : 0,
      inputs: {
        thrust: craft.thrust?.[i] ?? 0,
        port_thruster: craft.port_thruster?.[i] ?? 0,
        starboard_thruster: craft.starboard_thruster?.[i] ?? 0,
      },
    };
  }

  /** All craft, and some ground around them. @param {Canvas} canvas @param {{ x: number, y: number }[]} states */
  near(canvas, states, zoom = 1) {
    const length = Math.max(...this.data.crafts.map((craft) => craft.size.length));
    const { at, scale } = fitted(canvas, [states], 1.2 * length);
    return new Camera(canvas, at, zoom * Math.min(scale, Math.min(Math.max(canvas.width / 10, 40), 120) / length));
  }

  /** All of the paths. @param {Canvas} canvas */
  far(canvas, zoom = 1) {
    const { crafts, marks } = this.data;
    const paths = crafts.map(({ x, y }) => x.map((each, i) => ({ x: each, y: y[i] })));
    const room = Math.max(...crafts.map(({ size }) => Math.hypot(size.length, size.width)));
    const { at, scale } = fitted(canvas, [...paths, marks.map(([x, y]) => ({ x, y }))], room);
    return new Camera(canvas, at, zoom * scale);
  }

  /** @param {Camera} camera @param {ReturnType<Player["state"]>[]} states @returns {number} m, of a square */
  drawView(camera, states) {
    const { context: c, colors } = camera.canvas,
      { crafts, marks } = this.data,
      square = roundUp(SQUARE / camera.scale);
    drawSea(camera, square);
    marks.forEach(([x, y]) => dot(c, camera.place({ x, y }), 4, colors.accent));
    crafts.forEach(({ size, ghost }, i) => {
      const state = states[i],
        color = colors[COLORS[i % 2]];
      c.fillStyle = color;
      c.globalAlpha = 0.25;
      c.beginPath();
      c.arc(...camera.place(state), state.doubt * camera.scale, 0, 2 * Math.PI);
      c.fill();
      c.globalAlpha = 1;
      if (size.length * camera.scale < SMALLEST) dot(c, camera.place(state), 5, color);
      if (ghost) drawOutline(camera, state, size);
      else drawCraft(camera, state, size, state.inputs, i ? color : colors.edge);
    });
    crafts.forEach((craft, i) => this.drawPath(camera, craft, states[i], colors[COLORS[i % 2]]));
    this.drawLine(camera, states);
    return square;
  }

  /**
   * Faint what is to come; dashed, so that it hides no other, that of a ghost.
   * @param {Camera} camera
   * @param {Moving} craft
   * @param {{ x: number, y: number }} now
   * @param {string} color
   */
  drawPath(camera, { x, y, ghost }, now, color) {
    const { context: c } = camera.canvas,
      { i: passed } = this.place();
    c.strokeStyle = color;
    c.lineJoin = "round";
    c.setLineDash(ghost ? [7, 5] : []);
    for (const [from, to, width, alpha] of [
      [passed, x.length - 1, 1.5, 0.4],
      [0, passed, 2.5, 1],
    ]) {
      c.lineWidth = width;
      c.globalAlpha = alpha;
      c.beginPath();
      if (from) c.moveTo(...camera.place(now));
      for (let i = from ? from + 1 : 0; i <= to; i++) c.lineTo(...camera.place({ x: x[i], y: y[i] }));
      if (to === passed) c.lineTo(...camera.place(now));
      c.stroke();
    }
    c.globalAlpha = 1;
    c.setLineDash([]);
  }

  /** Dotted where it hangs loose. @param {Camera} camera @param {ReturnType<Player["state"]>[]} states */
  drawLine(camera, states) {
    const { line: tow } = this.data,
      { context: c, colors } = camera.canvas;
    if (!tow) return;
    const [a, b] = tow.ends.map((end, i) => {
      const [[x, y]] = turned([end], states[i].heading);
      return camera.place({ x: states[i].x + x, y: states[i].y + y });
    });
    c.strokeStyle = colors.accent;
    c.lineWidth = 3;
    c.setLineDash(tow.tension[this.place().i] > 0 ? [] : [4, 4]);
    c.beginPath();
    line(c, a, b);
    c.stroke();
    c.setLineDash([]);
  }
}

/**
 * The middle [m] and the pixels a metre of a view that shows all of the points.
 * @param {Canvas} canvas
 * @param {{ x: number, y: number }[][]} paths
 * @param {number} room m, around them
 */
function fitted({ width, height }, paths, room) {
  const [low, high] = [
    { x: Infinity, y: Infinity },
    { x: -Infinity, y: -Infinity },
  ];
  for (const { x, y } of paths.flat()) {
    [low.x, low.y] = [Math.min(low.x, x), Math.min(low.y, y)];
    [high.x, high.y] = [Math.max(high.x, x), Math.max(high.y, y)];
  }
  const scale = Math.min(width / (high.x - low.x + 2 * room), height / (high.y - low.y + 2 * room));
  return { at: { x: (low.x + high.x) / 2, y: (low.y + high.y) / 2 }, scale };
}

/** The least of 1, 2, 5 times a power of ten that is not less. @param {number} least */
function roundUp(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return tidy(([1, 2, 5].find((each) => each * power >= 0.999999 * least) ?? 10) * power);
}

/** So many of these numbers further. @param {number} round @param {number} by */
function further(round, by) {
  const power = Math.floor(Math.log10(round) + 1e-6),
    n = 3 * power + [1, 2, 5].indexOf(Math.round(round / 10 ** power)) + by;
  return tidy([1, 2, 5][((n % 3) + 3) % 3] * 10 ** Math.floor(n / 3));
}

/** Without the rounding of its last digits. @param {number} value */
function tidy(value) {
  return Number(value.toPrecision(12));
}

const player = new Player(JSON.parse(element("data").textContent ?? ""));
element("sorry").hidden = true;
element("app").hidden = false;
/** @param {number} now ms */
const go = (now) => {
  player.frame(now / 1000);
  requestAnimationFrame(go);
};
requestAnimationFrame(go);
// for the console
Object.assign(globalThis, { animation: player });
