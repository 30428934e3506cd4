// Helpers with which pages and films build HTML.

export function element(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

// Return the element that a text of HTML describes.
export const parsed = (text) => element("template", { innerHTML: text }).content.firstChild;

// Return a style that gives an element a colour on a light and one on a dark ground, which CSS calls
// `--curve`.
export const inks = (light, dark) => `--light: ${light}; --dark: ${dark}`;

// Return the elements in `root` that have an id, by their ids.
export function elements(root) {
  return Object.fromEntries([...root.querySelectorAll("[id]")].map((one) => [one.id, one]));
}

// Return the states of the check boxes in `root` by their ids.
export function checked(root) {
  return Object.fromEntries([...root.querySelectorAll("input")].map((one) => [one.id, one.checked]));
}

// Return texts by their names, stored as long as the tab is open; a frame or an app may forbid it.
function openStore() {
  try {
    return sessionStorage ?? {};
  } catch {
    return {};
  }
}

export const store = openStore();

// Copy a text, and `tell` that it is `done`. A page that came by plain http and some frames have no
// clipboard, but can copy a selection; where that is forbidden, too, the selected text is shown.
export async function copy(text, tell, done) {
  if (await navigator.clipboard?.writeText(text).then(() => true, () => false)) return tell(done);
  const field = element("textarea", { value: text, readOnly: true, className: "copied" });
  document.querySelector("main").append(field);
  field.select();
  const isCopied = document.execCommand("copy");
  tell(isCopied ? done : "This browser copies nothing by itself: copy the selected text.");
  if (isCopied) field.remove();
  else field.onblur = () => field.remove();
}

export function download(content, name, type) {
  const href = URL.createObjectURL(new Blob([content], { type }));
  element("a", { download: name, href }).click();
  setTimeout(() => URL.revokeObjectURL(href), 1e4);
}
