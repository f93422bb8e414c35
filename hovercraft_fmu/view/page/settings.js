// What can be chosen: as a link holds it, and as start values of the FMU.

/** @typedef {import("./fmu.js").Values} Values */
/** @typedef {import("./fmu.js").Description} Description */
/** @typedef {{ name: string, label: string, values: Values, input: boolean }} Term of `inputs`, or of parameters */
/** @typedef {{ stages: number, stability: number | null, rotation: number | null, text: string }} Method */
/**
 * What the page was made with.
 * @typedef {object} Data
 * @property {string} version
 * @property {string} fmu the file to replay on, where it is not the ordinary one
 * @property {string} module the compiled FMU, deflated, base64
 * @property {string} description its modelDescription.xml, in the same way
 * @property {Record<string, Values>} presets what they set
 * @property {import("./flight.js").Scene[]} scenes
 * @property {Term[]} terms
 * @property {Record<string, Method>} methods
 */
/**
 * @typedef {object} Settings
 * @property {string} preset
 * @property {string} scene '' is a person at the helm
 * @property {string} integrator
 * @property {number} step_size s
 * @property {number} tolerance of the adaptive method
 * @property {boolean} estimate
 * @property {string[]} terms that are on
 * @property {number} scale simulated seconds a second
 * @property {"open" | "wrap"} view
 * @property {Values} inputs other than those of the helm, where they are not 0
 */

export const HELM = ["thrust", "port_thruster", "starboard_thruster"];
export const STEP_SIZES = series(-4, 0).concat(1, 2, 5);
export const TOLERANCES = series(-12, 0, [1]).concat(1);
export const SCALES = series(-1, 3).concat(1000);

/** 1, 2, 5 times powers of ten. @param {number} from @param {number} to */
function series(from, to, heads = [1, 2, 5]) {
  const powers = Array.from({ length: to - from }, (_, i) => from + i);
  return powers.flatMap((power) => heads.map((head) => Number(`${head}e${power}`)));
}

/** @param {Data} data @returns {Settings} */
export function usual(data) {
  return {
    preset: Object.keys(data.presets)[0],
    scene: "",
    integrator: Object.keys(data.methods)[0],
    step_size: 0.001,
    tolerance: 1e-6,
    estimate: true,
    terms: [],
    scale: 10,
    view: "open",
    inputs: {},
  };
}

/** The fragment of a link. @param {Settings} settings @param {Data} data */
export function fragment(settings, data) {
  const before = usual(data),
    words = new URLSearchParams();
  for (const name of /** @type {(keyof Settings)[]} */ (Object.keys(before))) {
    if (name === "inputs")
      Object.entries(settings.inputs).forEach(([input, value]) => value && words.set(input, String(value)));
    else if (String(settings[name]) !== String(before[name])) words.set(name, String(settings[name]));
  }
  return words.toString();
}

/**
 * Settings from a fragment; what cannot be is said, and left as usual.
 * @param {string} text @param {Data} data @param {Description} description @param {(text: string) => void} say
 * @returns {Settings}
 */
export function parsed(text, data, description, say) {
  const settings = usual(data),
    known = Object.keys(settings).filter((name) => name !== "inputs");
  const choices = /** @type {Record<string, string[]>} */ ({
    preset: Object.keys(data.presets),
    scene: ["", ...data.scenes.map((each) => each.name)],
    integrator: Object.keys(data.methods),
    view: ["open", "wrap"],
    estimate: ["true", "false"],
    step_size: STEP_SIZES.map(String),
    tolerance: TOLERANCES.map(String),
    scale: SCALES.map(String),
  });
  const inputs = description.inputs.map((each) => each.name).filter((name) => !HELM.includes(name));
  for (const [name, value] of new URLSearchParams(text)) {
    const terms = value.split(","),
      named = data.terms.map((each) => each.name);
    if (inputs.includes(name) && Number.isFinite(Number(value))) settings.inputs[name] = Number(value);
    else if (name === "terms" && terms.every((each) => named.includes(each))) settings.terms = terms;
    else if (choices[name]?.includes(value))
      Object.assign(settings, { [name]: like(settings[/** @type {keyof Settings} */ (name)], value) });
    else say(`link: ${name} = ${value}: must be ${choices[name]?.join(", ") ?? [...known, ...inputs].join(", ")}`);
  }
  return settings;
}

/** @param {unknown} before @param {string} value */
const like = (before, value) =>
  typeof before === "number" ? Number(value) : typeof before === "boolean" ? value === "true" : value;

/** @param {Settings} settings @param {Data} data */
export const sceneOf = (settings, data) => data.scenes.find((each) => each.name === settings.scene);

/** @param {Settings} settings @param {Data} data */
export const presetOf = (settings, data) => sceneOf(settings, data)?.preset ?? settings.preset;

/**
 * Start values of the FMU, but for the state and for what it has anyway.
 * @param {Settings} settings
 * @param {Data} data
 * @param {Description} description
 */
export function startValues(settings, data, description) {
  const terms = data.terms.filter((term) => settings.terms.includes(term.name) && !term.input);
  /** @type {Values} */
  const values = Object.assign({}, ...terms.map((term) => term.values), sceneOf(settings, data)?.values);
  values.integrator = description.item("integrator", settings.integrator);
  values.error_estimate = description.item("error_estimate", settings.estimate ? "on" : "off");
  if (settings.integrator === "adaptive") values.tolerance = settings.tolerance;
  else values.step_size = settings.step_size;
  const changed = Object.entries(values).filter(([name, value]) => value !== description.variable(name).start);
  return { ...data.presets[presetOf(settings, data)], ...Object.fromEntries(changed) };
}

/**
 * The command that replays the log.
 * @param {Values} values
 * @param {Settings} settings
 * @param {Data} data
 * @param {Description} description
 * @param {number} step s
 */
export function command(values, settings, data, description, step) {
  const preset = presetOf(settings, data),
    words = ["hovercraft-fmu simulate", data.fmu, "--input hovercraft.csv"];
  words.push(preset === "own" ? "" : `--preset ${preset}`, `--communication-step ${step}`);
  for (const [name, value] of Object.entries(values)) {
    const { items } = description.variable(name);
    if (value !== data.presets[preset][name]) words.push(`--set ${name}=${items.length ? items[value - 1] : value}`);
  }
  return words.filter((each) => each).join(" ");
}
