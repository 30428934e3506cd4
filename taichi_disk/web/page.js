// The page that `taichi-disk view` serves: the sandbox over a websocket, which opens again after a
// sleep. A key, stored as long as the tab is open, gives it its own disk back.

import { Sandbox } from "./sandbox.js";
import { recall, remember } from "./html.js";

const ADDRESS = new URL("socket", location.href);
const KEY = "taichi-disk session"; // name under which the key of the session is stored

let socket;
let key = recall(KEY);

const send = (message) =>
  socket.readyState === WebSocket.OPEN && socket.send(JSON.stringify(message));
const sandbox = (window.sandbox = new Sandbox(document.querySelector(".sandbox"), send));
sandbox.onkey = (given) => remember(KEY, (key = given));

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
  socket = new WebSocket(`${ADDRESS.href.replace(/^http/, "ws")}?${key}`);
  socket.binaryType = "arraybuffer";
  let isOpened = false;
  socket.onopen = () => (isOpened = true);
  socket.onmessage = ({ data }) => sandbox.receive(data);
  socket.onclose = ({ reason }) => {
    if (isOpened) sandbox.lost(reason || undefined);
    else askWhy();
    setTimeout(open, reason ? 5000 : 1000);
  };
}
open();
