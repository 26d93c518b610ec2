/** Symbols that lie on each other are moved apart, so that each can be pressed. Pure. */

export interface Point {
  x: number;
  y: number;
}

const ROUNDS = 60;
/** More symbols than a person places by hand: they stay where they are. */
const MOST = 100;
/** Of the golden angle [rad]: symbols at one place go in as many directions. */
const TURN = 2.4;

/** How far each point is moved, so that all are so far from each other at least, or nearly [px]. */
export function offsetsOf(points: readonly Point[], apart_px: number): Point[] {
  const moved = points.map(({ x, y }) => ({ x, y }));
  for (let round = 0; round < ROUNDS && points.length <= MOST; round += 1) {
    if (!pushApart(moved, apart_px)) break;
  }
  return moved.map(({ x, y }, index) => ({ x: x - (points[index]?.x ?? x), y: y - (points[index]?.y ?? y) }));
}

/** Moves each two that are too near away from each other; returns whether there were any. */
function pushApart(points: Point[], apart_px: number): boolean {
  let hasMoved = false;
  points.forEach((one, index) => {
    for (const other of points.slice(index + 1)) {
      const x = other.x - one.x;
      const y = other.y - one.y;
      const distance = Math.hypot(x, y);
      if (distance >= apart_px - 0.5) continue;
      hasMoved = true;
      const push = (apart_px - distance) / 2;
      const [east, south] = distance > 0 ? [x / distance, y / distance] : [Math.cos(TURN * index), Math.sin(TURN * index)];
      one.x -= push * east;
      one.y -= push * south;
      other.x += push * east;
      other.y += push * south;
    }
  });
  return hasMoved;
}
