import { useTranslation } from "react-i18next";
import { serverAheadMs } from "../api/server_clock";
import type { Plan } from "../api/types";
import { useUnits } from "../app/preferences";
import { Notice } from "../controls/states";
import { useNow } from "../live/use_live";
import { lifeOf } from "../planning/plan_life";

/** Until when a plan can be flown, and why not for ever. */
export function PlanLife({ plan }: { plan: Plan }) {
  const { t } = useTranslation();
  const units = useUnits();
  const life = lifeOf(plan, useNow() + serverAheadMs());
  if (life === null) return null;
  const text = t(`plans.life_${life}`, { time: units.time(plan.expires_at) });
  return life === "open" ? <p className="muted small">{text}</p> : <Notice kind="info">{text}</Notice>;
}
