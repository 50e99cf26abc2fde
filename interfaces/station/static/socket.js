// The page's socket, in a thread of its own: beats go out while the page draws, but not for a page that hangs.

/** Time between two beats [ms]. */
const BEAT = 450;
/** A page that says nothing for so long hangs [ms]. */
const HANGS = 4000;

let socket = null;
let beat = null;
let alive = performance.now();

function open(number, address) {
  beat = null;
  const mine = (socket = new WebSocket(address, ["vrs.1.json"]));
  mine.onopen = () => postMessage({ number, type: "open" });
  mine.onmessage = ({ data }) => postMessage({ number, type: "message", data });
  mine.onclose = () => postMessage({ number, type: "close" });
}

onmessage = ({ data: { type, number, address, text } }) => {
  alive = performance.now();
  if (type === "open") open(number, address);
  else if (type === "beat") beat = text;
  else if (type === "send" && socket?.readyState === WebSocket.OPEN) socket.send(text);
  else if (type === "close") socket?.close();
};

setInterval(() => {
  const hangs = performance.now() - alive > HANGS;
  if (beat !== null && !hangs && socket?.readyState === WebSocket.OPEN) socket.send(beat);
}, BEAT);
