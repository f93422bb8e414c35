// The strip chart: two distances over time, on a logarithmic scale, the latest at the right.

export const SAMPLES = 300;
const LOWEST = -9; // 10^n m
const HIGHEST = 3;

export class Chart {
  /** @param {HTMLCanvasElement} element */
  constructor(element) {
    this.element = element;
    this.context = /** @type {CanvasRenderingContext2D} */ (element.getContext("2d"));
    /** @type {[number, number][]} the distance from the ghost, and the estimate, m */
    this.samples = [];
  }

  clear() {
    this.samples = [];
  }

  /** @param {number} distance @param {number} estimate */
  add(distance, estimate) {
    this.samples.push([distance, estimate]);
    if (this.samples.length > SAMPLES) this.samples.shift();
  }

  /** @param {number} now where the samples are of a whole run: the share of it that has passed */
  draw(now = NaN) {
    const ratio = Math.min(window.devicePixelRatio || 1, 2),
      { context: c, element } = this;
    const width = element.clientWidth,
      height = element.clientHeight,
      style = getComputedStyle(element);
    if (element.width !== Math.round(width * ratio) || element.height !== Math.round(height * ratio)) {
      element.width = Math.round(width * ratio);
      element.height = Math.round(height * ratio);
    }
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.clearRect(0, 0, width, height);
    const color = (/** @type {string} */ name) => style.getPropertyValue(name).trim();
    const level = (/** @type {number} */ power) => height - 8 - ((height - 16) * (power - LOWEST)) / (HIGHEST - LOWEST);
    c.font = "11px system-ui, sans-serif";
    c.lineWidth = 1;
    for (let power = LOWEST; power <= HIGHEST; power += 3) {
      c.strokeStyle = color("--rule");
      c.beginPath();
      c.moveTo(46, level(power));
      c.lineTo(width, level(power));
      c.stroke();
      c.fillStyle = color("--quiet");
      c.fillText(NAMES[power], 0, level(power) + 4);
    }
    [color("--ghost"), color("--accent")].forEach((stroke, k) => {
      c.strokeStyle = stroke;
      c.lineWidth = 2;
      c.setLineDash(k ? [5, 3] : []);
      c.beginPath();
      this.samples.forEach((sample, i) => {
        if (Number.isNaN(sample[k])) return;
        const power = Math.min(Math.max(Math.log10(sample[k] || 1e-99), LOWEST), HIGHEST);
        c.lineTo(46 + ((width - 46) * (SAMPLES - this.samples.length + i)) / (SAMPLES - 1), level(power));
      });
      c.stroke();
    });
    c.setLineDash([]);
    if (Number.isNaN(now)) return;
    c.fillStyle = color("--ink");
    c.fillRect(45 + (width - 46) * now, 0, 2, height);
  }
}

/** @type {Record<number, string>} */
const NAMES = { [-9]: "1 nm", [-6]: "1 µm", [-3]: "1 mm", 0: "1 m", 3: "1 km" };
