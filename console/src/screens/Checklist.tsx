import { useTranslation } from "react-i18next";
import type { Plan } from "../api/types";
import { Pill } from "../controls/StatusPill";
import { useLive } from "../live/use_live";
import { checklist } from "../planning/checklist";

/** What to look at before a plan is dispatched, for each of its vehicles. */
export function Checklist({ plan }: { plan: Plan }) {
  const { t } = useTranslation();
  const vehicles = useLive((state) => state.vehicles);
  return (
    <>
      {plan.missions.map((mission) => (
        <section key={mission.mission_id} className="checklist">
          <h3>{t("vehicle.name", { id: mission.vehicle_id })}</h3>
          <ul>
            {checklist(mission, vehicles.get(mission.vehicle_id)?.vehicle).map(({ name, state }) => (
              <li key={name}>
                <span>{t(`check.${name}`)}</span>
                <Pill tone={state}>{t(`check.${state}`)}</Pill>
              </li>
            ))}
          </ul>
        </section>
      ))}
    </>
  );
}
