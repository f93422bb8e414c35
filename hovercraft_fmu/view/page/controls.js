// Keys, touch, and the fields of the panel: what a person does becomes calls of the actions.

import { element, field, write } from "./elements.js";
import { HELM, SCALES, STEP_SIZES, TOLERANCES, sceneOf } from "./settings.js";

/** @typedef {import("./settings.js").Settings} Settings */
/**
 * @typedef {object} Actions
 * @property {(what: string, value: number) => void} act a held key, or an input
 * @property {() => void} pause
 * @property {() => void} stepOnce
 * @property {() => void} reset
 * @property {() => void} gates
 * @property {() => void} save
 * @property {(change: Partial<Settings>) => void} change
 */

/** @type {Record<string, string>} */
const HELD = {
  ArrowUp: "up",
  KeyW: "up",
  ArrowDown: "down",
  KeyS: "down",
  ArrowLeft: "left",
  KeyA: "left",
  ArrowRight: "right",
  KeyD: "right",
};
const MOVED_BY_KEYS = "input, select, textarea";

export class Controls {
  /**
   * @param {Actions} actions
   * @param {import("./settings.js").Data} data
   * @param {import("./fmu.js").Description} description
   * @param {() => Settings} settings
   */
  constructor(actions, data, description, settings) {
    this.actions = actions;
    this.data = data;
    this.description = description;
    this.settings = settings;
    this.fill();
    this.listenToKeys();
    this.listenToPads();
    this.listenToFields();
  }

  // ---- keys, and what is like keys

  listenToKeys() {
    /** @type {Set<string>} */
    const down = new Set();
    addEventListener("keydown", (event) => {
      const at = /** @type {HTMLElement} */ (event.target);
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      if (event.key === "Escape") at.blur();
      else if (!at.matches?.(MOVED_BY_KEYS) && !(event.code === "Space" && at.matches?.("button, summary")))
        this.press(event, down);
    });
    addEventListener("keyup", (event) => {
      if (down.delete(event.code) && ![...down].some((code) => HELD[code] === HELD[event.code]))
        this.actions.act(HELD[event.code], 0);
    });
    addEventListener("blur", () => {
      [...down].forEach((code) => this.actions.act(HELD[code], 0));
      down.clear();
    });
  }

  /** @param {KeyboardEvent} event @param {Set<string>} down */
  press(event, down) {
    const held = HELD[event.code],
      once = this.keys()[event.key.toLowerCase()];
    if (!held && !once) return;
    event.preventDefault();
    if (event.repeat && (held || event.key === " ")) return;
    if (held) {
      down.add(event.code);
      this.actions.act(held, 1);
    } else once();
  }

  /** @returns {Record<string, () => void>} */
  keys() {
    const { actions } = this,
      settings = this.settings(),
      methods = Object.keys(this.data.methods);
    const along = (/** @type {any[]} */ list, /** @type {any} */ now, /** @type {number} */ by) =>
      list[Math.min(Math.max(list.indexOf(now) + by, 0), list.length - 1)];
    const scale = (/** @type {number} */ by) => actions.change({ scale: along(SCALES, settings.scale, by) });
    const finer = (/** @type {number} */ by) => this.changeFineness(along(this.fineness(), this.finenessNow(), by));
    return {
      " ": actions.pause,
      ".": actions.stepOnce,
      r: actions.reset,
      g: actions.gates,
      v: () => actions.change({ view: settings.view === "open" ? "wrap" : "open" }),
      m: () => actions.change({ integrator: methods[(methods.indexOf(settings.integrator) + 1) % methods.length] }),
      "+": () => scale(1),
      "=": () => scale(1),
      "-": () => scale(-1),
      "[": () => finer(-1),
      "]": () => finer(1),
    };
  }

  listenToPads() {
    for (const pad of /** @type {NodeListOf<HTMLElement>} */ (document.querySelectorAll("[data-hold]"))) {
      const hold = (/** @type {number} */ value) => {
        pad.classList.toggle("held", value === 1);
        this.actions.act(pad.dataset.hold ?? "", value);
      };
      pad.addEventListener("pointerdown", (event) => {
        event.preventDefault();
        pad.setPointerCapture(event.pointerId);
        hold(1);
      });
      for (const end of ["pointerup", "pointercancel", "lostpointercapture"])
        pad.addEventListener(end, () => pad.classList.contains("held") && hold(0));
      pad.addEventListener("keydown", (event) => event.code === "Space" && !event.repeat && hold(1));
      pad.addEventListener("keyup", (event) => event.code === "Space" && hold(0));
      pad.addEventListener("contextmenu", (event) => event.preventDefault());
    }
  }

  // ---- fields

  fill() {
    const { data } = this;
    options("preset", Object.keys(data.presets));
    options("scene", ["", ...data.scenes.map((each) => each.name)], (name) => (name ? `scene: ${name}` : "you"));
    options("integrator", Object.keys(data.methods), (name) => name.replaceAll("_", " "));
    options("scale", SCALES.map(String), (scale) => `× ${scale}`);
    element("terms").append(
      ...data.terms.map((term) => {
        const label = document.createElement("label"),
          box = document.createElement("input"),
          price = document.createElement("output");
        box.type = "checkbox";
        box.id = `term-${term.name}`;
        price.id = `price-${term.name}`;
        label.title = Object.entries(term.values)
          .map(([name, value]) => `${name} = ${value}: ${this.description.variable(name).description}`)
          .join("\n");
        label.append(box, term.label, price);
        box.addEventListener("change", () => this.changeTerm(term.name, box.checked));
        return label;
      }),
    );
    element("inputs").append(
      ...this.description.inputs
        .filter((each) => !HELM.includes(each.name))
        .map((input) => {
          const label = document.createElement("label"),
            number = document.createElement("input");
          number.type = "number";
          number.step = String(input.nominal);
          number.id = `input-${input.name}`;
          label.title = input.description;
          label.append(`${input.name}, ${input.unit}`, number);
          number.addEventListener("change", () => {
            if (Number.isFinite(number.valueAsNumber)) this.actions.act(input.name, number.valueAsNumber);
          });
          return label;
        }),
    );
  }

