// The moves of a timeline, as people see them: a command's segments in a row.

/** Holes of a move shorter than this are none [s]. */
const SAME = 1e-6;
/** Steering makes many short commands: those that follow each other so closely are one [s]. */
const CLOSE = 0.05;

/**
 * Moves between two times.
 * @param {Timeline} timeline
 * @param {number} from [s]
 * @param {number} until [s]
 * @param {(id: number) => boolean} steers whether a command steered
 * @returns {{id: number, start: number, end: number, knots: number[], steers: boolean}[]}
 */
export function movesBetween(timeline, from, until, steers) {
  const moves = [];
  const { segments } = timeline;
  let index = Math.max(0, timeline.indexAt(from));
  // The move that holds at `from` began earlier.
  while (index > 0 && segments[index].commandId !== null && segments[index - 1].commandId === segments[index].commandId)
    index--;
  for (; index < segments.length && segments[index].start < until; index++) {
    const { start, duration, commandId } = segments[index];
    if (commandId === null || duration <= 0) continue;
    const end = start + duration;
    const last = moves.at(-1);
    const joins = last && start - last.end < SAME && last.id === commandId;
    const goesOn = last && last.steers && start - last.end < CLOSE && steers(commandId);
    if (joins || goesOn) {
      last.knots.push(start);
      last.end = end;
      last.id = commandId;
    } else moves.push({ id: commandId, start, end, knots: [], steers: steers(commandId) });
  }
  return moves;
}
