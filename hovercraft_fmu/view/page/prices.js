// What each term of a scene costs, measured here and now: the time of the same run with it, to that without.

import { Instance } from "./fmu.js";

const ROUNDS = 5;
const DURATION = 60; // s, of the run: 60 000 sub-steps, well above what the clock can tell

/**
 * @param {import("./fmu.js").Library} library
 * @param {import("./fmu.js").Description} description
 * @param {import("./settings.js").Term[]} terms
 * @param {(name: string, ratio: number) => void} tell what is not finite or 0: the clock of this browser is too coarse
 */
export async function measurePrices(library, description, terms, tell) {
  const none = { name: "", label: "", values: {}, input: false };
  /** @type {Map<string, number>} */
  const least = new Map();
  for (let round = 0; round < ROUNDS; round++)
    for (const term of [none, ...terms]) {
      await new Promise((resolve) => setTimeout(resolve, 20));
      least.set(term.name, Math.min(least.get(term.name) ?? Infinity, timed(library, description, term)));
    }
  for (const { name } of terms) tell(name, (least.get(name) ?? NaN) / (least.get("") ?? NaN));
}

/**
 * s.
 * @param {import("./fmu.js").Library} library
 * @param {import("./fmu.js").Description} description
 * @param {import("./settings.js").Term} term
 */
function timed(library, description, term) {
  const craft = new Instance(library, description, () => {});
  craft.initialize(term.input ? {} : term.values, term.input ? term.values : {});
  const began = performance.now();
  craft.doStep(0, DURATION);
  const took = performance.now() - began;
  craft.free();
  return took;
}
