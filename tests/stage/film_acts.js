noteFields(Field);
stage.root = document.querySelector("main");
stage.shown = described(stage.root);
while (!stage.frames.length) await new Promise((done) => later(done, 5));
const pass = (time) => {
  stage.clock += time;
  drawFrame();
};
const choose = (name, value) => {
  const select = document.querySelector(`[data-key=${name}] select`);
  select.value = value;
  select.onchange();
};
const moment = (place) => {
  get("moment").value = place;
  get("moment").oninput();
};
const panes = document.querySelectorAll("figure canvas");
look("the film opens");
look("fringes and points", () => {
  choose("quantity", "fringes");
  choose("draw", "points");
});
step("a twentieth of a second", () => pass(50));
look("another, while it cannot be seen", () => {
  stage.observers[0]([{ isIntersecting: false }]);
  pass(50);
});
step("a pause of the browser", () => {
  stage.observers[0]([{ isIntersecting: true }]);
  pass(900);
});
step("shortly before the end", () => moment(4.6));
step("from the start again", () => {
  get("play").click();
  pass(50);
});
step("a mark, which pauses", () => {
  document.querySelector("#line button").click();
  pass(50);
});
step("dark, and another quantity", () => {
  choose("theme", "dark");
  choose("quantity", "strain");
  moment(5);
  note(`  ${document.documentElement.outerHTML.split(">", 1)}`);
});
step("magnified, with other options", () => {
  type("magnify", "3.14159");
  for (const id of ["forces", "velocity"]) get(id).click();
  for (const id of ["outline", "path"]) get(id).click();
});
step("twice as fast at most", () => {
  type("speed", "7");
  get("play").click();
  for (let k = 0; k < 2; k++) pass(50);
});
step("no number", () => type("speed", "fast"));
step("zoomed and moved", () => {
  pointer(panes[0], "pointerdown", 50, 50);
  pointer(panes[0], "pointermove", 80, 45);
  pointer(panes[0], "pointerup", 80, 45);
  const wheel = new WheelEvent("wheel", { deltaY: -90, cancelable: true });
  Object.defineProperties(wheel, { offsetX: { value: 100 }, offsetY: { value: 120 } });
  panes[1].dispatchEvent(wheel);
});
step("in a window of another size", () => stage.observers[1]());
step("seen as a whole", () => get("whole").click());
step("one above the other", () => {
  media["(max-width: 599px) and (min-height: 701px)"].matches = true;
  stage.observers[1]();
});
step("low", () => {
  get("disks").style.height = "200px";
  stage.observers[1]();
});
look("tall and narrow curves", () => {
  Object.assign(get("curves").style, { width: "60px", height: "450px" });
  window.devicePixelRatio = 2;
  moment(4);
});
window.recorded = stage.lines.join("\n");
