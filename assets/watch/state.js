// What all parts of the page share: the server's last status, the view that is asked for, and the line to the server.

export const $ = (id) => document.getElementById(id);

export const state = {
  socket: null,
  status: null,
  view: null,
  resolution: [1, 1],
  /** Images that have come. */
  received: 0,
  /** Which of them is drawn. */
  drawn: 0,
  /** What it was like. */
  frame: null,
  /** The pixel that a click has pinned. */
  pinned: null,
};

export function say(message) {
  if (state.socket?.readyState === WebSocket.OPEN) state.socket.send(JSON.stringify(message));
}

export const pose = () => state.view.pose ?? state.status.ready.cameras[state.view.camera].pose;
