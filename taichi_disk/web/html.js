// Helpers with which pages and films build HTML.

export function element(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

// Return the elements in `root` that have an id, by their ids.
export function elements(root) {
  return Object.fromEntries([...root.querySelectorAll("[id]")].map((one) => [one.id, one]));
}

export function download(content, name, type) {
  const link = element("a", { download: name, href: URL.createObjectURL(new Blob([content], { type })) });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1e4);
}
