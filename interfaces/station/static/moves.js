// The moves of a timeline, as people see them: a command's segments in a row.

/** Holes of a move shorter than this are none [s]: what steers goes on where an input was late. */
const CLOSE = 0.05;

/**
 * Moves between two times.
 * @param {Timeline} timeline
 * @param {number} from [s]
 * @param {number} until [s]
 * @param {(id: number, t: number) => ?object} nameOf what a command is called at a time: where that changes, a move ends
 * @returns {{key: string, id: number, start: number, end: number, knots: number[], name: ?object}[]}
 */
export function movesBetween(timeline, from, until, nameOf = () => null) {
  const moves = [];
  const { segments } = timeline;
  let index = Math.max(0, timeline.indexAt(from));
  // The move that holds at `from` began earlier.
  while (index > 0 && segments[index].commandId !== null && segments[index - 1].commandId === segments[index].commandId)
    index--;
  for (; index < segments.length && segments[index].start < until; index++) {
    const { start, duration, commandId: id } = segments[index];
    if (id === null || duration <= 0) continue;
    const name = nameOf(id, start);
    const last = moves.at(-1);
    if (last?.id === id && last.name === name && start - last.end < CLOSE) {
      last.knots.push(start);
      last.end = start + duration;
    } else moves.push({ id, start, end: start + duration, knots: [], name });
  }
  return moves;
}