  listenToFields() {
    const { actions } = this;
    const click = (/** @type {string} */ id, /** @type {() => void} */ action) =>
      element(id).addEventListener("click", action);
    click("pause", actions.pause);
    click("step", actions.stepOnce);
    click("reset", actions.reset);
    click("gates", actions.gates);
    click("save", actions.save);
    click("copy-command", () => copy("copy-command", field("command").value));
    click("copy-link", () => copy("copy-link", location.href));
    click("unstable", () =>
      actions.change({ scene: "turn", integrator: "semi_implicit_euler", step_size: 2, scale: 5 }),
    );
    for (const name of ["preset", "scene", "integrator"])
      element(name).addEventListener("change", () => actions.change({ [name]: field(name).value }));
    element("view-kind").addEventListener("change", () =>
      actions.change({ view: /** @type {"open"} */ (field("view-kind").value) }),
    );
    element("scale").addEventListener("change", () => actions.change({ scale: Number(field("scale").value) }));
    element("estimate").addEventListener("change", () => actions.change({ estimate: field("estimate").checked }));
    element("fineness").addEventListener("input", () =>
      this.changeFineness(this.fineness()[field("fineness").valueAsNumber]),
    );
    // who chose with a pointer goes on with the keys of the craft
    let pointed = false;
    addEventListener("pointerdown", () => (pointed = true), true);
    addEventListener("keydown", () => (pointed = false), true);
    element("panel").addEventListener("change", (event) => {
      const at = /** @type {HTMLInputElement} */ (event.target);
      if (pointed && at.type !== "number") at.blur();
    });
    element("panel").addEventListener("click", (event) => {
      if (pointed && /** @type {HTMLElement} */ (event.target).matches("button"))
        /** @type {HTMLElement} */ (event.target).blur();
    });
  }

  /** @param {string} name @param {boolean} on */
  changeTerm(name, on) {
    const settings = this.settings(),
      term = this.data.terms.find((each) => each.name === name);
    if (term?.input) Object.entries(term.values).forEach(([input, value]) => this.actions.act(input, on ? value : 0));
    else
      this.actions.change({ terms: on ? [...settings.terms, name] : settings.terms.filter((each) => each !== name) });
  }

  /** What the slider goes through: sub-steps, or tolerances. */
  fineness() {
    return this.settings().integrator === "adaptive" ? TOLERANCES : STEP_SIZES;
  }

  finenessNow() {
    const settings = this.settings();
    return settings.integrator === "adaptive" ? settings.tolerance : settings.step_size;
  }

  /** @param {number} value */
  changeFineness(value) {
    this.actions.change(this.settings().integrator === "adaptive" ? { tolerance: value } : { step_size: value });
  }

  /** The fields say what is set. */
  show() {
    const { data } = this,
      settings = this.settings(),
      adaptive = settings.integrator === "adaptive",
      scene = sceneOf(settings, data);
    const values = {
      preset: scene?.preset ?? settings.preset,
      scene: settings.scene,
      integrator: settings.integrator,
      scale: String(settings.scale),
    };
    for (const [name, value] of Object.entries({ ...values, "view-kind": settings.view })) field(name).value = value;
    field("preset").disabled = Boolean(scene);
    field("estimate").checked = settings.estimate;
    field("fineness").max = String(this.fineness().length - 1);
    field("fineness").value = String(this.fineness().indexOf(this.finenessNow()));
    const text = adaptive ? `${settings.tolerance}` : seconds(settings.step_size);
    write("fineness-name", adaptive ? "tolerance" : "sub-step");
    write("fineness-text", text);
    field("fineness").setAttribute("aria-valuetext", text);
    write("scene-text", scene?.description ?? "");
    write("method-text", data.methods[settings.integrator].text);
    for (const term of data.terms) {
      const { inputs } = settings;
      field(`term-${term.name}`).checked = term.input
        ? Object.keys(term.values).some((name) => inputs[name])
        : settings.terms.includes(term.name);
      field(`term-${term.name}`).disabled = Boolean(scene);
    }
    for (const { name } of this.description.inputs.filter((each) => !HELM.includes(each.name))) {
      const number = field(`input-${name}`);
      number.disabled = Boolean(scene);
      if (document.activeElement !== number) number.value = String(settings.inputs[name] ?? 0);
    }
  }
}

/** @param {string} id @param {string[]} values */
function options(id, values, words = (/** @type {string} */ value) => value) {
  element(id).append(...values.map((value) => new Option(words(value), value)));
}

/** A time in its best unit. @param {number} time s */
export function seconds(time) {
  return time < 1e-3
    ? `${Number((time * 1e6).toPrecision(3))} µs`
    : time < 1
      ? `${Number((time * 1e3).toPrecision(3))} ms`
      : `${time} s`;
}

/** @param {string} id of the button @param {string} text */
async function copy(id, text) {
  const before = element(id).dataset.text ?? element(id).textContent ?? "";
  element(id).dataset.text = before;
  try {
    await navigator.clipboard.writeText(text);
    element(id).textContent = "Copied";
  } catch {
    prompt("To copy:", text);
  }
  setTimeout(() => (element(id).textContent = before), 1500);
}
