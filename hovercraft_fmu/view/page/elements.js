// The elements of a page, by id.

/** An element of the page. @param {string} id */
export function element(id) {
  return /** @type {HTMLElement} */ (document.getElementById(id));
}

/** A field of it. @param {string} id */
export function field(id) {
  return /** @type {HTMLInputElement} */ (document.getElementById(id));
}

/** Write, where it is not there already. @param {string} id @param {string} text */
export function write(id, text) {
  const at = element(id);
  if (at.textContent !== text) at.textContent = text;
}
