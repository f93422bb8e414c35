// The FMI 3.0 functions of the module, called as any host calls them: arguments are numbers, and places in its memory.

/**
 * @typedef {object} Variable
 * @property {string} name
 * @property {number} reference
 * @property {"Float64" | "Int32" | "Enumeration"} type
 * @property {string} causality
 * @property {string} unit
 * @property {number | null} start
 * @property {number | null} min
 * @property {number | null} max
 * @property {number} nominal
 * @property {string} description
 * @property {string[]} items of an enumeration, whose values count from 1
 */

/** @typedef {Record<string, number>} Values by name of the variable */
/** @typedef {(status: string, text: string) => void} Tell */

const STATUSES = ["OK", "Warning", "Discard", "Error", "Fatal"];
const DISCARD = 2;
const PAGE = 65536;
const REFERENCES = 0;
const NUMBERS = 4096;
const STRINGS = 8192;

/** A function of four numbers that calls another one: what of JavaScript stands in a table must be of a module. */
const CALLBACK = Uint8Array.of(
  ...[0, 97, 115, 109, 1, 0, 0, 0, 1, 8, 1, 96, 4, 127, 127, 127, 127, 0, 2, 7, 1, 1, 109, 1, 102, 0, 0, 7, 5, 1, 1],
  ...[102, 0, 0],
);

/** The FMU refused a call; the message is its own. */
export class Refusal extends Error {}

/** What modelDescription.xml says. */
export class Description {
  /** @param {string} xml */
  constructor(xml) {
    const root = new DOMParser().parseFromString(xml, "text/xml").documentElement;
    this.name = root.getAttribute("modelName") ?? "";
    this.token = root.getAttribute("instantiationToken") ?? "";
    /** @type {Map<string, Element[]>} */
    const types = new Map(
      [...root.querySelectorAll("EnumerationType")].map((type) => [
        type.getAttribute("name") ?? "",
        [...type.children],
      ]),
    );
    /** @type {Map<string, Variable>} */
    this.variables = new Map();
    for (const each of root.querySelectorAll("ModelVariables > *")) {
      const variable = describe(each, types);
      this.variables.set(variable.name, variable);
    }
    this.inputs = [...this.variables.values()].filter((each) => each.causality === "input");
  }

  /** @param {string} name */
  variable(name) {
    const found = this.variables.get(name);
    if (!found) throw new Refusal(`${name}: must be a variable of ${this.name}`);
    return found;
  }

  /** The number of an item of an enumeration. @param {string} name @param {string} item */
  item(name, item) {
    return this.variable(name).items.indexOf(item) + 1;
  }
}

/**
 * @param {Element} node
 * @param {Map<string, Element[]>} types
 * @returns {Variable}
 */
function describe(node, types) {
  const text = (/** @type {string} */ name) => node.getAttribute(name) ?? "";
  const number = (/** @type {string} */ name) => (node.hasAttribute(name) ? Number(text(name)) : null);
  return {
    name: text("name"),
    reference: Number(text("valueReference")),
    type: /** @type {Variable["type"]} */ (node.tagName),
    causality: text("causality"),
    unit: text("unit"),
    start: number("start"),
    min: number("min"),
    max: number("max"),
    nominal: number("nominal") ?? 1,
    description: text("description"),
    items: (types.get(text("declaredType")) ?? []).map((each) => each.getAttribute("name") ?? ""),
  };
}

/** The compiled FMU: its functions, its memory, and a page of that for arguments. */
export class Library {
  /** @param {BufferSource} bytes */
  static async load(bytes) {
    const { instance } = await WebAssembly.instantiate(bytes, {});
    return new Library(instance);
  }

  /** @param {WebAssembly.Instance} module */
  constructor(module) {
    this.functions = /** @type {Record<string, Function>} */ (/** @type {unknown} */ (module.exports));
    this.memory = /** @type {WebAssembly.Memory} */ (module.exports.memory);
    this.arguments = this.memory.grow(1) * PAGE;
    /** @type {Map<number, Tell>} */
    this.listeners = new Map();
    this.made = 0;
    const table = /** @type {WebAssembly.Table} */ (module.exports.__indirect_function_table);
    const heard = (/** @type {number[]} */ ...call) => this.hear(call[0], call[1], call[3]);
    const { f } = new WebAssembly.Instance(new WebAssembly.Module(CALLBACK), { m: { f: heard } }).exports;
    this.callback = table.grow(1);
    table.set(this.callback, f);
    this.version = this.read(this.functions.fmi3GetVersion());
  }

  /** What an instance says. @param {number} listener @param {number} status @param {number} text */
  hear(listener, status, text) {
    this.listeners.get(listener)?.(STATUSES[status], this.read(text));
  }

  /** The memory, which moves when it grows: n values from a place of the arguments on. @param {number} at */
  floats(at, n = 1) {
    return new Float64Array(this.memory.buffer, this.arguments + at, n);
  }

  /** @param {number} at */
  words(at, n = 1) {
    return new Int32Array(this.memory.buffer, this.arguments + at, n);
  }

  /** @param {number} at */
  longs(at, n = 1) {
    return new BigInt64Array(this.memory.buffer, this.arguments + at, n);
  }

