// The connection of a mobile robot's page: both robots' postures come as they are, and nothing is followed.
import { Session } from "./session.js";
import { NEWS } from "./tasks.js";
import { observed } from "./ui.js";

export class DriveSession extends Session {
  constructor(who) {
    super(who);
    this.welcomes = "mobile-welcome";
    // What the robot does by itself, what it sees, and the known map; null before they're told.
    observed(this, { tasks: null, seen: null, plan: null });
  }

  makeReader() {
    return null;
  }

  take(message) {
    if (NEWS.includes(message.type)) {
      this[message.type] = message;
      this.emit(message.type, message);
      return;
    }
    if (message.type !== "postures") {
      super.take(message);
      return;
    }
    this.state = message;
    this.become("live");
    this.emit("state", message);
  }
}
