import { useTranslation } from "react-i18next";
import { listFields } from "../api/resources";
import { serverAheadMs } from "../api/server_clock";
import type { Mission, Plan, StoredField } from "../api/types";
import { useUnits } from "../app/preferences";
import { Pill } from "../controls/StatusPill";
import { useLive } from "../live/use_live";
import { useResource } from "../live/use_resource";
import { useWind } from "../live/use_wind";
import { checklist, type Circumstances } from "../planning/checklist";
import { exclusionsElsewhere, fenceOf, fenceOfField } from "../planning/fence";

const NO_FIELDS: StoredField[] = [];

/** What to look at before a plan is dispatched, for each of its vehicles. */
export function Checklist({ plan }: { plan: Plan }) {
  const { t } = useTranslation();
  const fields = useResource(listFields).value ?? NO_FIELDS;
  const field = fields.find((one) => one.id === plan.field_id);
  const fence = fenceOf(plan.geofence) ?? (field ? fenceOfField(field) : null);
  const elsewhere = exclusionsElsewhere(fields, field?.id ?? null);
  return (
    <>
      {plan.missions.map((mission) => (
        <section key={mission.mission_id} className="checklist">
          <h3>{t("vehicle.name", { id: mission.vehicle_id })}</h3>
          <Checks mission={mission} fence={fence} elsewhere={elsewhere} />
        </section>
      ))}
    </>
  );
}

/** The checks of one vehicle. */
export function Checks({ mission, ...circumstances }: { mission: Mission } & Pick<Circumstances, "fence" | "elsewhere" | "endurance_s">) {
  const { t } = useTranslation();
  const units = useUnits();
  const vehicles = useLive((state) => state.vehicles);
  const stood = useLive((state) => state.homes.get(mission.vehicle_id));
  const home = stood === undefined ? null : { latitude: stood.latitude_deg, longitude: stood.longitude_deg };
  const wind = useWind();
  const now_ms = Date.now() + serverAheadMs();
  const checks = checklist(
    mission, vehicles.get(mission.vehicle_id)?.vehicle, { ...circumstances, home, wind, now_ms },
  );
  return (
    <ul>
      {checks.map(({ name, state }) => (
        <li key={name}>
          <span>
            {t(`check.${name}`)}
            {name === "wind" && wind !== null && state !== "look" && (
              <small>
                {t("check.wind_measured", {
                  speed: units.measured(wind.speed_m_s, "m/s"),
                  age: units.duration(now_ms - wind.at_ms),
                })}
              </small>
            )}
          </span>
          <Pill tone={state === "look" ? "neutral" : state}>{t(`check.${state}`)}</Pill>
        </li>
      ))}
    </ul>
  );
}
