// A link beside the session's own: it's made once the session is greeted.

/** A page that is held up may show its token too late: then it's tried again after so long [ms]. */
const AGAIN = 1000;

/**
 * A link of a panel to its part of the server.
 * @param {object} station
 * @param {string} path of the WebSocket
 * @param {{take: function(any): void, state?: function(string): void}} told as by `VrsLink`
 */
export function sideLink(station, path, { take, state = () => {} }) {
  const { session } = station;
  const link = new window.VrsLink(path, [], {
    take,
    state(next) {
      if (next === "token" && session.link !== "locked") setTimeout(join, AGAIN);
      state(next);
    },
  });
  function join() {
    if (link.socket === null && link.again === null) link.connect();
  }
  station.on("welcome", join);
  // Not before the panel is all there.
  if (session.welcome) queueMicrotask(join);
  return link;
}
