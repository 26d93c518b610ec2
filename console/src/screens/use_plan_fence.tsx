import { useMemo, type ReactNode } from "react";
import type { Plan } from "../api/types";
import type { Place } from "../live/trail";
import { fenceFeatures, fencePlaces } from "../map/fence_features";
import { FenceLegend } from "../map/FenceLegend";
import { fenceOf } from "../planning/fence";

interface PlanFence {
  features: GeoJSON.FeatureCollection;
  places: Place[];
  /** Null without a fence. */
  legend: ReactNode;
}

/** The fence of a plan for its map. */
export function usePlanFence(geofence: Plan["geofence"]): PlanFence {
  return useMemo(() => {
    const fence = fenceOf(geofence);
    return {
      features: fenceFeatures(fence === null ? [] : [fence]),
      places: fence === null ? [] : fencePlaces(fence),
      legend: fence && <FenceLegend fences={[fence]} />,
    };
  }, [geofence]);
}
