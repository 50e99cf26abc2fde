// What panels share of what a robot does by itself: asking for it, and saying why it can't be.
import { DEGREES } from "./ui.js";

/** Kinds of news of the server that are kept as they come. */
export const NEWS = ["tasks", "seen", "plan"];

/**
 * Ask for something that the robot does by itself; what is refused is said.
 * @param {object} station
 * @param {object} task a `task` as the protocol has it
 * @param {Function} refused is given why it's refused, "" where it isn't
 */
export function ask(station, task, refused) {
  const { session } = station;
  const why = !session.holds ? "Take control first" : session.link === "live" ? "" : "There's no connection";
  if (why) {
    refused(why + ": nothing was sent.");
    station.refuse(why + ": nothing was sent.");
    return;
  }
  const number = session.wish("task", { task });
  const settle = (text) => {
    session.removeEventListener("tasks", told);
    session.removeEventListener("problem", told);
    refused(text);
  };
  const told = ({ type, detail }) => {
    if (type === "tasks" ? detail.answers === number : detail.number === number) settle(detail.text ?? "");
  };
  session.addEventListener("tasks", told);
  session.addEventListener("problem", told);
}

/** Whether the robot does something by itself. */
export function busy(session) {
  return Boolean(session.tasks) && session.tasks.doing !== "nothing";
}

/** Metres and degrees of a goal, for people. */
export function goalText({ x, y, heading }) {
  const turned = heading == null ? "" : `, ${(heading * DEGREES).toFixed(0)}°`;
  return `${x.toFixed(2)}, ${y.toFixed(2)} m${turned}`;
}
