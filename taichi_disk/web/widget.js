// The notebook's widget: the sandbox over the messages of anywidget. `PAGE` and `STYLE` are put in
// front of it.

export default {
  render({ model, el }) {
    const shadow = el.attachShadow({ mode: "open" });
    const visitor = Math.random();
    const frame = `.frame { height: ${model.get("height")}px; container: page / size; }`;
    shadow.innerHTML = `<style>${STYLE} ${frame}</style>
      <div class="frame">${PAGE}</div>`;
    const send = (message) => model.send({ visitor, ...message });
    const sandbox = (el.sandbox = new Sandbox(shadow.querySelector(".sandbox"), send));
    const hear = ({ to, text }, [view]) => {
      const state = () => view.buffer.slice(view.byteOffset, view.byteOffset + view.byteLength);
      if (to === visitor) sandbox.receive(text ?? state());
    };
    model.on("msg:custom", hear);
    send({ do: "open" });
    return () => {
      model.off("msg:custom", hear);
      send({ do: "close" });
    };
  },
};
