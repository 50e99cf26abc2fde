// Where a robot's links are, by the product of exponentials; see interfaces/station/chain.py.
// Matrices are 4 × 4, in 16 numbers column by column, as three.js has them.

/** A · B. */
export function multiply(A, B) {
  const C = new Array(16);
  for (let column = 0; column < 4; column++) {
    for (let row = 0; row < 4; row++) {
      let sum = 0;
      for (let k = 0; k < 4; k++) sum += A[row + 4 * k] * B[k + 4 * column];
      C[row + 4 * column] = sum;
    }
  }
  return C;
}

/** exp([S] q) of a screw (ω, v) with |ω| 1 or 0. */
export function exponential([x, y, z, ...v], q) {
  const sine = Math.sin(q);
  const versed = 1 - Math.cos(q);
  const W = [[0, -z, y], [z, 0, -x], [-y, x, 0]];
  const WW = W.map((row) => [0, 1, 2].map((j) => row[0] * W[0][j] + row[1] * W[1][j] + row[2] * W[2][j]));
  const turns = x !== 0 || y !== 0 || z !== 0;
  const X = new Array(16).fill(0);
  for (let i = 0; i < 3; i++) {
    for (let j = 0; j < 3; j++) {
      const one = i === j ? 1 : 0;
      X[i + 4 * j] = one + sine * W[i][j] + versed * WW[i][j];
      X[i + 12] += (turns ? q * one + versed * W[i][j] + (q - sine) * WW[i][j] : q * one) * v[j];
    }
  }
  X[15] = 1;
  return X;
}

/** Angles of no turn, O, A, T [deg], of R = Rz(O − 90°) Ry(A + 90°) Rz(T): VAL-II's, as its WHERE shows them. */
const NO_TURN = [90, -90, 0];
/** Sine of the angle between tool and vertical under which O and T can't be told apart. */
const VERTICAL = 1e-9;
const DEGREE = Math.PI / 180;

/** O, A, T [deg] of a pose's turn; O and T within ±180°. */
export function anglesOf(X) {
  const level = Math.hypot(X[8], X[9]);
  const turns = level < VERTICAL ? [0, X[10] > 0 ? 0 : Math.PI, Math.atan2(X[1], X[5])]
    : [Math.atan2(X[9], X[8]), Math.atan2(level, X[10]), Math.atan2(X[6], -X[2])];
  const [o, a, t] = turns.map((turn, k) => turn / DEGREE + NO_TURN[k]);
  const wrapped = (angle) => angle - 360 * Math.ceil((angle - 180) / 360);
  return [wrapped(o), a, wrapped(t)];
}

/** The pose that turns by O, A, T [deg], at the origin. */
export function turned(angles) {
  const screws = [[0, 0, 1, 0, 0, 0], [0, 1, 0, 0, 0, 0], [0, 0, 1, 0, 0, 0]];
  return screws.map((screw, k) => exponential(screw, (angles[k] - NO_TURN[k]) * DEGREE)).reduce(multiply);
}

/** A robot's chain. */
export class Chain {
  /** @param {{home: number[][], screws: number[][], tool: number[]}} described by the server */
  constructor({ home, screws, tool }) {
    this.home = home;
    this.screws = screws;
    this.tool = tool;
  }

  /** Whether a joint is prismatic: its values are in m where others' are in rad. */
  slides(k) {
    return this.screws[k].slice(0, 3).every((part) => part === 0);
  }

  /** Poses of the base and of the links at q. */
  links(q) {
    const poses = [this.home[0]];
    let X = exponential([0, 0, 0, 0, 0, 0], 0);
    this.screws.forEach((screw, k) => {
      X = multiply(X, exponential(screw, q[k]));
      poses.push(multiply(X, this.home[k + 1]));
    });
    return poses;
  }

  /** The tool's point in the base frame [m] at q. */
  toolAt(q) {
    return this.toolOf(this.links(q).at(-1));
  }

  /** The last link's pose that has the tool's point at a place [m] in the base frame, turned as X. */
  linkAt(place, X) {
    const turn = [...X.slice(0, 12), 0, 0, 0, 1];
    const reach = this.toolOf(turn);
    return [...turn.slice(0, 12), ...place.map((x, k) => x - reach[k]), 1];
  }

  /** The tool's point in the base frame [m], by the last link's pose. */
  toolOf(X) {
    const [a, b, c] = this.tool;
    return [0, 1, 2].map((row) => X[row] * a + X[row + 4] * b + X[row + 8] * c + X[row + 12]);
  }
}
