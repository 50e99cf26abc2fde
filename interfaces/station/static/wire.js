// The page's end of its socket's thread.

export class Wire {
  /** @param {{open: () => void, message: (text: string) => void, close: () => void}} handlers */
  constructor(handlers) {
    this.handlers = handlers;
    this.number = 0;
    this.isOpen = false;
    this.worker = new Worker("/station/socket.js");
    this.worker.onmessage = ({ data: { number, type, data } }) => {
      // What an earlier socket says is of no interest.
      if (number !== this.number) return;
      if (type !== "message") this.isOpen = type === "open";
      this.handlers[type](data);
    };
  }

  connect(address) {
    this.isOpen = false;
    this.worker.postMessage({ type: "open", number: ++this.number, address });
  }

  send(message) {
    this.worker.postMessage({ type: "send", text: JSON.stringify(message) });
  }

  /** What keeps the lease, sent again and again; null for nothing. Said often, it says that the page is alive. */
  beat(message) {
    this.worker.postMessage({ type: "beat", text: message && JSON.stringify(message) });
  }

  close() {
    this.isOpen = false;
    this.number++;
    this.worker.postMessage({ type: "close" });
  }
}
