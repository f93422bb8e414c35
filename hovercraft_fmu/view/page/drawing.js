// What is seen of the sea: the craft as five lines, its jets and wake, the ghost, gates; the small map; the compass.

import { GATE_WIDTH } from "./course.js";

/** @typedef {import("./course.js").Pose} Pose */
/** @typedef {[number, number]} Point */
/**
 * @typedef {object} Shown
 * @property {Pose} craft
 * @property {Pose} ghost
 * @property {import("./fmu.js").Values} inputs
 * @property {{ length: number, width: number, thrust: number }} size m, m; full thrust, N
 * @property {import("./course.js").Course | null} course
 * @property {boolean} wraps
 * @property {boolean} still whether motion is to be reduced
 */

const WAKE_POINTS = 90;
const WAKE_SPACING = 4; // m
const TRACK_POINTS = 600;
const TRACK_SPACING = 6; // m
const GRID = 20; // m, a craft's length
const START = [0.1, 0.5]; // where the origin lies on a plane that wraps

/** Points that were passed, a spacing apart, the oldest forgotten. */
class Track {
  /** @param {number} spacing m @param {number} most */
  constructor(spacing, most) {
    this.spacing = spacing;
    this.most = most;
    /** @type {Pose[]} */
    this.points = [];
  }

  /** @param {Pose} pose */
  pass(pose) {
    const last = this.points[this.points.length - 1];
    if (last && Math.hypot(pose.x - last.x, pose.y - last.y) < this.spacing) return;
    this.points.push(pose);
    if (this.points.length > this.most) this.points.shift();
  }
}

export class Picture {
  /** @param {HTMLCanvasElement} view @param {HTMLCanvasElement} map @param {HTMLCanvasElement} compass */
  constructor(view, map, compass) {
    this.view = new Canvas(view);
    this.map = new Canvas(map);
    this.compass = new Canvas(compass);
    this.wake = new Track(WAKE_SPACING, WAKE_POINTS);
    this.track = new Track(TRACK_SPACING, TRACK_POINTS);
    this.ghostTrack = new Track(TRACK_SPACING, TRACK_POINTS);
  }

  clear() {
    for (const each of [this.wake, this.track, this.ghostTrack]) each.points = [];
  }

  /** The colours and sizes, which a change of theme or window changes. */
  measure() {
    for (const each of [this.view, this.map, this.compass]) each.measure();
  }

  /** @param {Shown} shown */
  pass(shown) {
    this.wake.pass(shown.craft);
    this.track.pass(shown.craft);
    this.ghostTrack.pass(shown.ghost);
  }

  /** @param {Shown} shown */
  draw(shown) {
    const camera = this.camera(shown);
    drawSea(camera, GRID);
    this.drawTrack(camera, this.ghostTrack, "ghost");
    if (!shown.still) this.drawWake(camera, shown);
    else this.drawTrack(camera, this.track, "wake");
    this.drawGates(camera, shown);
    drawOutline(camera, shown.ghost, shown.size);
    drawCraft(camera, shown.craft, shown.size, shown.inputs);
    this.drawMap(shown, camera);
    this.drawCompass(shown);
  }

  /** It follows the craft, or stands still and wraps at its edges. @param {Shown} shown */
  camera({ craft, wraps }) {
    const { width, height } = this.view,
      scale = Math.min(Math.max(width / 260, 2.2), 6);
    const fixed = { x: (0.5 - START[0]) * (width / scale), y: (0.5 - START[1]) * (height / scale) };
    return new Camera(this.view, wraps ? fixed : craft, scale, wraps);
  }

  /** A band that widens and fades. @param {Camera} camera @param {Shown} shown */
  drawWake(camera, shown) {
    const { context: c, colors } = this.view,
      points = [...this.wake.points, shown.craft];
    c.fillStyle = colors.wake;
    for (let i = 1; i < points.length; i++) {
      const age = (points.length - i) / WAKE_POINTS;
      c.globalAlpha = 0.34 * (1 - age);
      const ends = [points[i - 1], points[i]].map((each, k) => {
        const half = shown.size.width * (0.28 + 0.5 * (age + (1 - k) / WAKE_POINTS));
        const [x, y] = [each.x - points[i].x, each.y - points[i].y];
        return [-1, 1].map((side) => [
          x - side * half * Math.sin(each.heading),
          y + side * half * Math.cos(each.heading),
        ]);
      });
      camera.fill([ends[0][0], ends[1][0], ends[1][1], ends[0][1]], points[i]);
    }
    c.globalAlpha = 1;
  }

  /** @param {Camera} camera @param {Track} track @param {"ghost" | "wake"} color */
  drawTrack(camera, track, color) {
    const { context: c, colors } = this.view;
    c.strokeStyle = colors[color];
    c.lineWidth = 1.5;
    c.globalAlpha = 0.5;
    c.beginPath();
    for (let i = 1; i < track.points.length; i++) camera.line(track.points[i - 1], track.points[i]);
    c.stroke();
    c.globalAlpha = 1;
  }

