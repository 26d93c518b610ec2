/** The corners of the ring that is drawn, and the places between them where one can be added. */

import { useMemo, useRef } from "react";
import { useTranslation } from "react-i18next";
import type { Symbol } from "../map/FarmMap";
import { cornerElement, edgeElement, entryElement } from "../map/markers";
import { shifted } from "../planning/ground";
import { FEWEST_CORNERS, middleOf, type Corner, type Ring, type RingName } from "../planning/outline";

interface CornerActions {
  select: (index: number) => void;
  add: (corner: Corner, after: number) => void;
  remove: (index: number) => void;
  move: (index: number, corner: Corner, isDropped?: boolean) => void;
}

export function useCornerSymbols(
  name: RingName,
  ring: Ring,
  selected: number | null,
  actions: CornerActions,
  faulty: readonly number[] = [],
): Symbol[] {
  const { t } = useTranslation();
  // An element is made once and acts on the ring as it is when somebody uses it
  const latest = useRef({ ring, actions });
  latest.current = { ring, actions };
  const faults = faulty.join();
  return useMemo(() => {
    const marked = new Set(faults === "" ? [] : faults.split(",").map(Number));
    const corners = ring.map(([latitude, longitude], index): Symbol => ({
      key: `corner-${name}-${index}`,
      latitude,
      longitude,
      level: 5,
      make: () =>
        cornerElement(t("fields.corner", { number: index + 1 }), {
          select: () => latest.current.actions.select(index),
          remove: () => latest.current.actions.remove(index),
          move: (north_m, east_m) => {
            const corner = latest.current.ring[index];
            if (corner) latest.current.actions.move(index, shifted(corner, north_m, east_m));
          },
        }),
      update: (element) => {
        element.classList.toggle("is-selected", index === selected);
        element.classList.toggle("has-error", marked.has(index));
        element.classList.toggle("is-exclusion", name.startsWith("exclusions"));
      },
      drag: (toLongitude, toLatitude, isDropped) =>
        latest.current.actions.move(index, [toLatitude, toLongitude], isDropped),
    }));
    if (ring.length < FEWEST_CORNERS) return corners;
    const edges = ring.map((_, index): Symbol => {
      const [latitude, longitude] = middleOf(ring, index);
      return {
        key: `edge-${name}-${index}`,
        latitude,
        longitude,
        level: 4,
        make: () =>
          edgeElement(t("fields.add_after", { number: index + 1 }), () =>
            latest.current.actions.add(middleOf(latest.current.ring, index), index),
          ),
      };
    });
    return [...edges, ...corners];
  }, [name, ring, selected, faults, t]);
}

/** The entry of a field, which can be dragged and moved by the keys. */
export function useEntrySymbol(
  entry: Corner | null,
  move: (entry: Corner | null, continued?: string) => void,
): Symbol[] {
  const { t } = useTranslation();
  const latest = useRef({ entry, move });
  latest.current = { entry, move };
  const drags = useRef(0);
  return useMemo(() => {
    if (entry === null) return [];
    return [{
      key: "entry",
      latitude: entry[0],
      longitude: entry[1],
      level: 6,
      make: () =>
        entryElement(t("fields.entry"), {
          select: () => undefined,
          remove: () => latest.current.move(null),
          move: (north_m, east_m) => {
            const present = latest.current.entry;
            if (present) latest.current.move(shifted(present, north_m, east_m));
          },
        }),
      drag: (longitude, latitude, isDropped) => {
        latest.current.move([latitude, longitude], `entry ${drags.current}`);
        if (isDropped) drags.current += 1;
      },
    }];
  }, [entry, t]);
}
