// The connection of a mobile robot's page: both robots' postures come as they are, and nothing is followed.
import { Session } from "./session.js";

export class DriveSession extends Session {
  constructor(who) {
    super(who);
    this.welcomes = "mobile-welcome";
  }

  makeReader() {
    return null;
  }

  take(message) {
    if (message.type !== "postures") {
      super.take(message);
      return;
    }
    this.heard = performance.now() / 1000;
    this.state = message;
    this.become("live");
    this.emit("state", message);
  }
}