  /**
   * Port is red and starboard green, as at sea; the next gate is bright.
   * @param {Camera} camera
   * @param {Shown} shown
   */
  drawGates(camera, shown) {
    const { context: c, colors } = this.view;
    shown.course?.gates.forEach((gate, i) => {
      const is_next = i === shown.course?.next,
        passed = i < (shown.course?.next ?? 0);
      const [port, starboard] = posts(gate).map((post) => camera.place(post));
      c.globalAlpha = passed ? 0.25 : 1;
      c.strokeStyle = is_next ? colors.accent : colors.faint;
      c.lineWidth = is_next ? 3 : 1;
      c.setLineDash(is_next ? [] : [4, 6]);
      c.beginPath();
      line(c, port, starboard);
      c.stroke();
      c.setLineDash([]);
      for (const [post, color] of /** @type {[Point, string][]} */ ([
        [port, colors.port],
        [starboard, colors.starboard],
      ]))
        dot(c, post, 7, color);
      c.fillStyle = is_next ? colors.accent : colors.faint;
      c.font = "600 14px system-ui, sans-serif";
      c.fillText(String(i + 1), starboard[0] + 12, starboard[1] + 5);
      c.globalAlpha = 1;
      if (is_next) this.point(camera, shown.craft, gate);
    });
  }

  /**
   * An arrow around the craft toward what is out of sight.
   * @param {Camera} camera
   * @param {Pose} craft
   * @param {Pose} gate
   */
  point(camera, craft, gate) {
    const { context: c, width, height, colors } = this.view;
    const [x, y] = camera.place(gate);
    if (x > 0 && x < width && y > 0 && y < height) return;
    const [fromX, fromY] = camera.place(craft),
      angle = Math.atan2(y - fromY, x - fromX);
    const reach = Math.min(width, height) * 0.3;
    const tip = /** @type {Point} */ ([fromX + reach * Math.cos(angle), fromY + reach * Math.sin(angle)]);
    arrow(c, tip, angle, 14, colors.accent);
    c.fillStyle = colors.accent;
    c.font = "600 14px system-ui, sans-serif";
    c.textAlign = "center";
    const metres = Math.hypot(gate.x - craft.x, gate.y - craft.y);
    c.fillText(`${metres.toFixed(0)} m`, tip[0] - 34 * Math.cos(angle), tip[1] - 28 * Math.sin(angle) + 5);
    c.textAlign = "start";
  }

  /** All that was passed, the gates, and what the view shows. @param {Shown} shown @param {Camera} camera */
  drawMap(shown, camera) {
    const { context: c, width, height, colors } = this.map;
    c.clearRect(0, 0, width, height);
    const gates = shown.course?.gates ?? [];
    const all = [...this.track.points, ...gates, shown.craft, shown.ghost].filter((each) =>
      Number.isFinite(each.x + each.y),
    );
    const xs = all.map((each) => each.x),
      ys = all.map((each) => each.y);
    const [left, right, top, bottom] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    const scale = Math.min((width - 24) / Math.max(right - left, 200), (height - 24) / Math.max(bottom - top, 120));
    const place = (/** @type {{x: number, y: number}} */ at) =>
      /** @type {Point} */ ([
        width / 2 + scale * (at.x - (left + right) / 2),
        height / 2 + scale * (at.y - (top + bottom) / 2),
      ]);
    for (const [track, color] of /** @type {[Track, string][]} */ ([
      [this.ghostTrack, colors.ghost],
      [this.track, colors.wake],
    ])) {
      c.strokeStyle = color;
      c.lineWidth = 1.5;
      c.beginPath();
      track.points.forEach((each, i) => (i ? c.lineTo(...place(each)) : c.moveTo(...place(each))));
      c.stroke();
    }
    gates.forEach((gate, i) => {
      c.strokeStyle = i === shown.course?.next ? colors.accent : colors.faint;
      c.lineWidth = 2;
      c.beginPath();
      line(c, place(posts(gate)[0]), place(posts(gate)[1]));
      c.stroke();
    });
    if (!shown.wraps) {
      const [x, y] = place({
        x: camera.x - this.view.width / 2 / camera.scale,
        y: camera.y - this.view.height / 2 / camera.scale,
      });
      c.strokeStyle = colors.faint;
      c.lineWidth = 1;
      c.strokeRect(x, y, (scale * this.view.width) / camera.scale, (scale * this.view.height) / camera.scale);
    }
    dot(c, place(shown.ghost), 3, colors.ghost);
    arrow(c, place(shown.craft), shown.craft.heading % (2 * Math.PI), 7, colors.hull, colors.edge);
  }

