/** What a map of the farm shows at first: its fields and its vehicles. */

import type { StoredField } from "../api/types";
import type { Tracked } from "../live/state";
import { extentOf, type Extent } from "./extent";

export function farmExtent(fields: readonly StoredField[], vehicles: Iterable<Tracked>): Extent | null {
  const corners = fields.flatMap((field) =>
    field.boundary.map(([latitude = 0, longitude = 0]) => [longitude, latitude] as const),
  );
  const places = [...vehicles].flatMap(({ vehicle }) =>
    typeof vehicle.longitude === "number" && typeof vehicle.latitude === "number"
      ? [[vehicle.longitude, vehicle.latitude] as const]
      : [],
  );
  return extentOf([...corners, ...places]);
}
