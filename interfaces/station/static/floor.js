// The 3D view of a mobile robot: both twins in their room, where they drove, what is committed, and how old that is.
import { Screen } from "./camera.js";
import { busy } from "./tasks.js";
import { StationScene } from "./twins.js";
import { html } from "./ui.js";
import { Viewport } from "./viewport.js";

const LEGEND = [
  ["virtual", "Virtual", "ghost, as driven"],
  ["real", "Real", "solid, as measured"],
  ["committed", "Committed path", "where the real robot will go"],
  ["driven", "Driven", "where both were"],
];

/** A robot in its room: the server says how far away all of that is seen; upright, a phone needs a little more. */
class FloorScene extends StationScene {
  get further() {
    return 1.08;
  }
}

/** How the picture stands: symbol, words, status. */
function stands(session) {
  const { link, state } = session;
  if (link !== "live" || !state) return ["help", "Nothing known", "none"];
  if (!state.connected) return ["cloud_off", "Real robot not heard", "lost"];
  if (state.halted) return ["pause_circle", "Real robot waits", "none"];
  if (busy(session)) return ["route", "Drives by itself", "confirmed"];
  if (state.starved) return ["hourglass_empty", "Real robot waits for news", "none"];
  const later = state.time_difference;
  if (later == null || later < 0.02) return ["verified", "Real robot is there too", "confirmed"];
  return ["schedule", `Real robot ${later.toFixed(1)} s behind`, "predicted"];
}

export function Panel({ station }) {
  function standing() {
    const [symbol, words, status] = stands(station.session);
    return { symbol, words, status };
  }

  return html`<${Viewport} station=${station} Scene=${FloorScene} legend=${LEGEND} standing=${standing} />
    <${Screen} station=${station} />`;
}
