// The notebook's widget: the sandbox over the messages of anywidget. `PAGE` and `STYLE` are put in front of it.

export default {
  render({ model, el }) {
    const shadow = el.attachShadow({ mode: "open" });
    shadow.innerHTML = `<style>${STYLE} .frame { height: ${model.get("height")}px; container-type: size; }</style>
      <div class="frame">${PAGE}</div>`;
    const visitor = Math.random();
    const send = (message) => model.send({ visitor, ...message });
    const sandbox = (el.sandbox = new Sandbox(shadow.querySelector(".sandbox"), shadow, send));
    const hear = (message, buffers) => {
      if (message.to !== visitor) return;
      if (message.text) sandbox.receive(message.text);
      for (const { buffer, byteOffset, byteLength } of buffers) sandbox.receive(buffer.slice(byteOffset, byteOffset + byteLength));
    };
    model.on("msg:custom", hear);
    sandbox.connected(true);
    send({ do: "open" });
    return () => {
      model.off("msg:custom", hear);
      send({ do: "close" });
    };
  },
};
