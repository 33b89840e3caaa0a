"use strict";
// The socket of the page, in a thread of its own: a sign of life ten times a second while the page draws,
// however long one picture takes. A page that has not run for patience ms is silent, and so is lost.
let patience = 20000;
let socket = null, address = "", ran = performance.now();
function connect() {
  socket = new WebSocket(address);
  socket.onopen = () => postMessage({ link: "open" });
  socket.onmessage = (event) => postMessage({ text: event.data });
  socket.onclose = () => { postMessage({ link: "closed" }); setTimeout(connect, 500); };
}
onmessage = (event) => {
  ran = performance.now();
  if (event.data.address) { address = event.data.address; connect(); }
  else if (event.data.patience) patience = event.data.patience;
  else if (event.data.close) socket.close();
  else if (event.data.text && socket && socket.readyState === 1) socket.send(event.data.text);
};
setInterval(() => {
  if (socket && socket.readyState === 1 && performance.now() - ran < patience) socket.send('{"type":"alive"}');
}, 100);
