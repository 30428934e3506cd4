// What pages and films do with HTML.

export function element(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

// The elements in `root` that have an id, by their ids.
export function elements(root) {
  return Object.fromEntries([...root.querySelectorAll("[id]")].map((one) => [one.id, one]));
}

// Give a canvas a size in pixels, which empties it, if it has another one.
export function resize(canvas, width, height) {
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
}

export function download(content, name, type) {
  const link = element("a", { download: name, href: URL.createObjectURL(new Blob([content], { type })) });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1e4);
}
