// The page that `taichi-disk view` serves: the sandbox over a websocket, which opens again after a sleep.

import { Sandbox } from "./sandbox.js";

let socket, wait = 250;

const send = (message) => socket.readyState === WebSocket.OPEN && socket.send(JSON.stringify(message));
const sandbox = (window.sandbox = new Sandbox(document.querySelector(".sandbox"), send));

function open() {
  socket = new WebSocket(new URL("socket", location.href.replace(/^http/, "ws")));
  socket.binaryType = "arraybuffer";
  socket.onmessage = ({ data }) => sandbox.receive(data);
  socket.onopen = () => (wait = 250);
  socket.onclose = () => {
    sandbox.lost();
    setTimeout(open, (wait = Math.min(2 * wait, 4000)));
  };
}
open();
