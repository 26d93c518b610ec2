import { useTranslation } from "react-i18next";
import { useReportText } from "../i18n/use_report_text";
import { getPlan } from "../api/resources";
import type { Flight, FlownCommand } from "../api/types";
import { StatusPill } from "../controls/StatusPill";
import { statusAt, stepAt } from "../flights/steps";
import { useResource } from "../live/use_resource";
import { CommandTimes } from "./CommandTimes";

/** What a flight has done, step by step: when each command began and how long it took, as it was at a moment. */
export function FlightSteps({ flight, at_ms }: {
  flight: Flight & { command_array: FlownCommand[]; lost_reports: number };
  /** What the replay shows; null at its end. */
  at_ms: number | null;
}) {
  const { t } = useTranslation();
  const reportText = useReportText();
  const { plan_id } = flight;
  // The plan names the commands; it may have been deleted
  const plan = useResource(async () => (plan_id === null ? null : getPlan(plan_id)), plan_id ?? "");
  const planned = plan.value?.missions.find((one) => one.mission_id === flight.mission_id);
  if (flight.command_array.length === 0) return null;
  const shown = stepAt(flight.command_array, at_ms);
  return (
    <>
      <h2>{t("plans.timeline")}</h2>
      <ol className="timeline">
        {flight.command_array.map((command, index) => {
          const type = planned?.command_array.find((one) => one.command_id === command.command_id);
          const status = statusAt(command, at_ms);
          return (
            <li
              key={command.command_id}
              data-status={status}
              className={index === shown ? "is-shown" : ""}
              aria-current={index === shown ? "step" : undefined}
            >
              <span className="timeline-number">{index + 1}</span>
              <span>
                <strong>
                  {type ? t(`command.${type.command_type_id}`) : t("flights.step", { id: command.command_id })}
                </strong>
                <br />
                <span className="muted small">
                  <CommandTimes command={command} />
                  {command.message && <> · {reportText(command.message)}</>}
                </span>
              </span>
              <StatusPill status={status} />
            </li>
          );
        })}
      </ol>
    </>
  );
}
