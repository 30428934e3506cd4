// The page that `taichi-disk view` serves: the sandbox over a websocket, which opens again after a sleep.

import { Sandbox } from "./sandbox.js";

let socket;

const send = (message) =>
  socket.readyState === WebSocket.OPEN && socket.send(JSON.stringify(message));
const sandbox = (window.sandbox = new Sandbox(document.querySelector(".sandbox"), send));

function open() {
  socket = new WebSocket(new URL("socket", location.href.replace(/^http/, "ws")));
  socket.binaryType = "arraybuffer";
  socket.onmessage = ({ data }) => sandbox.receive(data);
  socket.onclose = () => {
    sandbox.lost();
    setTimeout(open, 1000);
  };
}
open();
