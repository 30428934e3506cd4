// The page that `taichi-disk view` serves: the sandbox over a websocket, which opens again after a
// sleep. A key, stored as long as the tab is open, gives it its own disk back.

import { Sandbox } from "./sandbox.js";
import { store } from "./html.js";

const ADDRESS = new URL("socket", location.href);
const KEY = "taichi-disk session"; // name under which the key of the session is stored

const SILENCE = 5000; // without an answer, after which the socket is taken for dead [ms]
const PATIENCE = 15000; // of hearing nothing, after which the page asks [ms]

let socket;
let heard = 0; // when the program was heard last [ms]
const key = (store[KEY] ||= String(Math.random()).slice(2));

const send = (message) => socket.readyState === WebSocket.OPEN && socket.send(JSON.stringify(message));
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

// Ask whether the program is still there. A socket that a sleep, or another network, has cut stays
// open for minutes and says nothing.
function ask() {
  if (socket.readyState !== WebSocket.OPEN) return;
  const asked = performance.now();
  const asking = socket;
  send({ do: "alive" });
  setTimeout(() => heard < asked && asking === socket && reopen(), SILENCE);
}

function reopen() {
  socket.onclose = null; // a dead socket takes long to close
  socket.close();
  sandbox.lost();
  open();
}

function open() {
  socket = new WebSocket(`${ADDRESS.href.replace(/^http/, "ws")}?${key}`);
  socket.binaryType = "arraybuffer";
  let isOpened = false;
  socket.onopen = () => (isOpened = true);
  socket.onmessage = ({ data }) => {
    heard = performance.now();
    sandbox.receive(data);
  };
  socket.onclose = () => {
    if (isOpened) sandbox.lost();
    else askWhy();
    setTimeout(open, 1000);
  };
}
open();
window.addEventListener("online", ask);
document.addEventListener("visibilitychange", () => document.hidden || ask());
setInterval(() => performance.now() - heard > PATIENCE && ask(), PATIENCE / 3);
