/** The corners of the ring that is edited: chosen, moved, added and removed on the map. */

import { useRef, useState } from "react";
import type { Symbol } from "../map/FarmMap";
import { withCorner, withMovedCorner, withoutCorner, type Corner, type Ring, type RingName } from "../planning/outline";
import { useCornerSymbols } from "./use_corner_symbols";

export interface Corners {
  symbols: Symbol[];
  selected: number | null;
  select: (index: number | null) => void;
  /** By default at the end of the ring. */
  add: (corner: Corner, after?: number) => void;
  remove: (index: number) => void;
  move: (index: number, corner: Corner) => void;
}

export function useCorners({ name, ring, change, faulty }: {
  name: RingName;
  ring: Ring;
  /** Called with a name for the places of one movement: together they are one step back. */
  change: (update: (present: Ring) => Ring, movement?: string) => void;
  /** The corners at which something is wrong. */
  faulty?: readonly number[];
}): Corners {
  const [selected, select] = useState<number | null>(null);
  const dragged = useRef<number | null>(null);
  const drags = useRef(0);
  const add = (corner: Corner, after?: number) => {
    change((present) => withCorner(present, corner, after));
    select(after === undefined ? ring.length : after + 1);
  };
  const remove = (index: number) => {
    change((present) => withoutCorner(present, index));
    select(null);
  };
  const move = (index: number, corner: Corner, isDropped = true) => {
    drags.current += dragged.current === index ? 0 : 1;
    dragged.current = isDropped ? null : index;
    change((present) => withMovedCorner(present, index, corner), `drag ${drags.current}`);
  };
  const symbols = useCornerSymbols(name, ring, selected, { select, add, remove, move }, faulty);
  return { symbols, selected, select, add, remove, move };
}
