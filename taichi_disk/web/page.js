// The page that `taichi-disk view` serves: the sandbox over a websocket, which opens again after a
// sleep.

import { Sandbox } from "./sandbox.js";

const ADDRESS = new URL("socket", location.href);

let socket;

const send = (message) =>
  socket.readyState === WebSocket.OPEN && socket.send(JSON.stringify(message));
const sandbox = (window.sandbox = new Sandbox(document.querySelector(".sandbox"), send));

// A browser does not say why a websocket was not opened, but it shows the answer to a request.
async function askWhy() {
  try {
    const response = await fetch(ADDRESS, { cache: "no-store" });
    sandbox.lost(`The program refuses: ${await response.text()}`);
  } catch {
    sandbox.lost();
  }
}

function open() {
  socket = new WebSocket(ADDRESS.href.replace(/^http/, "ws"));
  socket.binaryType = "arraybuffer";
  let isOpened = false;
  socket.onopen = () => (isOpened = true);
  socket.onmessage = ({ data }) => sandbox.receive(data);
  socket.onclose = () => {
    if (isOpened) sandbox.lost();
    else askWhy();
    setTimeout(open, 1000);
  };
}
open();