  /** Heading, course over ground, wind. @param {Shown} shown */
  drawCompass(shown) {
    const { context: c, width, height, colors } = this.compass,
      radius = Math.min(width, height) / 2 - 3;
    const center = /** @type {Point} */ ([width / 2, height / 2]);
    const at = (/** @type {number} */ angle, /** @type {number} */ reach) =>
      /** @type {Point} */ ([center[0] + reach * Math.cos(angle), center[1] + reach * Math.sin(angle)]);
    c.clearRect(0, 0, width, height);
    c.strokeStyle = colors.faint;
    c.lineWidth = 1.5;
    c.beginPath();
    c.arc(...center, radius, 0, 2 * Math.PI);
    for (let i = 0; i < 12; i++)
      line(c, at((i * Math.PI) / 6, radius), at((i * Math.PI) / 6, radius - (i % 3 ? 4 : 8)));
    c.stroke();
    const { "wind.x": windX = 0, "wind.y": windY = 0 } = shown.inputs;
    if (windX || windY)
      arrow(c, at(Math.atan2(windY, windX) + Math.PI, radius - 9), Math.atan2(windY, windX), 9, colors.wake);
    const heading = shown.craft.heading % (2 * Math.PI);
    c.fillStyle = colors.hull;
    c.strokeStyle = colors.edge;
    c.beginPath();
    for (const [angle, reach] of [
      [0, 0.72],
      [2.5, 0.5],
      [Math.PI, 0.26],
      [-2.5, 0.5],
    ])
      c.lineTo(...at(heading + angle, radius * reach));
    c.closePath();
    c.fill();
    c.stroke();
  }
}

/** A canvas, sharp on any screen, with the colours of the page. */
export class Canvas {
  /** @param {HTMLCanvasElement} element */
  constructor(element) {
    this.element = element;
    this.context = /** @type {CanvasRenderingContext2D} */ (element.getContext("2d"));
    this.width = this.height = 0;
    /** @type {Record<string, string>} */
    this.colors = {};
    this.measure();
  }

  measure() {
    const ratio = Math.min(window.devicePixelRatio || 1, 2),
      style = getComputedStyle(this.element);
    this.width = this.element.clientWidth;
    this.height = this.element.clientHeight;
    this.element.width = Math.round(this.width * ratio);
    this.element.height = Math.round(this.height * ratio);
    this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
    const names = ["ground", "grid", "wake", "hull", "edge", "ghost", "thrust", "port", "starboard", "accent", "faint"];
    this.colors = Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
  }
}

/** Where metres lie on a view, which may wrap at its edges. */
export class Camera {
  /**
   * @param {Canvas} canvas
   * @param {{ x: number, y: number }} at what is in the middle, m
   * @param {number} scale pixels a metre
   */
  constructor(canvas, at, scale, wraps = false) {
    this.canvas = canvas;
    this.x = at.x;
    this.y = at.y;
    this.scale = scale;
    this.wraps = wraps;
  }

  /** @param {{ x: number, y: number }} point @returns {Point} */
  place(point) {
    const { width, height } = this.canvas;
    const x = width / 2 + this.scale * (point.x - this.x),
      y = height / 2 + this.scale * (point.y - this.y);
    return this.wraps ? [((x % width) + width) % width, ((y % height) + height) % height] : [x, y];
  }

  /**
   * Where a shape is drawn: once, and on a view that wraps again on the far side.
   * @param {{ x: number, y: number }} around
   */
  moves(around) {
    const [x, y] = this.place(around),
      reach = 40 * this.scale,
      { width, height } = this.canvas;
    const across = [0],
      down = [0];
    if (this.wraps) {
      across.push(...(x < reach ? [width] : []), ...(x > width - reach ? [-width] : []));
      down.push(...(y < reach ? [height] : []), ...(y > height - reach ? [-height] : []));
    }
    return across.flatMap((right) => down.map((low) => /** @type {Point} */ ([x + right, y + low])));
  }

  /**
   * A closed shape, from a point: no rounding far from the origin.
   * @param {number[][]} points m
   * @param {{ x: number, y: number }} around
   */
  fill(points, around, edged = false) {
    const { context: c } = this.canvas;
    for (const [x, y] of this.moves(around)) {
      c.beginPath();
      for (const each of points) c.lineTo(x + this.scale * each[0], y + this.scale * each[1]);
      c.closePath();
      c.fill();
      if (edged) c.stroke();
    }
  }

  /** @param {{ x: number, y: number }} a @param {{ x: number, y: number }} b */
  line(a, b) {
    const [x, y] = this.place(b);
    line(this.canvas.context, [x + this.scale * (a.x - b.x), y + this.scale * (a.y - b.y)], [x, y]);
  }
}

