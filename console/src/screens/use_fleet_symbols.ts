/** The symbols of the fleet on the map: names of fields, homes and vehicles. */

import { useMemo } from "react";
import { useTranslation } from "react-i18next";
import type { StoredField, Vehicle } from "../api/types";
import { useLive } from "../live/use_live";
import { statusOf } from "../live/vehicle_status";
import type { Symbol } from "../map/FarmMap";
import { homeElement, nameElement, updateVehicleElement, vehicleElement } from "../map/markers";

export function useFleetSymbols(
  fields: readonly StoredField[],
  selected: number | null,
  /** What a press on a vehicle does; null: nothing, as where the map itself is pressed. */
  select: ((vehicleId: number) => void) | null,
): Symbol[] {
  const { t } = useTranslation();
  const vehicles = useLive((state) => state.vehicles);
  const homes = useLive((state) => state.homes);
  return useMemo(() => {
    const symbols = fieldNames(fields);
    for (const { vehicle, motion } of vehicles.values()) {
      const id = vehicle.vehicle_id;
      const home = homes.get(id);
      if (home !== undefined) {
        symbols.push({
          key: `home-${id}`,
          longitude: home.longitude_deg,
          latitude: home.latitude_deg,
          level: 1,
          make: () => homeElement(t("map.home")),
        });
      }
      if (typeof vehicle.longitude !== "number" || typeof vehicle.latitude !== "number") continue;
      symbols.push({
        key: `vehicle-${id}`,
        longitude: vehicle.longitude,
        latitude: vehicle.latitude,
        level: vehicleLevel(vehicle),
        make: () => vehicleElement(t("vehicle.name", { id }), select === null ? null : () => select(id)),
        update: (element) =>
          updateVehicleElement(element, motion.heading_deg, statusOf(vehicle), id === selected),
      });
    }
    return symbols;
  }, [fields, vehicles, homes, selected, select, t]);
}

/** What flies, or waits in the air, lies above what stands on the ground. */
export function vehicleLevel(vehicle: Vehicle): number {
  return vehicle.armed ? 4 : 3;
}

/** The name of each field, below the middle of its northern edge. */
export function fieldNames(fields: readonly StoredField[]): Symbol[] {
  return fields.flatMap((field) => {
    if (!field.name || field.boundary.length === 0) return [];
    const values = (index: number) => field.boundary.map((corner) => corner[index] ?? 0);
    const north = Math.max(...values(0));
    const south = Math.min(...values(0));
    const name = field.name;
    return [
      {
        key: `field-${field.id}`,
        latitude: north - (north - south) * 0.06,
        longitude: (Math.min(...values(1)) + Math.max(...values(1))) / 2,
        make: () => nameElement(name),
      },
    ];
  });
}
