import { Suspense, useMemo, useState } from "react";
import { useTranslation } from "react-i18next";
import { listFields } from "../api/resources";
import { Empty, ErrorNotice, Skeleton } from "../controls/states";
import { waitingMissions, type Waiting } from "../live/queue";
import { useLive, useSeldom } from "../live/use_live";
import { runningMissions, usePlans, type Running } from "../live/use_plans";
import { useResource } from "../live/use_resource";
import { farmExtent } from "../map/farm_extent";
import { collection, fieldFeatures, routeFeatures, trailFeatures } from "../map/features";
import { fenceFeatures } from "../map/fence_features";
import { FenceLegend } from "../map/FenceLegend";
import { FarmMap } from "../map/map_part";
import { fenceOf, type Fence } from "../planning/fence";
import { useFleetSymbols } from "./use_fleet_symbols";
import { VehicleCard } from "./VehicleCard";

/** Trails are drawn again as a whole; the symbols move at once. */
const REDRAWN_EVERY_MS = 1000;
/** Cards that a screen shows; the others are drawn when they come near. */
const SHOWN_AT_FIRST = 4;
/** The same array each time, so that a card is not drawn again for it. */
const NONE_WAITING: readonly Waiting[] = [];

/** The first screen: every vehicle on the map, and beside it what each is doing. */
export function Fleet() {
  const { t } = useTranslation();
  const vehicles = useLive((state) => state.vehicles);
  const homes = useLive((state) => state.homes);
  const missions = useLive((state) => state.missions);
  const connection = useLive((state) => state.connection);
  const [selected, setSelected] = useState<number | null>(null);
  const fields = useResource(listFields);
  const plans = usePlans();

  const running = useMemo(() => runningMissions(plans.value ?? []), [plans.value]);
  const waiting = useMemo(() => waitingMissions(plans.value ?? [], missions), [plans.value, missions]);
  const seldom = useSeldom(vehicles, REDRAWN_EVERY_MS);
  const outlines = useMemo(() => fieldFeatures(fields.value ?? []), [fields.value]);
  const trails = useMemo(
    () => collection(trailFeatures([...seldom.values()].map((one) => one.trail))),
    [seldom],
  );
  const routes = useMemo(
    () =>
      collection(
        [...running].flatMap(([vehicleId, { mission }]) =>
          routeFeatures(mission.command_array, homes.get(vehicleId) ?? null),
        ),
      ),
    [running, homes],
  );
  const fences = useMemo(() => fencesOf(running.values()), [running]);
  const fenceAreas = useMemo(() => fenceFeatures(fences), [fences]);
  const layers = useMemo(
    () => ({ fields: outlines, fences: fenceAreas, trails, routes }),
    [outlines, fenceAreas, trails, routes],
  );
  const symbols = useFleetSymbols(fields.value ?? [], selected, setSelected);
  const extent = useMemo(
    () =>
      fields.isLoading && fields.value === null
        ? null
        : farmExtent(fields.value ?? [], vehicles.values()),
    [fields.value, fields.isLoading, vehicles],
  );

  return (
    <div className="fleet">
      <h1 className="visually-hidden">{t("nav.fleet")}</h1>
      <Suspense fallback={<div className="farm-map" />}>
        <FarmMap
          layers={layers}
          symbols={symbols}
          extent={extent}
          legend={fences.length > 0 && <FenceLegend fences={fences} />}
          label={t("map.label")}
        />
      </Suspense>
      <section className="fleet-list" aria-label={t("fleet.list")}>
        {fields.error && <ErrorNotice error={fields.error} retry={fields.reload} />}
        {connection === "connecting" && <Skeleton rows={2} />}
        {connection !== "connecting" && vehicles.size === 0 && (
          <Empty icon="flight" title={t("fleet.empty_title")} text={t("fleet.empty_text")} />
        )}
        {[...vehicles.values()].map((tracked, index) => (
          <VehicleCard
            key={tracked.vehicle.vehicle_id}
            tracked={tracked}
            waiting={waiting.get(tracked.vehicle.vehicle_id) ?? NONE_WAITING}
            running={running.get(tracked.vehicle.vehicle_id) ?? null}
            isSelected={selected === tracked.vehicle.vehicle_id}
            isShownAtFirst={index < SHOWN_AT_FIRST}
            select={setSelected}
          />
        ))}
      </section>
    </div>
  );
}

/** The fence of each plan in flight, also of one that several vehicles fly. */
function fencesOf(running: Iterable<Running>): Fence[] {
  const plans = new Map([...running].map(({ plan }) => [plan.id, plan]));
  return [...plans.values()].map(({ geofence }) => fenceOf(geofence)).filter((fence) => fence !== null);
}
