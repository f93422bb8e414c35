// A course of gates, and the clock of whoever passes them in their order.

/** @typedef {{ x: number, y: number, heading: number }} Pose m, m, rad */

export const GATE_WIDTH = 60; // m
const SPACING = 110; // m

/** To starboard and to port in turn, in the frame of the pose where the course begins. */
const GATES = [
  [1, 0],
  [2, 0.16],
  [3, -0.16],
  [4, 0.16],
  [5, 0],
].map(([x, y]) => [x * SPACING, y * SPACING]);

export class Course {
  /** It lies ahead of a craft. @param {Pose} from */
  constructor(from) {
    const c = Math.cos(from.heading),
      s = Math.sin(from.heading);
    this.gates = GATES.map(([x, y]) => ({
      x: from.x + c * x - s * y,
      y: from.y + s * x + c * y,
      heading: from.heading,
    }));
    this.next = 0;
    /** @type {Pose | null} */
    this.last = null;
    this.began = 0;
    this.took = 0;
  }

  get finished() {
    return this.next === this.gates.length;
  }

  /**
   * The craft is there, at that time [s] of the clock, which the first gate starts.
   * @param {Pose} pose
   * @param {number} time
   */
  pass(pose, time) {
    const from = this.last;
    this.last = pose;
    if (!from || this.finished || !this.crosses(from, pose)) return;
    if (this.next === 0) this.began = time;
    this.next++;
    this.took = time - this.began;
  }

  /** @param {number} time s */
  clock(time) {
    return this.next === 0 ? 0 : this.finished ? this.took : time - this.began;
  }

  /** Whether a way leads through the next gate, between its posts. @param {Pose} a @param {Pose} b */
  crosses(a, b) {
    const { x, y, heading } = this.gates[this.next];
    const c = Math.cos(heading),
      s = Math.sin(heading);
    const [before, after] = [a, b].map((each) => [
      c * (each.x - x) + s * (each.y - y),
      c * (each.y - y) - s * (each.x - x),
    ]);
    if (!(before[0] < 0 && after[0] >= 0)) return false;
    const share = -before[0] / (after[0] - before[0]);
    return Math.abs(before[1] + share * (after[1] - before[1])) <= GATE_WIDTH / 2;
  }
}
