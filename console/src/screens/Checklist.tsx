import { useTranslation } from "react-i18next";
import type { Mission, Plan } from "../api/types";
import { Pill } from "../controls/StatusPill";
import { useLive } from "../live/use_live";
import { checklist, type Circumstances } from "../planning/checklist";
import { fenceOf } from "../planning/fence";

/** What to look at before a plan is dispatched, for each of its vehicles. */
export function Checklist({ plan }: { plan: Plan }) {
  const { t } = useTranslation();
  return (
    <>
      {plan.missions.map((mission) => (
        <section key={mission.mission_id} className="checklist">
          <h3>{t("vehicle.name", { id: mission.vehicle_id })}</h3>
          <Checks mission={mission} fence={fenceOf(plan.geofence)} />
        </section>
      ))}
    </>
  );
}

/** The checks of one vehicle. */
export function Checks({ mission, ...circumstances }: { mission: Mission } & Circumstances) {
  const { t } = useTranslation();
  const vehicles = useLive((state) => state.vehicles);
  return (
    <ul>
      {checklist(mission, vehicles.get(mission.vehicle_id)?.vehicle, circumstances).map(({ name, state }) => (
        <li key={name}>
          <span>{t(`check.${name}`)}</span>
          <Pill tone={state === "look" ? "neutral" : state}>{t(`check.${state}`)}</Pill>
        </li>
      ))}
    </ul>
  );
}