/** The ground, with lines a spacing apart. @param {Camera} camera @param {number} spacing m */
export function drawSea(camera, spacing) {
  const { context: c, width, height, colors } = camera.canvas;
  c.fillStyle = colors.ground;
  c.fillRect(0, 0, width, height);
  c.strokeStyle = colors.grid;
  c.lineWidth = 1;
  c.beginPath();
  const [x, y] = camera.place({ x: 0, y: 0 }),
    size = spacing * camera.scale;
  for (let at = ((x % size) + size) % size; at < width; at += size) line(c, [at, 0], [at, height]);
  for (let at = ((y % size) + size) % size; at < height; at += size) line(c, [0, at], [width, at]);
  c.stroke();
}

/**
 * @param {Camera} camera
 * @param {Pose} pose
 * @param {Shown["size"]} size
 * @param {Shown["inputs"]} inputs
 */
export function drawCraft(camera, pose, size, inputs, edge = camera.canvas.colors.edge) {
  const { context: c, colors } = camera.canvas;
  for (const [color, jet] of jets(size, inputs)) {
    c.fillStyle = colors[color];
    camera.fill(turned(jet, pose.heading), pose);
  }
  c.fillStyle = colors.hull;
  c.strokeStyle = edge;
  c.lineWidth = 2;
  camera.fill(turned(outline(size), pose.heading), pose, true);
}

/** Of a ghost, dashed. @param {Camera} camera @param {Pose} pose @param {Shown["size"]} size */
export function drawOutline(camera, pose, size) {
  const { context: c, colors } = camera.canvas;
  c.strokeStyle = colors.ghost;
  c.fillStyle = "transparent";
  c.lineWidth = 2;
  c.setLineDash([6, 4]);
  camera.fill(turned(outline(size), pose.heading), pose, true);
  c.setLineDash([]);
}

/** The craft, around the centre of gravity, bow ahead. @param {Shown["size"]} size */
function outline({ length, width }) {
  const [ahead, side] = [length / 2, width / 2];
  return [
    [0.75 * length, 0],
    [ahead, side],
    [-ahead, side],
    [-ahead, -side],
    [ahead, -side],
  ];
}

/**
 * What is blown out: the stronger the push, the longer; reverse thrust blows forward.
 * @param {Shown["size"]} size
 * @param {Shown["inputs"]} inputs
 * @returns {[string, number[][]][]}
 */
function jets(size, inputs) {
  const [stern, bow, side] = [-size.length / 2, size.length / 2, size.width / 2];
  const root = 0.06 * size.length,
    wide = side / 2,
    reach = 0.9 * size.width;
  const push = (0.7 * size.length * inputs.thrust) / (size.thrust || 1);
  return [
    [
      "thrust",
      [
        [stern, -wide],
        [stern, wide],
        [stern - push, 0],
      ],
    ],
    [
      "port",
      [
        [bow - root, -side],
        [bow + root, -side],
        [bow, -side - reach * inputs.port_thruster],
      ],
    ],
    [
      "starboard",
      [
        [bow - root, side],
        [bow + root, side],
        [bow, side + reach * inputs.starboard_thruster],
      ],
    ],
  ];
}

/** Points of the body, as they lie at a heading. @param {number[][]} points @param {number} heading */
export function turned(points, heading) {
  const c = Math.cos(heading),
    s = Math.sin(heading);
  return points.map(([ahead, across]) => [c * ahead - s * across, s * ahead + c * across]);
}

/** Port and starboard. @param {Pose} gate */
function posts(gate) {
  return turned(
    [
      [0, -GATE_WIDTH / 2],
      [0, GATE_WIDTH / 2],
    ],
    gate.heading,
  ).map(([x, y]) => ({ x: gate.x + x, y: gate.y + y }));
}

/** @param {CanvasRenderingContext2D} c @param {Point} a @param {Point} b */
export function line(c, a, b) {
  c.moveTo(...a);
  c.lineTo(...b);
}

/** @param {CanvasRenderingContext2D} c @param {Point} at @param {number} radius @param {string} color */
export function dot(c, at, radius, color) {
  c.fillStyle = color;
  c.beginPath();
  c.arc(...at, radius, 0, 2 * Math.PI);
  c.fill();
}

/**
 * @param {CanvasRenderingContext2D} c
 * @param {Point} at
 * @param {number} angle
 * @param {number} size
 * @param {string} fill
 */
function arrow(c, at, angle, size, fill, edge = "") {
  c.fillStyle = fill;
  c.beginPath();
  for (const [turn, reach] of [
    [0, 1],
    [2.5, 1],
    [Math.PI, 0.4],
    [-2.5, 1],
  ])
    c.lineTo(at[0] + size * reach * Math.cos(angle + turn), at[1] + size * reach * Math.sin(angle + turn));
  c.closePath();
  c.fill();
  if (edge) {
    c.strokeStyle = edge;
    c.lineWidth = 1;
    c.stroke();
  }
}