  /** A string of the module. @param {number} place */
  read(place) {
    const bytes = new Uint8Array(this.memory.buffer, place);
    return new TextDecoder().decode(bytes.slice(0, bytes.indexOf(0)));
  }

  /** A string for the module, until the next one. @param {string} text */
  write(text) {
    const bytes = new TextEncoder().encode(text + "\0");
    new Uint8Array(this.memory.buffer, this.arguments + STRINGS, bytes.length).set(bytes);
    return this.arguments + STRINGS;
  }
}

/** One craft in co-simulation, from instantiation to free. */
export class Instance {
  /** @param {Library} library @param {Description} description @param {Tell} tell */
  constructor(library, description, tell) {
    this.library = library;
    this.description = description;
    this.said = "";
    this.number = ++library.made;
    library.listeners.set(this.number, (status, text) => {
      this.said = text;
      tell(status, text);
    });
    const token = library.write(description.token);
    this.component = library.functions.fmi3InstantiateCoSimulation(
      token,
      token,
      0,
      0,
      1,
      0,
      0,
      0,
      0,
      this.number,
      library.callback,
      0,
    );
    if (!this.component) throw new Refusal(this.said || "the FMU could not be instantiated");
  }

  /** A function of FMI, after whose name comes what it takes after the instance. @param {string} name */
  call(name, /** @type {unknown[]} */ ...given) {
    const status = this.library.functions[`fmi3${name}`](this.component, ...given);
    if (status >= DISCARD) throw new Refusal(this.said || `fmi3${name}: ${STATUSES[status]}`);
  }

  /** Start values and inputs. @param {Values} values */
  set(values) {
    for (const [type, names] of this.sorted(Object.keys(values))) {
      this.place(names);
      if (type === "Float64") this.library.floats(NUMBERS, names.length).set(names.map((name) => values[name]));
      else if (type === "Int32") this.library.words(NUMBERS, names.length).set(names.map((name) => values[name]));
      else this.library.longs(NUMBERS, names.length).set(names.map((name) => BigInt(values[name])));
      this.transfer("Set", type, names.length);
    }
  }

  /** All inputs, which are Float64: what is called at every step makes no lists. @param {Values} values */
  setInputs(values) {
    const { inputs } = this.description,
      references = this.library.words(REFERENCES, inputs.length);
    const numbers = this.library.floats(NUMBERS, inputs.length);
    for (let i = 0; i < inputs.length; i++) {
      references[i] = inputs[i].reference;
      numbers[i] = values[inputs[i].name];
    }
    this.transfer("Set", "Float64", inputs.length);
  }

  /** @param {string[]} names @returns {Values} */
  get(...names) {
    /** @type {Values} */
    const values = {};
    for (const [type, some] of this.sorted(names)) {
      this.place(some);
      this.transfer("Get", type, some.length);
      const { library } = this;
      const found =
        type === "Float64"
          ? library.floats(NUMBERS, some.length)
          : type === "Int32"
            ? library.words(NUMBERS, some.length)
            : library.longs(NUMBERS, some.length);
      some.forEach((name, i) => (values[name] = Number(found[i])));
    }
    return values;
  }

  /** Names by the type of their variables. @param {string[]} names */
  sorted(names) {
    /** @type {Map<Variable["type"], string[]>} */
    const groups = new Map();
    for (const name of names) {
      const { type } = this.description.variable(name);
      groups.set(type, [...(groups.get(type) ?? []), name]);
    }
    return groups;
  }

  /** Their references, where the functions take them from. @param {string[]} names */
  place(names) {
    this.library.words(REFERENCES, names.length).set(names.map((name) => this.description.variable(name).reference));
  }

  /** @param {"Get" | "Set"} way @param {Variable["type"]} type @param {number} n */
  transfer(way, type, n) {
    const { arguments: base } = this.library;
    this.call(way + (type === "Enumeration" ? "Int64" : type), base + REFERENCES, n, base + NUMBERS, n);
  }

  /** From instantiation to step mode. @param {Values} values start values @param {Values} inputs */
  initialize(values, inputs) {
    this.set(values);
    this.call("EnterInitializationMode", 0, 0, 0, 0, 0);
    this.set(inputs);
    this.call("ExitInitializationMode");
  }

  /** One communication step. @param {number} time s @param {number} step s */
  doStep(time, step) {
    const at = this.library.arguments + NUMBERS;
    this.call("DoStep", time, step, 1, at, at + 4, at + 8, at + 16);
  }

  /** The FMU's state, for `restore`: a place in its memory; one from before is used again. */
  save(state = 0) {
    const at = this.library.words(NUMBERS);
    at[0] = state;
    this.call("GetFMUState", this.library.arguments + NUMBERS);
    return this.library.words(NUMBERS)[0];
  }

  /** @param {number} state */
  restore(state) {
    this.call("SetFMUState", state);
  }

  /** @param {number} state */
  forget(state) {
    this.library.words(NUMBERS)[0] = state;
    this.call("FreeFMUState", this.library.arguments + NUMBERS);
  }

  free() {
    this.library.functions.fmi3FreeInstance(this.component);
    this.library.listeners.delete(this.number);
  }
}
